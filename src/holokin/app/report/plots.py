"""Drawing: words and colours of all pictures, and one function for each thing that is drawn.

As in the paper, the clockwise path is solid and the counter-clockwise one dashed.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage.cover_workspace import Plane, grid_planes
from ...base.errors import ArgumentError, brief
from ...base.files import replacing
from ...base.types import Indices, Vector
from ...motion.trajectory import Status, Trajectory
from ...proof import UniqueRegion
from ...proof.proven_region import CAUSES
from ...robot import Robot
from .job_result import JobResult, StrategyResult

# --- What figures, tables and reports say of a result, in sentences.

ALIKE = 1e-8
"""Joint difference [rad or m] that is called none in captions: nobody could measure it."""


def on_figure(name: str, most: int = 60) -> str:
    """A name as matplotlib shows it: short, without control characters, which SVG forbids, and never a formula.

    Names that begin with _ are left out of legends, so they get a blank before.
    """
    text = brief(name, most).replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def joint_unit(robot: Robot) -> str:
    """The unit of a robot's joints: "rad", "m", or "m or rad" where it has both."""
    return " or ".join(dict.fromkeys(c.unit for c in robot.coordinates))


def alike(shift: Vector, units: tuple[str, ...]) -> bool:
    """Whether a joint difference (n,) in these units, also printed ones, is none that anybody could measure."""
    each = {"deg": ALIKE * 180 / np.pi, "mm": 1000 * ALIKE}
    return bool((np.abs(shift) < [each.get(unit, ALIKE) for unit in units]).all())


def largest(shift: Vector, units: tuple[str, ...]) -> str:
    """The largest entry of a joint difference (n,), with the unit of the joint that it is of."""
    i = int(np.argmax(np.abs(shift)))
    return f"{abs(shift[i]):.3g} {units[i]}"


def stopped(walk: Trajectory) -> str:
    """When and why a trajectory stopped; empty for a complete one."""
    if walk.status is Status.COMPLETE:
        return ""
    return f"stopped at {walk.t[-1]:.3g} s, {walk.status.cause.removeprefix('stopped').lstrip(': ')}"


def paths_end(pair: tuple[Trajectory, Trajectory]) -> str:
    """How the clockwise and the counter-clockwise path end: alike, apart, or before the end."""
    clockwise, counter = pair
    if clockwise.status is counter.status is Status.COMPLETE:
        gap = clockwise.q[-1] - counter.q[-1]
        apart = f"the two paths end {largest(gap, clockwise.joint_units)} apart"
        return "both paths end at the same joints" if alike(gap, clockwise.joint_units) else apart
    named = [("clockwise", clockwise), ("counter-clockwise", counter)]
    return "\n".join(f"{name} {stopped(walk)}" for name, walk in named if walk.status is not Status.COMPLETE)


def away(walk: Trajectory, cycles: int) -> str:
    """Where the joints stand after some cycles."""
    count = "1 cycle" if cycles == 1 else f"{cycles} cycles"
    shift = walk.q[walk.marks[cycles]] - walk.q[0]
    same = alike(shift, walk.joint_units)
    return f"after {count}: " + ("back at the start" if same else f"{largest(shift, walk.joint_units)} away")


def check_words(strategy: StrategyResult) -> str:
    """What the checks of a motion say besides their findings: that there are none, and of which share of the path."""
    clear = strategy.motion_check is not None and strategy.motion_check.passed
    if strategy.followed == 1.0:
        return "nothing found" if clear else ""
    seen = f"the first {strategy.followed:.1%} of the path" if strategy.followed > 0 else "the start posture"
    return f"{'nothing found, but ' if clear else ''}only {seen} was looked at: there the strategy stopped"


def paths_words(result: JobResult) -> str:
    """That no two paths were compared, and why; empty where the path has them."""
    return f"Two paths were not compared: {result.one_way}" if result.one_way else ""


def speed_warning(result: JobResult, strategy: StrategyResult) -> str:
    """A sentence about the first joint that would have to be faster than it can; empty if none."""
    limits = result.robot.max_velocity
    shares = np.max([np.abs(w.dq).max(axis=0) / limits for w in strategy.trajectories().values()], axis=0)
    i = int(np.argmax(shares))
    if not shares[i] > 1.0:
        return ""
    slower = 0.99 * result.path.speed / shares[i]
    return (
        f"joint {result.robot.joint_names[i]!r} would have to run at {shares[i]:.3g} times its speed limit of "
        f"{result.units.said(limits[i], result.robot.coordinates[i].unit + '/s', 3)}; run the path at "
        f"{result.units.said(slower, 'm/s', 2)} or slower"
    )


# --- The colours of everything drawn: plots, films, tables of the terminal, the studio. Safe for colour-blind readers.
#
# The eight colours are those of Okabe and Ito, "Color Universal Design", 2008 (https://jfly.uni-koeln.de/color/), also
# in B. Wong, "Points of view: Color blindness", Nature Methods 8, 441 (2011). A colour is never the only sign: lines
# differ by their dashes or have their names beside them too.

BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"
BLACK = "#000000"
YELLOW = "#F0E442"

COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, YELLOW)
"""All eight, best seen on white first; yellow is for fills with a dark edge."""

HOLONOMIC = BLUE
"""The (first) holonomic strategy: what comes back to its start."""
NONHOLONOMIC = VERMILLION
"""The pseudo-inverse, and the first of other strategies that are not holonomic: what drifts."""
LIMIT = PURPLE
"""Limits of joints, speeds and torques."""
LOOP = GREEN
"""The path that the tool shall follow."""
CLOCKWISE = SKY
"""The clockwise path round a loop, or the path there."""
COUNTER_CLOCKWISE = ORANGE
"""The counter-clockwise path round a loop, or the path back."""

GOOD = GREEN
"""In tables: as expected."""
BAD = VERMILLION
"""In tables: failed, or not holonomic."""
WARNING = ORANGE
"""In tables: not what was asked for, though computed."""

HOLONOMIC_TEXT = SKY
"""In tables of the terminal: holonomic. Blue, as light as black and white grounds both need."""

INK = "#22262E"
"""Text."""
GREY = "#8A919C"
"""What is for comparison only, and what stands still."""
START = PURPLE
"""The robot at the start, drawn pale: no part of a robot that stands still has this colour."""
PALE = "#E5E7EB"
"""Grids, floors, and bands behind lines."""

AXES = (VERMILLION, GREEN, BLUE)
"""The x, y and z axis of a frame."""

_HOLONOMIC = (BLUE, GREEN, SKY, BLACK)
_NONHOLONOMIC = (VERMILLION, ORANGE, PURPLE, YELLOW)


def color_of(index: int) -> str:
    """The colour of the line, joint or ghost of a number, as #RRGGBB; the eight repeat."""
    return COLORS[index % len(COLORS)]


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour #RRGGBB."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def law_colors(holonomic: Sequence[bool]) -> tuple[str, ...]:
    """A colour for each strategy: cool ones, blue first, for holonomic strategies, warm ones, vermillion first, else.

    Args:
        holonomic: of each strategy, whether it is.

    Returns:
        As many colours; the first four strategies of each kind have one of their own, then they repeat.
    """
    used = {True: 0, False: 0}
    colors: list[str] = []
    for kind in map(bool, holonomic):
        of_kind = _HOLONOMIC if kind else _NONHOLONOMIC
        colors.append(of_kind[used[kind] % len(of_kind)])
        used[kind] += 1
    return tuple(colors)


DIRECTIONS = {
    "clockwise": {"color": CLOCKWISE, "linestyle": "-", "linewidth": 2.4},
    "counter-clockwise": {"color": COUNTER_CLOCKWISE, "linestyle": (0, (4, 1.5)), "linewidth": 1.8},
}
"""How the two paths are drawn."""

NAMED = 7
"""Joints in a panel that have a colour each: those that move most. The others are grey, and named together."""

LABELS = 8
"""Strategies with a label each in the picture of drift; of more, the holonomic ones have one together."""

ROUND_OFF = 1e-9
"""Drift [rad or m] below which a strategy is counted to those that come back to the start."""

PAGE, TYPE = 7.3, 8.0
"""Width of a page [inches], to which wider figures are made smaller, and the smallest type on it [points]."""

_STYLE = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#6b7280",
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": "#4b5563",
    "ytick.color": "#4b5563",
    "axes.grid": True,
    "grid.color": "#e5e7eb",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.hashsalt": "holokin",
}


def write_figure(draw: Callable[[], Any], file: FilePath) -> None:
    """Write the figure that `draw` makes as an image of the file's type, PNG where its name has no ending.

    Raises:
        ArgumentError: there is no such type. WriteError: the system refuses the file.
    """
    from matplotlib import rc_context
    from matplotlib.backend_bases import FigureCanvasBase

    kind = file.suffix[1:].lower() or "png"
    known = FigureCanvasBase.get_supported_filetypes()
    if kind not in known:
        raise ArgumentError("the file to write", str(file), f"it cannot be written: choose of {', '.join(known)}")
    with rc_context(style()), replacing(file) as part:
        figure = legible(draw())
        figure.savefig(part, format=kind, dpi=130, facecolor="white")


def legible(figure: Any) -> Any:
    """The figure, its smallest type no smaller than `TYPE` where it is as wide as a `PAGE`."""
    from matplotlib.text import Text

    smallest = TYPE * max(1.0, figure.get_figwidth() / PAGE)
    for axes in figure.axes:
        for axis in axes._axis_map.values():  # ticks that are not made yet, too
            axis.set_tick_params(labelsize=max(smallest, *(t.get_fontsize() for t in axis.get_ticklabels()), 0.0))
    for text in figure.findobj(Text):
        text.set_fontsize(max(smallest, text.get_fontsize()))
    return figure


def new_figure(**keys: Any) -> Any:
    """A figure of matplotlib, of its arguments, that notebooks show without pyplot."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            stream = io.BytesIO()
            legible(self).savefig(stream, format="png", facecolor="white")
            return stream.getvalue()

    return Shown(**keys)


def style() -> Any:
    """matplotlib settings of every figure."""
    return dict(_STYLE)


def thin(count: int, most: int = 600) -> Indices:
    """Indices of at most `most` samples, ends included: pictures need no more."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def joint_histories(
    axes: Any, clockwise: Trajectory, counter: Trajectory, joint: int, robot: Robot | None = None
) -> Any:
    """One joint over time, by both ways, with the gap at the end or crosses where they stop. [ZR11, Figs 4, 5, 8]

    Of a robot with limits these are lines, or where they are far beyond the panel, numbers at its right edge.
    """
    stops: list[float] = []
    for walk, (label, style) in zip((clockwise, counter), DIRECTIONS.items(), strict=True):
        keep = thin(len(walk))
        axes.plot(walk.t[keep], walk.q[keep, joint], label=label, **style)
        if walk.status is not Status.COMPLETE:
            stops.append(float(walk.t[-1]))
        end = "o" if walk.status is Status.COMPLETE else "X"
        axes.plot(walk.t[-1], walk.q[-1, joint], end, color=style["color"], markersize=5 if end == "o" else 8)
    gap = abs(clockwise.q[-1, joint] - counter.q[-1, joint])
    unit = clockwise.joint_units[joint]
    low, high = axes.get_ylim()
    smallest = 0.02 if unit == "rad" else 0.01  # a joint that stands still shall look it
    if high - low < smallest:
        axes.set_ylim((low + high - smallest) / 2, (low + high + smallest) / 2)
    if robot is not None:
        _limit_lines(axes, float(robot.lower[joint]), float(robot.upper[joint]))
    ending = f"stopped at {' and '.join(f'{t:.3g}' for t in stops)} s" if stops else _gap(gap, unit)
    axes.set_title(f"{on_figure(clockwise.joint_names[joint], 30)}: {ending}", loc="left", color=INK, fontsize=10)
    axes.set_ylabel(unit)
    return axes


def _limit_lines(axes: Any, lower: float, upper: float) -> Any:
    """The limits of what is drawn: a line each where it is near, else its number beside an arrow at the right edge."""
    low, high = axes.get_ylim()
    near = [x for x in (lower, upper) if low - 0.6 * (high - low) <= x <= high + 0.6 * (high - low)]
    for limit in near:
        axes.axhline(limit, color=LIMIT, linewidth=1.6, linestyle=(0, (1, 1)), label="limit", zorder=1.5)
    if near:
        pad = 0.06 * (high - low)
        axes.set_ylim(min([low, *(x - pad for x in near)]), max([high, *(x + pad for x in near)]))
    for limit, arrow, y in ((lower, "\u2193", 0.0), (upper, "\u2191", 1.0)):
        if np.isfinite(limit) and limit not in near:
            # The colour of limits, dark enough for small letters.
            look = {"transform": axes.transAxes, "fontsize": 7.5, "color": "#8f3f6b"}
            axes.text(1.01, y, f"{arrow} {limit:.3g}", ha="left", va="bottom" if y == 0 else "top", **look)
    return axes


def joint_cycles(axes: Any, walk: Trajectory, named: Sequence[int] | None = None) -> Any:
    """Every joint's departure from its start over the cycles. [ZR11, Fig. 6]

    Args:
        named: the joints in colours, by default all; the others are grey.
    """
    keep = thin(len(walk), 900)
    shift = walk.q - walk.q[0]
    named = range(len(walk.joint_names)) if named is None else named
    rest = [j for j in range(len(walk.joint_names)) if j not in named]
    for joint in rest:
        label = f"grey: {', '.join(on_figure(walk.joint_names[j], 30) for j in rest)}" if joint == rest[0] else None
        axes.plot(walk.t[keep], shift[keep, joint], color="#c3c8d0", linewidth=1.0, label=label or "_grey", zorder=1.8)
    for place, joint in enumerate(named):
        name = on_figure(walk.joint_names[joint], 30)
        look = {"color": color_of(place), "linestyle": "-" if place < len(COLORS) else (0, (4, 1.5))}
        axes.plot(walk.t[keep], shift[keep, joint], linewidth=1.7, label=name, **look)
    axes.grid(axis="x", visible=False)  # the ends of the cycles are lines enough
    for mark in walk.marks[1:]:
        axes.axvline(walk.t[mark], color=PALE, linewidth=0.8, zorder=0)
    axes.axhline(0, color=GREY, linewidth=0.8, zorder=1)
    axes.set_xlabel("time [s]")
    return axes


def movers(walks: Sequence[Trajectory], most: int = NAMED) -> list[int]:
    """The joints that move most in some motions, in their own order; all where there are few."""
    reach = np.max([np.abs(walk.q - walk.q[0]).max(axis=0) for walk in walks], axis=0)
    if len(reach) <= most:
        return list(range(len(reach)))
    return sorted(int(j) for j in np.argsort(-reach, kind="stable")[:most])


def drift_per_cycle(axes: Any, walks: dict[str, Trajectory], colors: Sequence[str] | None = None) -> Any:
    """Largest joint drift after 1, 2, ... cycles, on a logarithmic scale down to round-off, each line with its name.

    Of many strategies those without drift have one name together, and of the others the last ones.
    """
    sizes = {name: np.abs(walk.drift_since_start()).max(axis=1) for name, walk in walks.items()}
    colors = [color_of(i) for i in range(len(sizes))] if colors is None else colors
    named_lines: list[tuple[float, str, str]] = []
    order = sorted(sizes, key=lambda name: -sizes[name][-1])
    for (name, values), color in zip(sizes.items(), colors, strict=True):
        cycles, shown = np.arange(1, len(values) + 1), np.maximum(values, 1e-17)
        alone = len(sizes) <= LABELS or (values.max() > ROUND_OFF and name in order[: LABELS - 2])
        paint = color if alone else HOLONOMIC if values.max() <= ROUND_OFF else GREY
        axes.semilogy(cycles, shown, "o-", color=paint, linewidth=1.8 if alone else 1.0, markersize=4, label=name)
        if alone:
            named_lines.append((float(shown[-1]), name, color))
    if len(sizes) > LABELS:
        named_lines += _grouped_labels(sizes, {name for _, name, _ in named_lines})
    axes.axhspan(1e-18, 1e-12, color="#f3f4f6", zorder=0)
    axes.text(0.01, 0.02, "below 1e-12: round-off", transform=axes.transAxes, ha="left", color="#6b7280", fontsize=9)
    axes.set_ylim(1e-17, 10)
    axes.set_xlabel("cycles done")
    units = dict.fromkeys(unit for walk in walks.values() for unit in walk.joint_units)
    axes.set_ylabel(f"joint drift, largest joint [{' or '.join(units)}]")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlim(0.7, max(len(v) for v in sizes.values()) + 0.3)
    beside(axes, named_lines)
    return axes


def _grouped_labels(sizes: dict[str, Vector], alone: set[str]) -> list[tuple[float, str, str]]:
    """Labels for the strategies that have none of their own: how many, and how far they drift."""
    labels = []
    rest = {name: values for name, values in sizes.items() if name not in alone}
    for back, color in ((True, HOLONOMIC), (False, "#6b7280")):
        group = [v for v in rest.values() if (v.max() <= ROUND_OFF) == back]
        if group:
            ends = [float(v[-1]) for v in group]
            what = "strategies come back to the start" if back else "more strategies drift"
            place = float(np.exp(np.mean(np.log(np.maximum(ends, 1e-17)))))
            labels.append((place, f"{len(group)} {what}, at most {max(ends):.1g}", color))
    return labels


def beside(axes: Any, named_lines: Sequence[tuple[float, str, str]], least: float = 0.058) -> None:
    """Names (height in data, text, colour) right of the axes, none over another, joined to the ends of their lines."""
    places = [
        float(axes.transAxes.inverted().transform(axes.transData.transform((0, y)))[1]) for y, _, _ in named_lines
    ]
    order = sorted(range(len(named_lines)), key=lambda i: places[i])
    spread: list[float] = []
    for i in order:
        spread.append(max(places[i], spread[-1] + least if spread else 0.02))
    over = spread[-1] - 0.98 if spread else 0.0
    if over > 0:  # from the top downwards
        for k in range(len(spread) - 1, -1, -1):
            spread[k] = min(spread[k], 0.98 if k == len(spread) - 1 else spread[k + 1] - least)
    for height, i in zip(spread, order, strict=True):
        _, text, color = named_lines[i]
        axes.plot([1.0, 1.03], [places[i], height], color=color, linewidth=0.8, transform=axes.transAxes, clip_on=False)
        axes.text(1.04, height, text, transform=axes.transAxes, va="center", fontsize=9, color=_readable(color))


def joint_ranges(axes: Any, robot: Robot, walks: dict[str, Trajectory], colors: Sequence[str]) -> Any:
    """What each strategy uses of each joint's range: 0 and 1 are its limits. Joints without limits are left out."""
    travel = robot.upper - robot.lower
    limited = np.flatnonzero(np.isfinite(travel) & (travel > 0))
    thick = 0.72 / max(len(walks), 1)
    for i, ((name, walk), color) in enumerate(zip(walks.items(), colors, strict=True)):
        share = (walk.q[:, limited] - robot.lower[limited]) / travel[limited]
        low, high = share.min(axis=0), share.max(axis=0)
        rows = np.arange(len(limited)) + (i - (len(walks) - 1) / 2) * thick
        axes.barh(rows, np.maximum(high - low, 0.004), left=low, height=0.85 * thick, color=color, label=name, zorder=2)
    for x in (0.0, 1.0):
        axes.axvline(x, color=LIMIT, linewidth=1.6, linestyle=(0, (1, 1)))
    axes.set_yticks(range(len(limited)), [on_figure(robot.joint_names[j], 24) for j in limited])
    axes.set_ylim(len(limited) - 0.5, -0.5)
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, -0.02), max(high, 1.02))
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["lower limit", "25 %", "50 %", "75 %", "upper limit"])
    axes.grid(axis="y", visible=False)
    return axes


def _readable(color: str) -> str:
    """A colour for letters: the pale ones of the palette are darkened."""
    from matplotlib.colors import to_rgb

    red, green, blue = to_rgb(color)
    light = 0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2
    return color if light < 0.25 else "#" + "".join(f"{round(158 * part):02x}" for part in (red, green, blue))


def _gap(gap: float, unit: str) -> str:
    return "ends agree" if gap < 1e-9 else f"ends {gap:.3g} {unit} apart"


# --- A picture of a region that is proven, and of what the rest of its workspace is.

PROOF_COLORS = ("#1f7a6b", "#c9d1da", PURPLE, ORANGE, SKY, VERMILLION)
"""Of a pose that is proven, and of the others by `CAUSES`."""


def region_figure(region: UniqueRegion, steps: int = 25) -> Any:
    """Planes through the centre of a workspace, the tool in its middle orientation: proven poses, and why the others
    are not.

    Args:
        steps: cells along the longest side.
    """
    from matplotlib import rc_context
    from matplotlib.patches import Patch

    space = region.workspace
    planes = list(grid_planes(space, steps))
    with rc_context(style()):
        figure = new_figure(figsize=(3.4 * len(planes) + 1.9, 3.6), layout="constrained")
        seen: set[int] = set()
        for axes, plane in zip(figure.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
            i, j = plane.axes
            seen |= region_map(axes, region, plane, region.causes(space.at(plane.points)))
            axes.set(xlabel=f"{'xyz'[i]} [m]", ylabel=f"{'xyz'[j]} [m]")
            axes.set_title(f"{'xyz'[3 - i - j]} = {plane.at:.3g} m", loc="left", fontsize=10)
        names = ("proven", *CAUSES)
        figure.legend(
            handles=[Patch(color=PROOF_COLORS[k], label=names[k]) for k in sorted(seen)], loc="outside right upper"
        )
        title = f"{on_figure(region.strategy.name)}: {region.share:.0%} of the box is proven"
        figure.suptitle(title, x=0.02, ha="left", fontsize=12)
    return figure


def region_map(axes: Any, region: UniqueRegion, plane: Plane, causes: Indices) -> set[int]:
    """Draw the cells of a plane by `COLORS`, of causes (k,) of its poses, -1 for proven; returns which are seen."""
    from matplotlib.colors import ListedColormap

    (i, j), solid = plane.axes, region.workspace.solid
    cells, low, high = 1 + causes.reshape(plane.inside.shape), solid.center - solid.half, solid.center + solid.half
    shown = {"cmap": ListedColormap(PROOF_COLORS), "vmin": 0, "vmax": len(PROOF_COLORS) - 1, "interpolation": "nearest"}
    axes.imshow(cells, origin="lower", extent=(low[i], high[i], low[j], high[j]), aspect="equal", **shown)
    axes.grid(False)
    return set(cells.ravel().tolist())
