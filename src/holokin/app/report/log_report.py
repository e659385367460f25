"""Audits of logs and datasets: table for the terminal, figure, JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.audit import DatasetAudit, LogAudit, LogVerdict
from ...base.files import write_json
from .job_figures import margins
from .plots import BAD, GOOD, GREY, INK, PALE, color_of, joint_unit, new_figure, on_figure, thin
from .robot_panels import Actor, Curve, draw_panel, stage_of
from .section import Note, Section, Tone


def print_audit(audit: LogAudit | DatasetAudit, console: Any) -> None:
    """Print the findings as a table, and the sentence of the verdict below in its colour."""
    tones: dict[LogVerdict, Tone] = {LogVerdict.REPEATS: "good", LogVerdict.UNDECIDED: "warning"}
    verdict = Note(audit.sentence(), tones.get(audit.verdict, "bad"))
    Section(rows=audit.rows(), remarks=[verdict]).rich(console)


def save_log_audits(audits: Sequence[LogAudit], file: FilePath) -> None:
    """Write `LogAudit.to_dict` as JSON; of several runs a list of them, under "runs". Raises: WriteError."""
    summaries = [audit.to_dict() for audit in audits]
    write_json(file, summaries[0] if len(summaries) == 1 else {"runs": summaries})


def log_figure(audit: LogAudit) -> Any:
    """Joints at the cycles' start pose against the cycle number, and the tool's path, cycles by colour."""
    word = f"{audit.verdict.name.lower()}, trend: {audit.trend.name.lower().replace('_', ' ')}"
    figure, left, right = _two_panels(f"{on_figure(FilePath(audit.recording.source).name)}: {word}")
    _joints_at_start(left, audit)
    _tool_cycles(right, audit)
    return figure


def _two_panels(title: str) -> tuple[Any, Any, Any]:
    """(a figure with a title, its left and its right axes), for what joints do and where the tool is."""
    figure = new_figure(figsize=(9.4, 4.6))
    margins(figure, left=0.85, right=0.35, bottom=0.65, top=0.75, width_gap=0.85, grid=(1, 2))
    figure.suptitle(title, fontsize=12, fontweight="bold", x=0.02, ha="left")
    return figure, figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)


def _joints_at_start(axes: Any, audit: LogAudit) -> Any:
    """Joints at the start pose after each cycle, less their start, for the joints that move most; tolerance in grey."""
    shift = np.vstack([np.zeros(audit.robot.n), audit.since_start])
    # Joints in the figure: those that move most.
    order = np.argsort(-np.abs(shift).max(axis=0), kind="stable")[:4]
    numbers = np.arange(len(shift))
    allowed = audit.tolerance + audit.noise_floor
    axes.axhspan(-allowed, allowed, color=PALE, zorder=0, label=f"tolerance {allowed:.2g}")
    marker = "o-" if len(shift) <= 60 else "-"
    for i, joint in enumerate(sorted(order)):
        name = on_figure(audit.robot.joint_names[joint])
        axes.plot(numbers, shift[:, joint], marker, color=color_of(i), linewidth=1.6, markersize=3.5, label=name)
    most = max(float(np.abs(shift).max()), 2 * allowed)
    axes.set_ylim(-1.15 * most, 1.15 * most)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("cycles done")
    axes.set_ylabel(f"less its start value [{joint_unit(audit.robot)}]")
    which = "Joints" if len(order) == audit.robot.n else f"The {len(order)} joints that move most,"
    axes.set_title(f"{which} at the start pose", loc="left", color=INK, fontsize=10)
    axes.legend(fontsize=8, loc="best")
    return axes


def _tool_cycles(axes: Any, audit: LogAudit) -> Any:
    """The tool's path, cycles by colour, the path in and out in grey, and the arm at the start pose after some."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize, to_hex

    # The path, and a colour for each cycle.
    robot, log, cycles = audit.robot, audit.recording, audit.cycles
    rows = thin(len(log), 20_000)
    points, _ = audit.task._poses(log.q[rows])
    colors = colormaps["viridis"]
    count = len(cycles)

    def color(done: int) -> str:
        return to_hex(colors(0.9 - 0.8 * done / count))

    # The arm at the start pose, after some of the cycles.
    first = np.vstack(
        [audit.visits[0, 0 if cycles.direction[0] > 0 else -1] + shift for shift in (0.0, *audit.since_start)]
    )
    # Postures in the figure: at the start pose, after so many cycles at most.
    shown = [int(i) for i in thin(count + 1, 4)]
    stage = stage_of(robot, first[shown], [Curve(points, PALE)], pairs=[(first[0], first[-1])])
    outlines = [Actor(first[i], color(i), "outline") for i in shown[1:]]
    draw_panel(
        axes, stage, [Actor(first[0], color(0)), *outlines], title="Path of the tool, and the arm at the start pose"
    )
    # The path, cycle by cycle.
    seen = stage.scene.view.seen(points)
    axes.plot(*seen[:, :2].T, color="#c9cdd4", linewidth=1.0, zorder=3)
    for i in thin(count, 30):
        in_cycle = (rows >= cycles.start[i]) & (rows <= cycles.stop[i])
        if in_cycle.any():
            axes.plot(*seen[in_cycle, :2].T, color=color(int(i) + 1), linewidth=1.3, zorder=4)
    bar = ScalarMappable(Normalize(0, count), colors.reversed())
    axes.figure.colorbar(bar, ax=axes, shrink=0.6, pad=0.04, label="cycles done", ticks=[0, count])
    return axes


MOST_POINTS = 4_000
"""Tool poses and pairs that are drawn."""


def dataset_figure(audit: DatasetAudit) -> Any:
    """Distances of the joints at equal poses by episode, and where the tool is there, with the two worst postures."""
    name = on_figure(audit.dataset.folder.resolve().name)
    word = {LogVerdict.REPEATS: "equal", LogVerdict.DIFFERS: "different"}.get(audit.verdict, "undecided")
    figure, left, right = _two_panels(f"{name}: joints at equal tool poses are {word}")
    _by_episode(left, audit)
    _places(right, audit)
    return figure


def _by_episode(axes: Any, audit: DatasetAudit) -> None:
    """Each pair of equal poses, at both of its episodes; those that differ in red."""
    pairs = audit.pairs
    shown = thin(len(pairs.first), MOST_POINTS) if len(pairs.first) else np.empty(0, np.intp)
    for beyond, color, word in ((False, GOOD, "equal"), (True, BAD, "different")):
        mine = shown[pairs.beyond[shown] == beyond]
        rows = np.concatenate([pairs.first[mine], pairs.second[mine]])
        episode = audit.episodes[np.searchsorted(audit.begins, rows, side="right") - 1]
        distance = np.maximum(np.tile(pairs.distance[mine], 2), 1e-6)
        if len(mine):
            axes.semilogy(episode, distance, "o", color=color, markersize=4, alpha=0.5, markeredgewidth=0, label=word)
    axes.axhline(audit.tolerance, color=INK, linewidth=0.8, linestyle="--", label=f"tolerance {audit.tolerance:g}")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("episode")
    axes.set_ylabel("distance of the joints [rad or m]")
    axes.set_title("Each pair of equal tool poses, at both episodes", loc="left", color=INK, fontsize=10)
    axes.legend(fontsize=8, loc="best")


def _places(axes: Any, audit: DatasetAudit) -> None:
    """The arm at the two postures of the worst pair, and the tool's places."""
    worst = audit.worst()
    shown = thin(len(audit.q), 20 * MOST_POINTS // 40)
    rows = [0] if worst is None else [int(audit.pairs.first[worst]), int(audit.pairs.second[worst])]
    first, last = audit.q[rows[0]].astype(float), audit.q[rows[-1]].astype(float)
    points, _ = audit.task._poses(audit.q[shown].astype(float))
    stage = stage_of(audit.robot, np.vstack([first, last]), [Curve(points, GREY)], pairs=[(first, last)])
    differs = worst is not None and audit.verdict is LogVerdict.DIFFERS
    actors = [Actor(first, GOOD), *([Actor(last, BAD, "outline")] if differs else [])]
    title = "The arm at a tool pose"
    if differs and worst is not None:
        (e, _), (f, _) = audit.frame(rows[0]), audit.frame(rows[1])
        title = f"One tool pose, two postures: episodes {e} and {f}"
    draw_panel(axes, stage, actors, title=title)
    seen = stage.scene.view.seen(points)
    axes.plot(*seen[:, :2].T, ".", color="#c9cdd4", markersize=1.5, zorder=3)
    if differs:
        pairs = audit.pairs
        bad = pairs.first[np.flatnonzero(pairs.beyond)]
        spots, _ = audit.task._poses(audit.q[bad[thin(len(bad), MOST_POINTS)]].astype(float))
        axes.plot(*stage.scene.view.seen(spots)[:, :2].T, ".", color=BAD, markersize=3, zorder=4)
