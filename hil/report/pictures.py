"""Whether pictures can be drawn here: they need matplotlib, an extra."""

from importlib.util import find_spec

from hil.extras import pip_install


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def no_pictures() -> str:
    """Why there is no picture, and the command that brings them."""
    return f"no pictures without matplotlib; install it with: {pip_install('figures')}"
