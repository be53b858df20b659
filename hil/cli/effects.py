"""``brakebench effects``: what a real car has and the baseline has not."""

import argparse
import difflib
import json
from typing import Any

from hil.cli.columns import listing, say, terminal_width
from hil.cli.options import add_json


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("effects")
    parser.add_argument("name", nargs="?", help="one effect, with all it declares")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print a list, one effect, or JSON."""
    from hil.scenario.effects import EffectError, layout
    from hil.validation.doc_pages.effects_page import described, text

    effects = [described(effect) for effect in layout().effects]
    if args.name is not None:
        near = difflib.get_close_matches(args.name, [effect["name"] for effect in effects])
        effects = [effect for effect in effects if effect["name"] == args.name]
        if not effects:
            hint = f"did you mean {', '.join(near)}?" if near else "`brakebench effects` lists them"
            raise EffectError(f"no effect {args.name!r}; {hint}")
    if args.json:
        print(json.dumps({"effects": effects}, indent=2))
    elif args.name is not None:
        print(text(effects[0]))
    else:
        _list(effects)
    return 0


def _list(effects: list[dict[str, Any]]) -> None:
    rows = [(f"{one['row']:3d}", one["name"], one["scope"], one["title"]) for one in effects]
    say(listing(rows, terminal_width()))
