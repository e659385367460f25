"""All postures of a pose: how fast, how many, how exact? Closed forms, ours and those of other libraries.

Random postures within the joint limits, the held joint at one value, give the poses, by Pinocchio; each answer is
judged by Pinocchio. All libraries of an arm are called in turns, round by round, on all poses, in processor time, on
one thread. They run as their own examples run them; what is prepared once for an arm is not timed.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.page import table, us
from benchmarks.speed import environment, in_turns
from holokin.motion.ik.closed_leaf import DOUBT, closed_leaf
from holokin.robot import to_urdf
from holokin.robot.closed_form import ClosedInverse

HELD: dict[str, list[int]] = {"panda": [6], "xarm7": [6], "iiwa14": [2], "ur5e": [], "irb140": []}
"""The arms, with the joint that is held: the other six have a closed inverse."""

NAMES = {"panda": "Panda", "xarm7": "xArm 7", "iiwa14": "iiwa 14", "ur5e": "UR5e", "irb140": "IRB 140"}

DECOMPOSITIONS = {
    "panda": ("spherical_two_intersecting", ([0, 1], [3, 4, 5]), True),
    "xarm7": ("spherical_two_intersecting", ([0, 1], [3, 4, 5]), True),
    "iiwa14": ("spherical_two_intersecting", ([0, 1], [3, 4, 5]), False),
    "ur5e": ("three_parallel_two_intersecting", ([4, 5],), False),
    "irb140": ("spherical_two_parallel", ([3, 4, 5],), False),
}
"""What IK-Geo is told: its decomposition, which axes meet in a point, and whether it goes from the tool to the base."""

SSIK = {"panda": "franka_panda", "iiwa14": "iiwa14", "xarm7": "xarm7", "ur5e": "ur5e"}

WRONG = 1e-3
"""Error [m or rad] from which an answer counts as none."""

TURN = 2 * np.pi

BATCH = 200
"""Poses of a batch that is timed."""


@dataclass(frozen=True)
class Asked:
    """How to ask for postures: `call` takes a pose, or with `many` all; `postures` makes (k, n) of answers."""

    name: str
    call: Callable[[Any], Any]
    poses: Any
    postures: Callable[[Any], Any]
    many: bool = False
    native: bool = True


class Arm:
    """Postures (k, n) of an arm, drawn within its limits, the held joint at one value, and their poses (k, 4, 4)."""

    def __init__(self, name: str, count: int) -> None:
        pin = importlib.import_module("pinocchio")
        self.name, self.robot, self.held = name, hk.load(name), HELD[name]
        self.rest = [i for i in range(self.robot.n) if i not in self.held]
        self.start = self.robot.lower + 0.3 * (self.robot.upper - self.robot.lower)
        low, high = np.clip(self.robot.lower, -np.pi, np.pi), np.clip(self.robot.upper, -np.pi, np.pi)
        self.q = np.random.default_rng(0).uniform(low, high, (count, self.robot.n))
        self.q[:, self.held] = self.start[self.held]
        self._pin, self._model = pin, pin.buildModelFromXML(to_urdf(self.robot))
        self._data, self._frame = self._model.createData(), self._model.getFrameId(self.robot.tips[0].name)
        self.poses = np.array([self.pose(q) for q in self.q])

    def pose(self, q: np.ndarray) -> np.ndarray:
        """The tool pose (4, 4), by Pinocchio."""
        self._pin.framesForwardKinematics(self._model, self._data, q)
        return self._data.oMf[self._frame].homogeneous.copy()

    def whole(self, six: Any) -> np.ndarray:
        """Postures (k, n) of values (k, 6) of the joints that are not held."""
        out = np.tile(self.start, (len(six), 1))
        out[:, self.rest] = np.asarray(six, dtype=float).reshape(len(six), 6)
        return out

    def framed(self, kinematics: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """The poses as a library has them whose base and tool are others. Raises: LookupError: its arm is not this."""
        for base in (np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0])):
            tool = np.linalg.solve(base @ self.poses[0], kinematics(self.q[0]))
            if all(np.abs(kinematics(self.q[i]) - base @ self.poses[i] @ tool).max() < 1e-4 for i in range(9)):
                return base @ self.poses @ tool
        raise LookupError("its arm is another one")

    def axes(self, groups: Sequence[list[int]] = (), backward: bool = False) -> tuple[np.ndarray, ...]:
        """(axes (6, 3), steps from each to the next (7, 3), poses (k, 4, 4)): the arm as a product of exponentials.

        groups: of axes that meet, of which all begin where they do.
        """
        home = self.whole(np.zeros((1, 6)))[0]
        T, J = self.pose(home), self.robot.jacobian(home)[:, self.rest].T
        h, points, poses = J[:, 3:], T[:3, 3] - np.cross(J[:, :3], J[:, 3:]), self.poses.copy()
        poses[:, :3, :3] = poses[:, :3, :3] @ T[:3, :3].T
        if backward:
            h, poses = -h[::-1], np.linalg.inv(poses)
            points = np.vstack([T[:3, 3], points[::-1], np.zeros(3)])
        else:
            points = np.vstack([np.zeros(3), points, T[:3, 3]])
        for group in groups:
            planes = np.array([np.eye(3) - np.outer(h[i], h[i]) for i in group])
            meeting = np.linalg.solve(planes.sum(axis=0), np.einsum("kij,kj->i", planes, points[1:][group]))
            points[1:][group] = meeting
        return np.ascontiguousarray(h), np.diff(points, axis=0), poses

    def judged(self, answers: Sequence[Any]) -> tuple[float, float]:
        """(different postures of a pose, largest error)."""
        total, largest = 0, 0.0
        for pose, given in zip(self.poses, answers, strict=True):
            kept: list[np.ndarray] = []
            for q in given:
                T = self.pose(q)
                error = float(np.abs([*(T[:3, 3] - pose[:3, 3]), *self._pin.log3(T[:3, :3].T @ pose[:3, :3])]).max())
                if error < WRONG and all(np.abs((q - k + np.pi) % TURN - np.pi).max() > 1e-5 for k in kept):
                    kept.append(q)
                    largest = max(largest, error)
            total += len(kept)
        return total / len(answers), largest


def holokin(arm: Arm) -> Iterator[Asked]:
    """The closed form itself, and what users call."""
    task = hk.pose(arm.robot)
    strategy = hk.holonomic(task, hk.lock(*arm.held)) if arm.held else hk.moore_penrose(task)
    ik, unlimited = hk.ik(strategy, arm.start), hk.ik(strategy, arm.start, limits=False)
    leaf: Any = closed_leaf(ik.strategy, arm.start[arm.held], False)
    machine = ClosedInverse(leaf.inverse.arm, False).at(leaf.values)

    def real(answers: np.ndarray) -> np.ndarray:
        return leaf.postures(answers[answers[:, 9] > DOUBT])

    yield Asked("the closed form alone", leaf.one, arm.poses, real)
    yield Asked("the same, a batch", lambda P: leaf.answers(P, 1), arm.poses, lambda all: map(real, all), True)
    yield Asked("the same, no compiler", machine.one, arm.poses, real, native=False)
    yield Asked("`ik.all(pose)`", unlimited.all, arm.poses, lambda found: found.q)


def eaik(arm: Arm) -> Iterator[Asked]:
    """As its `HPRobot`, of axes and the steps between them."""
    robot = importlib.import_module("eaik.IK_HP").HPRobot

    def read(found: Any) -> np.ndarray:
        Q = np.asarray(found.Q)
        return arm.whole(Q[~np.asarray(found.is_LS, dtype=bool)] if len(Q) else Q)

    h, steps, poses = arm.axes()
    solver = robot(h, steps)
    yield Asked("`IK(pose)`", solver.IK, poses, read)
    yield Asked("`IK_batched(poses, 1)`", lambda P: solver.IK_batched(P, 1), poses, lambda all: map(read, all), True)


def ik_geo(arm: Arm) -> Iterator[Asked]:
    """As its `Robot`, of axes and steps, by the decomposition that fits."""
    name, groups, backward = DECOMPOSITIONS[arm.name]
    h, steps, poses = arm.axes(groups, backward)
    solver = getattr(importlib.import_module("ik_geo").Robot, name)(h.tolist(), steps.tolist())

    def read(found: Any) -> np.ndarray:
        q = np.array([q for q, least_squares in found if not least_squares]).reshape(-1, 6)
        return arm.whole(q[:, ::-1] if backward else q)

    parts = [(pose[:3, :3].T.copy(), pose[:3, 3].copy()) for pose in poses]  # it reads columns
    yield Asked("`get_ik(R, t)`", lambda pose: solver.get_ik(*pose), parts, read)


def frankik(arm: Arm) -> Iterator[Asked]:
    """Its `ik_full` and `ik`, joint 7 given, and `inverse`, which samples joint 7."""
    if arm.name != "panda":
        return
    library = importlib.import_module("frankik")
    robot, hand = library.FrankaKinematics(robot_type="panda"), np.eye(4)
    hand[:2, :2], hand[2, 3] = np.sqrt(0.5) * np.array([[1, 1], [-1, 1]]), 0.1034  # its own, to the last digit
    poses, start, held = arm.framed(robot.forward) @ np.linalg.inv(hand), arm.start, float(arm.start[6])

    def read(found: Any) -> np.ndarray:
        q = np.atleast_2d(np.full(7, np.nan) if found is None else found)
        return q[np.isfinite(q).all(axis=1)]

    yield Asked("`ik_full(pose, q0, q7)`", lambda X: library.ik_full(X, start, held), poses, read)


def ssik(arm: Arm) -> Iterator[Asked]:
    """The arms that it ships, whose redundant joint is free; another of its axes and steps."""
    library = importlib.import_module("ssik")

    def read(found: Any) -> np.ndarray:
        return np.array([solution.q for solution in found]).reshape(len(found), -1)

    whole = {"respect_limits": False, "enumerate_windings": False}
    if arm.name not in SSIK:
        h, steps, poses = arm.axes()
        made = library.Manipulator.from_axes(h, steps)
        yield Asked("`solve(pose)`", lambda X: made.solve(X, **whole), poses, read)
        return
    made = library.Manipulator.from_prebuilt(SSIK[arm.name])
    free = ", joint 7 or 3 sampled" if arm.held else ""
    yield Asked(f"`solve(pose)`{free}", lambda X: made.solve(X, **whole), arm.framed(made.fk), read)


def ur_analytic_ik(arm: Arm) -> Iterator[Asked]:
    """The UR5e that it ships."""
    if arm.name == "ur5e":
        robot = importlib.import_module("ur_analytic_ik").ur5e
        poses = np.ascontiguousarray(arm.framed(lambda q: robot.forward_kinematics(*q)))
        yield Asked("`inverse_kinematics(pose)`", robot.inverse_kinematics, poses, lambda q: np.array(q).reshape(-1, 6))


LIBRARIES = (holokin, eaik, ik_geo, frankik, ssik, ur_analytic_ik)
PACKAGES = ("EAIK", "ik-geo", "frankik", "ssik", "ur-analytic-ik", "pin")


def postures_table(quick: bool) -> str:
    """A row a way, a column an arm: the time of a pose, and how many postures it has."""
    arms = [Arm(name, 20 if quick else 1000) for name in ((*HELD,)[::4] if quick else HELD)]
    cells: dict[str, dict[str, str]] = {}
    errors: dict[str, float] = {}
    for arm in arms:
        for name, seconds, count, error in measured(arm, *((3, 1e-3) if quick else (15, 2e-2))):
            cells.setdefault(name, {})[arm.name] = f"{us(seconds)} ({count:.3g})"
            errors[name] = max(errors.get(name, 0.0), error)
    held = {arm.name: f", joint {arm.held[0] + 1} held" if arm.held else "" for arm in arms}
    rows = [[name, *(of.get(arm, "-") for arm in held), f"{errors[name]:.0e}"] for name, of in cells.items()]
    return table(("library", *(f"{NAMES[arm]}{words}" for arm, words in held.items()), "largest error"), rows)


def measured(arm: Arm, rounds: int, each: float) -> Iterator[tuple[str, float, float, float]]:
    """(name, seconds of a pose, postures of it, largest error) of each way."""
    ways: dict[str, Asked] = {}
    for library in LIBRARIES:
        name = library.__name__.replace("eaik", "EAIK").replace("ik_geo", "IK-Geo")
        try:
            ways |= {f"{name}, {way.name}": way for way in library(arm)}
        except (ImportError, LookupError) as problem:
            print(f"{name} for {arm.name}: {problem}", flush=True)

    def run(way: Asked) -> Callable[[int], object]:
        stream = cycle([way.poses[:BATCH]] if way.many else way.poses)

        def over(count: int) -> None:
            with environment(HOLOKIN_NATIVE="1" if way.native else "0"):
                for given in islice(stream, count):
                    way.call(given)

        return over

    times = in_turns({name: run(way) for name, way in ways.items()}, rounds, each)
    for name, way in ways.items():
        given = way.call(way.poses) if way.many else map(way.call, way.poses)
        answers = list(way.postures(given) if way.many else map(way.postures, given))
        yield name, times[name].median / (len(way.poses[:BATCH]) if way.many else 1), *arm.judged(answers)
