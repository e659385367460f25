"""The picture of a self-motion: its arcs, and a leaf as a level on them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.types import Matrix, Vector
from ...motion.ik import SelfMotion, all_postures
from ...strategies import HolonomicStrategy
from .plots import BLUE, GREY, INK, LIMIT, PALE, color_of, on_figure, style
from .robot_panels import Actor, Curve, draw_panel, stage_of

GAP = 0.8
"""Space between self-motions [joint units]."""

APART = 0.1
"""How far [joint units] a posture is from the curve that it is on, at most."""


def self_motion_figure(motion: SelfMotion, strategy: HolonomicStrategy, level: float) -> Any:
    """The level g along the self-motions of a pose, those arcs thick that are within the joint limits; a leaf is a
    level, and its postures are where the curves have it. Beside it the arm in these postures."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    postures = all_postures(strategy, motion.pose, level).q
    with rc_context(style()):
        figure = Figure(figsize=(11.4, 4.6))
        figure.subplots_adjust(0.015, 0.13, 0.985, 0.9, wspace=0.09)
        arm, axes = figure.subplots(1, 2, width_ratios=(1, 2.1))
        _levels(axes, motion, strategy, level, postures)
        if len(postures):
            _arm(arm, motion, postures)
    return figure


def _levels(axes: Any, motion: SelfMotion, strategy: HolonomicStrategy, level: float, postures: Any) -> None:
    """The level along each curve, over arc length, one curve beside the other."""
    angle = strategy.constraint.angular[0]

    def values(q: Matrix) -> Vector:
        """The level along a curve; angles with gaps where they come round."""
        g = strategy.constraint_value.batch(q).reshape(-1)
        return np.where(np.append(False, np.abs(np.diff(g)) > np.pi), np.nan, g) if angle else g

    # The curves that have arcs, each from the beginning of one on.
    right = 0.0
    for curve in motion.curves:
        arcs = [arc for arc in motion.arcs if arc.curve == curve.curve and curve.place_of(arc.q[0])[1] < APART]
        if not arcs:
            continue
        begin = curve.place_of(arcs[0].q[0])[0]

        def along(
            s: Any, begin: float = begin, length: float = curve.length, closed: bool = curve.closed, left: float = right
        ) -> Any:
            """Places [joint units] of the picture; a closed curve begins where its first arc does."""
            return left + ((s - begin) % length if closed else s)

        axes.axvspan(right, right + curve.length, color=PALE, alpha=0.5, linewidth=0)
        turns = np.round((arcs[0].q[0] - curve.at(min(begin, curve.length))) / (2 * np.pi))
        _line(axes, along(curve.s), values(curve.q + 2 * np.pi * turns), color=GREY, linewidth=1.3, zorder=2)
        for arc in arcs:
            first = curve.place_of(arc.q[0])[0]
            s, g = along(first + arc.s), values(arc.q)
            _line(axes, s, g, color=BLUE, linewidth=3.4, solid_capstyle="butt", zorder=3)
            for i, end in ((0, arc.ends[0]), (-1, arc.ends[1])):
                if end.joint:
                    name = f"q{motion.task.robot.joint_names.index(end.joint) + 1}"
                    axes.plot(s[i], g[i], "o", color=LIMIT, markersize=6, zorder=4)
                    place = {"textcoords": "offset points", "fontsize": 10, "zorder": 6, "color": LIMIT}
                    axes.annotate(name, (s[i], g[i]), (-4, 8) if i else (-10, 8), **place)
        for number, q in enumerate(postures):
            s, away = curve.place_of(q)
            if away < APART:
                color = color_of(number)
                axes.plot(along(s), level, "o", markersize=11, color=color, markeredgecolor="white", zorder=7)
        right += curve.length + GAP
    axes.axhline(level, color=INK, linewidth=1.3, linestyle="--", zorder=4)
    paper = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5}
    middle = {"textcoords": "offset points", "fontsize": 10, "ha": "center", "bbox": paper, "zorder": 5}
    axes.annotate("a leaf: one level", (0.46 * right, level), (0, 7), **middle)
    # The levels that serve the pose, at the right.
    count = f"{motion.components} self-motion{'s' if motion.components != 1 else ''}"
    for part in motion.levels(strategy).intervals:
        axes.plot([right, right], [part.low, part.high], color=BLUE, linewidth=9, solid_capstyle="butt")
    axes.set(
        xlim=(-0.3, right + 0.4),
        xlabel="along the self-motions, one beside the other; at the right edge, the levels that serve the pose",
        ylabel=f"{on_figure(strategy.constraint.name, 40)}" + (" [rad]" if angle else ""),
        title=f"{count} of one tool pose: thick within the joint limits, dots where a joint is at its limit",
    )
    axes.set_xticks([])


def _line(axes: Any, s: Vector, g: Vector, **look: Any) -> None:
    """A line with a gap where it comes round."""
    axes.plot(s, np.where(np.append(False, np.diff(s) < 0), np.nan, g), **look)


def _arm(axes: Any, motion: SelfMotion, postures: Any) -> None:
    """The arm in the postures of the leaf, and the way of its elbow along the arc of the first one."""
    robot = motion.task.robot
    arc, _ = motion.place_of(postures[0])
    elbows = np.array([robot.skeleton(q)[0][len(robot.skeleton(q)[0]) // 2] for q in arc.q])
    curves = [Curve(elbows, GREY)]
    stage = stage_of(robot, np.vstack([postures, arc.q[:: max(1, len(arc.q) // 8)]]), curves, ratio=(1.1, 1.4))
    actors = [Actor(q, color_of(k), "solid" if k == 0 else "ghost") for k, q in reversed(list(enumerate(postures)))]
    draw_panel(axes, stage, actors, curves, "The postures of the leaf")
