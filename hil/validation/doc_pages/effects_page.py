"""The effects as JSON values, as text, and as the page docs/effects.md that is generated from them."""

from collections.abc import Iterable
from typing import Any

from plant.effects.effect import Effect
from plant.effects.manoeuvres import MANOEUVRES
from plant.effects.places import JOINTS

NOT_HERE = {
    67: ("jitter", "random latency of frames: `late` of a scenario's `[[frame_faults]]`"),
    68: ("frame_drop", "lost, doubled and stale frames: `drop`, `duplicate`, `stale` of `[[frame_faults]]`"),
}
"""Rows of the catalogue that are no effect of the plant, and where they are."""

PARTS = (
    (range(1, 13), "Environment and vehicle body"),
    (range(13, 22), "Tyre"),
    (range(22, 41), "Friction brake"),
    (range(41, 55), "Electro-hydraulic brake and motors"),
    (range(55, 72), "Sensors, clocks, bus"),
    (range(76, 77), "Beyond the catalogue"),
)


def described(effect: Effect) -> dict[str, Any]:
    """An effect as JSON values."""
    return {
        "name": effect.name,
        "row": effect.row,
        "title": effect.title,
        "equation": effect.equation,
        "joints": list(effect.joints),
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
        f"  joints      {', '.join(effect['joints'])}",
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
    for rows, title in PARTS:
        lines += ["", f"## {title}"]
        for effect in sorted(known, key=lambda effect: effect["row"]):
            if effect["row"] in rows:
                lines += _section(effect)
    lines += ["", "## Joints", "", "| joint | unit | what |", "|---|---|---|"]
    lines += [f"| `{name}` | {unit} | {what} |" for name, (_, unit, what) in JOINTS.items()]
    lines += ["", "Every number of the parameter set is a joint too, by its own name (`vehicle_mass_kg`).", ""]
    lines += ["## Manoeuvres", "", "| name | what |", "|---|---|"]
    lines += [f"| `{name}` | {show.what} |" for name, show in MANOEUVRES.items()]
    return "\n".join(lines) + "\n"


def _section(effect: dict[str, Any]) -> list[str]:
    lines = [
        "",
        f"### {effect['row']}. `{effect['name']}`",
        "",
        f"{effect['title']}. `{effect['equation']}` at {', '.join(f'`{j}`' for j in effect['joints'])}; one for each "
        f"{effect['scope']}.",
        "",
        *[f"- {_number(p)}" for p in effect["parameters"]],
        f"- shows as: {effect['signature']}; in `{effect['manoeuvre']}`",
        f"- source: {effect['source']}",
    ]
    if effect["confounded_with"]:
        lines.append(f"- looks like: {', '.join(f'`{n}`' for n in effect['confounded_with'])}")
    if effect["twins"]:
        lines.append(
            f"- cannot be told from: {', '.join(f'`{n}`' for n in effect['twins'])} (by some of its parameters)"
        )
    return lines


if __name__ == "__main__":
    from pathlib import Path

    from plant.effects.catalogue import BUILT_IN

    Path("docs/effects.md").write_text(page(BUILT_IN), encoding="utf-8")
