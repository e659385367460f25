"""The picture of a motion over sheets: the joints along the path, and where the sheet changes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...analysis.sheets import SheetMotion
from ...robot import Robot
from .palette import COLORS, GREY, INK, LIMIT, color_of
from .plots import movers, thin
from .sheets_plot import NONE
from .sheets_plot import color_of as sheet_color
from .words import on_figure

JUMPS = (
    "The joints along the job's path on the sheets. The bar below has the colour of the sheet that serves. At a line "
    "across the panel the sheet changes: drawn through, by a self-motion with the tool at rest; dashed, the arm must "
    "leave the path to go on."
)
"""What to see in the picture."""


def sheet_motion_figure(motion: SheetMotion, robot: Robot) -> Any:
    """Every joint over the share of the path, a bar of the sheets below, lines at changes and divisions.

    Of many joints those that move most have a colour each, the others are grey.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(7.2, 3.9))
    axes, bar = figure.subplots(2, 1, sharex=True, height_ratios=[14, 1])
    figure.subplots_adjust(left=0.09, right=0.74, top=0.96, bottom=0.13, hspace=0.08)
    walks = [piece.trajectory for piece in motion.pieces]
    named = movers(walks) if walks else []
    for piece in motion.pieces:
        walk = piece.trajectory
        keep = thin(len(walk))
        share = 100 * (piece.start + (piece.stop - piece.start) * walk.t[keep] / max(float(walk.t[-1]), 1e-300))
        for j in range(robot.n):
            color = color_of(named.index(j)) if j in named else "#c3c8d0"
            style = "-" if j not in named or named.index(j) < len(COLORS) else (0, (4, 1.5))
            axes.plot(share, walk.q[keep, j], color=color, linestyle=style, linewidth=1.6 if j in named else 1.0)
        bar.axvspan(100 * piece.start, 100 * piece.stop, color=sheet_color(piece.sheet), linewidth=0)
    for part in motion.left_out:
        bar.axvspan(100 * part.start, 100 * part.stop, color=NONE, linewidth=0)
    for at in _places(motion):
        axes.axvline(100 * at, color=INK, linewidth=1.2, zorder=1.5)
    for one in motion.divisions:
        axes.axvline(100 * one.at, color=LIMIT, linewidth=1.6, linestyle=(0, (3, 2)), zorder=1.5)
    _frame(axes, bar, robot)
    _legend(figure, motion, robot, named, Patch)
    return figure


def _places(motion: SheetMotion) -> list[float]:
    """Where the sheet changes with the tool at rest, as shares of the path."""
    divided = {one.at for one in motion.divisions}
    ends = {one.stop for one in motion.pieces}
    starts = [one.start for one in motion.pieces if one.start in ends and one.start not in divided]
    begun = [0.0] if motion.changes > len(starts) else []
    return begun + starts


def _frame(axes: Any, bar: Any, robot: Robot) -> None:
    units = " or ".join(dict.fromkeys(c.unit for c in robot.coordinates))
    axes.set_ylabel(f"joints [{units}]")
    axes.set_xlim(0, 100)
    axes.axhline(0, color=GREY, linewidth=0.8, zorder=1)
    bar.set_yticks([])
    bar.grid(visible=False)
    bar.set_xlabel("share of the path [%]")


def _legend(figure: Any, motion: SheetMotion, robot: Robot, named: list[int], patch: Any) -> None:
    """The joints, the sheets, and what is not served."""
    from matplotlib.lines import Line2D

    lines = [
        Line2D([], [], color=color_of(k), label=on_figure(robot.joint_names[j], 22),
               linestyle="-" if k < len(COLORS) else (0, (4, 1.5)))
        for k, j in enumerate(named)
    ]  # fmt: skip
    if len(named) < robot.n:
        lines.append(Line2D([], [], color="#c3c8d0", label="other joints"))
    used = np.unique([one.sheet for one in motion.pieces]).tolist() if motion.pieces else []
    patches = [patch(color=sheet_color(s), label=f"sheet {s}") for s in used]
    patches += [patch(color=NONE, label="no sheet")] if motion.left_out else []
    figure.legend(handles=[*lines, *patches], loc="upper left", bbox_to_anchor=(0.745, 0.98), fontsize=8.5)
