"""The effects as JSON values, as text, and as the page docs/effects.md that is generated from them."""

from collections.abc import Iterable
from typing import Any

from hil.validation.doc_pages.wrap import markdown
from plant.effects.effect import Effect
from plant.injection_points import INJECTION_POINTS
from plant.open_loop_manoeuvres import MANOEUVRES

NOT_HERE = {
    67: ("jitter", "random latency of frames: the fault `late` of [docs/faults.md](faults.md)"),
    68: ("frame_drop", "lost, doubled and stale frames: the faults `lost`, `doubled`, `stale` there"),
}
"""Rows of the catalogue that are no effect of the plant, and where they are."""

SUBSYSTEMS = {
    "road_air": "Road and air",
    "chassis": "Chassis",
    "tyres": "Tyres",
    "pads": "Pads, discs and calipers",
    "hydraulics": "Pressure control and lines",
    "motors": "Motors and battery",
    "sensing": "Sensors and clocks",
    "": "From outside",
}
"""Headings of the page, by `plant.effects.effect.Effect.subsystem`."""


def described(effect: Effect) -> dict[str, Any]:
    """An effect as JSON values."""
    return {
        "name": effect.name,
        "row": effect.row,
        "subsystem": effect.subsystem,
        "title": effect.title,
        "equation": effect.equation,
        "injection_points": list(effect.injection_points),
        "scope": effect.scope.value,
        "members": list(effect.scope.members),
        "parameters": [
            {
                "name": p.name,
                "unit": p.unit,
                "low": p.low,
                "high": p.high,
                "neutral": p.neutral,
                "typical": p.typical,
                "shape": p.shape,
            }
            for p in effect.parameters
        ],
        "states": list(effect.states),
        "source": effect.source,
        "signature": effect.signature,
        "confounded_with": list(effect.confounded_with),
        "twins": list(effect.twins),
        "manoeuvre": effect.manoeuvre,
        "dissipates": effect.dissipates,
        "sensing": effect.sensing,
        "invertible": effect.undo is not None,
    }


def _number(parameter: dict[str, Any]) -> str:
    unit = f" {parameter['unit']}" if parameter["unit"] else ""
    usual = "usually" if not parameter["shape"] else "shape, usually"
    low, high, size = (f"{parameter[key]:g}" for key in ("low", "high", "typical"))
    return f"`{parameter['name']}` {low} to {high}{unit}, {usual} {size}"


def text(effect: dict[str, Any]) -> str:
    """One effect for a terminal."""
    lines = [
        f"{effect['name']} (row {effect['row']}): {effect['title']}",
        f"  equation    {effect['equation']}",
        f"  injected at {', '.join(effect['injection_points'])}",
        f"  scope       {effect['scope']} ({', '.join(effect['members'])})",
        *[f"  parameter   {_number(p).replace('`', '')}" for p in effect["parameters"]],
        f"  source      {effect['source']}",
        f"  signature   {effect['signature']}",
        f"  shown by    {effect['manoeuvre']}: {MANOEUVRES[effect['manoeuvre']].what}"
        if effect["manoeuvre"] in MANOEUVRES
        else f"  shown by    {effect['manoeuvre']}",
        f"  looks like  {', '.join(effect['confounded_with']) or '-'}",
    ]
    return "\n".join(lines)


def page(effects: Iterable[Effect]) -> str:
    """The documentation of the effects in Markdown."""
    known = [described(effect) for effect in effects]
    lines = [
        "# Effects",
        "",
        "What a real car has and the baseline has not. Generated from the declarations in `plant/effects` by",
        "`python -m hil.validation.doc_pages.effects_page`; a test holds it current. Sources: S read in the source",
        "named, M recalled, D derived, C a choice.",
        "",
        "A scenario switches an effect on with a table; without a strength it acts at its usual size:",
        "",
        "```toml",
        "[effects.stuck_corner]",
        'at = ["fl"]        # members; all of them without it',
        "loss = 0.5         # or one number for each: loss = { fl = 0.5, rr = 0.2 }",
        "onset_s = 1.5      # of the manoeuvre's clock; until_s ends it",
        "```",
        "",
        "Rows of the catalogue that are elsewhere: "
        + "; ".join(f"{row} `{name}`: {why}" for row, (name, why) in NOT_HERE.items())
        + ".",
    ]
    for subsystem, title in SUBSYSTEMS.items():
        own = sorted((one for one in known if one["subsystem"] == subsystem), key=lambda one: one["row"])
        lines += ["", f"## {title}"] if own else []
        for effect in own:
            lines += _section(effect)
    lines += ["", "## Injection points", "", "| injection point | unit | what |", "|---|---|---|"]
    lines += [f"| `{name}` | {unit} | {what} |" for name, (_, unit, what) in INJECTION_POINTS.items()]
    lines += [
        "",
        "Every number of the parameter set is an injection point too, by its own name (`vehicle_mass_kg`).",
        "",
    ]
    lines += ["## Manoeuvres", "", "| name | what |", "|---|---|"]
    lines += [f"| `{name}` | {show.what} |" for name, show in MANOEUVRES.items()]
    return markdown(lines)


def _section(effect: dict[str, Any]) -> list[str]:
    lines = [
        "",
        f"### {effect['row']}. `{effect['name']}`",
        "",
        f"{effect['title']}. `{effect['equation']}` at {', '.join(f'`{p}`' for p in effect['injection_points'])}; "
        f"one for each {effect['scope']}.",
        "",
        *[f"- {_number(p)}" for p in effect["parameters"]],
        f"- shows as: {effect['signature']}; in `{effect['manoeuvre']}`",
        f"- source: {effect['source']}",
    ]
    if effect["confounded_with"]:
        lines.append(f"- looks like: {', '.join(f'`{n}`' for n in effect['confounded_with'])}")
    if effect["twins"]:
        lines.append(f"- not isolable from: {', '.join(f'`{n}`' for n in effect['twins'])} (by some of its parameters)")
    return lines


if __name__ == "__main__":
    from pathlib import Path

    from plant.effects.catalogue import BUILT_IN

    Path("docs/effects.md").write_text(page(BUILT_IN), encoding="utf-8")
