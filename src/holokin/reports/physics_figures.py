"""Figures of runs on physics: rests over the cycles, a push, and the arms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.types import Matrix
from ..physics_simulation import PhysicalRun
from ..strategies import HolonomicStrategy
from .palette import GREY, INK, LOOP, PALE, color_of, law_colors
from .plots import NAMED
from .robot_panels import Actor, Curve, draw_panel, stage_of
from .words import joint_unit, on_figure

AROUND = (0.3, 1.0)
"""Seconds before a push and after it that its figure shows."""


def apart_figure(runs: Mapping[str, PhysicalRun], predicted: Mapping[str, Matrix | None]) -> Any:
    """How far the joints rest from their first rest, after each cycle: physics as points, kinematics as lines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.4, 4.2), layout="constrained")
    axes: Any = figure.add_subplot()
    colors = law_colors([isinstance(run.strategy, HolonomicStrategy) for run in runs.values()])
    for color, (label, run) in zip(colors, runs.items(), strict=True):
        cycles = np.arange(1, run.cycles + 1)
        axes.semilogy(cycles, np.maximum(run.apart, 1e-9), "o", color=color, markersize=5, label=on_figure(label))
        known = predicted.get(label)
        if known is not None and (sizes := np.abs(known).max(axis=1)).max() > 1e-9:
            axes.semilogy(np.arange(1, len(sizes) + 1), sizes, "-", color=color, linewidth=1.2, alpha=0.7)
    axes.plot([], [], "-", color=GREY, label="by kinematics alone")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("cycles done")
    unit = joint_unit(next(iter(runs.values())).strategy.task.robot)
    axes.set_ylabel(f"largest joint, from its first rest [{unit}]")
    axes.set_title("Where the joints rest after each cycle, on physics", loc="left", color=INK, fontsize=11)
    axes.legend(fontsize=9)
    return figure


def push_figure(runs: Mapping[str, PhysicalRun]) -> Any:
    """How far each joint is deflected by the push: against the cycle before."""
    from matplotlib.figure import Figure

    shown = {label: run for label, run in runs.items() if run.push is not None and run.t[-1] > run.push[0]}
    figure = Figure(figsize=(3.9 * max(len(shown), 1) + 0.9, 3.6), layout="constrained")
    grid = figure.subplots(1, max(len(shown), 1), squeeze=False, sharey=True)
    for axes, (label, run) in zip(grid.flat, shown.items(), strict=False):
        first, last = run.push or (0.0, 0.0)
        t, off = run.pushed(*AROUND)
        for joint, name in enumerate(run.strategy.task.robot.joint_names):
            dash = "-" if joint < NAMED else "--"
            axes.plot(t, 1e3 * off[:, joint], color=color_of(joint % NAMED), linestyle=dash, label=on_figure(name, 30))
        axes.axvspan(0, last - first, color=PALE, zorder=0)
        axes.set_title(on_figure(label), loc="left", color=INK, fontsize=10)
        axes.set_xlabel("seconds since the push began")
    grid[0, 0].set_ylabel(f"deflection [m{joint_unit(next(iter(runs.values())).strategy.task.robot)}]")
    if shown:
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    return figure


def arms_figure(runs: Mapping[str, PhysicalRun]) -> Any:
    """The arms: at their first rest pale, at their last in colour, with the loop of the tool; all on one scale."""
    from matplotlib.figure import Figure

    colors = law_colors([isinstance(run.strategy, HolonomicStrategy) for run in runs.values()])
    ends = [(run.rests[0], run.rests[-1]) for run in runs.values()]
    loops = [Curve(run.position[run.clock >= run.clock[-1] - 1.0], LOOP) for run in runs.values()]
    robot = next(iter(runs.values())).strategy.task.robot
    stage = stage_of(robot, np.vstack(ends), loops, pairs=ends)
    wide, tall = stage.scene.shape
    figure = Figure(figsize=(3.65 * len(runs), 3.45 * tall / wide + 1.1), layout="constrained")
    for i, (label, run) in enumerate(runs.items()):
        first, last = ends[i]
        actors = [Actor(first, GREY, "ghost"), Actor(last, colors[i]), Actor(first, GREY, "outline")]
        draw_panel(figure.add_subplot(1, len(runs), i + 1), stage, actors, [loops[i]], _caption(label, run))
    figure.supxlabel("in colour: at the last rest; grey: at the first; green: the loop of the tool", fontsize=10)
    return figure


def _caption(label: str, run: PhysicalRun) -> str:
    unit = joint_unit(run.strategy.task.robot)
    said = f"after {run.cycles} cycles {run.apart[-1]:.2g} {unit} away" if run.cycles else "no cycle done"
    return f"{on_figure(label)}\n{said}"
