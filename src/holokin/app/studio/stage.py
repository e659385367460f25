"""`Page`: a session and its scene, handles, plots and panels on a server; one thread does all that changes them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...base.errors import HolokinError
from ...base.poses import pose_from
from ...base.types import Matrix, Vector
from ...base.units import SI, PrintedUnits
from ...robot import reach
from ..report.plots import BAD, GOOD, INK, LOOP, PALE, rgb, thin
from .followers import Loop, circle_loop, polygon_loop
from .page_scene import Scene, pose_of, wxyz_of
from .panel_html import block, marks, plain, put, quiet, short_names, table
from .session import Session
from .states import Phase, Snapshot, colors_of, joint_factors, joint_unit, largest
from .work import failure

RATE = 30.0  # pictures a second
SLOW = 0.2  # seconds between two updates of texts, plots and traces, which nobody reads faster
TRACED = 150  # points of the lines that elbows leave behind
MANY = 8  # strategies above which no traces are drawn

Action = Callable[[], Any]


class Page:
    """What all browsers see of a session. One state is shared: whoever drags, drags for all.

    Args:
        server: a viser.ViserServer.
        session: what is shown.
        panels: makes the panels of the page, `Panels`.
        reopen: called with the name of a job or robot that the page is asked to show instead.
        units: of what is shown.

    Attributes:
        lead: the index of the strategy whose robot is solid. colors: of the strategies (#RRGGBB).
        message: the sentence for everyone. drawn: the number of the snapshot that is drawn, -1 to draw it again.

    Raises:
        MissingExtraError: trimesh is not installed.
    """

    def __init__(
        self,
        server: Any,
        session: Session,
        panels: Callable[[Page], Any],
        reopen: Callable[[str], None] | None = None,
        units: PrintedUnits = SI,
    ):
        self.server, self.session, self.reopen, self.units = server, session, reopen, units
        self.lead = next((i for i, strategy in enumerate(session.strategies) if strategy.holonomic), 0)
        self.colors: tuple[str, ...] = ()
        self.drawn, self.message = -1, ""
        self._make_panels = panels
        self._loop_drawn: tuple[int, str] | None = None
        self._slow_at, self._turn = 0.0, 0
        self._waiting: dict[object, Action] = {}
        self._busy: set[object] = set()
        self._wake = threading.Condition()
        self._drawing = threading.Lock()  # of the robots
        self._over = self._held_still = False
        self.scene = Scene(server, session.robot, session.home)
        self.handles = Handles(self)
        self._arrange()
        self.scene.look_at_all(self._points_of_interest())
        snap = session.snapshot()
        for draw in (self.draw, *self._slow):
            draw(snap)
        self._thread = threading.Thread(target=self._run, name="holokin studio", daemon=True)

    def _arrange(self) -> None:
        """A robot, a line in each plot and a place in each list for every strategy that there is."""
        states = self.session.snapshot().strategies
        self.lead = min(self.lead, len(states) - 1)
        self.colors = colors_of(states)
        self.scene.set_strategies([state.name for state in states], self.colors, self.lead)
        self.charts = Charts(self)
        self.panels = self._make_panels(self)

    def _recolor(self, snap: Snapshot) -> None:
        """All in other colours, as when a strategy without leaves was found to be holonomic."""
        self.colors = colors_of(snap.strategies)
        self.scene.set_strategies(self.scene.names, self.colors, self.lead)
        self.charts.recolor(snap)
        self.drawn, self._loop_drawn = -1, None

    def start(self) -> None:
        """Begin to move."""
        self._thread.start()

    def close(self) -> None:
        """End the thread; the server stays."""
        with self._wake:
            self._over = True
            self._wake.notify()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)

    def ask(self, action: Action, key: object = None) -> None:
        """Have something done by the page's thread, soon; of several with one key only the last is done.

        What it raises is said in the page.
        """
        with self._wake:
            self._waiting.pop(key, None)
            self._waiting[key if key is not None else object()] = action
            self._wake.notify()

    def attempt(self, action: Action) -> None:
        """Do it in the thread of the caller. What it raises is said in the page, which goes on whatever happens."""
        try:
            action()
        except HolokinError as problem:
            self.say(str(problem))
        except Exception as problem:  # noqa: BLE001  one fault must not end the page of everybody
            if not self._over:
                self.say(failure("The page", problem))

    def alone(self, key: object, action: Action) -> None:
        """As `attempt`, and not while it is being done: threads of clicks are few, and all browsers share them."""
        with self._wake:
            if key in self._busy:
                return
            self._busy.add(key)
        try:
            self.attempt(action)
        finally:
            with self._wake:
                self._busy.discard(key)

    def say(self, sentence: str) -> None:
        """A sentence for everyone, until the next; an empty one takes it away."""
        self.message = sentence

    def worded(self, sentence: str) -> str:
        """A sentence in the units of the page."""
        joints = [(c.name, c.unit) for c in self.session.robot.coordinates]
        return self.units.reworded(sentence, joints)

    def set_units(self, units: PrintedUnits) -> None:
        """In what numbers are shown; what they mean stays the same."""
        before, self.units = self.units, units
        self.charts.forget()
        self.panels.rescale(before)

    def set_lead(self, index: int) -> None:
        """Whose robot is drawn solid."""
        with self._drawing:
            self.lead = index
            if not self._held_still:
                self.scene.set_lead(index)
            self.drawn = -1

    @contextmanager
    def own_drawing(self, colors: Sequence[str]) -> Iterator[None]:
        """For a while robots of these colours stand in the scene, which somebody else moves than the page's thread."""
        names = self.scene.names
        with self._drawing:
            self._held_still = True
            self.scene.set_strategies([""] * len(colors), colors)
        try:
            yield
        finally:
            with self._drawing:
                self.scene.set_strategies(names, self.colors, self.lead)
                self._held_still, self.drawn, self._loop_drawn = False, -1, None

    def _run(self) -> None:
        before = time.perf_counter()
        due = before + 1 / RATE
        while True:
            # Wait for an action or the next picture: a wait may end a moment early.
            with self._wake:
                while not self._waiting and not self._over and (left := due - time.perf_counter()) > 0:
                    self._wake.wait(left)
                if self._over:
                    return
                actions, self._waiting = list(self._waiting.values()), {}
            for action in actions:
                self.attempt(action)
            # The loop goes on by the time that has passed.
            now = time.perf_counter()
            if now >= due:
                self.attempt(lambda dt=now - before: self.session.advance(min(dt, 0.2)))
                before, due = now, max(due + 1 / RATE, now)
            self.attempt(lambda now=now: self._picture(now))

    def _picture(self, now: float) -> None:
        """All that moves; and what is drawn less often by turns, since all of it at once would hold the robots up."""
        snap = self.session.snapshot()
        self.draw(snap)
        if now - self._slow_at >= SLOW / len(self._slow):
            self._slow_at, self._turn = now, (self._turn + 1) % len(self._slow)
            self._slow[self._turn](snap)

    @property
    def _slow(self) -> tuple[Callable[[Snapshot], None], ...]:
        """What draws texts, plots and traces: less often than robots."""
        return self.panels.draw, self.charts.draw, self._draw_traces

    def draw(self, snap: Snapshot) -> None:
        """Bring robots, handles and the loop to a snapshot."""
        with self._drawing:
            if not self._held_still:
                self._draw_robots(snap)
        if (snap.loop, snap.loop_fault) != self._loop_drawn:
            moved = self._loop_drawn is None or self._loop_drawn[0] != snap.loop
            self._loop_drawn = snap.loop, snap.loop_fault
            self._draw_loop(moved, bool(snap.loop_fault))

    def _draw_robots(self, snap: Snapshot) -> None:
        if tuple(state.name for state in snap.strategies) != self.scene.names:  # a program added or removed one
            self.server.gui.reset()
            self._arrange()
            self.drawn, self._loop_drawn = -1, None
        elif colors_of(snap.strategies) != self.colors:
            self._recolor(snap)
        if snap.number != self.drawn:
            self.drawn = snap.number
            self.scene.show(np.array([state.q for state in snap.strategies]))
            self.handles.draw(snap)

    def _draw_loop(self, moved: bool, red: bool) -> None:
        """The line of the loop, red where a strategy does not get round it; elbows' lines are of the loop before."""
        loop = self.session.loop
        curves = () if loop is None else loop.points(240)
        for index in range(self.session.task.frames):
            self.scene.path(curves[index] if len(curves) else [], f"loop{index or ''}", BAD if red else LOOP)
        if moved:
            self.handles.place_loop(loop)
            self.clear_traces()

    def clear_traces(self) -> None:
        """Take the lines away that elbows drew."""
        for index in range(len(self.scene.names)):
            self.scene.trace(index, np.zeros((0, 3)), "elbow")

    def _draw_traces(self, snap: Snapshot) -> None:
        if self._held_still or snap.phase not in (Phase.RUNNING, Phase.DONE) or len(snap.strategies) > MANY:
            return
        for index, state in enumerate(snap.strategies):
            if len(state.history) > 1:
                rows = thin(len(state.history), TRACED)
                self.scene.trace(index, self.scene.points_of(state.history[rows])[1], "elbow")

    def _points_of_interest(self) -> Matrix:
        """Points (k, 3) [m] that shall be seen besides the robot: the loop, and the handles of the tools."""
        loop, size = self.session.loop, self.handles.size
        line: Matrix = np.zeros((0, 3)) if loop is None else loop.points(50).reshape(-1, 3)
        tools = self.session.snapshot().target
        grips = [pose[:3, 3] + sign * size * pose[:3, :3].T for pose in tools for sign in (-1, 1)]
        return np.vstack([line, *grips])


# --- What is dragged in the page: the tool, the loop's centre, plane and radius, and the corners of a polygon.

LEAST = 0.005  # smallest radius of a loop that can be dragged [m]
# where corners are [m], and how many: a click near the horizon meets the tool's level far beyond all robots
FAR, MOST = 100.0, 50


class Handles:
    """Transform controls in the scene of a page."""

    def __init__(self, page: Page):
        self.page, robot, task = page, page.session.robot, page.session.task
        self.size = 0.11 * min(max(reach(robot), 0.3), 3.0) if robot.tips else 0.2
        self.corners: list[Vector] = []
        self._clicks: Any = None
        self._held: set[str] = set()
        self._circle_wanted = False
        # Of each tool a handle, and a ball at its target.
        scene, axes = page.server.scene, (True, True, not robot.planar)
        # seen through the robot, and the loop through them
        look: dict[str, Any] = {"line_width": 2.0, "depth_test": False, "opacity": 0.7}
        straight = task.orientation is None and task.m <= 3 * task.frames
        self._tools, self._balls = [], []
        for index in range(task.frames):
            name = f"/handles/tool{index or ''}"
            handle = scene.add_transform_controls(name, self.size, active_axes=axes, disable_rotations=straight, **look)
            self._on_drag(handle, f"tool{index}", lambda pose, index=index: self._drag_tool(index, pose))
            self._tools.append(handle)
            ball = scene.add_icosphere(f"/target/{index}", 0.12 * self.size, color=rgb(GOOD), cast_shadow=False)
            self._balls.append(ball)
        # Of a circle its centre and plane, and its radius along one axis.
        self._loop = scene.add_transform_controls("/handles/loop", 0.8 * self.size, visible=False, **look)
        one_axis = {"active_axes": (True, False, False), "disable_sliders": True, "disable_rotations": True}
        self._radius = scene.add_transform_controls(
            "/handles/radius", 0.7 * self.size, visible=False, **look | one_axis | {"line_width": 5.0}
        )
        self._on_drag(self._loop, "loop", self._drag_circle)
        self._on_drag(self._radius, "radius", self._drag_radius)

    def _on_drag(self, handle: Any, name: str, action: Callable[[Matrix], Any]) -> None:
        """Something is done with the pose (4, 4) of a handle while it is dragged; of several poses with the last."""

        @handle.on_update
        async def _(event: Any) -> None:
            (self._held.discard if event.phase == "end" else self._held.add)(name)
            if event.phase == "end":
                self.page.drawn = -1
            if event.phase != "start":
                pose = pose_of(event.target.position, event.target.wxyz)
                self.page.ask(lambda: action(pose), name)

    def let_go(self) -> None:
        """Nobody drags: of a browser that went away no end of its drag is heard."""
        self._held.clear()
        self.page.drawn = -1

    def draw(self, snap: Snapshot) -> None:
        """The tool's handle at its target; its ball is red where a strategy does not get there."""
        free = snap.phase in (Phase.IDLE, Phase.PAUSED, Phase.DONE)
        color = rgb(GOOD if snap.following else BAD)
        for index, (handle, ball) in enumerate(zip(self._tools, self._balls, strict=True)):
            pose = snap.target[index]
            ball.position = pose[:3, 3]
            if tuple(ball.color) != color:
                ball.color = color
            if handle.visible != free:
                handle.visible = free
            if f"tool{index}" not in self._held and free:
                handle.position, handle.wxyz = pose[:3, 3], wxyz_of(pose)

    def place_loop(self, loop: Loop | None) -> None:
        """The handles of a circle on it; of what is no circle there are none."""
        circle = circle_of(loop)
        self._loop.visible = self._radius.visible = self._circle_wanted and circle is not None
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
        self._circle_wanted = wanted
        self.place_loop(self.page.session.loop)

    def _drag_tool(self, index: int, pose: Matrix) -> None:
        poses = np.array(self.page.session.snapshot().target)
        poses[index] = pose
        self.page.say("")
        self.page.session.drag(poses)

    def _drag_circle(self, pose: Matrix) -> None:
        if (circle := circle_of(self.page.session.loop)) is not None:
            self._set_circle(pose[:3, 3], pose[:3, 2], circle[2])

    def _drag_radius(self, pose: Matrix) -> None:
        if (circle := circle_of(self.page.session.loop)) is not None:
            center, normal, _ = circle
            self._set_circle(center, normal, max(float(np.linalg.norm(pose[:3, 3] - center)), LEAST))

    def _set_circle(self, center: Vector, normal: Vector, radius: float) -> None:
        loop, tool = self.page.session.loop, self.page.session.snapshot().target[0][:3, 3]
        if loop is not None:
            way = {"clockwise": loop.clockwise, "samples": loop.samples}
            self.page.session.set_loop(circle_loop(center, radius, normal, near=tool, **way))

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


# --- Plots of drift and of one joint, and the joints between their limits.

MOST_LINES = 12  # strategies in a plot at most: more lines nobody tells apart
KEPT = 400  # points of a line at most
SOFT = 0.1  # drift [rad or m] to which its plot goes at least
WIDE = 300  # width of the column [pixels]
# width of the scene over its height below which a browser has the column as a bar at its edge: the robot needs the room
NARROW = 0.7
CYCLE, TIME = "cycle", "time [s]"  # what the plots are over
_EMPTY = np.array([0.0, 1.0])


class Charts:
    """A column of plots at the left of the page."""

    def __init__(self, page: Page):
        self.page = page
        self._drawn: tuple[Any, ...] = ()
        robot, gui = page.session.robot, page.server.gui
        self._names = short_names(robot.joint_names)
        self._panel = gui.add_panel()
        self._panel.dock_left()
        self._panel.set_width(WIDE)
        self._seen: set[int] = set()  # browsers whose window was too narrow for it
        # The joint of the second plot: first the one that the self-motion moves most.
        restless = int(np.argmax(np.linalg.norm(page.session.task.null_space(page.session.home), axis=1)))
        with self._panel.add_tab("What the joints do"):
            self.title = gui.add_markdown("")
            self.drift = self._plot(CYCLE)
            hint = "The joint of the plot below, with a line for each strategy"
            self.pick = gui.add_dropdown(
                "Joint", robot.joint_names, initial_value=robot.joint_names[restless], hint=hint
            )
            self.history = self._plot(TIME)
            gui.add_markdown("**Joints** between their limits, a mark for each strategy")
            self.bars = gui.add_html("")
        self.forget()

        @self.pick.on_update
        def _(_event: Any) -> None:
            self._drawn = ()

    def forget(self) -> None:
        """All is drawn anew, as in other units."""
        self._drawn = ()
        unit = joint_unit(self.page.units, self.page.session.robot)
        put(self.title, f"**Drift**: how far the worst joint is from where it began, after each cycle [{unit}]")
        self.drift.scales = self._scales(CYCLE)
        self.pick.label = f"Joint [{unit}]"

    def draw(self, snap: Snapshot) -> None:
        """Bring plots to a snapshot; those without news are left alone."""
        self._make_room()
        states = snap.strategies[:MOST_LINES]
        news = (snap.number, self.pick.value)
        if news == self._drawn:
            return
        self._drawn = news
        # Drift after each cycle, from 0; NaN where a strategy has not done so many.
        units, robot = self.page.units, self.page.session.robot
        cycles = max((len(state.drift) for state in states), default=0)
        if cycles:
            rows = thin(cycles + 1, KEPT)
            drifts = [largest(units, robot, state.drift_joints) for state in states]
            lines = [np.concatenate([[0.0], drift, np.full(cycles - len(drift), np.nan)]) for drift in drifts]
            self.drift.data = (rows.astype(float), *(line[rows] for line in lines))
        else:
            self.drift.data = (_EMPTY, *[np.zeros(2) for _ in states])
        # One joint over time, where it is known.
        joint = robot.joint_names.index(self.pick.value)
        scale = joint_factors(units, robot)[joint]
        longest = max((state.t for state in states), key=len, default=np.zeros(0))
        if len(longest) > 1:
            t = longest[thin(len(longest), KEPT)]
            lines = [
                np.interp(t, state.t, scale * state.history[:, joint], left=np.nan, right=np.nan)
                if len(state.t) > 1
                else np.full(len(t), np.nan)
                for state in states
            ]
            self.history.data = (t, *lines)
        else:
            self.history.data = (_EMPTY, *[np.full(2, scale * state.q[joint]) for state in states])
        self.bars.content = self._bars(snap)

    def _make_room(self) -> None:
        """In a browser whose window is narrow the column is a bar, once: who opens it there wants to see it.

        viser places the panel of all browsers in all of them alike, but for a handle of one browser with its name.
        """
        from viser._gui_handles import MainPanelHandle

        for number, client in self.page.server.get_clients().items():
            if number not in self._seen and client.camera.image_width < NARROW * client.camera.image_height:
                self._seen.add(number)
                handle = MainPanelHandle(client.gui)
                handle._placement_uuid = self._panel._placement_uuid
                handle.minimize()

    def _scales(self, across: str) -> dict[str, Any]:
        smallest = SOFT * joint_factors(self.page.units, self.page.session.robot).max()
        grows = {"min": {"pad": 0.05, "soft": 0.0, "mode": 1}, "max": {"pad": 0.05, "soft": smallest, "mode": 1}}
        return {"x": {"time": False}, **({"y": {"range": grows}} if across == CYCLE else {})}

    def recolor(self, snap: Snapshot) -> None:
        """The lines in the colours of the page."""
        for plot, across in ((self.drift, CYCLE), (self.history, TIME)):
            plot.series = self._series(snap, across)

    def _series(self, snap: Snapshot, across: str) -> tuple[Any, ...]:
        """The lines of a plot, one for each strategy, dashed where it is not holonomic."""
        from viser import uplot

        series = [uplot.Series(label=across)]
        for state, color in zip(snap.strategies[:MOST_LINES], self.page.colors, strict=False):
            line: dict[str, Any] = {"width": 2, "dash": () if state.repeatable else (6.0, 4.0)}
            series.append(uplot.Series(label=state.name, stroke=color, points={"show": across == CYCLE}, **line))
        return tuple(series)

    def _plot(self, across: str) -> Any:
        """An empty plot."""
        series = self._series(self.page.session.snapshot(), across)
        axis = {"stroke": INK, "grid": {"stroke": PALE}, "size": 34}
        axes = ({**axis, "label": across, "labelSize": 18}, {**axis, "size": 52})
        look: dict[str, Any] = {"height": 180, "legend": {"show": False}, "padding": (14, 16, 0, 0)}
        data = (_EMPTY, *[np.zeros(2) for _ in series[1:]])
        return self.page.server.gui.add_uplot(data, series, scales=self._scales(across), axes=axes, **look)

    def _bars(self, snap: Snapshot) -> str:
        """The joints of all strategies between their limits, and the number of the solid robot's."""
        robot, units, rows, hints = self.page.session.robot, self.page.units, [], []
        for index, c in enumerate(robot.coordinates):
            bounded = bool(np.isfinite([c.lower, c.upper]).all())
            low, high = (c.lower, c.upper) if bounded else (-np.pi, np.pi)
            q = np.array([state.q[index] for state in snap.strategies])
            shares = np.clip((q - low) / (high - low), 0.0, 1.0) if high > low else np.full(len(q), 0.5)
            scale, unit = units.factor(c.unit), units.name(c.unit)
            number = plain(f"{scale * q[self.page.lead]:.{3 if scale == 1 else 1}f}", right=True)
            rows.append(
                (plain(self._names[index]), marks(shares[:MOST_LINES].tolist(), self.page.colors, bounded), number)
            )
            span = f"{scale * low:.4g} to {scale * high:.4g} {unit}" if bounded else "without limits"
            hints.append(f"{c.name}: {span}")
        foot = f"Number: of the solid robot [{joint_unit(units, robot)}]. Dark ends: limits."
        return block(table(rows, hints), quiet(foot))
