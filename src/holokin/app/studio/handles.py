"""What is dragged in the page: the tool, the loop's centre, plane and radius, and the corners of a polygon."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.poses import pose_from
from ...base.types import Matrix, Vector
from ...robot import reach
from ..report.palette import BAD, GOOD, LOOP, rgb
from .page_scene import pose_of, wxyz_of
from .session_loops import Loop, circle_loop, polygon_loop
from .stage import Stage
from .states import Phase, Snapshot

LEAST = 0.005
"""Smallest radius of a loop that can be dragged [m]."""

FAR, MOST = 100.0, 50
"""Where corners are [m], and how many: a click near the horizon meets the tool's level far beyond all robots."""


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
        """The tool's handle at its target; its ball is red where a law does not get there."""
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
        found = circle_of(loop)
        self._loop.visible = self._radius.visible = self.loop_wanted and found is not None
        if loop is None or found is None:
            return
        center, normal, radius = found
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
            f"/handles/tool{index or ''}", self.size, line_width=3.0, depth_test=False,
            active_axes=(True, True, not flat), disable_rotations=straight,
        )  # fmt: skip
        return self._dragged(handle, f"tool{index}", lambda pose: self._drag(index, pose))

    def _dragged(self, handle: Any, name: str, then: Callable[[Matrix], Any]) -> Any:
        """A handle by whose pose (4, 4) something is done while it is dragged; of several poses by the last."""

        @handle.on_update
        async def _(event: Any) -> None:
            self._hold(name, event.phase)
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
            "/handles/radius", 0.7 * self.size, line_width=5.0, active_axes=(True, False, False), disable_sliders=True,
            disable_rotations=True, depth_test=False, visible=False,
        )  # fmt: skip
        self._dragged(loop, "loop", lambda pose: self._set_circle(pose[:3, 3], pose[:3, 2], None))
        self._dragged(radius, "radius", lambda pose: self._set_radius(pose[:3, 3]))
        return loop, radius

    def _hold(self, name: str, phase: str) -> None:
        (self._held.discard if phase == "end" else self._held.add)(name)
        if phase == "end":
            self.page.drawn = -1

    def let_go(self) -> None:
        """Nobody drags: of a browser that went away no end of its drag is heard."""
        self._held.clear()
        self.page.drawn = -1

    def _set_circle(self, center: Vector, normal: Vector, radius: float | None) -> None:
        old = self.page.session.loop
        found = circle_of(old)
        if old is None or found is None:
            return
        size = found[2] if radius is None else radius
        near = self.page.session.snapshot().target[0][:3, 3]
        loop = circle_loop(center, size, normal, near=near, clockwise=old.clockwise, samples=old.samples)
        self.page.session.set_loop(loop)

    def _set_radius(self, place: Vector) -> None:
        found = circle_of(self.page.session.loop)
        if found is not None:
            self._set_circle(found[0], found[1], max(float(np.linalg.norm(place - found[0])), LEAST))


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
