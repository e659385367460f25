"""The picture of a self-motion: its arcs, and a leaf as a level on them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.types import Vector
from ...motion.ik import SelfMotion, SelfMotionArc, all_postures
from ...strategies import HolonomicStrategy
from .plots import BLUE, GREY, INK, LIMIT, PALE, color_of, on_figure, style
from .robot_panels import Actor, Curve, draw_panel, stage_of

GAP = 0.6
"""Space between self-motions [joint units]."""


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

    def values(arc: SelfMotionArc) -> Vector:
        """The level along an arc; angles with gaps where they come round."""
        g = strategy.constraint_value.batch(arc.q).reshape(-1)
        return np.where(np.append(False, np.abs(np.diff(g)) > np.pi), np.nan, g) if angle else g

    starts, right = [], 0.0
    for curve in motion.curves:
        starts.append(right)
        axes.axvspan(right, right + curve.length, color=PALE, alpha=0.45, linewidth=0)
        axes.plot(right + curve.s, values(curve), color=GREY, linewidth=1.2, zorder=2)
        right += curve.length + GAP
    # Arcs within the limits, and the joints that end them.
    for arc in motion.arcs:
        k = next(k for k, c in enumerate(motion.curves) if c.curve == arc.curve and c.place_of(arc.q[0])[1] < GAP)
        curve, g = motion.curves[k], values(arc)
        s = (curve.place_of(arc.q[0])[0] + arc.s) % curve.length
        line = np.where(np.append(False, np.diff(s) < 0), np.nan, g)
        axes.plot(starts[k] + s, line, color=BLUE, linewidth=3.2, solid_capstyle="butt", zorder=3)
        for i, end in ((0, arc.ends[0]), (-1, arc.ends[1])):
            if end.joint:
                number = motion.task.robot.joint_names.index(end.joint) + 1
                at = starts[k] + s[i], g[i]
                axes.plot(*at, "o", color=LIMIT, markersize=5, zorder=4)
                axes.annotate(f"q{number}", at, (4, 5), textcoords="offset points", color=LIMIT, fontsize=9, zorder=6)
    # The leaf, and its postures.
    axes.axhline(level, color=INK, linewidth=1.2, linestyle="--", zorder=4)
    for number, q in enumerate(postures):
        arc, _ = motion.place_of(q)
        k = min(range(len(starts)), key=lambda k: motion.curves[k].place_of(q)[1])
        at = starts[k] + motion.curves[k].place_of(q)[0], level
        axes.plot(*at, "o", markersize=10, markerfacecolor=color_of(number), markeredgecolor="white", zorder=7)
    # The levels that serve the pose, at the right.
    served = motion.levels(strategy)
    for part in served.intervals:
        axes.plot([right, right], [part.low, part.high], color=BLUE, linewidth=8, solid_capstyle="butt")
    axes.set(
        xlim=(-0.3, right + 0.4),
        xlabel="along the self-motions [joint units]; at the right, the levels that serve the pose",
        ylabel=f"level of {on_figure(strategy.name, 34)}" + (" [rad]" if angle else ""),
        title=f"{motion.components} self-motions of one tool pose; thick within the joint limits; dashed, a leaf",
    )
    axes.set_xticks([])


def _arm(axes: Any, motion: SelfMotion, postures: Any) -> None:
    """The arm in the postures of the leaf, and the way of its elbow along the arc of the first one."""
    robot = motion.task.robot
    arc, _ = motion.place_of(postures[0])
    elbows = np.array([robot.skeleton(q)[0][len(robot.skeleton(q)[0]) // 2] for q in arc.q])
    curves = [Curve(elbows, GREY)]
    stage = stage_of(robot, np.vstack([postures, arc.q[:: max(1, len(arc.q) // 8)]]), curves, ratio=(1.1, 1.4))
    actors = [Actor(q, color_of(k), "solid" if k == 0 else "ghost") for k, q in reversed(list(enumerate(postures)))]
    draw_panel(axes, stage, actors, curves, "The postures of the leaf")
