"""Which state of the program an answer comes from: a digest of its sources.

Comments, docstrings and the layout of Python files do not count.
"""

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

ANSWERS = ("plant", "hil.diagnosis", "hil.validation.reference_car")
"""Packages that cases and answers depend on."""
STRANGERS = ("plant", "hil.diagnosis", "hil.validation.strangers")
"""Those of cars that strangers wrote."""
_ENDINGS = (".py", ".toml", ".dbc")


def digest(roots: Iterable[Path]) -> str:
    """SHA-256 of the sources in files and folders, in hexadecimal digits; of other files given by name, their bytes.

    Raises
    ------
    FileNotFoundError
        A root does not exist.
    """
    found = hashlib.sha256()
    for root in roots:
        if not root.exists():
            raise FileNotFoundError(f"{root}: no such file or folder")
        inside = (path for path in root.rglob("*") if path.suffix in _ENDINGS) if root.is_dir() else (root,)
        for path in sorted(inside, key=Path.as_posix):
            found.update(f"{root.name}/{path.relative_to(root).as_posix()}\n".encode())
            found.update(_meaning(path.read_text("utf-8")).encode() if path.suffix == ".py" else path.read_bytes())
    return found.hexdigest()


@cache
def state(packages: tuple[str, ...] = ANSWERS) -> str:
    """Twelve hexadecimal digits that differ when cases or answers may; of the first call, whatever is edited since."""
    return digest(Path(str(resources.files(package))) for package in packages)[:12]


def _meaning(source: str) -> str:
    return _written(ast.parse(source))


def _written(node: Any) -> str:
    """As `ast.dump`, but the same for all versions of Python: fields that are empty are left out."""
    if isinstance(node, list):
        return f"[{','.join(map(_written, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    fields = {name: value for name, value in ast.iter_fields(node) if value is not None and value != []}
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        fields["body"] = [statement for statement in node.body if not _is_text(statement)]
    return f"{type(node).__name__}({','.join(f'{name}={_written(value)}' for name, value in fields.items())})"


def _is_text(statement: ast.stmt) -> bool:
    """Whether it is a docstring, or the text below an attribute."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
