"""The equation of a leaf over a family of tool poses, E(q, y) = [f(q) - x(y); g(q) - c] = 0, and its enclosures.

The rows of an orientation are polynomials of rotations, so that no logarithm is enclosed: with M = R_d R^T they are the
skew part of M, 1/2 (M_32 - M_23, M_13 - M_31, M_21 - M_12), which vanishes where R = R_d, and where R is R_d turned by
pi, which `facing` > 0 excludes; of an axis the two components of R a across R_d a. At a root D_q E is [J; J_g], its
orientation rows up to sign and the coordinates of the orientation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial
from typing import Any, ClassVar

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Array, Flags, Matrix, Value, Vector, kept
from ..strategies import HolonomicStrategy
from ..strategies.tasks.frame_task import AxisDirection, FrameTask, free_directions, parts_of
from ..strategies.tasks.task import Task
from ..symbolic import SX, cos, jacobian, sin, substitute, sumsqr, symbol, vertcat
from ..symbolic.expression import Separated
from ..symbolic.interval_function import IntervalFunction, operation_list
from ..symbolic.rotations import frame_about, one_formula, skew

# --- Families of tool poses x(u), u = u0 + h y, y in [-1, 1]^d: a stretch of a path, d = 1, or a box, d = 3 or 6.
#
# They are expressions of the `dimension` parameters y and of some `numbers`, u0 and h the last of them, so that one
# expression serves all cells of a proof. Where the tool turns in it, a family is `turning`. Two cells with a value of u
# in common have that pose in common, exactly.


TERMS = 22
"""Terms of the series of exp(phi): for |phi| <= 2 pi what is left out is below 1e-19."""


@dataclass(frozen=True)
class Stretch(Value):
    """A stretch of a `Segment` of a path: u is the share of it.

    p = centre + cos(a u) x + sin(a u) y + u b + u^2 c + u^3 d. An even turn is R = (1 + sin(t u) [k]x + (1 - cos(t u))
    [k]x^2) R0; where it is `curved`, R = (1 + S(|w|^2) [w]x + C(|w|^2) [w]x^2) R0, w(u) a cubic, with the series
    S(z) = sum_k (-z)^k / (2k + 1)! and C(z) = sum_k (-z)^k / (2k + 2)!, their coefficients rounded to doubles: at most
    1e-14 from exp([w]x) for |w| <= 2 pi.
    """

    turning: bool
    curved: bool = False

    @property
    def numbers(self) -> int:
        """Those of `of`, u0 and h."""
        return 42 if self.curved else 34

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The tool's pose."""
        center, x, across, angle = numbers[0:3], numbers[3:6], numbers[6:9], numbers[9]
        along, turn, R = numbers[10:19], numbers[19:-11], numbers[-11:-2].reshape((3, 3)).T
        u = numbers[-2] + numbers[-1] * y
        cubic = u * (along[0:3] + u * (along[3:6] + u * along[6:9]))
        position = center + cos(angle * u) * x + sin(angle * u) * across + cubic
        if self.curved:
            w = turn[0:3] + u * (turn[3:6] + u * (turn[6:9] + u * turn[9:12]))
            z, K = sumsqr(w), skew(w)
            S = C = SX(0)
            for k in reversed(range(TERMS)):
                S, C = S * z + (-1) ** k / factorial(2 * k + 1), C * z + (-1) ** k / factorial(2 * k + 2)
            R = (SX.eye(3) + S * K + C * (K @ K)) @ R
        elif self.turning:
            K = skew(turn[0:3])
            R = (SX.eye(3) + sin(turn[3] * u) * K + (1 - cos(turn[3] * u)) * (K @ K)) @ R
        return position, R

    def of(self, row: Vector) -> Vector:
        """The numbers of a row of `Path.table`, but for u0 and h. The path that is meant is the one with these doubles.

        Raises:
            ArgumentError: a curved turn of more than a whole turn.
        """
        turning = row[19:31].reshape(4, 3)
        if self.curved:
            bezier = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])
            # the control points: over [0, 1] a cubic lies between them
            largest = float(np.linalg.norm(bezier @ turning, axis=1).max())
            if largest > 2 * np.pi:
                cure = "give more waypoints, so that no piece turns the tool by more than a whole turn"
                raise ArgumentError("the turn of a piece of the path", largest, cure)
            return row[:40]
        size = float(np.linalg.norm(turning[1]))
        axis = turning[1] / size if size > 0 else np.array([0.0, 0.0, 1.0])
        return np.concatenate([row[:19], axis, [size], row[31:40]])


@dataclass(frozen=True)
class Stretches(Value):
    """Stretches of several frames' paths, run through together: one share u for all. `members`: of each frame.

    Their numbers follow each other; u0 and h are the last ones. Positions and rotations stand one below the other.
    """

    turning: bool
    members: tuple[Stretch, ...]
    dimension: ClassVar = 1

    @property
    def numbers(self) -> int:
        """Those of all frames, u0 and h."""
        return 2 + sum(member.numbers - 2 for member in self.members)

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The poses of the tools, (3F,) and (3F, 3)."""
        poses, first = [], 0
        for member in self.members:
            last = first + member.numbers - 2
            poses.append(member.pose(y, vertcat(numbers[first:last], numbers[-2:])))
            first = last
        positions, rotations = zip(*poses, strict=True)
        return vertcat(*positions), vertcat(*rotations)

    def of(self, rows: Matrix) -> Vector:
        """The numbers of a row of `Path.table` of each frame (F, .), but for u0 and h. Raises: as `Stretch.of`."""
        return np.concatenate([member.of(row) for member, row in zip(self.members, rows, strict=True)])

    @staticmethod
    def along(tables: Array) -> Stretches:
        """Of the tables of `Path.table` of F frames (F, pieces, .)."""
        members = []
        for rows in tables:
            curved = bool(rows[:, [19, 20, 21, *range(25, 31)]].any())
            members.append(Stretch(bool(rows[:, 19:31].any()), curved))
        return Stretches(any(member.turning for member in members), tuple(members))


@dataclass(frozen=True)
class PoseBox(Value):
    """A box of poses: p = p0 + P u with the half sides P, R = R0 C(w) with w = W u the Cayley parameters of a turn.

    C(w) = ((4 - |w|^2) 1 + 4 [w]x + 2 w w^T) / (4 + |w|^2) turns by 2 atan(|w| / 2) about w, in the tool's frame. The
    first three parameters are the position's, the others, where there are any, the turn's.
    """

    turning: bool

    @property
    def dimension(self) -> int:
        """3, or 6 with turns."""
        return 6 if self.turning else 3

    @property
    def numbers(self) -> int:
        """p0 (3), R0 (9), half sides (d); u0 (d), h (d)."""
        return 12 + 3 * self.dimension

    def pose(self, y: SX, numbers: SX) -> tuple[SX, SX]:
        """The tool's pose."""
        d = self.dimension
        p0, R0, sides = numbers[0:3], numbers[3:12].reshape((3, 3)).T, numbers[12 : 12 + d]
        u = numbers[12 + d : 12 + 2 * d] + numbers[12 + 2 * d :] * y
        position = p0 + sides[:3] * u[:3]
        if not self.turning:
            return position, R0
        w = sides[3:] * u[3:]
        size = sumsqr(w)
        return position, R0 @ (((4 - size) * SX.eye(3) + 4 * skew(w) + 2 * w @ w.T) / (4 + size))


# --- The rows f(q) - x of a task and what of the tool pose enters them, without a logarithm; and turns left free.


def _parts(task: Task) -> list[tuple[int, FrameTask]]:
    """(f, the task of frame f) of a task of one frame or more, those of which it has rows.

    Raises: ArgumentError of another kind of task.
    """
    tasks = []
    for f, part in enumerate(parts_of(task)):
        rows = tuple(row % 6 for row in task.rows if row // 6 == f)
        if rows:
            tasks.append((f, part if rows == part.rows else replace(part, rows=rows)))
    if not tasks:
        raise ArgumentError("the task to certify", task.name, "give a task of frames: hk.pose, hk.position, hk.stacked")
    return tasks


def rows_of(task: Task, position: SX, rotation: SX, p: SX, R: SX) -> tuple[SX, SX]:
    """(f(q) - x (m,), what must be positive so that no half turn is taken for none, a number for each part).

    Args:
        position, rotation: (3F,), (3F, 3) of the frames. p, R: wanted of them.
    """
    rows: dict[int, SX] = {}
    facing = []
    for f, part in _parts(task):
        place = slice(3 * f, 3 * f + 3)
        values, ahead = _part(part, position[place], rotation[place, :], p[place], R[place, :])
        rows |= {6 * f + row: values[i] for i, row in enumerate(part.rows)}
        facing.append(ahead)
    return vertcat(*(rows[row] for row in task.rows)), vertcat(*facing)


def _by_twist(task: FrameTask) -> bool:
    """Whether its angular rows are those of a twist: of a full orientation, or the one of a plane."""
    return task._turns or (task._geometric and any(task._angular))


def _part(task: FrameTask, position: SX, rotation: SX, p: SX, R: SX) -> tuple[SX, SX]:
    six = [position[i] - p[i] for i in range(3)]
    facing = SX(1)
    kind = task.representation
    if _by_twist(task):
        M = R @ rotation.T
        six += [(M[1, 2] - M[2, 1]) / 2, (M[2, 0] - M[0, 2]) / 2, (M[0, 1] - M[1, 0]) / 2]
        facing = M[0, 0] + M[1, 1] + M[2, 2] + 1
    elif isinstance(kind, AxisDirection) and sum(i > 2 for i in task.rows) == 2:
        a = SX(kind.axis)
        across = (R @ SX(frame_about(kind.axis)))[:, :2].T @ (rotation @ a)
        six += [across[0], across[1]]
        facing = (R @ a).T @ (rotation @ a)
    elif task.orientation is not None:
        gap = kind.value(rotation) - kind.value(R)
        six += [gap[i] for i in range(gap.shape[0])]
    return vertcat(*(six[i] for i in task.rows)), facing


def _target_of(task: Task, p: SX, R: SX) -> SX:
    """What of the poses enters E; of a turn R itself, whose change bounds that of its rows twice over."""
    target = []
    for f, part in _parts(task):
        place = slice(3 * f, 3 * f + 3)
        target.append(p[place])
        if _by_twist(part) or isinstance(part.representation, AxisDirection):
            target.append(R[place, :].reshape((9, 1)))
        elif part.orientation is not None:
            target.append(part.representation.value(R[place, :]))
    return vertcat(*target)


def _reached_by(task: Task, p: SX, R: SX) -> SX:
    """What two tool poses have in common where E is the same: the rows of the task, a turn as R, an axis as R a."""
    rows = []
    for f, part in _parts(task):
        turn, kind = R[3 * f : 3 * f + 3, :], part.representation
        rows += [p[3 * f + row] for row in part.rows if row < 3]
        if _by_twist(part):
            rows.append(turn.reshape((9, 1)))
        elif isinstance(kind, AxisDirection) and any(row > 2 for row in part.rows):
            rows.append(turn @ SX(kind.axis))
        elif part.orientation is not None:
            value = kind.value(turn)
            rows += [value[row - 3] for row in part.rows if row > 2]
    return vertcat(*rows)


def spins_freely(task: Task, R: Matrix) -> bool:
    """Whether turns about the tool's z axis at the middle of a box, whose rotation is R (3, 3), are free."""
    direction = free_directions(task)[0]
    if direction is None:
        return False
    axis, of_base = direction
    return float(np.abs((R.T @ axis if of_base else axis)[:2]).max()) < 1e-9  # round-off


def deepest(turn: Matrix, axis: Vector, of_base: bool, half: Vector) -> Matrix:
    """Of turns (k, 4), as quaternions x, y, z, s, then or first turned freely about an axis (3,), those with the least
    of the largest |w_i| / half_i, w the Cayley parameters.

    A free turn by 2 atan(t) leads to a + t b, and 2 w_i = (a_i + t b_i) / (a_s + t b_s): where two of the ratios are
    as large, or one is 0, t solves a linear equation.
    """
    from scipy.spatial.transform import Rotation

    free, turns = Rotation.from_quat([*axis, 0.0]), Rotation.from_quat(turn)
    a, b = turns.as_quat(), (free * turns if of_base else turns * free).as_quat()
    size = np.maximum(half, 1e-12)
    A, B = a[:, :3] / size, b[:, :3] / size
    pairs = [(i, j, sign) for i in range(3) for j in range(i, 3) for sign in ((1.0,) if i == j else (1.0, -1.0))]
    best, least = turn, np.full(len(turn), np.inf)
    for i, j, sign in pairs:
        over, under = A[:, i] + sign * (A[:, j] if i != j else 0.0), B[:, i] + sign * (B[:, j] if i != j else 0.0)
        length = np.hypot(over, under)
        c, s = (np.where(length > 0, x / np.where(length > 0, length, 1.0), y) for x, y in ((under, 1.0), (-over, 0.0)))
        candidate = c[:, None] * a + s[:, None] * b
        candidate *= np.where(candidate[:, 3:] < 0, -1.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(candidate[:, :3] / size).max(axis=1) / candidate[:, 3]
        better = ratio < least
        best, least = np.where(better[:, None], candidate, best), np.where(better, ratio, least)
    return best


Family = Stretches | PoseBox

ROOM = 6_000_000
"""Numbers of intervals that may be in memory at once: 100 MB."""


@dataclass(frozen=True, eq=False)
class Equation(Value):
    """E(q, y) (n,) of a holonomic strategy on the leaf c (r,), over a family of tool poses.

    Where its constraint is `implicit`, q holds the joints and then its unknowns, and E their equations at the end.
    Each enclosure below takes its arguments one below the other, in the order named.
    """

    strategy: HolonomicStrategy
    family: Family

    @property
    def joints(self) -> int:
        """Joints: the first of the unknowns."""
        return self.strategy.task.n

    @cached_property
    def n(self) -> int:
        """Unknowns, and rows."""
        implicit = self.strategy.constraint.implicit
        return self.joints + (implicit.size(self.strategy.task) if implicit else 0)

    @cached_property
    def at_once(self) -> int:
        """Cells whose second derivatives are enclosed at once, in `ROOM`."""
        return max(1, ROOM // (self.curvature.operations + 4 * self.n**3))

    @property
    def d(self) -> int:
        """Parameters of the family."""
        return self.family.dimension

    def completed(self, q: Matrix) -> Matrix:
        """All unknowns (k, n) at postures (k, joints)."""
        implicit, task = self.strategy.constraint.implicit, self.strategy.task
        if implicit is None or not len(q):
            return q
        return np.hstack([q, [implicit.at(task, posture) for posture in q]])

    @cached_property
    def _symbols(self) -> tuple[dict[str, SX], SX, SX]:
        """(inputs, E, facing)."""
        e, task, constraint = self.strategy.expressions, self.strategy.task, self.strategy.constraint
        y, numbers, c = symbol("y", self.d), symbol("numbers", self.family.numbers), symbol("c", constraint.rows)
        k, others = e.kinematics, symbol("others", self.n - self.joints)
        rows, facing = rows_of(task, k.position, k.rotation, *self.family.pose(y, numbers))
        with one_formula():
            if constraint.implicit is None:
                g, h = constraint.bind(task, k, e.q), SX(0, 1)
            else:
                g, h = constraint.implicit.rows(task, k, e.q, others)
        inputs = {"q": vertcat(e.q, others), "y": y, "numbers": numbers, "c": c}
        return inputs, vertcat(rows, g - c, h), facing

    @cached_property
    def positive(self) -> int:
        """How many numbers `facing` has, one a frame."""
        return self._symbols[2].shape[0]

    @cached_property
    def operations(self) -> list[list[Any]]:
        """E and `facing`, of (q, y, numbers, c), as a list of operations."""
        inputs, E, facing = self._symbols
        return operation_list(inputs, vertcat(E, facing))

    @kept
    def periodic(self, turns: tuple[float, ...]) -> bool:
        """Whether E stays as it is, but for whole turns of its angles, when the joints go on by whole turns (n,).

        By the list of operations: each value is followed by what it goes on by, in turns, where that is known.
        """
        shifts: list[float | None] = []
        known: dict[int, float] = {}
        rows: list[float | None] = []
        for name, *of in self.operations:
            given = [shifts[i] for i in of] if name not in ("const", "input") else []
            shift: float | None = None
            if name == "input":
                shift = float(turns[of[0]]) if of[0] < self.joints else 0.0
            elif name == "const":
                known[len(shifts)], shift = of[0], 0.0
            elif name == "output":
                rows.append(given[0])
                continue
            elif not any(s != 0 for s in given) or (name in ("sin", "cos") and given[0] and given[0] % 1 == 0):
                shift = 0.0
            elif None not in given and name in ("add", "sub", "neg", "twice"):
                a, b = (float(s or 0.0) for s in (given[0], given[-1]))
                shift = {"add": a + b, "sub": a - b, "neg": -a, "twice": 2 * a}[name]
            elif None not in given and name == "mul" and any(i in known for i in of):
                factor, i = (of[0], 1) if of[0] in known else (of[1], 0)
                shift = known[factor] * float(given[i] or 0.0) if known[factor] % 1 == 0 else None
            shifts.append(shift)
        angular = [*self.angular, *[False] * self.positive]
        return all(s == 0 or (a and s is not None and s % 1 == 0) for s, a in zip(rows, angular, strict=True))

    @property
    def angular(self) -> tuple[bool, ...]:
        """(n,) which rows of E count but for whole turns."""
        task, constraint = self.strategy.task, self.strategy.constraint
        return (False,) * task.m + tuple(constraint.angular) + (False,) * (self.n - self.joints)

    @property
    def derivative(self) -> str:
        """What D_q E is, in words of the theorem: with auxiliary unknowns among q it is not [J; J_g]."""
        return "D_q E" if self.n > self.joints else "[J; J_g]"

    @cached_property
    def revolute(self) -> Flags:
        """(n,) which unknowns are angles of joints."""
        units = [c.unit for c in self.strategy.task.robot.coordinates]
        return np.array([unit == "rad" for unit in units] + [False] * (self.n - self.joints))

    @cached_property
    def _separated(self) -> Separated:
        """E and `facing`, for derivatives that are exact."""
        inputs, E, facing = self._symbols
        return Separated.of(inputs, vertcat(E, facing), [*self.angular, *[False] * self.positive])

    def _enclosed(self, name: str, inputs: dict[str, SX], output: SX) -> IntervalFunction:
        return IntervalFunction(name, inputs, output, (self._separated.symbols, self._separated.values))

    @cached_property
    def guards(self) -> int:
        """How many expressions must not vanish, for E to be smooth."""
        return self._separated.guards.shape[0]

    @cached_property
    def value(self) -> IntervalFunction:
        """(q, y, numbers, c) -> E, and D_q E column by column."""
        inputs, E = self._symbols[0], self._separated.output[: self.n]
        A = jacobian(E, inputs["q"])
        return self._enclosed("E", inputs, vertcat(E, A.reshape((-1, 1))))

    @cached_property
    def curvature(self) -> IntervalFunction:
        """(q, y, numbers, c) -> facing, the guards, columns (j, k), j <= k, of D_q^2 E.

        Where the tool turns the columns of D_y D_q E follow.
        """
        inputs, both = self._symbols[0], self._separated
        E, facing = both.output[: self.n], both.output[self.n :]
        q, y = inputs["q"], inputs["y"]
        A = jacobian(E, q)
        outputs = [facing, both.guards]
        outputs += [jacobian(A[:, j], q)[:, j:].reshape((-1, 1)) for j in range(self.n)]
        if self.family.turning:
            outputs += [jacobian(A[:, j], y).reshape((-1, 1)) for j in range(self.n)]
        return self._enclosed("the second derivatives of E", inputs, vertcat(*outputs))

    @cached_property
    def along(self) -> IntervalFunction:
        """(y, q0, V, Q, numbers, c) -> first derivatives by y of E(q0 + V y + 1/2 Q y y, y), and second ones, i <= j.

        V (n, d) and Q (n, d (d + 1) / 2), of the pairs i <= j, column by column.
        """
        inputs, E = self._symbols[0], self._separated.output[: self.n]
        n, d = self.n, self.d
        y, q0, V = inputs["y"], symbol("q0", n), symbol("V", n, d)
        Q = symbol("Q", n, d * (d + 1) // 2)
        way = q0 + V @ y
        pairs = [(i, j) for i in range(d) for j in range(i, d)]
        for k, (i, j) in enumerate(pairs):
            way += Q[:, k] * y[i] * y[j] * (0.5 if i == j else 1.0)
        F = substitute(E, inputs["q"], way)
        first = jacobian(F, y)
        second = [jacobian(first[:, i], y)[:, i:].reshape((-1, 1)) for i in range(d)]
        needed = {"y": y, "q0": q0, "V": V, "Q": Q, "numbers": inputs["numbers"], "c": inputs["c"]}
        return self._enclosed("E along the predictor", needed, vertcat(first.reshape((-1, 1)), *second))

    @cached_property
    def seam(self) -> IntervalFunction:
        """(numbers, others) -> by what E changes from the end of one member to the beginning of another."""
        inputs = {name: symbol(name, self.family.numbers) for name in ("numbers", "others")}
        end, begin = (self.family.pose(SX([y]), inputs[name]) for name, y in (("numbers", 1.0), ("others", -1.0)))
        change = _target_of(self.strategy.task, *end) - _target_of(self.strategy.task, *begin)
        return IntervalFunction("the poses at a seam", inputs, change)

    @cached_property
    def reached(self) -> IntervalFunction:
        """(y, numbers) -> the rows of the tool pose: E is the same where they are."""
        y, numbers = symbol("y", self.d), symbol("numbers", self.family.numbers)
        pose = _reached_by(self.strategy.task, *self.family.pose(y, numbers))
        return IntervalFunction("the tool pose", {"y": y, "numbers": numbers}, pose)


@kept
def equation_of(strategy: HolonomicStrategy, family: Family) -> Equation:
    """The equation of a strategy over a family, made once."""
    return Equation(strategy, family)
