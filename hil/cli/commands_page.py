"""The page docs/commands.md: every command with its options, generated from the parsers that read them.

It is written from the parsers' content and not from their help, whose layout differs between versions of Python.
"""

import argparse
import re
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

from hil.cli.main import COMMANDS, build_parser

_INTRO = """# Commands

Generated from the command line itself by `python -m hil.cli.commands_page`; a test holds it current. Every command has
`--help`. Exit codes: 0 passed, 1 failed, 2 wrong use or input, 3 broken, 4 inconclusive, 5 incomplete, 130 interrupted
([json](json.md)).

Where a command takes a LOG, `sample:weak_brake` is one that comes with brakebench."""


def page() -> str:
    """Text of the page."""
    lines = [_INTRO]
    for name in COMMANDS:
        for action in build_parser([name])._actions:
            if isinstance(action, argparse._SubParsersAction):
                lines += _command(action.choices[name], 2)
    return "\n".join(lines) + "\n"


def _command(parser: argparse.ArgumentParser, level: int) -> Iterator[str]:
    """Lines of a command and of its own commands."""
    yield f"\n{'#' * level} {parser.prog}\n"
    if parser.description:
        yield f"{_plain(parser.description)}\n"
    rows, below = [], []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            told = {one.dest: one.help or "" for one in action._choices_actions}
            for name, sub in action.choices.items():
                sub.description = sub.description or told.get(name)
                below.append(sub)
        elif action.help is not argparse.SUPPRESS and not isinstance(action, argparse._HelpAction):
            rows.append(f"| {_name(action)} | {_plain(_expanded(action, parser))} |")
    if rows:
        yield "\n".join(["| argument | what it is |", "|---|---|", *rows])
    if parser.epilog:
        yield f"\n{_plain(parser.epilog)}"
    for sub in below:
        yield from _command(sub, min(level + 1, 4))


def _name(action: argparse.Action) -> str:
    """How an argument is typed: ``--out DIR``, ``LOG...``, ``[SCENARIO]``."""
    choices = "{" + ",".join(map(str, action.choices)) + "}" if action.choices else None
    metavar = action.metavar[0] if isinstance(action.metavar, tuple) else action.metavar
    value = metavar or choices or (action.dest.upper() if action.option_strings else action.dest)
    if action.nargs == 0:
        value = ""
    elif action.nargs in ("+", "*"):
        value += "..."
    if not action.option_strings:
        text = f"[{value}]" if action.nargs in ("?", "*") else value
    else:
        text = f"{', '.join(action.option_strings)} {value}".rstrip()
    return f"`{_bars(text)}`" + (", required" if action.option_strings and action.required else "")


def _expanded(action: argparse.Action, parser: argparse.ArgumentParser) -> str:
    """Help of an argument with its ``%(default)s`` put in."""
    if not action.help:
        return ""
    return action.help % {**vars(action), "prog": parser.prog, "default": action.default}


def _plain(text: str) -> str:
    """Text as Markdown: signs that would begin markup are escaped, but not between back quotes."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(_bars(part) if k % 2 else re.sub(r"([*_<>\[\]|])", r"\\\1", part) for k, part in enumerate(parts))


def _bars(text: str) -> str:
    return text.replace("|", "\\|")


def _path() -> Path:
    return Path(str(resources.files("hil"))).parent / "docs" / "commands.md"


if __name__ == "__main__":
    _path().write_text(page(), encoding="utf-8")
