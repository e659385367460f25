"""Recordings: motions of one robot in one HTML file that any browser plays, without a server and without network.

The scene is that of the studio. A recording has no sliders to ask, so what it shows is written into it: a title, what
to see, the colour of each strategy, and its joint error after each cycle, which appears when the cycle ends.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.files import write_text
from ...base.types import Array, ArrayLike, Indices, Matrix, Value, Vector, finite, frozen, positive
from ...motion.drift_and_spread import NO_DRIFT
from ...motion.trajectory import Status
from ...robot import LinkShape, Robot
from ..report.plots import law_colors
from ..report.robot_view import best_view
from .door import HERE, Door
from .page_scene import FOV, Scene, camera_axes, silent_viser, viser_package
from .session import Session
from .states import colors_of

SECONDS = 20.0  # for which a recording plays at most
RATE = 25.0  # postures a second of a recording: the player does not blend them, and more cost more than they show
HOLD = 2.5  # seconds for which the end is held, to be read
TRACE = 40  # points of an elbow's line at most in a cycle: a line smooth enough, in few bytes
PIECES = 8  # pieces in which the elbow's line of a cycle appears
# width of the picture over its height, and where the robots are in it: from LEFT to RIGHT of half its width, the
# caption being on the left, and up to UPRIGHT of half its height
ASPECT, LEFT, RIGHT, UPRIGHT = 1.6, -0.2, 0.96, 0.86
# from where to where of half the picture's height wide scenes are, which have its whole width, below the caption
BELOW = (-0.8, 0.04)
ASIDE = np.deg2rad(20.0)  # of the camera, from the middle between two hands that it looks at from the front
ELEVATION = np.deg2rad(18.0)  # of the camera; planar robots are seen from above
TRIANGLES = 60_000  # of the robot at most: a megabyte
ABOVE = np.array([0.0, 0.0, 0.06])  # how far [m] lines are drawn above the floor in which a planar robot moves


@dataclass(frozen=True, eq=False)
class Motion(Value):
    """Joints over time, as of a trajectory, for a motion that was made in another way.

    t (k,) [s], rising; q (k, n) [joint units]; marks: indices, the joints at all of them should be the same, as where
    cycles begin and end. The error that a recording shows is the largest joint's difference from the first of them.
    """

    t: Vector
    q: Matrix
    marks: tuple[int, ...] = ()
    status: Status = Status.COMPLETE

    def __post_init__(self) -> None:
        t, q = finite("t of a motion", self.t), finite("q of a motion", self.q)
        if t.ndim != 1 or q.ndim != 2 or len(t) != len(q) or len(t) < 2:
            raise ShapeError(
                "q of a motion", (len(t.reshape(-1)), "n"), q.shape, "give a row for each time, two at least"
            )
        if not (np.diff(t) >= 0).all():
            raise ArgumentError("t of a motion", "falling", "let it rise")
        for mark in self.marks:
            if not 0 <= mark < len(t):
                raise ArgumentError("a mark of a motion", mark, f"give indices from 0 to {len(t) - 1}")
        object.__setattr__(self, "t", frozen(t))
        object.__setattr__(self, "q", frozen(q))
        super().__post_init__()

    def at(self, times: Vector) -> Matrix:
        """Joints (k, n) at times (k,), on straight lines between the samples; the last ones after the end."""
        return np.stack([np.interp(times, self.t, column) for column in self.q.T], axis=1)

    @property
    def errors(self) -> Vector:
        """The largest joint's difference from the first mark, at each of the others [joint unit]."""
        q = self.q[list(self.marks)]
        return np.abs(q[1:] - q[:1]).max(axis=1) if len(q) > 1 else np.zeros(0)

    @property
    def returns(self) -> bool:
        """True where the joints at all marks are the same."""
        return len(self.marks) > 1 and bool(self.errors.max() < NO_DRIFT)


@dataclass(frozen=True, eq=False)
class Recording(Value):
    """A recording: `scene`, the bytes of a .viser file, and `caption`, what is written over it, ready for JSON."""

    scene: bytes
    caption: dict[str, Any] = field(default_factory=dict)

    def html(self) -> str:
        """One HTML document that holds everything and plays without a server."""
        scene = base64.b64encode(self.scene).decode("ascii")
        caption = json.dumps(self.caption).replace("<", "\\u003c")  # no text may end the script, or hide its end
        return _page(f'window.__VISER_EMBED_DATA__="{scene}";window.HOLOKIN_CAPTION={caption};')

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write `html()` to a file, whole or not at all. Raises: WriteError."""
        write_text(file, self.html())
        return FilePath(file)


def player() -> str:
    """The page without a recording: `player.html?playbackPath=NAME.viser` plays that file, with NAME.json as caption.

    For several recordings on one site, which then share it; browsers read no other files from file:// pages.
    """
    return _page("")


@typed
def record(
    robot: Robot,
    motions: Mapping[str, Any],
    file: str | FilePath | None = None,
    *,
    title: str = "",
    text: str = "",
    path: ArrayLike | None = None,
    lead: str | None = None,
    seconds: float = SECONDS,
    obstacles: Sequence[LinkShape] = (),
) -> Recording:
    """Record motions of one robot, side by side in one place, to an HTML file that plays without a server.

    Args:
        motions: name of each strategy -> its `Trajectory`, `TimedTrajectory` or `Motion`; one that ends early stays
            there.
        file: where to write it; None writes nothing.
        title, text: what it shows and what to see, for people.
        path: points (k, 3) [m] of the line that the tool shall follow, or (F, k, 3) of the lines of several tools; by
            default where the tools of the lead went.
        lead: the strategy whose robot is drawn solid, by default the last one; the others are translucent ghosts.
        seconds: for how long it plays at most; longer motions are played faster.
        obstacles: what stands around the robot, such as the part that it works on: shapes of `hk.obstacle`.
            Tools that the robot carries are drawn, too: see `hk.robot.with_shape`.

    Returns:
        The recording; its `html()` is what the file holds.

    Raises:
        MissingExtraError: the extra `studio` is not installed. ArgumentError, ShapeError, NotFiniteError: bad
            arguments. WriteError: the system refuses the file.
    """
    if not motions:
        raise ArgumentError("the motions of a recording", 0, "give one at least")
    clips = {name: _motion(name, motion, robot) for name, motion in motions.items()}
    if lead is None:
        lead = list(clips)[-1]
    if lead not in clips:
        raise ArgumentError("lead", lead, f"give one of {', '.join(clips)}")
    colors = law_colors([name == lead or clip.returns for name, clip in clips.items()])
    film = _Film(robot, clips, lead, colors, positive("seconds", seconds), tuple(obstacles))
    return film.recording(file, title, text, path)


@typed
def record_session(session: Session, file: str | FilePath | None = None, *, text: str = "") -> Recording:
    """Record what the strategies of a session did on its loop since it began, as `record` does.

    Raises:
        ArgumentError: the loop has not run yet. MissingExtraError, WriteError.
    """
    states, loop = session.snapshot().strategies, session.loop
    if loop is None or not any(len(strategy.t) > 1 for strategy in states):
        cure = "none has run yet: press Start first, or call play() and advance()"
        raise ArgumentError("the loop to record", None, cure)
    motions = {}
    for strategy in states:
        if len(strategy.t) < 2:
            continue
        ends = strategy.t[0] + np.arange(len(strategy.drift) + 1) * loop.path.duration
        marks = np.unique(np.searchsorted(strategy.t, ends - 1e-9 * loop.path.duration).clip(max=len(strategy.t) - 1))
        motions[strategy.name] = Motion(strategy.t, strategy.history, tuple(int(mark) for mark in marks))
    holonomic = [strategy.name for strategy in states if strategy.holonomic and strategy.name in motions]
    lead = holonomic[0] if holonomic else list(motions)[-1]
    colors = [color for state, color in zip(states, colors_of(states), strict=True) if state.name in motions]
    film = _Film(session.robot, motions, lead, colors, SECONDS)
    return film.recording(file, session.title, text, loop.points(200))


class _Film:
    """Motions on the clock of a recording."""

    def __init__(
        self,
        robot: Robot,
        clips: Mapping[str, Motion],
        lead: str,
        colors: Sequence[str],
        seconds: float,
        things: tuple[LinkShape, ...] = (),
    ):
        self.robot, self.clips, self.lead, self.things = robot, clips, list(clips).index(lead), things
        self.start = min(float(clip.t[0]) for clip in clips.values())
        self.length = max(float(clip.t[-1]) for clip in clips.values()) - self.start
        self.pace = max(1.0, self.length / seconds)
        self.count = max(2, round(self.length / self.pace * RATE) + 1)
        self.colors = colors
        carried = {tip.joint: tip for tip in reversed(robot.tips)}
        self.tools = list(carried.values())[::-1]  # one for each link that has a tip
        self.lift = ABOVE if robot.planar else np.zeros(3)

    def recording(self, file: str | FilePath | None, title: str, text: str, path: ArrayLike | None) -> Recording:
        """The recording, written to a file unless that is None."""
        made = Recording(self.shoot(path), self.caption(title, text))
        if file is not None:
            made.save(file)
        return made

    def clock(self, t: float) -> float:
        """Seconds of the recording at a time of the motions."""
        return round((t - self.start) / self.length * (self.count - 1)) / RATE

    def shoot(self, path: ArrayLike | None) -> bytes:
        """The scene and all that moves in it, as the bytes of a .viser file."""
        times = np.linspace(self.start, self.start + self.length, self.count)
        Q = np.stack([clip.at(times) for clip in self.clips.values()], axis=1)
        server = _quiet_server()
        try:
            # The robots, the lines of the tools, what stands around, and the camera.
            scene = Scene(server, self.robot, Q[0, self.lead], TRIANGLES)
            scene.set_strategies([""] * len(self.clips), self.colors, self.lead)
            lines = [line + self.lift for line in self._lines(scene, Q, path)]
            for index, line in enumerate(lines):
                scene.path(line, f"loop{index or ''}")
            things = scene.stand(self.things)
            scene.look_from(*self._camera(scene, Q, np.vstack(lines), things))
            # Picture by picture.
            pieces = self._pieces(scene)
            tape = server.get_scene_serializer()
            for frame in range(self.count):
                scene.show(Q[frame])
                for index, name, points in pieces.get(frame, ()):
                    scene.trace(index, points, name)
                tape.insert_sleep(1 / RATE)
            tape.insert_sleep(HOLD)
            return tape.serialize()
        finally:
            with silent_viser():
                server.stop()

    def _lines(self, scene: Scene, Q: Array, path: ArrayLike | None) -> list[Matrix]:
        """The lines (k, 3) of the tools: given ones, else where those of the lead went."""
        if path is not None:
            given = finite("path", path)
            return [*given] if given.ndim == 3 else [given]
        return [scene.points_of(Q[:, self.lead], tip)[0] for tip in self.tools]

    def _camera(self, scene: Scene, Q: Array, line: Matrix, things: Matrix) -> tuple[Vector, Vector]:
        """(place of the camera, point it looks at): from where the strategies are seen best apart, by the caption."""
        frames = Q[np.linspace(0, len(Q) - 1, 13).round().astype(int)]
        bodies = [[np.vstack(self.robot.skeleton(q)) for q in row] for row in frames]
        pairs = [(body, row[self.lead]) for row in bodies for body in row]
        # From the side; planar robots from above, two hands from the front.
        if self.robot.planar:
            azimuth, elevation = -np.pi / 2, float(np.deg2rad(78.0))
        else:
            azimuth = float(np.deg2rad(best_view([body for body, _ in pairs], [line], pairs).azimuth))
            elevation = float(ELEVATION)
        if len(self.tools) > 1:
            hands = np.mean([scene.points_of(Q[:1, self.lead], tip)[0][0] for tip in self.tools], axis=0)
            azimuth = float(np.arctan2(hands[1], hands[0])) - ASIDE
        # From the other side where the ghosts are behind the robot, or where more is hidden behind things.
        gap = sum((ghost - solid).sum(axis=0) for ghost, solid in pairs)
        behind = np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) @ gap < -1e-9
        if not self.robot.planar and len(self.tools) == 1 and behind:
            azimuth += np.pi
        body = np.vstack([line, *(ghost for ghost, _ in pairs)])
        views = [camera_axes(side, elevation) for side in (azimuth, azimuth + np.pi)]
        axes = min(views, key=lambda axes: _hidden(body, things, axes))
        # So far away that all is in the picture, beside the caption or below it.
        seen = np.vstack([*(scene.drawn(q) for q in frames[::3].reshape(-1, self.robot.n)), line, things]) @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        tan, wide, tall = np.tan(FOV / 2), (high[0] - low[0]) / ASPECT, high[1] - low[1]
        places = (((LEFT, RIGHT), (-UPRIGHT, UPRIGHT)), ((-RIGHT, RIGHT), BELOW))
        distances = [max(wide / (x[1] - x[0]), tall / (y[1] - y[0])) / tan for x, y in places]
        near, (x, y) = min(zip(distances, places, strict=True), key=lambda option: option[0])
        right, above, away = axes
        middle = (low + high) / 2 @ axes
        look_at = middle - tan * near * (sum(x) / 2 * ASPECT * right + sum(y) / 2 * above)
        return look_at + (near + (high[2] - low[2]) / 2) * away, look_at

    def _pieces(self, scene: Scene) -> dict[int, list[tuple[int, str, Matrix]]]:
        """Frame -> (strategy, name, points (k, 3)) of the pieces of the elbows' lines that appear there."""
        pieces: dict[int, list[tuple[int, str, Matrix]]] = {}
        for strategy, clip in enumerate(self.clips.values()):
            ends = [*clip.marks] if len(clip.marks) > 1 else [0, len(clip.t) - 1]
            for cycle, (first, last) in enumerate(pairwise(ends)):
                rows: Indices = np.unique(np.linspace(first, last, TRACE + 1).round().astype(int))
                points = scene.points_of(clip.q[rows])[1] + self.lift
                for piece, part in enumerate(np.array_split(np.arange(len(rows) - 1), PIECES)):
                    if len(part):
                        frame = round(self.clock(float(clip.t[rows[part[-1] + 1]])) * RATE)
                        line = points[part[0] : part[-1] + 2]
                        pieces.setdefault(frame, []).append((strategy, f"elbow/{cycle}-{piece}", line))
        return pieces

    def caption(self, title: str, text: str) -> dict[str, Any]:
        """What the overlay writes: title, text, and of each strategy its colour, and (second, error) of each cycle."""
        strategies = []
        for index, (name, clip) in enumerate(self.clips.items()):
            ends = zip(clip.marks[1:], clip.errors, strict=True)
            complete = clip.status is Status.COMPLETE
            strategies.append(
                {
                    "name": name,
                    "color": self.colors[index],
                    "solid": index == self.lead,
                    "errors": [[self.clock(float(clip.t[mark])), float(error)] for mark, error in ends],
                    "ended": [] if complete else [self.clock(float(clip.t[-1])), clip.status.cause],
                }
            )
        unit = "rad" if all(self.robot.hinges) else "rad or m"
        return {"title": title, "text": text, "strategies": strategies, "unit": unit, "pace": round(self.pace, 1)}


def _hidden(points: Matrix, things: Matrix, axes: Matrix) -> int:
    """How many of the points (k, 3) are behind things, by the eight corners of their boxes, for a distant camera."""
    behind, seen = np.zeros(len(points), dtype=bool), points @ axes.T
    for corners in things.reshape(-1, 8, 3) @ axes.T:
        low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
        across = ((seen[:, :2] > low) & (seen[:, :2] < high)).all(axis=1)
        behind |= across & (seen[:, 2] < corners[:, 2].mean())
    return int(behind.sum())


def _motion(name: str, motion: Any, robot: Robot) -> Motion:
    if not hasattr(motion, "t") or not hasattr(motion, "q"):
        raise ArgumentError(f"the motion of {name}", type(motion).__name__, "give a Trajectory or a Motion")
    status = getattr(motion, "status", Status.COMPLETE)
    recorded = Motion(motion.t, motion.q, tuple(getattr(motion, "marks", ())), status)
    if recorded.q.shape[1] != robot.n:
        raise ShapeError(
            f"q of {name}", ("k", robot.n), recorded.q.shape, f"the joints are {', '.join(robot.joint_names)}"
        )
    return recorded


def _quiet_server() -> Any:
    """A viser server whose token nobody is told: a scene can be recorded of a server only."""
    viser_package()
    from .gate import Incoming, open_server

    return open_server(HERE, 0, Door(HERE), Incoming())


def _page(script: str) -> str:
    """viser's own page with a script before everything, and the overlay."""
    client = FilePath(viser_package().__file__).parent / "client" / "build" / "index.html"
    overlay = files("holokin.app.studio").joinpath("caption.html").read_text("utf-8")
    head, mark, rest = client.read_text("utf-8").partition("</head>")
    return f"{head}<script>{script}</script>{overlay}{mark}{rest}"
