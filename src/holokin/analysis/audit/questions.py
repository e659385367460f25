"""The questions that `audit` asks of a law. Each runs it through `simulate`, and judges where the joints end.

A question answers with a sentence and its metrics, by name [joint units unless the name says else].
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from ...base.errors import ArgumentError, ControllerError, HolokinError
from ...base.types import Array, Matrix, NoTruthValue, Vector
from ...motion import simulate
from ...motion.control import ControlLaw
from ...motion.trajectory import Trajectory, whole_turns
from ...path import Path, polyline
from ...path.path import rotation_vector
from ...strategies import self_motion_curve
from ...strategies.tasks.task import Task, check_representation
from ..curvature.curvature_of_planes import pairs

# --- Judging joint postures at equal tool poses: the verdicts, distances, the first limit, moves to a pose close by.


@dataclass(frozen=True)
class Distance:
    """Largest joint distance at equal tool poses: `value` [rad or m] of `joint` at `phase` of the cycle (0 to 1),
    and how far it is over what is allowed there; `beyond` when it is."""

    value: float
    joint: str
    phase: float
    beyond: bool


class LogVerdict(NoTruthValue, Enum, ask="`is LogVerdict.REPEATS`"):
    """Whether the joints repeated in a log; the text says what it means."""

    REPEATS = "repeats: the joints were the same at equal tool poses, in every comparison that the log allows"
    DIFFERS = "differs: the joints were not the same at equal tool poses"
    UNDECIDED = (
        "cannot tell: noise, a shift of the tool's own path, or a turn between two samples may hide that the joints "
        "differ"
    )

    @property
    def exit_code(self) -> int:
        """Of a command: 0, 1 and 2."""
        return list(LogVerdict).index(self)


class Repeatability(NoTruthValue, Enum, ask="`is Repeatability.REPEATS`"):
    """What the audit of a control law found; the text says what it means."""

    REPEATS = "repeats: the joints are the same at equal tool poses, in all that was tested"
    BUT_FOR_THE_STEP = "repeats but for the error of the step: take a shorter step, or feedback to the leaf"
    CONVERGES = (
        "converges: cycles repeat in the end, but the joints at a pose depend on the path, the speed or the past"
    )
    DRIFTS = "drifts: every cycle leaves the joints elsewhere"
    UNKNOWN = "cannot be judged: the law failed, as told below"


def first_limit(lower: Vector, upper: Vector, q: Matrix, rate: Matrix) -> tuple[int, float] | None:
    """(joint, cycles) of the first joint at a limit when the postures q (P, n) of a cycle go on at their rates (P, n)
    [joint units a cycle]; None when none moves towards one."""
    room = np.where(rate > 0, upper - q, q - lower)
    cycles = np.full(q.shape, np.inf)
    np.divide(np.maximum(room, 0.0), np.abs(rate), out=cycles, where=rate != 0)
    _, joint = np.unravel_index(int(np.argmin(cycles)), cycles.shape)
    return (int(joint), float(cycles.min())) if np.isfinite(cycles.min()) else None


def to_pose(task: Task, q: Matrix, position: Matrix, rotation: Array) -> tuple[Matrix, Vector]:
    """Postures (k, n) moved to tool poses (k, 3), (k, 3, 3) close by, dq = J^+ e, and the largest joint's move (k,).

    What remains between two visits so moved is motion of the joints that the gap of the tool does not explain.
    """
    error = task.error(q, position, rotation)
    jacobian, _ = task.jacobian_batch(q)
    gram = jacobian @ jacobian.transpose(0, 2, 1)
    trace = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    weights = np.linalg.solve(gram + 1e-9 * trace * np.eye(task.m), error[:, :, None])
    move = (jacobian.transpose(0, 2, 1) @ weights)[:, :, 0]
    return q + move, np.abs(move).max(axis=1)


# --- Loops of the tool in the plane of two task rows, and the area that a loop encloses in each such plane.
#
# The drift of a small loop is the sum over the planes (i, j) of enclosed area times curvature F_ij (theory 1.1): a loop
# sees only the curvature of the planes in which it encloses area.

# Sides of a loop: 0.1 m like the other loops of an audit; 0.2 rad is a like motion for an arm's joints, and small
# enough that turns about different axes commute up to a tenth.
SIDES = {"m": 0.1, "rad": 0.2}

# Area, as a share of the largest that one of the loops encloses in any plane, from which a plane counts as looked at:
# there a tolerance on the drift allows ten times the curvature.
ENCLOSED = 0.1

LEAST = 1e-4  # area, as a share of that of `SIDES`, below which a loop encloses nothing: 1 mm by 1 mm


def plane_name(task: Task, i: int, j: int) -> str:
    """For instance "x-wz"."""
    return f"{task.row_names[i]}-{task.row_names[j]}"


def sides(task: Task, i: int, j: int, size: float = 1.0) -> tuple[float, float]:
    """Sides of a loop in the plane (i, j) [m or rad]."""
    return size * SIDES[task.units[i]], size * SIDES[task.units[j]]


def _area_unit(task: Task, i: int, j: int) -> str:
    """ "m^2", "m rad" or "rad^2"."""
    a, b = task.units[i], task.units[j]
    return f"{a}^2" if a == b else f"{a} {b}"


def _steps(task: Task, position: Vector, rotation: Matrix, rows: tuple[int, int], size: float) -> list[Vector]:
    """The least twists (6,) of a tool at a pose that change one of two task rows each, by the sides of a loop.
    Raises: SingularityError where the representation is singular."""
    twists = np.asarray(np.linalg.pinv(_rates(task, rotation)).T, dtype=float)
    inward = [-1.0 if (row := task.rows[k]) < 3 and position[row] > 0 else 1.0 for k in rows]
    return [size * sign * SIDES[task.units[k]] * twists[k] for sign, k in zip(inward, rows, strict=True)]


def plane_loop(task: Task, position: Vector, rotation: Matrix, i: int, j: int, size: float = 1.0) -> Path:
    """A loop of four sides from a tool pose: row i, row j, row i back, and the path back.

    Position rows move towards the robot's base first. With turns the last side is the shortest turn that closes the
    loop; it differs from that of a rectangle by the product of the sides, so that the area in other planes is smaller
    by the size of the loop. One row alone (i = j) gives the path there and back.
    Raises: SingularityError where the representation is singular."""
    from scipy.spatial.transform import Rotation

    a, b = _steps(task, position, rotation, (i, j), size)
    if i == j:
        return polyline([position, position + a[:3]], turns=[a[3:], -a[3:]], closed=True)
    turned = Rotation.from_rotvec(-a[3:]) * Rotation.from_rotvec(b[3:]) * Rotation.from_rotvec(a[3:])
    corners = [position, position + a[:3], position + a[:3] + b[:3], position + b[:3]]
    turns = [a[3:], b[3:], -a[3:], turned.inv().as_rotvec()]
    return polyline(corners, turns=turns, closed=True)


def enclosed(task: Task, path: Path, start_rotation: Matrix) -> Matrix:
    """Area (m, m) that a closed path encloses in each plane of task rows, as a share of that of `plane_loop`.

    A_ij = 1/2 of the integral of x_i dx_j - x_j dx_i, x the tool's way from its start in the task rows, to first
    order in the turns.
    """
    samples = path.at(np.linspace(0.0, path.duration, 2001))
    x = np.hstack([samples.position - path.start, rotation_vector(samples.rotation)]) @ _rates(task, start_rotation).T
    x /= [SIDES[unit] for unit in task.units]
    after = np.roll(x, -1, axis=0)
    return (x.T @ after - after.T @ x) / 2


def looked_at(task: Task, paths: list[Path], start_rotation: Matrix) -> dict[tuple[int, int], float]:
    """The planes in which one of the paths encloses area, with the largest share of `enclosed`."""
    areas = np.max([np.abs(enclosed(task, path, start_rotation)) for path in paths], axis=0)
    threshold = max(ENCLOSED * float(areas.max()), LEAST)
    return {(i, j): float(areas[i, j]) for i, j in pairs(task.m) if areas[i, j] >= threshold}


def _rates(task: Task, rotation: Matrix) -> Array:
    """The map (m, 6) from the twist of a tool turned by R (3, 3) to the rates of the task rows."""
    unit = np.eye(6)
    rates, margins = task._tool_rates(np.tile(rotation, (6, 1, 1)), unit[:, :3], unit[:, 3:])
    check_representation(task, np.full(task.n, np.nan), margins[0])
    return rates.T


Answer = tuple[str, dict[str, float]]

NO_DRIFT = 1e-5  # drift [joint units] of a loop of 0.07 m by 0.07 m that is none: a curvature of 0.002 per square metre

# Tool error, as a share of the loop's reach from its start, beyond which the law did not go round the loop: a law
# that stands still, or leaves the orientation alone, drifts nowhere. Soft laws with errors of 3 cm on 0.14 m still
# count.
FOLLOWED = 0.3

# Sizes of the loop in a plane, as a share of `planes.SIDES`: where the tool cannot go round one, the next is tried.
SIZES = (1.0, 0.5, 0.25)

# Size of the small loops, and half of it, as a share of `planes.SIDES`: 0.07 m or 0.14 rad, of an area like that of a
# circle of 0.04 m in radius.
SMALL = 0.7

# Change up to which a law is of the form dq = G(q) x', as a share of a small loop's drift: of that drift when the
# loop is reversed, when it is gone round at half the speed, and of where the joints end when stairs replace a line.
# There each is 0 but for terms of higher order in the size and for the error of the step: 0.015, 0.0005 and 0.003
# were met.
TURNED, HURRIED, BENT = 0.5, 0.05, 0.05

STAIRS = 8  # stairs instead of a straight line, and twice as many: a side of 7 cm in 4 s is then 6 steps of 0.02 s long

# Ratio of the drifts of two small loops, one twice as large, that is near to 4, that of their areas: half-way, on a
# scale of ratios, to 2, that of lengths, and to 8, that of a curvature that is 0 at the start and rises from there.
AREA = (2.8, 5.6)

# Drift of the smaller loop, as a share of the larger one's, below which the larger one is reversed and slowed.
LEAST_SMALL = 0.02

ALIKE = 1e-6  # difference of two answers, as a share of the answer, up to which they are the same


@dataclass(frozen=True, eq=False)
class AuditSetup:
    """What every question needs."""

    law: ControlLaw
    task: Task
    q0: Vector
    dt: float
    cycles: int
    patience: float
    tolerance: float
    until: float = np.inf  # the time of `time.monotonic` after which no run begins, and what is said then
    late: str = ""

    @cached_property
    def tool(self) -> Matrix:
        """The tool pose (4, 4) at the start."""
        return self.task.pose(self.q0)

    def run(
        self,
        path: Path,
        q0: Vector | None = None,
        *,
        cycles: int = 1,
        dt: float | None = None,
        law: ControlLaw | None = None,
    ) -> Trajectory:
        """One run of the law, or of another, such as this one watched. Raises: ControllerError; it is too late."""
        if time.monotonic() > self.until:
            raise ControllerError(self.law.name, self.late)
        begin, law = self.q0 if q0 is None else q0, law or self.law
        return simulate(law, self.task, path, begin, dt=dt or self.dt, cycles=cycles, patience=self.patience)

    def loop(self, plane: tuple[int, int], scale: float = 1.0) -> Path:
        """`plane_loop` from the start. Raises: SingularityError."""
        return plane_loop(self.task, self.tool[:3, 3], self.tool[:3, :3], *plane, scale)

    def went_round(self, walk: Trajectory, path: Path) -> str:
        """Why the tool did not go along the path; empty if it did."""
        samples = path.at(np.linspace(0.0, path.duration, 65))
        reach = {
            "m": float(np.linalg.norm(samples.position - path.start, axis=1).max()),
            "rad": float(np.linalg.norm(rotation_vector(samples.rotation), axis=1).max()),
        }
        for unit, far in reach.items():
            off = walk.tracking_error(unit)
            if off > FOLLOWED * far and off > self.tolerance:
                moves = "leads" if unit == "m" else "turns"
                where = f"{off:.3g} {unit} off the path, which {moves} it by {far:.3g} {unit}"
                return f"the tool did not follow: it was {where}"
        return ""


def largest(difference: Vector) -> float:
    """The largest joint's difference."""
    return float(np.abs(difference).max())


def ask_cycles(setup: AuditSetup, path: Path) -> Answer:
    """Drift per cycle and after all, how it goes on, and the worst tracking. Raises: ControllerError."""
    # All cycles, and the first one with half the step: the step's share of the drift falls with the step.
    walk = setup.run(path, cycles=setup.cycles)
    unfollowed = setup.went_round(walk, path)
    if unfollowed:
        cure = "feedback, dq = J^+ (x' + K e), or a smaller dt keeps it on the path"
        raise ControllerError(setup.law.name, f"without a verdict: {unfollowed}; {cure}", walk)
    fine = setup.run(path, dt=setup.dt / 2)
    each = np.abs(walk.drift()).max(axis=1)
    total = largest(walk.drift_since_start()[-1])
    without_step = 2 * fine.drift()[0] - walk.drift()[0]
    metrics = {"first": float(each[0]), "last": float(each[-1]), "after_all": total}
    metrics |= {"first_without_step": largest(without_step)}
    metrics |= {"tracking_m": walk.tracking_error(), "tracking_rad": walk.tracking_error("rad")}
    # In words.
    track = f"tracks to {1e3 * metrics['tracking_m']:.3g} mm"
    if walk.tracking_error("rad") > 0:
        track += f", {metrics['tracking_rad']:.2g} rad"
    sentences = {
        Repeatability.REPEATS: f"back within {max(float(each.max()), total):.1e} after {setup.cycles} cycles",
        Repeatability.BUT_FOR_THE_STEP: f"drifts {each[0]:.2g} a cycle, by its step of {setup.dt:g} s alone",
        Repeatability.CONVERGES: f"drifts {each[0]:.3g} in the first cycle, {each[-1]:.2g} in the last: converges",
        Repeatability.DRIFTS: f"drifts {each[0]:.3g} in the first cycle, {each[-1]:.3g} in cycle {setup.cycles}, "
        f"{total:.3g} in all",
    }
    wound = whole_turns(without_step, walk.joint_units, setup.tolerance)
    turned = [f"{name} by {k:+d}" for name, k in zip(walk.joint_names, wound, strict=True) if k]
    if turned:
        track = f"whole turns in the first cycle: {', '.join(turned)}; {track}"
    return f"{sentences[of_cycles(metrics, setup.tolerance, setup.cycles)]}; {track}", metrics


def of_cycles(metrics: dict[str, float], tolerance: float, cycles: int) -> Repeatability:
    """What the cycles of one loop say."""
    first, last = metrics["first"], metrics["last"]
    if max(first, metrics["after_all"]) <= tolerance:
        return Repeatability.REPEATS
    if step_alone(first, metrics["first_without_step"], tolerance) and metrics["after_all"] <= 1.5 * cycles * first:
        return Repeatability.BUT_FOR_THE_STEP
    if last <= 0.5 * first or (last <= tolerance < first):
        return Repeatability.CONVERGES
    return Repeatability.DRIFTS


def step_alone(drift: float, without_step: float, tolerance: float) -> bool:
    """Whether a drift beyond the tolerance is the error of the step and no more."""
    return without_step <= min(tolerance, 0.1 * drift)


@dataclass(frozen=True)
class PlaneDrift:
    """One loop in the plane of two task rows: its drift.

    plane: (i, j); name: of the two rows. drift [joint units]: the largest joint's, without the share of the step;
    as_run: with it. per_area: drift over the area enclosed [unit]. size: the loop's sides, 1 for 0.1 m or 0.2 rad
    (of loops that were given: the root of the area). untested: why nothing is known of this plane; empty if something
    is. failed: the law failed there.
    """

    plane: tuple[int, int]
    name: str
    drift: float = float("nan")
    as_run: float = float("nan")
    per_area: float = float("nan")
    unit: str = ""
    size: float = 0.0
    untested: str = ""
    failed: bool = False

    @property
    def tested(self) -> bool:
        """Whether a loop enclosed area in this plane, and the tool went round it."""
        return not self.untested


def ask_plane(setup: AuditSetup, plane: tuple[int, int]) -> PlaneDrift:
    """The drift of one loop in a plane. A law's fault there is told in the answer."""
    name, unfollowed = plane_name(setup.task, *plane), ""
    try:
        for size in SIZES:
            path = setup.loop(plane, size)
            walk = setup.run(path)
            why = setup.went_round(walk, path)
            unfollowed = unfollowed or why
            if not why:
                return _plane_drift(setup, plane, name, path, walk, size)
    except ControllerError as problem:
        return PlaneDrift(plane, name, untested=problem.fact, failed=True)
    except ArgumentError:
        raise
    except HolokinError as problem:
        return PlaneDrift(plane, name, untested=str(problem), failed=True)
    return PlaneDrift(plane, name, untested=unfollowed)


def _plane_drift(
    setup: AuditSetup, plane: tuple[int, int], name: str, path: Path, walk: Trajectory, size: float
) -> PlaneDrift:
    drift = walk.drift()[0]
    as_run = largest(drift)
    if as_run > NO_DRIFT:
        drift = 2 * setup.run(path, dt=setup.dt / 2).drift()[0] - drift
    a, b = sides(setup.task, *plane)
    area = a * b * abs(float(enclosed(setup.task, path, setup.tool[:3, :3])[plane]))
    unit = f"{walk.joint_units[int(np.abs(drift).argmax())]} per {_area_unit(setup.task, *plane)}"
    return PlaneDrift(plane, name, largest(drift), as_run, largest(drift) / area, unit, size)


def worst_plane(planes: Sequence[PlaneDrift]) -> PlaneDrift | None:
    """The plane whose loop drifts most."""
    known = [p for p in planes if p.tested and np.isfinite(p.drift)]
    return max(known, key=lambda p: p.drift, default=None)


def tell_planes(setup: AuditSetup, planes: Sequence[PlaneDrift]) -> Answer:
    """The planes in one sentence: the worst, and those that were not tested."""
    worst = worst_plane(planes)
    metrics = {p.name: p.drift for p in planes if p.tested and np.isfinite(p.drift)}
    parts = []
    if worst is not None:
        long = zip(sides(setup.task, *worst.plane, worst.size), worst.plane, strict=True)
        a, b = (f"{side:g} {setup.task.units[k]}" for side, k in long)
        metrics["worst_per_area"] = worst.per_area
        parts.append(
            f"{len(metrics) - 1} of {len(planes)} tested, one loop each: the largest drift, {worst.drift:.2g}, is in "
            f"{worst.name}, with a loop of {a} by {b} ({worst.per_area:.3g} {worst.unit})"
        )
        if step_alone(worst.as_run, worst.drift, setup.tolerance):
            parts[-1] += f" ({worst.as_run:.2g} with the error of the step)"
    elif any(p.tested for p in planes):
        parts.append(f"your loops enclose area in {', '.join(p.name for p in planes if p.tested)}")
    elif not planes:
        parts.append("a task of one row has none: every closed path goes there and back")
    parts += [f"NOT tested: {reason}" for reason in by_reason([p for p in planes if not p.failed])]
    return "; ".join(parts), metrics


def by_reason(planes: Sequence[PlaneDrift]) -> list[str]:
    """The planes that were not tested, those with one reason together: "x-y, x-z (why)"."""
    reasons: dict[str, list[str]] = {}
    for p in planes:
        if p.untested:
            reasons.setdefault(p.untested, []).append(p.name)
    return [f"{', '.join(names)} ({why})" for why, names in reasons.items()]


def ask_two_paths(setup: AuditSetup, path: Path) -> Answer:
    """Two paths to one tool pose from the start. Raises: ControllerError."""
    a, b = path.halves()
    fresh = largest(setup.run(a).q[-1] - setup.run(b).q[-1])
    finer = largest(setup.run(a, dt=setup.dt / 2).q[-1] - setup.run(b, dt=setup.dt / 2).q[-1])
    metrics = {"apart": fresh, "of_the_step": 2 * abs(fresh - finer)}
    same = fresh <= setup.tolerance + metrics["of_the_step"]
    return f"{'the same' if same else 'not the same'} joints by two paths to one pose: {fresh:.2g} apart", metrics


def ask_speed(setup: AuditSetup, path: Path) -> Answer:
    """The same half loop at half and at twice the speed; the step is scaled along, so its error is not counted.
    Raises: ControllerError."""
    half = path.part(0.0, 0.5)
    ends = [setup.run(half.at_speed(path.speed * k, path.angular_speed * k)).q[-1] for k in (0.5, 1.0, 2.0)]
    scaled = setup.run(half.at_speed(path.speed * 2, path.angular_speed * 2), dt=setup.dt / 2).q[-1]
    apart = max(largest(ends[0] - ends[1]), largest(ends[2] - ends[1]))
    step = 2 * largest(ends[2] - scaled)
    same = apart <= setup.tolerance + step
    metrics = {"apart": apart, "of_the_step": step}
    verdict = f"the joints {'do not depend' if same else 'depend'} on the speed"
    ends = f"at half and at twice the speed they end at most {apart:.2g} from where they end at the normal speed"
    return f"{verdict}: {ends}", metrics


def ask_start(setup: AuditSetup, path: Path) -> Answer:
    """From another posture with the same tool pose: does the difference stay, or does the law forget it?
    Raises: ControllerError."""
    if setup.task.n - setup.task.m != 1:
        return "not asked: only the self-motions of one redundant joint are curves", {}
    curve = self_motion_curve(
        setup.task, setup.q0, step=0.02, length=0.1, limits=bool(setup.task.robot.within(setup.q0))
    )
    other = curve.q[int(np.argmax(np.abs(curve.s)))]
    before = largest(other - setup.q0)
    ends = [setup.run(path, q, cycles=setup.cycles).q[-1] for q in (setup.q0, other)]
    after = largest(ends[1] - ends[0])
    metrics = {"before": before, "after": after}
    verdict = "forgets" if after < 0.5 * before else "keeps"
    two = f"two runs, from different postures, are {before:.2g} apart at first and {after:.2g} apart"
    return f"{verdict} its start: {two} after {setup.cycles} cycles", metrics


def ask_small_loops(setup: AuditSetup, plane: tuple[int, int] | None) -> Answer:
    """Is the law of the form dq = G(q) x'? Then small loops drift back if reversed, and alike at half the speed.

    And does it go as well by fine stairs as straight, as it does where dq is linear in x'? Then a loop drifts by
    area times curvature: as the size squared where that is alike all over the loop, else as it may.
    Raises: ControllerError, SingularityError."""
    if plane is None:
        return "not asked: a task of one row has no plane to loop in", {}
    # Two sizes of the loop; the smaller one that drifts well is gone round backward and slowly, too.
    name = plane_name(setup.task, *plane)
    (big, shared), (small, _) = (_loop_drift(setup, plane, scale) for scale in (SMALL, SMALL / 2))
    larger = largest(small) < LEAST_SMALL * largest(big)  # then the small one is next to its own round-off and step
    scale, forward = (SMALL, big) if larger else (SMALL / 2, small)
    back, _ = _loop_drift(setup, plane, scale, backward=True)
    slow, _ = _loop_drift(setup, plane, scale, seconds=8.0)
    size = max(largest(forward), 1e-15)
    a, b = sides(setup.task, *plane, scale)
    metrics = {"ratio": largest(big) / max(largest(small), 1e-15), "drift_per_area": size / (a * b)}
    metrics |= {"turned": largest(forward + back) / size, "hurried": largest(forward - slow) / size}
    metrics["drift"] = 0.0 if largest(big) <= max(NO_DRIFT, 0.1 * shared) else largest(big)
    if not metrics["drift"]:
        return f"none drifts in {name}: {largest(big):.1e} at the most", metrics
    facts = (
        f"in {name}: a loop of twice the size drifts {metrics['ratio']:.2f} times as far; the drift forward plus "
        f"the drift backward is {metrics['turned']:.0%} of the drift forward; half the speed changes the drift by "
        f"{metrics['hurried']:.0%}"
    )
    # Stairs instead of straight lines are tried only where both are as dq = G(q) x' has them.
    if metrics["turned"] < TURNED and metrics["hurried"] < HURRIED:
        metrics["stairs"] = _stairs_gap(setup, plane, scale) / size
        change = f"change it by {metrics['stairs']:.0%}"
        facts += f", many small steps, each along one task row, instead of straight lines {change}"
    if not metrics.get("stairs", np.inf) < BENT:
        form = "With this form, (1) a loop of twice the size drifts about 4 times as far where the curvature is about "
        form += "constant, (2) the drifts forward and backward cancel, (3) another speed gives the same drift, (4) "
        form += "many small steps, each along one task row, lead to the same joints as straight lines"
        return f"not of the form dq = G(q) x', because the drifts do not fit it ({facts}). {form}", metrics
    per = f"{metrics['drift_per_area']:.3g} per {_area_unit(setup.task, *plane)}"
    curved = ""
    if metrics["ratio"] >= AREA[1]:
        curved = " with a curvature that rises from about 0 at the start"
    elif metrics["ratio"] <= AREA[0]:
        curved = " with a curvature that changes within the loops"
    return f"drift by the area of the loop{curved} ({facts}), as every law dq = G(q) x' does: {per}", metrics


def _stairs_gap(setup: AuditSetup, plane: tuple[int, int], scale: float) -> float:
    """How far joints by ever finer stairs end from those by the straight line, less the area between, which falls."""
    ends = []
    for stairs in (0, STAIRS, 2 * STAIRS):
        # From a corner of `plane_loop` to the opposite one: in so many stairs along the two rows, straight for none.
        a, b = _steps(setup.task, setup.tool[:3, 3], setup.tool[:3, :3], plane, scale)
        steps = np.tile([a, b], (stairs, 1)) / stairs if stairs else np.array([a + b])
        corners = setup.tool[:3, 3] + np.vstack([np.zeros(3), np.cumsum(steps[:, :3], axis=0)])
        path = _lasting(polyline(list(corners), turns=list(steps[:, 3:])), 4.0)
        q, finer = (setup.run(path, dt=dt).q[-1] for dt in (setup.dt, setup.dt / 2))
        ends.append(2 * finer - q)
    straight, coarse, fine = ends
    return largest(2 * fine - coarse - straight)


def _loop_drift(
    setup: AuditSetup, plane: tuple[int, int], scale: float, *, backward: bool = False, seconds: float = 4.0
) -> tuple[Vector, float]:
    """(drift (n,) of a small loop without the share of the step, that share)."""
    loop = setup.loop(plane, scale)
    loop = _lasting(loop.reversed() if backward else loop, seconds)
    d, finer = (setup.run(loop, dt=dt).drift()[0] for dt in (setup.dt, setup.dt / 2))
    return 2 * finer - d, largest(finer - d)  # the step's share falls with the step


def _lasting(path: Path, seconds: float) -> Path:
    """The same path in so many seconds."""
    times = path.duration / seconds
    return path.at_speed(path.speed * times, path.angular_speed * times)


def widest(setup: AuditSetup, planes: Sequence[PlaneDrift]) -> tuple[int, int] | None:
    """The plane for small loops: that which drifts most, else that in which the loops enclose most area."""
    worst = worst_plane(planes) or max((p for p in planes if p.tested), key=lambda p: p.size, default=None)
    every = pairs(setup.task.m)
    return worst.plane if worst is not None else every[0] if every else None
