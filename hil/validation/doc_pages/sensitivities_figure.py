"""The signatures as one figure: effects by channels, size over noise on a logarithmic scale."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from hil.report.palette import INK, NEUTRAL
from hil.validation.doc_pages.effects_page import SUBSYSTEMS
from hil.validation.sensitivities import SHOWN, Signature
from plant.signals import CHANNELS, NAMES

LEAST, MOST = 0.1, 100.0  # sigma; smaller is left white, larger saturates
GROUPS = {
    "wheel": "wheel speeds", "imu": "IMU", "pressure": "pressures", "motor": "motor torques", "driver": "pedal",
    "ground": "GPS",
}  # fmt: skip
_SHORT = ("fl", "fr", "rl", "rr", "ax", "ay", "yaw rate", *("fl", "fr", "rl", "rr") * 2, "travel", "speed")


def draw(title: str, found: list[Signature], path: Path) -> None:
    """Write the figure as PNG."""
    parts = [([s for s in found if s.effect.subsystem == name], title) for name, title in SUBSYSTEMS.items()]
    order = [s for signatures, _ in parts for s in signatures]
    sizes = np.array([s.sizes for s in order])
    height = 1.9 + 0.172 * len(order)
    figure = Figure(figsize=(10.5, height), dpi=120, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.215, 0.45 / height, 0.565, 1.0 - 1.75 / height))
    shown = np.ma.masked_less(sizes, LEAST)
    mesh = axes.imshow(shown, aspect="auto", cmap="YlGnBu", norm=LogNorm(LEAST, MOST), interpolation="nearest")
    axes.set_yticks(range(len(order)), [s.name for s in order], fontsize=7, color=INK)
    for label, signature in zip(axes.get_yticklabels(), order, strict=True):
        label.set_color(INK if signature.total >= SHOWN else "#B0B7BE")
    axes.set_xticks(range(len(NAMES)), _SHORT, rotation=60, ha="left", rotation_mode="anchor", fontsize=7, color=INK)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_xticks(np.arange(-0.5, len(NAMES)), minor=True)
    axes.set_yticks(np.arange(-0.5, len(order)), minor=True)
    axes.grid(which="minor", color="#ECEFF2", linewidth=0.5)
    axes.tick_params(which="minor", length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    at = 0
    for node, names in CHANNELS.items():
        middle = at + (len(names) - 1) / 2
        axes.text(middle, -0.5 - 44.0 / 12.4, GROUPS[node], ha="center", va="bottom", fontsize=7.5, color=NEUTRAL)
        at += len(names)
        axes.axvline(at - 0.5, color="#9AA3AC", linewidth=0.7)
    at = 0
    for signatures, part in parts:
        number = len(signatures)
        if not number:
            continue
        axes.axhline(at + number - 0.5, color="#9AA3AC", linewidth=0.7)
        figure_y = at + number / 2 - 0.5
        axes.text(-6.35, figure_y, part, rotation=90, ha="center", va="center", fontsize=7.5, color=NEUTRAL)
        at += number
    axes.text(len(NAMES) + 0.1, -0.9, "total", fontsize=7.5, color=NEUTRAL, va="bottom")
    for k, signature in enumerate(order):
        value = f"{signature.total:.0f} σ" if signature.total >= SHOWN else "not shown"
        colour = INK if signature.total >= SHOWN else "#B0B7BE"
        axes.text(len(NAMES) + 0.1, k, value, fontsize=7, color=colour, va="center")
    bar = figure.colorbar(mesh, cax=figure.add_axes((0.895, 0.45 / height, 0.016, 3.0 / height)))
    bar.set_label("rms change / noise of one sample", fontsize=7.5, color=INK)
    bar.ax.tick_params(labelsize=7, colors=INK)
    figure.text(0.03, 1.0 - 0.28 / height, title, fontsize=11, color=INK, weight="bold")
    figure.text(
        0.03, 1.0 - 0.5 / height,
        "Every effect at its typical size: change of each channel against its noise; white is below a tenth of it.",
        fontsize=8, color=NEUTRAL,
    )  # fmt: skip
    figure.savefig(path)
