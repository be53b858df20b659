"""``brakebench doctor``: what this machine can do."""

import argparse
import json
import os
import shutil
import sys
import textwrap

from hil.cli.options import add_json
from hil.doctor.line import Line, Status

_SGR = {Status.OK: "32", Status.WARNING: "33", Status.MISSING: "31"}


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "doctor",
        description="Look at buses, adapters, scheduling and software; print what is missing or unwise, each with the "
        "command that mends it. Nothing is changed.",
        epilog="The exit code is 0 whatever was found. --json prints {lines: [{topic, status, finding, fix}]}, status "
        "one of ok, warning, missing; fix is a shell command or empty.",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Look and print."""
    from hil.doctor.examine import examine

    lines = examine()
    if args.json:
        print(json.dumps({"lines": [line._asdict() for line in lines]}, indent=2))
        return 0
    colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"
    width = min(140, shutil.get_terminal_size((100, 24)).columns)
    print(render(lines, width, colour), end="")
    return 0


def render(lines: list[Line], width: int, colour: bool = False) -> str:
    """Return the lines as text: findings wrapped at ``width``, fixes whole, on lines of their own, to be copied."""
    left = max(len(line.topic) for line in lines)
    indent = 9 + left + 2
    out = []
    for topic, status, finding, fix in lines:
        head = f"{status:<7}  {topic:<{left}}  "
        first, *rest = textwrap.wrap(finding, max(30, width - indent), break_on_hyphens=False) or [""]
        word = f"\x1b[{_SGR[status]}m{status}\x1b[0m" if colour else str(status)
        out += [word + head[len(status) :] + first, *(" " * indent + line for line in rest)]
        if fix:
            out.append(f"         $ {fix}")
    ok, warnings, missing = (sum(line.status is status for line in lines) for status in Status)
    out += ["", f"{ok} ok, {warnings} warning{'' if warnings == 1 else 's'}, {missing} missing"]
    return "\n".join(line.rstrip() for line in out) + "\n"
