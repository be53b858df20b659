"""``brakebench scenarios``: the library, one line a scenario."""

import argparse
import json
from typing import Any

from hil.cli.columns import listing, say, terminal_width, wrapped
from hil.cli.options import add_json


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "scenarios",
        description="List the scenarios that come with brakebench; each is a commented TOML file to copy.",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """List them."""
    rows = listed()
    if args.json:
        print(json.dumps({"scenarios": rows}, indent=2))
        return 0
    lines = listing([(row["name"], f"{row['duration_s']:6.0f} s", row["title"]) for row in rows], terminal_width())
    lines += ["", *wrapped("Durations are the longest; most end when the car has stopped.", terminal_width())]
    say([*lines, f"Copy one to begin with: {rows[0]['file'].rpartition('/')[0]}"])
    return 0


def listed() -> list[dict[str, Any]]:
    """Name, title, longest duration, what it expects, and file of each scenario."""
    from hil.scenario.scenario import load_scenario, scenario_names

    rows = []
    for scenario in map(load_scenario, scenario_names()):
        expects = [e.name for e in scenario.expectations] + [e.name for e in scenario.signal_expectations]
        rows.append(
            {
                "name": scenario.name,
                "title": scenario.title,
                "duration_s": scenario.manoeuvre.duration_s,
                "expects": expects,
                "file": scenario.source,
            }
        )
    return rows
