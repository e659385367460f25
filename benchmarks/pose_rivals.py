"""Other libraries' inverse kinematics, run as their own examples run them. Part of `python -m benchmarks.inverse`.

ssik is asked on the Panda that it ships, for all branches, for the one next to a seed, and by its tracker; its flange
is led to our tool by a constant transformation, which is checked. TRAC-IK gets our URDF, with its two usual aims and
its default time-out. roboticstoolbox's `ik_LM` in C++ gets our chain, with its defaults, which stop a millimetre off,
and with the tolerance of the others, with one search from the seed alone, too. Pinocchio's example loop takes steps of
0.1 along damped least squares; full steps are measured, too, which are its best.

Each is asked from its last answer, and from the start each time: then a pose has the same joints twice by
construction, and what is left to ask is whether they are near each other at near poses. Compared are the time for a
pose, the share of all poses that is found within joint limits, how far apart the joints are at one pose reached on two
ways, and on how many straight legs between poses they jump.
"""

from __future__ import annotations

import importlib
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
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

JUMP = 0.5
"""Joints further apart than this [rad] at neighbouring poses of a leg jump, if they do at a `FINER` spacing, too."""

LEG = 50
"""Steps of a leg in which jumps are looked for, at first."""

FINER = 20
"""Parts of a step that looks like a jump: a continuous motion that is only fast moves 0.5 rad in several of them."""

TIMED = 16
"""Poses whose ways are timed."""

PACKAGES = ("ssik", "pytracik", "roboticstoolbox-python", "pin", "numpy")
"""What is named with its version."""


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
    """What one solver did at poses that were each reached on two paths, step by step, and on the legs between them.

    found: the poses that it found by the first way, to `TOLERABLE` and
    within joint limits (k,). spread: largest joint difference between the two paths at each pose that it found by both
    (j,) [rad]. worst: largest error of an answer [m, and of the rotation]. jumps: the legs on which its joints jump
    (k,). whole: the legs on which it answers every step within limits, without a jump (k,).
    """

    name: str
    found: np.ndarray
    spread: np.ndarray
    worst: float
    jumps: np.ndarray
    whole: np.ndarray


def compared(
    name: str, begin: Begin, robot: hk.Robot, start: np.ndarray, poses: np.ndarray, steps: int, leg: int
) -> Compared:
    """One solver at every pose, straight from the start, and by way of the pose before it in the list; then from
    each pose of the list to the next.
    """
    first = robot.pose(start)
    spread, worst, found, ends = [], 0.0, np.zeros(len(poses), bool), []
    for k, pose in enumerate(poses):
        both = []
        for way in (_legs([first, pose], steps), _legs([first, poses[k - 1], pose], steps)):
            solve, q = begin(start), None
            for target in way:
                q = solve(target)
            both.append(q)
        a, b = both
        if a is not None:
            worst = max(worst, float(np.abs(robot.pose(a) - pose).max()))
        found[k] = _is_answer(robot, pose, a)
        ends.append(a if found[k] else start)
        if a is not None and b is not None:
            spread.append(np.abs(a - b).max())
    legs = [jumps_of(begin, robot, ends[k - 1], (poses[k - 1], pose), leg) for k, pose in enumerate(poses)]
    jumps, whole = np.array(legs, bool).T
    return Compared(name, found, np.array(spread), worst, jumps, whole)


def step_time(begin: Begin, robot: hk.Robot, start: np.ndarray, poses: np.ndarray, steps: int) -> float:
    """Processor seconds of a step of the straight paths from the start: the median of the ways' means."""
    times = []
    for pose in poses:
        way, solve = _legs([robot.pose(start), pose], steps), begin(start)
        clock = time.process_time()
        for target in way:
            solve(target)
        times.append((time.process_time() - clock) / len(way))
    return float(np.median(times))


def jumps_of(
    begin: Begin, robot: hk.Robot, q: np.ndarray, ends: tuple[np.ndarray, np.ndarray], steps: int, finer: int = FINER
) -> tuple[bool, bool]:
    """(the joints jump, every step has an answer within limits and they do not) on a straight leg, from a posture.

    Joints jump within their limits or past them. Two answers further apart than `JUMP` are a jump only if they are so
    on the step cut into `finer` parts.
    """
    solve, before, last = begin(q), None, ends[0]
    jumped, whole = False, True
    for pose in [ends[0], *_legs(list(ends), steps)]:
        now = solve(pose)
        whole = whole and _is_answer(robot, pose, now)
        now = now if _reaches(robot, pose, now) else None
        if now is not None and before is not None and np.abs(now - before).max() > JUMP:
            torn, closed = jumps_of(begin, robot, before, (last, pose), finer, 0) if finer else (True, False)
            jumped, whole = jumped or torn, whole and closed
        before, last = now, pose
    return jumped, whole


def _reaches(robot: hk.Robot, pose: np.ndarray, q: np.ndarray | None) -> bool:
    """Whether joints reach a pose to `TOLERABLE`, also past their limits."""
    return q is not None and float(np.abs(robot.pose(q) - pose).max()) < TOLERABLE


def _is_answer(robot: hk.Robot, pose: np.ndarray, q: np.ndarray | None) -> bool:
    """Whether joints reach a pose within their limits."""
    return q is not None and bool(((q >= robot.lower) & (q <= robot.upper)).all()) and _reaches(robot, pose, q)


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
        ik = hk.ik(LAWS[name](task, start), start)
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
    """Lines of a page: ours and the others at all poses drawn in a box before a Panda."""
    box = hk.workspace(box=([0.5, 0.0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.pi / 2)
    poses, steps, leg = (box.poses(4), 2, 2) if quick else (box.poses(128), 20, LEG)
    others, left_out = rivals(robot, start)
    own = ours(robot, start, ["joint 3 locked"] if quick else LAWS)
    solvers = [*own, *others]
    times = [step_time(begin, robot, start, poses[:TIMED], steps) for _, begin in solvers]
    done = [compared(name, begin, robot, start, poses, steps, leg) for name, begin in solvers]
    return poses_table(done, times, floor, (steps, leg), left_out)


def poses_table(
    done: list[Compared], times: list[float], floor: float, cuts: tuple[int, int], left_out: list[str]
) -> list[str]:
    """Lines of a page. `cuts`: steps of a leg of the ways, and of the legs between poses."""
    (steps, leg), count, by_any = cuts, len(done[0].found), int(np.any([c.found for c in done], axis=0).sum())
    lines = [
        "",
        "## Inverse kinematics, on two paths to each pose",
        "",
        f"Run with {_versions()}; a C floor took {1e6 * floor:.3g} us in this run.",
        "",
        f"A Panda goes from its ready posture to {count} poses drawn in a box, [0.5, 0, 0.3] +- [0.25, 0.4, 0.3] m,",
        "the tool down, tilted by up to 40 degrees, spun by +-90: straight, and by way of another of them, each leg in",
        f"{steps} steps, each step asked from the last answer, or, as it is named, from the ready posture each time.",
        f"All poses count: {by_any} of them are found within joint limits by at least one row. Times are of the",
        f"straight paths to the first {min(TIMED, count)}.",
        "Found: at the end of the first way, within joint limits. Apart: the largest joint's difference between the",
        f"two paths, in rad. Jumps: the share of the {count} straight legs from a pose to the next on which a joint",
        f"differs by more than {JUMP} rad between neighbouring steps: the leg is cut into {leg}, and a step that jumps",
        f"into {FINER} more, so a jump is one within a {leg * FINER:,}th of the leg; answers past the limits count",
        "here. Whole: the share of legs with an answer within limits at every step and no jump.",
        "",
        "From one seed a library, too, has the same joints twice, if it draws nothing at random: what that costs is",
        "in the jumps. A law of ours breaks off where its leaf ends, or a joint's range; a search goes on, elsewhere.",
        "",
        "| | a step | in C floors | found | apart, median | apart, most | jumps | whole | largest error |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for c, seconds in zip(done, times, strict=True):
        apart = [f"{f(c.spread):.2g}" if len(c.spread) else "-" for f in (np.median, np.max)]
        lines.append(
            f"| {c.name} | {1e6 * seconds:.3g} us | {seconds / floor:.3g} | {c.found.mean():.0%} "
            f"| {' | '.join(apart)} | {c.jumps.mean():.0%} | {c.whole.mean():.0%} | {c.worst:.1e} |"
        )
    return lines + ([f"\nLeft out: {'; '.join(left_out)}."] if left_out else [])


def _versions() -> str:
    named = [f"holokin {hk.__version__}"]
    for package in PACKAGES:
        try:
            named.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    return ", ".join(named)


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


def _both(
    label: str, solve: Callable[[np.ndarray, np.ndarray], np.ndarray | None], start: np.ndarray
) -> Iterator[tuple[str, Begin]]:
    """A solver from (pose, seed) -> q, asked from its last answer, and from the start each time."""
    yield label, _from_last(solve)
    yield f"{label}, from one seed", lambda _q: lambda pose: solve(pose, start)


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

    yield from _both(", all branches, the nearest taken", every, start)
    yield from _both(", one solution from a seed", nearest, start)
    yield ", its tracker", tracked


def _trac_ik(robot: hk.Robot, start: np.ndarray) -> Iterator[tuple[str, Begin]]:
    solver = importlib.import_module("trac_ik").TracIK
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(to_urdf(robot), "utf-8")
        for aim in ("Speed", "Distance"):
            arm = solver("base", robot.tips[0].name, str(file), solver_type=aim)

            def solve(pose: np.ndarray, seed: np.ndarray, arm=arm) -> np.ndarray | None:
                return arm.ik(pose[:3, 3], pose[:3, :3], seed)

            yield from _both(f", {aim.lower()}", solve, start)


def _roboticstoolbox(robot: hk.Robot, start: np.ndarray) -> Iterator[tuple[str, Begin]]:
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

        yield from _both(label, solve, start)


def _pinocchio(robot: hk.Robot, start: np.ndarray) -> Iterator[tuple[str, Begin]]:
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

        yield from _both(label, solve, start)
