"""A robot in words, and the advice on its strategy: a table and a figure."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import fill
from typing import Any

import numpy as np

from ...analysis.design import Advice, RatedStrategy
from ...analysis.design.trials import is_proven
from ...base.errors import brief
from ...base.progress import as_printed
from ...base.types import Vector
from ...robot import Coordinate, Robot, Tip, knows_masses, reach
from .plots import HOLONOMIC, INK, PAGE, on_figure
from .robot_panels import Actor, draw_panel, stage_of
from .section import Note, Section, right
from .sheets_plots import CAUSES, coverage_cloud

# --- A robot in words: its joints with their limits, its tool frames, where its numbers are from.


def robot_section(robot: Robot) -> Section:
    """A robot: its name, source and reach, a table of its joints, its tool frames, its shapes and masses."""
    count = f"{robot.n} joint{'s' * (robot.n > 1)}"
    title = f"{robot.name}: {count}, reach {reach(robot):.3f} m" if robot.tips else f"{robot.name}: {count}"
    joints = [(c.name, _range(c), _speed(c)) for c in robot.coordinates]
    kinds = sorted({type(shape.shape).__name__.lower() for shape in robot.shapes})
    shapes = f"{len(robot.shapes)}, {', '.join(kinds)}" if kinds else "none; capsules stand for the links"
    remarks = [f"tool frame {_tip(robot, tip)}" for tip in robot.tips]
    remarks += [f"shapes: {shapes}", f"masses: {'known' if knows_masses(robot) else 'not known'}"]
    notes = [f"source: {robot.source}"] if robot.source else []
    return Section(title, notes, head=["joint", "range", "largest speed"], rows=joints, remarks=remarks)


def _range(c: Coordinate) -> str:
    """The limits of a joint; of a hinge in degrees, too."""
    if not np.isfinite([c.lower, c.upper]).any():
        return f"no limits [{c.unit}]"
    plain = f"{c.lower:.4f} to {c.upper:.4f} {c.unit}"
    return plain if c.unit != "rad" else f"{plain} ({np.degrees(c.lower):.1f} to {np.degrees(c.upper):.1f} deg)"


def _speed(c: Coordinate) -> str:
    """The largest speed of a joint; of a hinge in degrees, too."""
    if not np.isfinite(c.max_velocity):
        return "not known"
    plain = f"{c.max_velocity:.4f} {c.unit}/s"
    return plain if c.unit != "rad" else f"{plain} ({np.degrees(c.max_velocity):.1f} deg/s)"


def _tip(robot: Robot, tip: Tip) -> str:
    """A tool frame, in the frame of the joint that carries it."""
    from scipy.spatial.transform import Rotation

    where = "the base" if tip.joint < 0 else robot.joints[tip.joint].name
    angles = Rotation.from_matrix(tip.placement[:3, :3]).as_euler("xyz", degrees=True)
    xyz, rpy = (", ".join(f"{v + 0.0:.6g}" for v in np.round(three, 6)) for three in (tip.placement[:3, 3], angles))
    return f"{tip.name}: on {where}, xyz [{xyz}] m, rpy [{rpy}] deg"


SHOWN = 6
"""Strategies in the table and in the picture at most."""


def print_advice(advice: Advice, console: Any) -> None:
    """Print the advice in lines, and below it the best strategies as a table."""
    Section(as_printed(brief(advice.subject, 600)), notes=advice.reasons).rich(console)
    clear = right("clearance\nmin [m]") if advice.scene else []
    head = ["strategy", *right("workspace\nserved", "nearest limit\n[of its range]"), "joint", *right("rcond\nmin")]
    rows = []
    for k, law in enumerate(advice.strategies[:SHOWN]):
        cells = _cells(law)
        cells[-1:-1] = [f"{law.clearance:.3f}" if np.isfinite(law.clearance) else "-"] if advice.scene else []
        rows.append([Note(cell, "" if k else "good") for cell in cells])
    remarks: list[Note | str] = []
    if advice.proposed:
        known = {"tip": f"the tip ({advice.chain.tip})", "task": f"the task ({advice.work})", "q0": "the start posture"}
        chosen = ", ".join(known.get(word, f"the {word}") for word in advice.proposed)
        remarks.append(Note(f"Not given, so chosen here: {chosen}.", "warning"))
    if advice.offers:
        task = "position" if advice.task.orientation is None else "axis"
        remarks.append(Note(f"The task is '{task}': {advice.offers}.", "warning"))
    for law in advice.strategies[:SHOWN]:
        if law.same:
            remarks.append(f"{law.name} stands for {', '.join(law.same)}, too: the same joint rates at every pose.")
    head += [*clear, *right("joint speed\n/ least")]
    Section(head=head, rows=rows, remarks=remarks).rich(console)


def _cells(law: RatedStrategy) -> list[str]:
    """The row of a strategy."""
    served = np.isfinite(law.margin) and law.served.any()
    return [
        law.name,
        f"{law.coverage:.1%}",
        f"{law.margin:.1%}" if served else "-",
        law.joint if served else "-",
        f"{law.rcond:.2g}" if np.isfinite(law.rcond) and law.served.any() else "-",
        f"{law.speed:.3f}" if np.isfinite(law.speed) else "-",
    ]


def advice_figure(advice: Advice, robot: Robot | None = None) -> Any:
    """The strategies as bars: what they do not serve, what is left to the limits, their joint speed; and below them the
    robot with what the best serves.

    Args:
        robot: the same with what it carries; by default the robot of the advice.
    """
    from matplotlib.figure import Figure

    # Strategies in the figure: the best ones.
    laws, every = advice.strategies[:SHOWN], len(advice.strategies)
    # The robot with the poses that the best strategy reaches.
    robot = advice.task.robot if robot is None else robot
    points = advice.coverage.poses[:, :3, 3]
    things = () if advice.scene is None else advice.scene.obstacles
    stage = stage_of(robot, advice.q0[None], extra=points, obstacles=things, ratio=(0.5, 0.8))
    # The size of the figure, from that of its names and of the scene.
    subject = fill(on_figure(f"{advice.work}; {advice.workspace}", 300), LETTERS)
    wide, tall = stage.scene.shape
    scene, bars = SCENE * tall / wide, bars_height(laws)
    top = 0.65 + 0.15 * subject.count("\n")
    below = 0.75 if robot.planar else 0.45  # the names of the axes, and the causes
    size = (PAGE, top + 0.35 + bars + 0.95 + scene + below)
    figure = Figure(figsize=size)

    def place(left: float, from_top: float, width: float, height: float) -> Any:
        """Axes at a place in inches."""
        return figure.add_axes((left / size[0], 1 - (from_top + height) / size[1], width / size[0], height / size[1]))

    # The bars, the scene, the words.
    panels = [place(left, top + 0.35, BAR, bars) for left in BARS]
    name_bars(panels[0], laws)
    served = [law.served.any() for law in laws]
    left_over = [100 * law.margin if known else np.nan for law, known in zip(laws, served, strict=True)]
    for panel in panels[1:]:
        panel.set_yticks([])
    _bars(panels[0], laws, [100 * (1 - law.coverage) for law in laws], "workspace not served [%]", best=min)
    _bars(panels[1], laws, left_over, "nearest limit [% of range]", best=max)
    _bars(panels[2], laws, [100 * (law.speed - 1) for law in laws], "joint speed above least [%]", best=min)
    shown = f"the {len(laws)} best of {every} strategies" if every > len(laws) else f"{every} strategies"
    proven = "; *: proven on the whole arm" if any(map(is_proven, laws)) else ""
    panels[0].set_title(f"{shown}, the advised one dark{proven}", loc="left", fontsize=10, color=INK)
    panel = place((PAGE - SCENE) / 2, top + 0.35 + bars + 0.95, SCENE, scene)
    title = f"start posture, and {len(points)} poses of the workspace"
    draw_panel(panel, stage, [Actor(advice.q0, HOLONOMIC)], title=title)
    coverage_cloud(panel, advice.coverage, seen=stage.scene.view.seen(points))
    _legend(figure, advice)
    head = fill(f"{on_figure(advice.task.robot.name)}: {on_figure(advice.best.name, 90)}", HEAD)
    figure.text(0.015, 1 - 0.1 / size[1], head, fontsize=11, fontweight="bold", va="top")
    figure.text(0.015, 1 - (0.35 + 0.17 * head.count("\n")) / size[1], subject, fontsize=9, color="#4b5563", va="top")
    return figure


THICK, LEAST = 1.3, 2.2
"""Thickness of a bar, and least distance of two, in lines of text."""

LINE = 0.125
"""Height of a line of text [inch]."""

BARS, BAR = (2.25, 3.98, 5.7), 1.5
"""Where the panels of bars begin, and their width [inch]."""

OTHERS = "#A6C8E0"
"""Bars of the strategies that are not advised."""

LONGEST = 4.0
"""Length of the longest bar that is shown whole, in medians of its panel."""

SCENE = 5.8
"""Width of the robot's picture [inch]."""

LETTERS, HEAD = 96, 72
"""In a line of the subject, and of the head."""


def bars_height(laws: tuple[RatedStrategy, ...]) -> float:
    """The height of the bars [inch], greater where the names of strategies are long."""
    return LINE * max(_rows(laws)[1], 6.0)


def _label(law: RatedStrategy) -> str:
    """The name of a strategy in lines, with a star if it is proven on the whole arm."""
    return fill(on_figure(law.name, 120) + (" *" if is_proven(law) else ""), 33)


def _rows(laws: tuple[RatedStrategy, ...]) -> tuple[Vector, float]:
    """Where the bar of each strategy stands, and where the last one ends, in lines of text: names do not overlap."""
    lines = np.array([max(LEAST, _label(law).count("\n") + 1.5) for law in laws])
    ends = np.cumsum(lines)
    return ends - lines / 2, float(ends[-1])


def name_bars(axes: Any, laws: tuple[RatedStrategy, ...]) -> Any:
    """The names of strategies at the left of their bars, the best on top."""
    rows, end = _rows(laws)
    axes.set_yticks(rows, [_label(law) for law in laws], fontsize=8, linespacing=1.0)
    axes.set_ylim(end, 0)
    return axes


def _bars(
    axes: Any, laws: tuple[RatedStrategy, ...], values: list[float], words: str, best: Callable[..., float]
) -> None:
    """A bar for each strategy with its number: that of the advice, the first, dark, the best number bold. Of a bar far
    longer than the others a part is left out, and a stroke through it shows it."""
    (rows, end), known = _rows(laws), np.nan_to_num(np.array(values), nan=0.0, posinf=0.0)
    usual = float(np.median(known[known > 0])) if known.any() else 1.0
    most = min(float(known.max(initial=1.0)), LONGEST * usual)
    axes.barh(rows, np.minimum(known, most), color=[HOLONOMIC, *[OTHERS] * (len(laws) - 1)], height=THICK)
    axes.set_ylim(end, 0)
    axes.set_xlim(0, 1.35 * most)
    axes.set_xticks([])
    axes.set_xlabel(f"{words}\n{'less' if best is min else 'more'} is better", fontsize=8)
    axes.grid(visible=False)
    leader = best((value for value in values if np.isfinite(value)), default=np.nan)
    for row, value, shown in zip(rows, values, known, strict=True):
        text = _rounded(value)
        weight = "bold" if text == _rounded(leader) != "-" else "normal"
        axes.text(min(shown, most) + 0.03 * most, row, text, va="center", fontsize=8, color=INK, fontweight=weight)
        if shown > most:
            strokes = [row + 0.6 * THICK, row - 0.6 * THICK]
            axes.plot(np.array([0.86, 0.92]) * most, strokes, color="white", linewidth=2)


def _rounded(value: float) -> str:
    """A number beside its bar."""
    return "-" if not np.isfinite(value) else f"{value:.1f}" if value < 99.95 else f"{value:,.0f}"


def _legend(figure: Any, advice: Advice) -> None:
    """The causes for which poses are not reached."""
    from matplotlib.lines import Line2D

    coverage = advice.coverage
    marks = [("#1f7a6b", "reached", int(coverage.reached.sum()))]
    marks += [(color, name, coverage.count(cause)) for cause, (color, name) in CAUSES.items() if coverage.count(cause)]
    handles = [
        Line2D([], [], color=color, marker="o", linestyle="", markersize=6, label=f"{name}: {count}")
        for color, name, count in marks
    ]
    figure.legend(handles=handles, loc="lower center", fontsize=8, ncols=min(len(handles), 4))
