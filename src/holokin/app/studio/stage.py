"""What stands beside the scene: handles, plots, texts, and the `Stage` that all of them belong to."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from html import escape
from typing import Any, Protocol

import numpy as np

from ...base.poses import pose_from
from ...base.types import Matrix, Vector
from ...base.units import PrintedUnits
from ...robot import reach
from ..report.plots import BAD, GOOD, GREY, HOLONOMIC, INK, LOOP, PALE, rgb, thin
from .followers import Loop, circle_loop, polygon_loop
from .page_scene import Scene, pose_of, wxyz_of
from .session import Session
from .states import Phase, Snapshot, joint_factors, joint_unit, largest


class Stage(Protocol):
    """See `Page`, which is the only one.

    Attributes:
        server: of viser. session, scene: what is shown, and where. lead: the strategy whose robot is solid.
        colors: of the strategies (#RRGGBB). said: the sentence for everyone. reopen: shows another job, by name.
        units: of what is shown.
        drawn: the number of the snapshot that is drawn, -1 to draw it again. handles: of the scene.
    """

    server: Any
    session: Session
    scene: Scene
    lead: int
    colors: tuple[str, ...]
    said: str
    reopen: Callable[[str], None] | None
    units: PrintedUnits
    drawn: int
    handles: Any

    def attempt(self, action: Callable[[], Any]) -> None:
        """Do something in this thread; what it raises is said in the page."""
        ...

    def alone(self, key: object, action: Callable[[], Any]) -> None:
        """The same, and not while it is being done already, as a key tells."""
        ...

    def clear_traces(self) -> None:
        """Take the lines away that elbows drew."""
        ...

    def ask(self, action: Callable[[], Any], key: object = None) -> None:
        """Have something done by the page's thread; of several with one key only the last is done."""
        ...

    def say(self, sentence: str) -> None:
        """A sentence for everyone, until the next."""
        ...

    def set_units(self, units: PrintedUnits) -> None:
        """In what numbers are shown."""
        ...

    def set_lead(self, index: int) -> None:
        """Whose robot is drawn solid."""
        ...

    def own_drawing(self) -> AbstractContextManager[None]:
        """The page's thread leaves the robots alone."""
        ...


# --- What is dragged in the page: the tool, the loop's centre, plane and radius, and the corners of a polygon.

LEAST = 0.005  # smallest radius of a loop that can be dragged [m]
# where corners are [m], and how many: a click near the horizon meets the tool's level far beyond all robots
FAR, MOST = 100.0, 50


class Handles:
    """Transform controls in the scene of a page."""

    def __init__(self, page: Stage):
        self.page = page
        self.size = 0.14 * min(max(reach(page.session.robot), 0.3), 3.0) if page.session.robot.tips else 0.2
        self.corners: list[Vector] = []
        self._held: set[str] = set()
        self._tools = [self._tool(index) for index in range(page.session.task.frames)]
        self._balls = [
            page.server.scene.add_icosphere(f"/target/{i}", 0.16 * self.size, color=rgb(GOOD), cast_shadow=False)
            for i in range(page.session.task.frames)
        ]
        self._loop, self._radius = self._loop_handles()
        self._clicks: Any = None
        self.loop_wanted = False

    def draw(self, snap: Snapshot) -> None:
        """The tool's handle at its target; its ball is red where a strategy does not get there."""
        free = snap.phase in (Phase.IDLE, Phase.PAUSED, Phase.DONE)
        for index, (handle, ball) in enumerate(zip(self._tools, self._balls, strict=True)):
            pose = snap.target[index]
            ball.position = pose[:3, 3]
            color = rgb(GOOD if snap.following else BAD)
            if tuple(ball.color) != color:
                ball.color = color
            if handle.visible != free:
                handle.visible = free
            if f"tool{index}" not in self._held and free:
                handle.position, handle.wxyz = pose[:3, 3], wxyz_of(pose)

    def place_loop(self, loop: Loop | None) -> None:
        """The handles of a circle on it; of what is no circle there are none."""
        circle = circle_of(loop)
        self._loop.visible = self._radius.visible = self.loop_wanted and circle is not None
        if loop is None or circle is None:
            return
        center, normal, radius = circle
        frame = frame_of(normal, loop.path.start[:3] - center)
        if "loop" not in self._held:
            self._loop.position, self._loop.wxyz = center, wxyz_of(frame)
        if "radius" not in self._held:
            self._radius.position, self._radius.wxyz = center - radius * frame[:3, 0], wxyz_of(frame)

    def show_loop_handles(self, wanted: bool) -> None:
        """Whether centre, plane and radius of the loop can be dragged."""
        self.loop_wanted = wanted
        self.place_loop(self.page.session.loop)

    def start_corners(self) -> None:
        """From now on clicks in the scene add corners of a polygon, on the level of the tool."""
        self.stop_corners()
        self.corners = []

        def clicked(event: Any) -> None:
            origin, ray = np.array(event.ray_origin), np.array(event.ray_direction)
            self.page.ask(lambda: self.add_corner(origin, ray))

        self._clicks = self.page.server.scene.on_click()(clicked)

    def add_corner(self, origin: Vector, ray: Vector) -> None:
        """The point of a ray on the horizontal plane through the tool's target."""
        height = self.page.session.snapshot().target[0][2, 3]
        if abs(ray[2]) < 1e-9 or (height - origin[2]) / ray[2] <= 0:
            self.page.say("That click does not meet the level of the tool: look at it from above and click again.")
            return
        corner = origin + (height - origin[2]) / ray[2] * ray
        if np.abs(corner).max() > FAR or len(self.corners) == MOST:
            self.page.say(f"A corner is within {FAR:g} m of the base, and a polygon has at most {MOST} of them.")
            return
        self.corners.append(corner)
        self.page.scene.path(self.corners, "corners")
        self.page.scene.ball(corner, LOOP, f"corner{len(self.corners) - 1}", 0.08 * self.size)

    def close_corners(self) -> None:
        """The polygon through the corners is the loop. Raises: ArgumentError: fewer than three."""
        self.page.session.set_loop(polygon_loop(self.corners))
        self.stop_corners()

    def stop_corners(self) -> None:
        """Clicks do nothing any more."""
        if self._clicks is not None:
            self.page.server.scene.remove_click_callback(self._clicks)
        self._clicks = None
        for index in range(len(self.corners)):
            self.page.scene.ball(None, LOOP, f"corner{index}")
        self.page.scene.path([], "corners")

    def _tool(self, index: int) -> Any:
        task, flat = self.page.session.task, self.page.session.robot.planar
        straight = task.orientation is None and task.m <= 3 * task.frames
        handle = self.page.server.scene.add_transform_controls(
            f"/handles/tool{index or ''}",
            self.size,
            line_width=3.0,
            depth_test=False,
            active_axes=(True, True, not flat),
            disable_rotations=straight,
        )
        return self._dragged(handle, f"tool{index}", lambda pose: self._drag(index, pose))

    def _dragged(self, handle: Any, name: str, then: Callable[[Matrix], Any]) -> Any:
        """A handle by whose pose (4, 4) something is done while it is dragged; of several poses by the last."""

        @handle.on_update
        async def _(event: Any) -> None:
            (self._held.discard if event.phase == "end" else self._held.add)(name)
            if event.phase == "end":
                self.page.drawn = -1
            if event.phase != "start":
                pose = pose_of(event.target.position, event.target.wxyz)
                self.page.ask(lambda: then(pose), name)

        return handle

    def _drag(self, index: int, pose: Matrix) -> None:
        poses = np.array(self.page.session.snapshot().target)
        poses[index] = pose
        self.page.say("")
        self.page.session.drag(poses)

    def _loop_handles(self) -> tuple[Any, Any]:
        controls = self.page.server.scene.add_transform_controls
        loop = controls("/handles/loop", 0.8 * self.size, line_width=3.0, depth_test=False, visible=False)
        radius = controls(
            "/handles/radius",
            0.7 * self.size,
            line_width=5.0,
            active_axes=(True, False, False),
            disable_sliders=True,
            disable_rotations=True,
            depth_test=False,
            visible=False,
        )
        self._dragged(loop, "loop", lambda pose: self._set_circle(pose[:3, 3], pose[:3, 2], None))
        self._dragged(radius, "radius", lambda pose: self._set_radius(pose[:3, 3]))
        return loop, radius

    def let_go(self) -> None:
        """Nobody drags: of a browser that went away no end of its drag is heard."""
        self._held.clear()
        self.page.drawn = -1

    def _set_circle(self, center: Vector, normal: Vector, radius: float | None) -> None:
        old = self.page.session.loop
        circle = circle_of(old)
        if old is None or circle is None:
            return
        size = circle[2] if radius is None else radius
        near = self.page.session.snapshot().target[0][:3, 3]
        loop = circle_loop(center, size, normal, near=near, clockwise=old.clockwise, samples=old.samples)
        self.page.session.set_loop(loop)

    def _set_radius(self, place: Vector) -> None:
        circle = circle_of(self.page.session.loop)
        if circle is not None:
            self._set_circle(circle[0], circle[1], max(float(np.linalg.norm(place - circle[0])), LEAST))


def circle_of(loop: Loop | None) -> tuple[Vector, Vector, float] | None:
    """Centre (3,) [m], normal (3,) and radius [m] of a circle, however its job says it; None of another curve."""
    if loop is None or loop.kind != "circle" or not loop.path.closed:
        return None
    points = loop.points(49)[0, :-1]
    center = points.mean(axis=0)
    normal = np.cross(points[0] - center, points[12] - center)  # a quarter of the way round
    radius = float(np.linalg.norm(points[0] - center))
    return center, (-1.0 if loop.clockwise else 1.0) * normal / np.linalg.norm(normal), radius


def frame_of(normal: Vector, towards: Vector) -> Matrix:
    """A pose (4, 4) at the origin whose z axis is the normal (3,), and whose x axis points from a direction's way."""
    x = towards - (towards @ normal) * normal
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else np.cross(normal, [0.0, 1.0, 0.0])
    return pose_from(np.zeros(3), np.column_stack([-x, np.cross(normal, -x), normal]))


# --- Small pieces of HTML for the panels of the page.

Cell = str  # HTML of a cell: what a user wrote was escaped


def block(*lines: str) -> str:
    """Lines below each other, in the type of the page."""
    return f'<div style="padding:2px 10px;font-size:13px;color:{INK}">{"".join(lines)}</div>'


def line(text: str, bold: bool = False) -> str:
    """A line of plain text."""
    return f'<div style="font-weight:{600 if bold else 400}">{escape(text)}</div>'


def quiet(text: str) -> str:
    """A line that explains."""
    return f'<div style="color:{GREY};font-size:12px">{escape(text)}</div>'


def warning(text: str) -> str:
    """A line that says what is wrong; none of an empty text."""
    return f'<div style="color:{BAD};font-weight:600;margin-top:3px">{escape(text)}</div>' if text else ""


def gauge(share: float) -> str:
    """A thin bar, filled by a share of 0 to 1."""
    inner = f'<div style="height:4px;background:{HOLONOMIC};width:{100 * share:.0f}%"></div>'
    return f'<div style="height:4px;background:{PALE};margin:4px 0">{inner}</div>'


def swatch(color: str, framed: bool = False) -> Cell:
    """A square of a colour; `framed` with an edge round it."""
    edge = f"outline:2px solid {INK};outline-offset:1px;" if framed else ""
    return f'<div style="width:12px;height:12px;border-radius:3px;background:{color};{edge}"></div>'


def ramp(low: str, high: str, left: str, right: str) -> str:
    """A bar whose colour goes from one to another, with a word at each end."""
    bar = f'<div style="height:8px;border-radius:4px;background:linear-gradient(to right,{low},{high})"></div>'
    ends = f'<div style="display:flex;justify-content:space-between"><span>{escape(left)}</span><span>{escape(right)}'
    return f'<div style="font-size:12px;color:{INK};margin:5px 2px">{bar}{ends}</span></div></div>'


def short_names(names: Sequence[str], most: int = 14) -> list[str]:
    """Names without the words that all of them begin or end with, and what is too long still without its end."""
    words = [re.split("([_/.])", name) for name in names]
    first = 2 * (_shared([parts[::2] for parts in words]) if len(words) > 1 else 0)
    last = 2 * (_shared([parts[first:][::-2] for parts in words]) if len(words) > 1 else 0)
    if any(parts[first : first + 1][0].isdigit() for parts in words):  # "joint_1" tells more than "1"
        first = max(first - 2, 0)
    shortened = ["".join(parts[first : len(parts) - last]) for parts in words]
    return [name if len(name) <= most else f"{name[: most - 1]}\u2026" for name in shortened]


def _shared(words: Sequence[Sequence[str]]) -> int:
    """How many words all begin with; of each at least one is left."""
    most = min(map(len, words)) - 1
    return next((i for i in range(most) if len({parts[i] for parts in words}) > 1), max(most, 0))


def plain(text: str, red: bool = False, grey: bool = False, right: bool = False) -> Cell:
    """A text in a cell."""
    color = BAD if red else GREY if grey else INK
    place = "text-align:right;white-space:nowrap" if right else "text-align:left"
    return f'<div style="color:{color};{place}">{escape(text)}</div>'


def named(name: str, note: str = "") -> Cell:
    """A name, and something about it in grey."""
    return f'<b>{escape(name)}</b> <span style="color:{GREY}">{escape(note)}</span>'


def table(rows: Sequence[Sequence[Cell]], hints: Sequence[str] = ()) -> str:
    """Cells in rows; a hint is shown where the mouse rests on its row."""
    titles = [*hints, *[""] * (len(rows) - len(hints))]
    lines = [
        f'<tr title="{escape(hint)}">{"".join(f"<td>{cell}</td>" for cell in row)}</tr>'
        for row, hint in zip(rows, titles, strict=True)
    ]
    return f'<table style="width:100%;font-size:12.5px;color:{INK};border-spacing:2px 3px">{"".join(lines)}</table>'


def marks(values: Sequence[float], colors: Sequence[str], ended: bool) -> Cell:
    """A bar with a mark at each of some shares of 0 to 1; `ended`: the ends of the bar are limits."""
    html = ""
    for index, (value, color) in enumerate(zip(values, colors, strict=False)):
        place = f"left:calc({100 * value:.1f}% - 2px);top:{-1 if index else -3}px"
        size = f"width:4px;height:{14 if index else 18}px;border-radius:2px"
        html += f'<div style="position:absolute;{place};{size};background:{color}"></div>'
    edge = f"2px solid {INK if ended else PALE}"
    style = f"position:relative;height:12px;min-width:120px;background:{PALE};border-left:{edge};border-right:{edge}"
    return f'<div style="{style}">{html}</div>'


def put(handle: Any, content: str) -> None:
    """Set the content of a text, if it is another one: every message costs all browsers time."""
    if handle.content != content:
        handle.content = content


def file_name(title: str) -> str:
    """A title as the name of a file."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60] or "studio"


MOST_LINES = 12  # strategies in a plot at most: more lines nobody tells apart
KEPT = 400  # points of a line at most
_EMPTY = np.array([0.0, 1.0])
SOFT = 0.1  # drift [rad or m] to which its plot goes at least


class Charts:
    """A column of plots at the left of the page."""

    def __init__(self, page: Stage):
        self.page = page
        self.panel = page.server.gui.add_panel()
        self.panel.dock_left()
        self.panel.set_width(330)
        self.joint = 0
        self._drawn: tuple[Any, ...] = ()
        names = page.session.robot.joint_names
        self._names = short_names(names)
        with self.panel.add_tab("What the joints do"):
            gui = page.server.gui
            self.title = gui.add_markdown(self._title())
            self.drift = self._plot("cycle", dots=True)
            self.pick = gui.add_dropdown(
                self._picked(),
                names,
                initial_value=names[self._restless()],
                hint="The joint of the plot below, with a line for each strategy",
            )
            self.history = self._plot("time [s]", dots=False)
            gui.add_markdown("**Joints** between their limits, a mark for each strategy")
            self.bars = gui.add_html("")

        @self.pick.on_update
        def _(_event: Any) -> None:
            self._drawn = ()

    def draw(self, snap: Snapshot) -> None:
        """Bring plots to a snapshot; those without news are left alone."""
        strategies = snap.strategies[:MOST_LINES]
        news = (snap.number, self.pick.value)
        if news == self._drawn:
            return
        self._drawn = news
        cycles = max((len(strategy.drift) for strategy in strategies), default=0)
        units, robot = self.page.units, self.page.session.robot
        drifts = [largest(units, robot, strategy.drift_joints) for strategy in strategies]
        if cycles:
            rows = thin(cycles + 1, KEPT)
            lines = [np.concatenate([[0.0], drift, np.full(cycles - len(drift), np.nan)]) for drift in drifts]
            self.drift.data = (rows.astype(float), *(line[rows] for line in lines))
        else:
            self.drift.data = (_EMPTY, *[np.zeros(2) for _ in strategies])
        joint = robot.joint_names.index(self.pick.value)
        scale = joint_factors(units, robot)[joint]
        longest = max((strategy.t for strategy in strategies), key=len, default=np.zeros(0))
        if len(longest) > 1:
            t = longest[thin(len(longest), KEPT)]
            self.history.data = (
                t,
                *[scale * _joint_at(t, strategy.t, strategy.history, joint) for strategy in strategies],
            )
        else:
            self.history.data = (_EMPTY, *[np.full(2, scale * strategy.q[joint]) for strategy in strategies])
        self.bars.content = self._bars(snap)

    def forget(self) -> None:
        """All is drawn anew, as in other units."""
        self._drawn = ()
        put(self.title, self._title())
        self.drift.scales = self._scales(soft=True)
        self.pick.label = self._picked()

    def _title(self) -> str:
        unit = joint_unit(self.page.units, self.page.session.robot)
        return f"**Drift**: how far the worst joint is from where it began, after each cycle [{unit}]"

    def _picked(self) -> str:
        """The label of the joint that is plotted, with its unit."""
        return f"Joint [{joint_unit(self.page.units, self.page.session.robot)}]"

    def _scales(self, soft: bool) -> dict[str, Any]:
        smallest = SOFT * joint_factors(self.page.units, self.page.session.robot).max()
        grows = {"min": {"pad": 0.05, "soft": 0.0, "mode": 1}, "max": {"pad": 0.05, "soft": smallest, "mode": 1}}
        return {"x": {"time": False}, **({"y": {"range": grows}} if soft else {})}

    def _plot(self, across: str, dots: bool) -> Any:
        from viser import uplot

        strategies = self.page.session.strategies[:MOST_LINES]
        series = [uplot.Series(label=across)]
        for strategy, color in zip(strategies, self.page.colors, strict=False):
            dash = () if strategy.holonomic else (6.0, 4.0)
            series.append(uplot.Series(label=strategy.name, stroke=color, width=2, dash=dash, points={"show": dots}))
        axis = {"stroke": INK, "grid": {"stroke": PALE}, "size": 34}
        return self.page.server.gui.add_uplot(
            (_EMPTY, *[np.zeros(2) for _ in strategies]),
            tuple(series),
            height=180,
            legend={"show": False},
            scales=self._scales(dots),
            padding=(14, 16, 0, 0),
            axes=({**axis, "label": across, "labelSize": 18}, {**axis, "size": 52}),
        )

    def _restless(self) -> int:
        """The joint that the self-motion moves most."""
        return int(np.argmax(np.linalg.norm(self.page.session.task.null_space(self.page.session.home), axis=1)))

    def _bars(self, snap: Snapshot) -> str:
        robot, rows, hints = self.page.session.robot, [], []
        for index, c in enumerate(robot.coordinates):
            bounded = bool(np.isfinite([c.lower, c.upper]).all())
            low, high = (c.lower, c.upper) if bounded else (-np.pi, np.pi)
            values = [_share(strategy.q[index], low, high) for strategy in snap.strategies[:MOST_LINES]]
            scale, unit = self.page.units.factor(c.unit), self.page.units.name(c.unit)
            number = plain(f"{scale * snap.strategies[self.page.lead].q[index]:.{3 if scale == 1 else 1}f}", right=True)
            rows.append((plain(self._names[index]), marks(values, self.page.colors, bounded), number))
            hints.append(
                f"{c.name}: {scale * low:.4g} to {scale * high:.4g} {unit}" if bounded else f"{c.name}: without limits"
            )
        return block(
            table(rows, hints),
            quiet(f"Number: of the solid robot [{joint_unit(self.page.units, robot)}]. Dark ends: limits."),
        )


def _share(value: float, low: float, high: float) -> float:
    """Where a value is between two others, 0 to 1."""
    return float(np.clip((value - low) / (high - low), 0.0, 1.0)) if high > low else 0.5


def _joint_at(t: Vector, known: Vector, history: Any, joint: int) -> Vector:
    """A joint at instants t, where it is known; else NaN."""
    if len(known) < 2:
        return np.full(len(t), np.nan)
    return np.interp(t, known, history[:, joint], left=np.nan, right=np.nan)
