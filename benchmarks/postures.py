"""All postures of a pose: how fast, how many, how exact? Closed forms, ours and those of other libraries.

    taskset -c 1 python -m benchmarks.postures     # needs: pip install -e ".[rivals]", Pinocchio and a C compiler

Random postures within the joint limits, the held joint at one value, give the poses, by Pinocchio; each answer is
judged by Pinocchio. All libraries of an arm are called in turns, round by round, on all poses, in processor time, on
one thread. They run as their own examples run them; what is prepared once for an arm is not timed.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.speed import environment, in_turns, processor
from holokin.motion.ik.closed_leaf import DOUBT, closed_leaf
from holokin.robot import to_urdf
from holokin.robot.closed_form import ClosedInverse
from holokin.symbolic.native.toolchain import engine

HELD: dict[str, list[int]] = {"panda": [6], "xarm7": [6], "iiwa14": [2], "ur5e": [], "irb140": []}
"""The arms, with the joint that is held: the other six have a closed inverse."""

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

    def judged(self, answers: Sequence[Any]) -> tuple[float, float, float, float]:
        """(share of poses with an answer, different postures of a pose, those within limits, largest error)."""
        total, inside, found, largest = 0, 0, 0, 0.0
        for pose, given in zip(self.poses, answers, strict=True):
            kept: list[np.ndarray] = []
            for q in given:
                T = self.pose(q)
                error = float(np.abs([*(T[:3, 3] - pose[:3, 3]), *self._pin.log3(T[:3, :3].T @ pose[:3, :3])]).max())
                if error < WRONG and all(np.abs((q - k + np.pi) % TURN - np.pi).max() > 1e-5 for k in kept):
                    kept.append(q)
                    largest = max(largest, error)
                    turned = q + TURN * np.ceil((self.robot.lower - 1e-9 - q) / TURN)
                    inside += bool((turned <= self.robot.upper + 1e-9).all())
            total, found = total + len(kept), found + bool(kept)
        return found / len(answers), total / len(answers), inside / len(answers), largest


def holokin(arm: Arm) -> Iterator[Asked]:
    """The closed form itself, and what users call."""
    task = hk.pose(arm.robot)
    strategy = hk.holonomic(task, hk.lock(*arm.held)) if arm.held else hk.moore_penrose(task)
    ik, unlimited = hk.ik(strategy, arm.start), hk.ik(strategy, arm.start, limits=False)
    leaf: Any = closed_leaf(ik.strategy, arm.start[arm.held], False)
    nothing = np.zeros((0, arm.robot.n))

    def real(answers: np.ndarray) -> np.ndarray:
        return leaf.postures(answers[answers[:, 9] > DOUBT])

    def one(pose: np.ndarray) -> np.ndarray:
        try:
            return ik(pose)[None]
        except hk.HolokinError:
            return nothing

    def each(found: Any) -> list[np.ndarray]:
        return [q[None] if reached else nothing for q, reached in zip(found.q, found.reached, strict=True)]

    yield Asked("the closed form alone", leaf.one, arm.poses, real)
    yield Asked(
        "the closed form alone, batch", lambda P: leaf.answers(P, 1), arm.poses, lambda all: map(real, all), True
    )
    yield Asked("`ik.all(pose)`", unlimited.all, arm.poses, lambda found: found.q)
    yield Asked("one: `ik(pose)`", one, arm.poses, lambda q: q)
    yield Asked("one: `ik.batch(poses)`", lambda P: ik.batch(P, 1), arm.poses, each, True)
    machine = ClosedInverse(leaf.inverse.arm, False).at(leaf.values)
    yield Asked("no compiler: the closed form alone", machine.one, arm.poses, real, native=False)
    yield Asked(
        "no compiler: the closed form alone, batch",
        lambda P: machine.answers(P, 1),
        arm.poses,
        lambda all: map(real, all),
        True,
        False,
    )


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
    yield Asked("one: `inverse(pose, q0, q7=)`", lambda X: robot.inverse(X, start, q7=held), poses, read)
    yield Asked("one, joint 7 free: `inverse(pose, q0)`", lambda X: robot.inverse(X, start), poses, read)


def ssik(arm: Arm) -> Iterator[Asked]:
    """The arms that it ships, whose redundant joint is free; another of its axes and steps."""
    library = importlib.import_module("ssik")

    def read(found: Any) -> np.ndarray:
        return np.array([solution.q for solution in found]).reshape(len(found), -1)

    whole = {"respect_limits": False, "enumerate_windings": False}
    if arm.name not in SSIK:
        h, steps, poses = arm.axes()
        made = library.Manipulator.from_axes(h, steps)
        yield Asked("of axes, `solve(pose)`", lambda X: made.solve(X, **whole), poses, read)
        return
    made = library.Manipulator.from_prebuilt(SSIK[arm.name])
    poses, free = arm.framed(made.fk), ", the redundant joint free" if arm.held else ""
    yield Asked(f"prebuilt{free}, `solve(pose)`", lambda X: made.solve(X, **whole), poses, read)
    yield Asked(
        f"one: prebuilt{free}, from a seed", lambda X: made.solve(X, q_seed=arm.start, max_solutions=1), poses, read
    )


def ur_analytic_ik(arm: Arm) -> Iterator[Asked]:
    """The UR5e that it ships."""
    if arm.name == "ur5e":
        robot = importlib.import_module("ur_analytic_ik").ur5e
        poses = np.ascontiguousarray(arm.framed(lambda q: robot.forward_kinematics(*q)))
        yield Asked("`inverse_kinematics(pose)`", robot.inverse_kinematics, poses, lambda q: np.array(q).reshape(-1, 6))


def roboticstoolbox(arm: Arm) -> Iterator[Asked]:
    """Its search `ik_LM`, by its defaults and to 1e-12, on the chain of the URDF; the redundant joint is free."""
    library, free = importlib.import_module("roboticstoolbox"), ", the redundant joint free" if arm.held else ""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(to_urdf(arm.robot), "utf-8")
        chain = library.Robot.URDF(str(file)).ets(end=arm.robot.tips[0].name)

    def read(found: Any) -> np.ndarray:
        return np.array([found.q] if found.success else []).reshape(-1, arm.robot.n)

    yield Asked(f"one{free}: `ik_LM`", lambda X: chain.ik_LM(X, q0=arm.start), arm.poses, read)
    yield Asked(f"one{free}: `ik_LM`, tol 1e-12", lambda X: chain.ik_LM(X, q0=arm.start, tol=1e-12), arm.poses, read)


LIBRARIES = (holokin, eaik, ik_geo, frankik, ssik, ur_analytic_ik, roboticstoolbox)
PACKAGES = ("numpy", "EAIK", "ik-geo", "frankik", "ssik", "ur-analytic-ik", "roboticstoolbox-python", "pin")


def rows(arm: Arm, rounds: int, each: float) -> tuple[list[str], list[str]]:
    """(rows of the table, what is left out) of an arm."""
    ways: dict[str, Asked] = {}
    left_out = []
    for library in LIBRARIES:
        name = library.__name__.replace("eaik", "EAIK").replace("ik_geo", "IK-Geo")
        try:
            ways |= {f"{name}, {way.name}": way for way in library(arm)}
        except (ImportError, LookupError) as problem:
            left_out.append(f"{name} for {arm.name} ({problem})")

    def run(way: Asked) -> Callable[[int], object]:
        stream = cycle([way.poses[:BATCH]] if way.many else way.poses)

        def over(count: int) -> None:
            with environment(HOLOKIN_NATIVE="1" if way.native else "0"):
                for given in islice(stream, count):
                    way.call(given)

        return over

    times = in_turns({name: run(way) for name, way in ways.items()}, rounds, each)
    lines = []
    for name, way in ways.items():
        given = way.call(way.poses) if way.many else map(way.call, way.poses)
        answers = list(way.postures(given) if way.many else map(way.postures, given))
        found, count, inside, error = arm.judged(answers)
        seconds = times[name].median / (len(way.poses[:BATCH]) if way.many else 1)
        lines.append(
            f"| {name} | {1e6 * seconds:.3g} us | {100 * found:.4g}% | {count:.3g} | {inside:.3g} | {error:.0e} |"
        )
    return lines, left_out


def main(arguments: list[str] | None = None) -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="20 poses, few rounds, a Panda and a UR5e")
    given = parser.parse_args(arguments)
    said = [f"holokin {hk.__version__}"]
    for package in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            said.append(f"{package} {version(package)}")
    print(f"{', '.join(said)}; {engine()}; {processor()}")
    for name in ("panda", "ur5e") if given.quick else HELD:
        arm = Arm(name, 20 if given.quick else 1000)
        held = f", {arm.robot.joint_names[arm.held[0]]} held" if arm.held else ""
        lines, left_out = rows(arm, *((3, 1e-3) if given.quick else (15, 2e-2)))
        print(f"\n| {name}{held} | a pose | found | postures | within limits | largest error |")
        print("|---|---:|---:|---:|---:|---:|", *lines, sep="\n")
        if left_out:
            print("\nLeft out: " + "; ".join(left_out) + ".")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
