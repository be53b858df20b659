"""``brakebench sensitivities``: what a manoeuvre can and cannot show."""

import argparse
import json
import sys

from hil.cli.options import add_json, out_folder


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("sensitivities")
    parser.add_argument("scenario", help="scenario by name or path, or a manoeuvre of `brakebench effects`")
    parser.add_argument("--out", type=out_folder, help="folder for figure (PNG) and table (CSV)")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Compute, print, draw."""
    from hil.scenario.scenario import load_scenario
    from hil.validation.sensitivities import SHOWN, alike, as_json, recorded, signatures
    from hil.validation.verify.car import paper_car
    from plant.open_loop_manoeuvres import MANOEUVRES, drive
    from plant.signals import NAMES

    if args.scenario in MANOEUVRES:
        show = MANOEUVRES[args.scenario]
        name, title, plan = args.scenario, show.what, drive(show, paper_car())
    else:
        scenario = load_scenario(args.scenario)
        name, title, plan = scenario.name, scenario.title, recorded(scenario)
    found = signatures(plan)
    if args.out is not None:
        from hil.report.pictures import can_draw, no_pictures

        args.out.mkdir(parents=True, exist_ok=True)
        if can_draw():
            from hil.validation.doc_pages.sensitivities_figure import draw

            draw(title, found, args.out / f"sensitivities_{name}.png")
        else:
            print(no_pictures(), file=sys.stderr)
        rows = [",".join(["effect", "member", "total_sigma", *NAMES])]
        rows += [",".join([s.effect.name, s.member, f"{s.total:.6g}", *[f"{v:.6g}" for v in s.sizes]]) for s in found]
        (args.out / f"sensitivities_{name}.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    if args.json:
        print(json.dumps(as_json(name, plan, found), indent=2))
        return 0
    print(f"{name}: {title}")
    for signature in sorted(found, key=lambda s: -s.total):
        if signature.total >= SHOWN:
            best = sorted(zip(signature.sizes, NAMES, strict=True), reverse=True)[:3]
            most = ", ".join(f"{channel} {size:.2g}" for size, channel in best if size >= 0.05)
            print(f"  {signature.name:28} {signature.total:9.1f} sigma   {most}")
    hidden = [signature.name for signature in found if signature.total < SHOWN]
    print(f"not shown: {', '.join(hidden) or 'none'}")
    for a, b, cosine in alike(found):
        print(f"not told apart: {a} and {b} (cosine {cosine:+.4f})")
    return 0
