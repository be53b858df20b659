"""``brakebench effects``: what a real car has and the baseline has not."""

import argparse
import json
from typing import Any

from hil.cli.options import add_json


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("effects", help="list the effects that scenarios can switch on")
    parser.add_argument("name", nargs="?", help="one effect, with all it declares")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print a list, one effect, or JSON."""
    from hil.scenario.effects import EffectError, layout
    from hil.validation.doc_pages.effects_page import described, text

    effects = [described(effect) for effect in layout().effects]
    if args.name is not None:
        effects = [effect for effect in effects if effect["name"] == args.name]
        if not effects:
            raise EffectError(f"no effect {args.name!r}; `brakebench effects` lists them")
    if args.json:
        print(json.dumps({"effects": effects}, indent=2))
    elif args.name is not None:
        print(text(effects[0]))
    else:
        _list(effects)
    return 0


def _list(effects: list[dict[str, Any]]) -> None:
    width = max(len(effect["name"]) for effect in effects)
    for effect in effects:
        print(f"{effect['row']:3d}  {effect['name']:{width}}  {effect['scope']:5}  {effect['title']}")
