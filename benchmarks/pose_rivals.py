"""Other libraries' inverse kinematics, run as their own examples run them. Part of `python -m benchmarks.inverse`.

ssik is asked on the Panda that it ships, for all branches, for the one next to a seed, and by its tracker; its flange
is led to our tool by a constant transformation, which is checked. TRAC-IK gets our URDF, with its two usual aims and
its default time-out. roboticstoolbox's `ik_LM` in C++ gets our chain, with its defaults, which stop a millimetre off,
and with the tolerance of the others, with one search from the seed alone, too. Pinocchio's example loop takes steps of
0.1 along damped least squares; full steps are measured, too, which are its best.

Each is compared by its time for a pose from its last answer, by the share of poses that it finds within joint limits,
and by how far apart its joints are at one pose reached on two ways.
"""

from __future__ import annotations

import importlib
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk
from holokin.robot import to_urdf

Solve = Callable[[np.ndarray], np.ndarray | None]
"""Wanted pose (4, 4) -> q (n,), or None where it finds none."""

Begin = Callable[[np.ndarray], Solve]
"""Start posture (n,) -> a solver that starts each search from its last answer, at first from the start."""

SAME = 1e-6
"""Largest difference of poses [m, and of rotations] up to which two models are one robot."""

TOLERABLE = 1e-2
"""Largest error of the pose [m, and of the rotation] up to which an answer counts: a solver's own tolerance is told
beside it."""


def rivals(robot: hk.Robot, start: np.ndarray) -> tuple[list[tuple[str, Begin]], list[str]]:
    """(name, begin) of all that are installed, and the names of those that are not, or that do not work here."""
    found: list[tuple[str, Begin]] = []
    left_out: list[str] = []
    for name, make in (
        ("ssik", _ssik), ("TRAC-IK", _trac_ik), ("roboticstoolbox ik_LM", _roboticstoolbox), ("Pinocchio", _pinocchio),
    ):  # fmt: skip
        try:
            found += [(f"{name}{variant}", begin) for variant, begin in make(robot, start)]
        except ImportError as problem:
            left_out.append(f"{name} ({problem.name or 'a part of it'} is not installed)")
        except LookupError as problem:
            left_out.append(f"{name} ({problem})")
    return found, left_out


@dataclass(frozen=True)
class Compared:
    """What one solver did at poses that were each reached on two ways, step by step.

    seconds: processor time of a step, median. within: share of the poses that it found by the first way, to
    `TOLERABLE` and within joint limits. spread: largest joint difference between the two ways at each pose that it
    found by both (k,) [rad]. worst: largest error of an answer [m, and of the rotation].
    """

    name: str
    seconds: float
    within: float
    spread: np.ndarray
    worst: float


def compared(name: str, begin: Begin, robot: hk.Robot, start: np.ndarray, poses: np.ndarray, steps: int) -> Compared:
    """One solver at every pose, straight from the start, and by way of the pose before it in the list."""
    first = robot.pose(start)
    ends, times, worst, within = [], [], 0.0, 0
    for k, pose in enumerate(poses):
        direct = _legs([first, pose], steps)
        detour = _legs([first, poses[k - 1], pose], steps)
        found = []
        for way in (direct, detour):
            solve, q = begin(start), None
            clock = time.process_time()
            for target in way:
                q = solve(target)
            times.append((time.process_time() - clock) / len(way))
            found.append(q)
        a, b = found
        if a is not None:
            error = float(np.abs(robot.pose(a) - pose).max())
            worst = max(worst, error)
            within += int(error < TOLERABLE and bool(((a >= robot.lower) & (a <= robot.upper)).all()))
        if a is not None and b is not None:
            ends.append(np.abs(a - b).max())
    return Compared(name, float(np.median(times)), within / len(poses), np.array(ends), worst)


LAWS: dict[str, Callable[[hk.Task, np.ndarray], hk.Strategy]] = {
    "joint 3 locked": lambda task, _: hk.holonomic(task, hk.lock(2)),
    "arm angle": lambda task, _: hk.holonomic(task, hk.arm_angle()),
    "radial": lambda task, start: hk.radial(hk.moore_penrose(task), start),
}
"""Our own, by name."""


def ours(robot: hk.Robot, start: np.ndarray, names: Iterable[str]) -> list[tuple[str, Begin]]:
    """(name, begin) of our own inverse kinematics."""
    task = hk.pose(robot)
    found: list[tuple[str, Begin]] = []
    for name in names:
        ik = hk.inverse(LAWS[name](task, start), start)
        found.append((f"holokin, {name}, `ik(pose)`", lambda _start, ik=ik: lambda pose: _or_none(lambda: ik(pose))))
        near = _from_last(lambda pose, seed, ik=ik: _or_none(lambda: ik.near(pose, seed)))
        found.append((f"holokin, {name}, `ik.near(pose, q)`", near))
    return found


def _or_none(call: Callable[[], np.ndarray]) -> np.ndarray | None:
    try:
        return call()
    except hk.HolokinError:
        return None


def poses_page(robot: hk.Robot, start: np.ndarray, floor: float, quick: bool) -> list[str]:
    """Lines of a page: ours and the others at poses of a box that a Panda reaches within its limits."""
    box = hk.workspace(box=([0.5, 0.0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.pi / 2)
    poses, steps = box.poses(8 if quick else 128), 5 if quick else 20
    found = hk.inverse(hk.holonomic(hk.pose(robot), hk.lock(2)), start).batch(poses)
    inside = found.reached & ((found.q >= robot.lower) & (found.q <= robot.upper)).all(axis=1)
    others, left_out = rivals(robot, start)
    own = ours(robot, start, ["joint 3 locked"] if quick else LAWS)
    lines = [
        "",
        "## Inverse kinematics, on two ways to each pose",
        "",
        f"A Panda goes from its ready posture to {inside.sum()} poses of a box, [0.5, 0, 0.3] +- [0.25, 0.4, 0.3] m,",
        "the tool down, tilted by up to 40 degrees, spun by +-90: straight, and by way of another of them, each leg",
        f"in {steps} steps, each step asked from the last answer. All can be reached within joint limits.",
        "Found: at the end of the first way, within joint limits. Apart: the largest joint's difference between the",
        "two ways, in rad.",
        "",
        "| | a step | in C floors | found | apart, median | apart, most | largest error |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for name, begin in [*own, *others]:
        c = compared(name, begin, robot, start, poses[inside], steps)
        apart = [f"{f(c.spread):.2g}" if len(c.spread) else "-" for f in (np.median, np.max)]
        lines.append(
            f"| {name} | {1e6 * c.seconds:.3g} us | {c.seconds / floor:.3g} | {c.within:.0%} | {' | '.join(apart)} "
            f"| {c.worst:.1e} |"
        )
    return lines + ([f"\nLeft out: {'; '.join(left_out)}."] if left_out else [])


def _legs(corners: list[np.ndarray], steps: int) -> list[np.ndarray]:
    """Poses (4, 4) on straight lines between corners, turning evenly, `steps` a leg."""
    found = []
    for a, b in pairwise(corners):
        turn = Rotation.from_matrix(b[:3, :3] @ a[:3, :3].T).as_rotvec()
        for k in range(1, steps + 1):
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_rotvec(k / steps * turn).as_matrix() @ a[:3, :3]
            pose[:3, 3] = a[:3, 3] + k / steps * (b[:3, 3] - a[:3, 3])
            found.append(b if k == steps else pose)
    return found


def _from_last(solve: Callable[[np.ndarray, np.ndarray], np.ndarray | None]) -> Begin:
    """A solver from (pose, seed) -> q."""

    def begin(start: np.ndarray) -> Solve:
        seed = start

        def step(pose: np.ndarray) -> np.ndarray | None:
            nonlocal seed
            q = solve(pose, seed)
            seed = seed if q is None else q
            return q

        return step

    return begin


def _ssik(robot: hk.Robot, start: np.ndarray) -> Iterator[tuple[str, Begin]]:
    ssik = importlib.import_module("ssik")
    arm = ssik.Manipulator.from_prebuilt("franka_panda")
    offset = np.linalg.solve(arm.fk(start), robot.pose(start))
    for q in np.random.default_rng(0).uniform(robot.lower, robot.upper, (8, robot.n)):
        if np.abs(arm.fk(q) @ offset - robot.pose(q)).max() > SAME:
            raise LookupError("its Panda is another robot than ours")
    back = np.linalg.inv(offset)

    def every(pose: np.ndarray, seed: np.ndarray) -> np.ndarray | None:
        solutions = arm.solve(pose @ back)
        return min((s.q for s in solutions), key=lambda q: np.abs(q - seed).max(), default=None)

    def nearest(pose: np.ndarray, seed: np.ndarray) -> np.ndarray | None:
        solutions = arm.solve(pose @ back, q_seed=seed, max_solutions=1)
        return solutions[0].q if solutions else None

    def tracked(start: np.ndarray) -> Solve:
        tracker = arm.tracker(start)

        def step(pose: np.ndarray) -> np.ndarray | None:
            found = tracker.update(pose @ back)
            return found.q if found.status.name == "OK" else None

        return step

    yield ", all branches, the nearest taken", _from_last(every)
    yield ", one solution from a seed", _from_last(nearest)
    yield ", its tracker", tracked


def _trac_ik(robot: hk.Robot, _start: np.ndarray) -> Iterator[tuple[str, Begin]]:
    solver = importlib.import_module("trac_ik").TracIK
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(to_urdf(robot), "utf-8")
        for aim in ("Speed", "Distance"):
            arm = solver("base", robot.tips[0].name, str(file), solver_type=aim)

            def solve(pose: np.ndarray, seed: np.ndarray, arm=arm) -> np.ndarray | None:
                return arm.ik(pose[:3, 3], pose[:3, :3], seed)

            yield f", {aim.lower()}", _from_last(solve)


def _roboticstoolbox(robot: hk.Robot, _start: np.ndarray) -> Iterator[tuple[str, Begin]]:
    rtb = importlib.import_module("roboticstoolbox")
    parts = []
    for joint, *limits in zip(robot.joints, robot.lower, robot.upper, strict=True):
        parts += [rtb.ET.SE3(joint.placement), rtb.ET.Rz(qlim=np.array(limits))]
    chain = rtb.ETS([*parts, rtb.ET.SE3(robot.tips[0].placement)])
    for label, more in (
        (", its defaults", {}),
        (", to 1e-6 m", {"tol": 1e-12}),
        (", one search", {"tol": 1e-12, "slimit": 1}),
    ):

        def solve(pose: np.ndarray, seed: np.ndarray, more=more) -> np.ndarray | None:
            found = chain.ik_LM(pose, q0=seed, **more)
            return found.q if found.success else None

        yield label, _from_last(solve)


def _pinocchio(robot: hk.Robot, _start: np.ndarray) -> Iterator[tuple[str, Begin]]:
    pin = importlib.import_module("pinocchio")
    model = pin.buildModelFromXML(to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)
    for label, share in ((", its example's loop", 0.1), (", its example's loop in full steps", 1.0)):

        def solve(pose: np.ndarray, seed: np.ndarray, share: float = share) -> np.ndarray | None:
            wanted, q = pin.SE3(pose[:3, :3], pose[:3, 3]), seed.copy()
            for _ in range(1000):
                pin.framesForwardKinematics(model, data, q)
                apart = data.oMf[frame].actInv(wanted)
                error = pin.log(apart).vector
                if np.linalg.norm(error) < 1e-4:
                    return q
                J = -pin.Jlog6(apart.inverse()) @ pin.computeFrameJacobian(model, data, q, frame)
                v = -J.T @ np.linalg.solve(J @ J.T + 1e-12 * np.eye(6), error)
                q = pin.integrate(model, q, v * share)
            return None

        yield label, _from_last(solve)
