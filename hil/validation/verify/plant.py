"""``brakebench verify plant``: the plant held against what is not ours, as numbers, one page and figures."""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from hil.errors import BrakebenchError
from hil.extras import missing
from hil.report.report import Report, Verdict
from hil.validation.verify import balances, closed_forms, handling, limits, pads, standstill, steps, tyre
from hil.validation.verify.topic import Topic

TOPICS: dict[str, Callable[[], Topic]] = {
    "balances": balances.topic,
    "steps": steps.topic,
    "standstill": standstill.topic,
    "closed_forms": closed_forms.topic,
    "tyre": tyre.topic,
    "handling": handling.topic,
    "pads": pads.topic,
    "limits": limits.topic,
}


def single(topic: Topic) -> Report:
    """One topic as a report of its own."""
    return Report(topic.title, reason=f"Against {topic.against}.", numbers=topic.numbers, sections=(topic.section,))


def build_report(topics: dict[str, Topic]) -> Report:
    """All topics on one page."""
    numbers = tuple(number for topic in topics.values() for number in topic.numbers)
    failed = [number.label for number in numbers if not number.met]
    reason = f"{len(numbers) - len(failed)} of {len(numbers)} within their limits"
    sections = tuple(replace(t.section, text=f"Against {t.against}. {t.section.text}".strip()) for t in topics.values())
    return Report(
        title="The plant, held against what is not ours",
        verdict=Verdict.FAILED if failed else Verdict.PASSED,
        reason=f"{reason}: {', '.join(failed)} not" if failed else reason,
        numbers=numbers,
        sections=sections,
        provenance={"parameters": "plant/parameters/paper_car.toml", "brakebench": version("brakebench")},
    )


def main(args: argparse.Namespace) -> int:
    """Verify, print the numbers, write page and figures into ``args.out`` where it is given.

    Returns
    -------
    0 when every number is within its limit, 1 when one is not.
    """
    if why := missing("vehiclemodels"):
        raise BrakebenchError(f"verify plant {why}")
    topics = {}
    for name, make in TOPICS.items():
        print(f"verifying: {name}", file=sys.stderr)
        topics[name] = make()
    report = build_report(topics)
    if args.out is not None:
        _write(report, topics, args.out)
    if args.json:
        rows = [
            {"topic": name, "label": n.label, "value": n.value, "unit": n.unit, "limit": n.limit, "met": n.met}
            for name, topic in topics.items()
            for n in topic.numbers
        ]
        print(json.dumps({"passed": report.verdict is Verdict.PASSED, "numbers": rows}, indent=2))
    else:
        for topic in topics.values():
            print(f"{topic.title}, against {topic.against}")
            for n in topic.numbers:
                print(f"  {'ok ' if n.met else 'NOT'} {n.label:26} {n.value:12.5g} {n.unit:16} {n.limit:14} {n.note}")
        print(f"{report.verdict}: {report.reason}")
    return 0 if report.verdict is Verdict.PASSED else 1


def _write(report: Report, topics: dict[str, Topic], out: Path) -> None:
    from hil.report.figure import write_figure
    from hil.report.html import write_html
    from hil.report.pictures import no_pictures

    out.mkdir(parents=True, exist_ok=True)
    write_html(report, out / "report.html")
    if not all(write_figure(single(topic), out / f"{name}.png") for name, topic in topics.items()):
        print(no_pictures(), file=sys.stderr)
