"""A page to play with: strategies of one robot in one HTML file, which a browser computes itself, without Python.

The file has the strategies as WebAssembly, from the C that `hk.follow` runs, and draws by WebGL. It needs no network.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import json
import re
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from importlib.resources import files
from pathlib import Path as FilePath
from string import Template
from typing import Any

import numpy as np

from ...analysis.curvature import CuspWitness, cusps
from ...base.arguments import typed
from ...base.errors import (
    ArgumentError,
    ExportError,
    HolokinError,
    MissingExtraError,
    NativeError,
    OpenPathError,
    PathError,
    UnknownNameError,
)
from ...base.files import write_text
from ...base.tolerances import TOLERANCES
from ...base.types import ArrayLike, Matrix, Value, Vector
from ...motion import follow
from ...motion.checks import CheckReport
from ...motion.follow_path import by_leaf, path_rate, velocity_rules
from ...motion.ik.branch import branch_code
from ...motion.ik.leaf import leaf_rules, leaf_step, leaf_value, with_leaves
from ...motion.ik.plan import check_start, make_plan
from ...motion.trajectory import Trajectory
from ...path import Path, circle
from ...robot import Box, Capsule, Cylinder
from ...strategies import HolonomicStrategy, Strategy, may_jump, moore_penrose
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic import SX, Function, symbol, vertcat
from ...symbolic.native import LARGEST
from ...symbolic.native.toolchain import PATIENCE, call
from ...version import __version__
from ..job import Job
from ..report.html_page import CONTROL
from ..report.plots import law_colors
from ..report.robot_view import Piece, best_view, pieces_of
from .followers import leaf_start, loop_start
from .session import Session
from .strategies import NamedStrategy


@dataclass(frozen=True, eq=False)
class DrawnArm:
    """The pieces of a task's robot: rods, whatever shapes its model has."""

    task: Task
    parts: tuple[Piece, ...]

    @staticmethod
    def of(task: Task, Q: Matrix) -> DrawnArm:
        """The arm, whose rails are long enough for postures (k, n)."""
        bare = replace(task.robot, shapes=(), visuals=())
        return DrawnArm(task, pieces_of(bare, Q))

    @property
    def pieces(self) -> list[dict[str, Any]]:
        """What the page draws between the two points of each piece."""
        return [
            {"role": part.role, "radius": _size(part)[0], "flat": not isinstance(part.part.shape, Capsule)}
            for part in self.parts
        ]

    @cached_property
    def function(self) -> Function:
        """q -> points in the base's frame (3 k,): the tool's, then both ends of each piece."""
        robot = self.task.robot
        q, tip = symbol("q", robot.n), robot._find_tip(self.task.tip)
        joints = sorted({part.joint for part in self.parts} - {-1})
        frames = {j: robot._kinematics_at(q, j, np.eye(4)) for j in joints}
        rows = [robot.kinematics(q, tip.name).position]
        for part in self.parts:
            T, half, frame = part.part.placement, _size(part)[1], frames.get(part.joint)
            for end in (T[:3, 3] - half * T[:3, 2], T[:3, 3] + half * T[:3, 2]):
                rows.append(SX(end) if frame is None else frame.position + frame.rotation @ SX(end))
        return Function("drawn", {"q": q}, {"points": vertcat(*rows)})

    def at(self, q: Vector) -> Matrix:
        """The points (k, 3) at a posture (n,)."""
        return np.asarray(self.function(q)).reshape(-1, 3)

    def view(self, Q: Matrix, path: Path) -> dict[str, Any]:
        """From where the arm at postures (k, n) and a path are seen.

        Returns:
            The middle, half the size and the floor [m], azimuth and elevation [degrees].
        """
        line = path.at(np.linspace(0, path.duration, 61)).position
        eight = 2 * path.start - line  # the other half of a figure eight
        every = np.vstack([line, eight, *(self.at(q) for q in Q)])
        low, high = every.min(axis=0), every.max(axis=0)
        planar, view = self.task.robot.planar, best_view([self.at(Q[0])], [line])
        return {
            "center": ((low + high) / 2).tolist(),
            "around": float(np.linalg.norm(high - low)) / 2,
            "azimuth": -90.0 if planar else view.azimuth,
            "elevation": 89.0 if planar else view.elevation,
            "floor": min(0.0, float(low[2])),
        }


def _size(piece: Piece) -> tuple[float, float]:
    """(radius, half length) of a rod, a disc or a beam [m]."""
    shape = piece.part.shape
    if isinstance(shape, Box):
        return float(shape.sides[0]) / 2, float(shape.sides[2]) / 2
    if isinstance(shape, Capsule | Cylinder):
        return float(shape.radius), float(shape.length) / 2
    raise TypeError(f"a robot without shapes has no {shape!r}")


# --- A strategy as WebAssembly: the C by which `hk.follow` goes along a path, compiled by zig for a browser.

# As for native code: products and sums are not fused, so that a browser computes what Python does.
FLAGS = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-O1", "-std=gnu99", "-fno-math-errno", "-ffp-contract=off")
ENDLESS = 1e300  # a joint limit [joint units] that is none


def strategy_code(strategy: Strategy, arm: DrawnArm, segments: int) -> str:
    """The C of a strategy for a page: `hk_follow` with its functions, and strategy.c.

    Args:
        segments: of the longest loop.

    Raises:
        ExportError: the strategy is too long, may jump, or has no C.
    """
    # What follows it: by its leaf, or by velocity.
    leaf = by_leaf(strategy)
    if leaf is not None and (jumps := may_jump(leaf)):
        fact = f"the rule of {strategy.name!r} may jump ({', '.join(jumps)}), which a page does not look for"
        raise ExportError(fact, "choose another rule")
    function = path_rate(strategy) if leaf is None else leaf_step(leaf)
    if (size := function.program.instructions) > LARGEST:
        fact = f"{strategy.name!r} is {size:,} operations long, {LARGEST:,} are the most"
        raise ExportError(fact, "take a shorter strategy; of one with leaves hk.strategies.fitted makes a polynomial")
    try:
        code = function.follower_c("velocity") if leaf is None else function.follower_c("leaf", branch_code(leaf))
    except NativeError as problem:
        raise ExportError(problem.fact, "write the strategy without it") from None

    # What the page calls, with the limits of the joints and the rules of the steps.
    def row(values: Vector) -> str:
        return ", ".join(repr(float(np.clip(value, -ENDLESS, ENDLESS))) for value in values)

    robot, slack = strategy.task.robot, TOLERANCES.limit
    rules = velocity_rules() if leaf is None else leaf_rules(0.0)
    words = {
        "drawn": 3 + 6 * len(arm.parts),
        "segments": segments,
        "lower": row(robot.lower - slack),
        "upper": row(robot.upper + slack),
        "free_lower": row(np.full(robot.n, -np.inf)),
        "free_upper": row(np.full(robot.n, np.inf)),
        "rules": ", ".join("side" if key == "side" else repr(getattr(rules, key)) for key, *_ in rules._fields_),
    }
    return code + arm.function.c("hk_drawn_body") + Template(_file("strategy.c")).substitute(words)


def _check_zig() -> None:
    """Raises: MissingExtraError: there is no zig."""
    if importlib.util.find_spec("ziglang") is None:
        raise MissingExtraError("ziglang", "native")


def _wasm_of(code: str, name: str) -> bytes:
    """The WebAssembly module of a C source, by zig.

    Raises:
        MissingExtraError: there is no zig. ExportError: it refuses the code, or does not end.
    """
    _check_zig()
    with tempfile.TemporaryDirectory() as folder:
        source, module = FilePath(folder) / "strategy.c", FilePath(folder) / "strategy.wasm"
        source.write_text(code, "utf-8")
        command = (sys.executable, "-m", "ziglang", "cc", *FLAGS, "-Wl,--strip-all", str(source), "-o", str(module))
        try:
            status, output = call(command, PATIENCE, "stderr")
        except (OSError, subprocess.TimeoutExpired) as problem:
            cure = "try again, or take a shorter strategy"
            raise ExportError(f"zig did not compile {name!r} ({problem})", cure) from None
        if status != 0 or not module.is_file():
            complaint = next((line for line in output.splitlines() if "error" in line), f"code {status}").strip()
            raise ExportError(f"zig refused the C of {name!r} ({complaint})", "please report it, with the job")
        return module.read_bytes()


# --- The HTML of a page from its parts. What is the user's is escaped, and nothing but the page's own script may run.

SCRIPTS = ("stage.js", "loops.js", "strategy.js", "charts.js", "play.js")


def page_text(title: str, text: str, data: dict[str, Any]) -> str:
    """The page: one file with style, script and data. Its policy names script and style by their hashes."""
    script, style = "\n".join(_file(name) for name in SCRIPTS), _file("page.css")
    sources = "\0".join(_file(name) for name in ("page.html", "page.css", "strategy.c", *SCRIPTS))
    parts = {
        "title": escape(title),
        "text": f"<p>{escape(text)}</p>" if text else "",
        "version": escape(__version__),
        "sources": digest(sources),
        "style": style,
        "style_hash": _policy_hash(style),
        "script": script,
        "script_hash": _policy_hash(script),
        "data": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
    }
    return CONTROL.sub("\ufffd", re.sub(r"\{\{(\w+)\}\}", lambda hole: parts[hole[1]], _file("page.html")))


def digest(text: str) -> str:
    """A number of a text, to tell whether it is another one."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _file(name: str) -> str:
    return files("holokin.app.studio").joinpath("web", name).read_text("utf-8")


def _policy_hash(text: str) -> str:
    """As a Content-Security-Policy names a script or a style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _packed(data: bytes) -> str:
    """Bytes for a page: deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


# --- A page: strategies of one robot beside each other, and the loops that it offers.

STEPS = 240  # steps of a round: `hk.follow` with as many samples gives the same joints
ROUNDS = 8  # rounds that are shown at first
MOST_STRATEGIES = 3  # strategies beside each other: more are too narrow
LOOKED = 24  # postures of a round by which a view is chosen
SMALL = 0.15  # diameter of the first circle over the size of the arm, where there is no path


@dataclass(frozen=True, eq=False)
class PageLoop(Value):
    """A closed path that a page offers: its name, the path, the posture (n,) at which all begin, what to see.

    rounds: how often it is gone; 0 for as often as the page's reader wants.
    """

    name: str
    path: Path
    q0: Vector
    text: str = ""
    rounds: int = 0


@dataclass(frozen=True, eq=False)
class WebPage(Value):
    """A page as the text of one HTML file."""

    html: str

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write the page to a file, whole or not at all. Raises: WriteError."""
        write_text(file, self.html)
        return FilePath(file)


@typed
def web_page(
    strategies: Mapping[str, Strategy],
    q0: ArrayLike,
    path: Path | None = None,
    *,
    title: str = "",
    text: str = "",
    loops: Sequence[PageLoop] = (),
) -> WebPage:
    """A page on which a loop of the tool is dragged, and strategies of one robot follow it beside each other.

    The numbers are those of `hk.follow` with 240 samples a round. The page has a circle and a figure eight, which begin
    at the tool pose of q0, beside the path.

    Args:
        strategies: name -> strategy, one to three of one robot and task; the first is at the left.
        q0: the posture (n,) at which all begin, or one for each strategy (strategies, n), of one tool pose.
        path: a closed path from there, whose size and plane the circle has at first.
        title: heads the page. text: what there is to see, beside what the page says of drift.
        loops: more closed paths, with postures of their own.

    Raises:
        MissingExtraError: zig is not installed. ExportError: a strategy cannot be compiled. OpenPathError. StartError:
            a path begins elsewhere. ArgumentError: too many strategies, or of several robots, tasks or tips.
            ShapeError, NotFiniteError, JointLimitError, SingularityError: of a start.
    """
    # Strategies of one task, and the posture at which each begins.
    rules = list(strategies.values())
    _check_one_task(rules)
    task, robot = rules[0].task, rules[0].task.robot
    given = list(np.asarray(q0)) if np.ndim(q0) == 2 else [q0] * len(rules)
    if len(given) != len(rules):
        raise ArgumentError("the number of start postures", len(given), f"give one, or {len(rules)}")
    starts = [robot.checked(q, "the start posture") for q in given]
    # The loops: that of the page's own circle, the path where it is no circle, and more.
    loop = path if path is not None else _first_circle(task, starts[0])
    arm = DrawnArm.of(task, _postures(rules, loop, starts))
    offered = [_loop_data(PageLoop("", loop, starts[0]), rules, starts, arm)]
    if path is not None and not _is_circle(path):
        offered.append(_loop_data(PageLoop("The planned path", path, starts[0]), rules, starts, arm))
    for more in loops:
        posture = robot.checked(more.q0, f"the start posture of {more.name!r}")
        offered.append(_loop_data(more, rules, [posture] * len(rules), arm))
    # The strategies as modules.
    segments, modules = max(2, *(len(offer["counts"]) for offer in offered)), []
    colors = law_colors([isinstance(rule, HolonomicStrategy) for rule in rules])
    for (name, rule), color in zip(strategies.items(), colors, strict=True):
        code = strategy_code(rule, arm, segments)
        module = {"code": digest(code), "module": _packed(_wasm_of(code, name))}
        modules.append({"name": name, "leaf": by_leaf(rule) is not None, "color": color} | module)
    # The size of the circle: from the start of the path to its farthest point, in the plane in which it winds most.
    area = np.abs(loop.area)
    plane = 2 if robot.planar or not area.max() > 0 else int(area.argmax())
    offsets = loop.at(np.linspace(0, loop.duration, 361)).position - loop.start
    offsets[:, plane] = 0.0
    data = {
        "joints": [{"name": joint.name, "unit": joint.unit} for joint in robot.coordinates],
        "steps": STEPS,
        "rounds": ROUNDS,
        "planar": robot.planar,
        "plane": plane,
        "size": offsets[np.argmax(np.linalg.norm(offsets, axis=1))].tolist(),
        "pieces": arm.pieces,
        "loops": offered,
        "strategies": modules,
    }
    return WebPage(page_text(title or f"{robot.name}: drag the loop", text, data))


def cusp_loop(witness: CuspWitness, rule: str = "the rule") -> PageLoop:
    """The loop of a cusp for a page, which says how far the joints end from where they began."""
    turn = np.degrees(witness.turn)
    sentence = (
        f"This loop is {100 * witness.length:.1f} cm long, and the tool turns by {turn:.0f} degrees on it. "
        f"It goes round a cusp of {rule}. The joints end {witness.apart:.2f} rad from where they began, "
        "though no posture on it is singular and the rule is kept all the way. "
        "A rule is repeatable within a region of tool poses. No such region contains this loop."
    )
    return PageLoop("A loop round a cusp", witness.path, witness.first, sentence, rounds=1)


def _check_one_task(strategies: Sequence[Strategy]) -> None:
    """Raises: ArgumentError: too many strategies, or not of one robot and one task of one tool in space."""
    if not 1 <= len(strategies) <= MOST_STRATEGIES:
        raise ArgumentError("the number of strategies on a page", len(strategies), f"give one to {MOST_STRATEGIES}")
    task = strategies[0].task
    for strategy in strategies:
        other = strategy.task
        if task.robot != other.robot or (task.m, task.tip) != (other.m, other.tip):
            names = [strategy.name for strategy in strategies]
            raise ArgumentError("the strategies of a page", names, "give those of one robot and one task")
        of_one_tool(other, "a page")
    if not task._spatial:
        raise ArgumentError("the task", task.name, "a page leads a tool in space: take a position or a pose")


def _loop_data(
    loop: PageLoop, strategies: Sequence[Strategy], starts: Sequence[Vector], arm: DrawnArm
) -> dict[str, Any]:
    """A loop for the page: its table, as `hk.follow` has it, what each strategy begins with, and the view."""
    task, path = strategies[0].task, loop.path
    if not path.closed:
        raise OpenPathError("a page", path.gap)
    plan = make_plan(task, path, STEPS, task._place(starts[0])[1])
    p, R = plan.first
    first = [*p.tolist(), *R.ravel().tolist()]
    # A run begins with joints, on a leaf also with (p, R, c) and the side of det [J; J_g].
    begins = []
    for strategy, q in zip(strategies, starts, strict=True):
        task.robot.check_limits(q)
        strategy(q)
        check_start(task, q, p, R)
        begin, leaf = {"q0": q.tolist(), "state": [], "side": 0.0}, by_leaf(strategy)
        if leaf is not None:
            c = leaf_value(leaf, q)
            begin |= {"state": [*first, *c.tolist()], "side": float(leaf_step(leaf)(q, p, R, c)[3])}
        begins.append(begin)
    return {
        "name": loop.name,
        "text": loop.text,
        "rounds": loop.rounds,
        "first": first,
        "table": _packed(path.table(plan.start_rotation).astype("<f8").tobytes()),
        "counts": plan.counts.tolist(),
        "begin": begins,
        "view": arm.view(_postures(strategies, path, starts), path),
    }


def _postures(strategies: Sequence[Strategy], path: Path, starts: Sequence[Vector]) -> Matrix:
    """Some postures (k, n) of the first rounds, by which a view is chosen; of a strategy that stops those before."""
    postures = [starts[0]]
    for strategy, q in zip(strategies, starts, strict=True):
        try:
            postures += list(follow(strategy, path, q, samples=LOOKED).q)
        except PathError as problem:
            postures += [] if problem.trajectory is None else list(problem.trajectory.q)
    return np.array(postures)


def _is_circle(path: Path) -> bool:
    """Whether it is what the page draws itself: one turn about an axis of the base."""
    (first, *others), normal = path.segments, path.area
    even = np.count_nonzero(np.abs(normal) > 1e-9 * np.abs(normal).max()) == 1
    return not others and not first.along.any() and not first.turning.any() and even and bool(normal.max() > 0)


def _first_circle(task: Task, q0: Vector) -> Path:
    """A level circle that lies towards the base, of a share of the arm's size: of the diagonal of a box about it."""
    start = task._place(q0)[0][:3]
    size = float(np.linalg.norm(np.ptp(DrawnArm.of(task, q0[None]).at(q0), axis=0)))
    inward = -np.sign(start[0]) or -1.0
    return circle(start, start + [inward * SMALL / 2 * size, 0.0, 0.0])


# --- From a session to a page that needs no installation: which strategies, where they begin, whether they get round.


@dataclass(frozen=True, eq=False)
class PagePlan(Value):
    """What a page of a session shows: two strategies by name, where each begins (n,), the closed path, a title."""

    strategies: dict[str, Strategy]
    starts: tuple[Vector, Vector]
    path: Path | None
    title: str

    @property
    def second(self) -> str:
        """The name of the strategy with leaves, which is at the right."""
        return list(self.strategies)[1]

    @cached_property
    def rounds(self) -> dict[str, Trajectory | HolokinError]:
        """Name -> the first round of the path, or why a strategy does not get round; nothing without a path."""
        rounds: dict[str, Trajectory | HolokinError] = {}
        for (name, strategy), start in zip(self.strategies.items(), self.starts, strict=True):
            if self.path is not None:
                try:
                    rounds[name] = follow(strategy, self.path, start, samples=STEPS)
                except HolokinError as problem:
                    rounds[name] = problem
        return rounds

    def checked(self, job: Job) -> CheckReport | None:
        """What the [checks] of a job find of the second strategy's round; None without them, or if it stops."""
        trajectory = self.rounds.get(self.second)
        if job.checks is None or not isinstance(trajectory, Trajectory):
            return None
        return job.checks.checked(trajectory, self.strategies[self.second].task)

    def cusp_loops(self) -> list[PageLoop]:
        """The smallest loop that is found round a cusp of the second strategy, if there is one.

        Raises:
            MissingExtraError: there is no zig, so that no page can be made.
        """
        _check_zig()
        strategy = self.strategies[self.second]
        if not isinstance(strategy, HolonomicStrategy):
            return []
        witness = cusps(with_leaves(strategy), self.starts[1]).witness
        return [] if witness is None else [cusp_loop(witness, self.second)]

    def page(self, loops: list[PageLoop] | None = None) -> WebPage:
        """The page, with more loops. Raises: as `web_page`."""
        return web_page(self.strategies, list(self.starts), self.path, title=self.title, loops=loops or [])


@typed
def page_plan(session: Session, name: str | None = None) -> PagePlan:
    """What a page of a session shows: its first strategy without leaves beside one with leaves.

    Where the session has none without leaves, the pseudo-inverse is the first.

    Args:
        name: of one of them; by default the first with leaves that is not radial, or else the first with leaves.

    Raises:
        UnknownNameError: of the strategy. ArgumentError: a session without two strategies for a page.
    """
    known = [strategy for strategy in session.strategies if strategy.G is not None]
    if name is not None and name not in [strategy.name for strategy in known]:
        raise UnknownNameError("strategy of a page", name, tuple(strategy.name for strategy in known))
    # The one that is asked for stands before the others; of those with leaves the radial ones last.
    known.sort(key=lambda strategy: (strategy.name != name, "radial" in str(strategy.keys or strategy.name)))
    second = next((strategy for strategy in known if strategy.holonomic), None)
    if second is None:
        cure = "a page shows one beside the pseudo-inverse: add a rule"
        raise ArgumentError("the number of strategies with leaves", 0, cure)
    usual = NamedStrategy("pseudo-inverse", moore_penrose(second.task, name="pseudo-inverse"), second.task)
    plain = (strategy for strategy in known if not strategy.holonomic and strategy.task.m == second.task.m)
    pair = (next(plain, usual), second)
    # Where each begins: on the loop of the session, if that is closed.
    loop, path = session.loop, None
    if loop is not None and isinstance(loop.path, Path) and loop.path.closed:
        path = loop.path
        first, last = (loop_start(strategy, loop, session.home) for strategy in pair)
    else:
        first, last = (leaf_start(strategy, session.home) for strategy in pair)
    strategies = {strategy.name: strategy.G for strategy in pair if strategy.G is not None}
    return PagePlan(strategies, (first, last), path, f"{session.title[:100]}: drag the loop")
