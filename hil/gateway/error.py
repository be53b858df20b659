"""What is wrong with a map, a database or an edit."""

from hil.errors import BrakebenchError


class GatewayError(BrakebenchError):
    """A map, a database or a command that cannot be used."""
