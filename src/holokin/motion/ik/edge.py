"""The edge of reach on a leaf: how far a posture is from a wanted pose and from what it must keep to.

On a leaf the tool pose is a chart: a motion z of the tool, in metres, moves the joints by S z. What is missing to a
pose (p_d, R_d) is

    e = [p_d - p; length log(R_d R^T)]        (m,) [m],

so that |e| falls fastest along z = e, whatever the posture. What must be kept to are constraints c(q) >= 0: a margin to
singular postures and, when asked for, the joint limits. A are their slopes by z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import NativeError
from ...base.types import ROTATION, Flags, Indices, Matrix, Value, Vector, frozen, kept
from ...path.path import StraightPath, rotation_vector
from ...strategies import HolonomicStrategy
from ...strategies.tasks.frame_task import completed, completing, leaves_free
from ...strategies.tasks.task import Task, poses_expression
from ...symbolic import (
    SX,
    Function,
    TaylorModel,
    directional,
    dot,
    gradient,
    horzcat,
    substitute,
    sumsqr,
    symbol,
    vertcat,
)
from .branch import branch_code, on_ray, rays_code, turning
from .leaf import (
    REGULAR,
    LeafPath,
    PathEnd,
    Pose,
    leaf_rules,
    leaf_step,
    leaf_value,
    leaf_walk,
    newton_on_leaf,
    straight_path,
)

# --- Stretches of a path along a leaf that are shown to keep to its branch: tubes about curves, for native code.
#
# The path of the tool and of the level is even: its rate xi is constant, in the task's geometric rows. Along it the
# joints obey A(q) q' = xi, A = [J; J_g]. A stretch follows them from its middle c, at which Y = A^-1, by
#
#     P(t) = c + t v + t^2 w + t^3 z,   |t| <= 1,   v = h Y xi,   w = -Y DA[v] v / 2,
#     z = -Y (D^2 A[v, v] v / 2 + DA[w] v + 2 DA[v] w) / 3
#
# (h: half its share of the way), and Taylor models enclose A over all q = P(t) + e, |e_i| <= radius:
#
#     Y A(q) = 1 + t X1 + t^2 X2 + S,   (1 - t X1) Y A(q) = 1 + t^2 (X2 - X1^2) - t^3 X1 X2 + (1 - t X1) S.
#
# With K a bound of what differs from 1 there, and eta one of (1 - t X1) Y E on the curve, in the largest joint: eta + K
# radius <= radius, K < 1. By the contraction principle [Deu04, section 2.1] each pose of the stretch then has one
# posture on the level within `radius` of the curve, it lies within eta / (1 - K), A is regular there, and so it moves
# continuously. Stretches follow one another where one's posture lies within the other's radius.

NUMBERS = {
    # Radius of a stretch over the largest joint's motion in half of it, to begin with and at most: then it is such that
    # what the curve misses and what A changes off it take as much room; and at least: the middles of thinner ones take
    # more Newton steps.
    "SLENDER": 0.02,
    "SLENDEREST": 0.004,
    "CENTRED": 0.25,  # Newton correction in the middle of a stretch that may be left, over its radius
    "FULL": 0.98,  # room that a stretch may take: below 1, for round-off
    # Largest joint's motion [joint unit] in half of the first stretch that is tried, and of the last one, before the
    # pieces of `follow` take over: they get closer to a fold.
    "FIRST": 0.12,
    "SHORTEST": 2e-4,
    # Half the width [joint unit] of a region about a posture that is tried for short ways, some steps of a loop; how
    # much wider than the last one the next may be; the share of its radius by which its middle lies ahead of the
    # posture for which it is made; the largest |1 - Y A| in it: then a way may be 1.4 / 0.6 times as long in it as
    # Newton's first correction.
    "WIDEST": 0.1,
    "WIDER": 1.3,
    "AHEAD": 0.7,
    "ALIKE": 0.4,
}
"""Of native code."""

SHORT = 2_000
"""Operations of the extended Jacobian up to which it has Taylor models. Those of longer ones are so wide that stretches
are no longer than the pieces of `follow`, and take longer: that of `stationary` has 2,200 to 2,700. With Taylor
models, a strategy of a planar arm with 1,273 operations answers 100 times as fast as without."""

PIECES = 1_000
"""Pieces of `follow` that native code tries at most after the stretches, which end within some 1e-4 rad of a fold:
inverse kinematics is asked in loops, where no answer is better than a late one."""


@kept
def node(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, c) -> (Newton correction, rcond, margin, sign of det, A^-1) of the extended Jacobian A."""
    e, task = strategy.expressions, strategy.task
    (p, R), c, identity = task._target_symbols(), symbol("c", task.n - task.m), SX.eye(task.n)
    solution = e.rate(
        horzcat(task._error_expression(e.kinematics, p, R), identity[: task.m, :]),
        horzcat(strategy.leaf_gap(c), identity[task.m :, :]),
    )
    outputs = {"dq": solution.X[:, 0], "rcond": solution.rcond, "margin": strategy._margin_expression}
    outputs |= {"side": solution.orientation, "inverse": solution.X[:, 1:]}
    return Function("node", {"q": e.q, "p": p, "R": R, "c": c}, outputs, solution.system)


@kept
def along(strategy: HolonomicStrategy) -> TaylorModel | None:
    """The Taylor models of the extended Jacobian; None where there are none, or its angular rows are not geometric."""
    e = strategy.expressions
    if not strategy.task._geometric or strategy.looped is not strategy:  # a loop has no Taylor models
        return None
    try:
        model = TaylorModel("hk_along_body", {"q": e.q}, vertcat(e.J, e.planes))
    except NativeError:
        return None
    return model if model.instructions <= SHORT else None


@kept
def bend(strategy: HolonomicStrategy) -> Function:
    """(q, v) -> DA[v] v, the second derivative of [f; g] along a line."""
    e, v = strategy.expressions, symbol("v", strategy.task.n)
    moved = directional(vertcat(e.J, e.planes) @ v, e.q, v)
    return Function("bend", {"q": e.q, "v": v}, {"bend": moved})


@kept
def twist(strategy: HolonomicStrategy) -> Function:
    """(q, v, w) -> D^2 A[v, v] v / 2 + DA[w] v + 2 DA[v] w, what goes with t^2 in A P', P = q + t v + t^2 w."""
    e, v, w = strategy.expressions, symbol("v", strategy.task.n), symbol("w", strategy.task.n)
    A = vertcat(e.J, e.planes)
    moved = directional(directional(A @ v, e.q, v), e.q, v) / 2
    moved = moved + directional(A @ v, e.q, w) + 2 * directional(A @ w, e.q, v)
    return Function("twist", {"q": e.q, "v": v, "w": w}, {"twist": moved})


def inverse_code(strategy: HolonomicStrategy) -> str:
    """C that inverse.c and what is before it need besides hk_leaf_body: numbers, and the functions of a strategy."""
    # Numbers: how a path is followed, in stretches where there are any, at most 2,000 of one way, then in pieces.
    s, task, e, models = strategy, strategy.task, strategy.expressions, along(strategy)
    r = task.n - task.m
    rules = leaf_rules(1.0) if models is None else leaf_rules(1.0, PIECES)
    numbers = NUMBERS | {"R": r, "ROTATION": ROTATION, "REGULAR": REGULAR}
    numbers["RULES"] = f"{{{', '.join(repr(getattr(rules, key)) for key, *_ in rules._fields_)}}}"
    if models is not None:
        numbers["STRETCHES"] = 2_000
    head = "".join(f"#define HK_{key} {value}\n" for key, value in numbers.items())
    angular = [int(flag) for flag in s.constraint.angular] if r else []
    for name, values in (("rows", list(task.rows)), ("angular", angular)):
        head += f"static const int hk_{name}[] = {{{', '.join(map(str, values or [0]))}}};\n"
    # The tool's pose and the constraint, which poses.c needs.
    pose = Function("pose", {"q": e.q}, {"T": poses_expression(e.kinematics)}).c("hk_pose_body")
    level = "static void hk_constraint_body(const hk_t *q, hk_t *g) { (void)q, (void)g; }\n"
    level = s.constraint_value.c("hk_constraint_body") if r else level
    return head + branch_code(s) + rays_code(s) + free_code(task) + pose + level


def free_code(task: Task) -> str:
    """C that way.c needs of a task that leaves something free; empty of others."""
    return "#define HK_LEAVES_FREE\n" + completing(task).c("hk_completed_body") if leaves_free(task) else ""


def stretch_code(strategy: HolonomicStrategy) -> str:
    """C that stretch.c needs; empty where there are no stretches."""
    models = along(strategy)
    if models is None:
        return ""
    curve = bend(strategy).c("hk_bend_body") + twist(strategy).c("hk_twist_body")
    return models.c + node(strategy).c("hk_node_body") + curve


Goal = Pose
"""A wanted pose of the tool."""

UNMOVED = 1e-9
"""Share of the largest slope of a constraint below which the tool does not move it: round-off, a thousandfold."""

SAME = 1e-7
"""Difference of two postures [joint units] that are the same, found in two ways; branches lie far apart."""

NARROW = 2.0**-16
"""Share of a way below which a glance at it gives up: 0.02 mm of a metre. With 2^-12, 2 % of the ways of arm angles
that lead to their ends were given up, those that pass close by singular postures; with this one, none of 640."""

COARSE = 2.0**-12
"""Share of a way below which a glance that is given up in the end does not move the posture where it got to: a fold is
near there, from which the path down is long."""

LEAP = 0.1
"""Joint motion [joint units] from where a piece of a glance is expected to end to where it does, at most: a larger one
may be a leap to another branch."""

BEGUN = 1e-3
"""Share of a way over which its first rate is taken."""

FEW = 200
"""Pieces of one step of the tool tried at most, after stretches, where there are any. A step is some centimetres long;
where that is not enough, a shorter one is tried."""


@kept
def edge_function(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, length) -> (e, S, rcond^2, its slope, twist, position, rotation).

    e (m,) [m]: what is missing to the pose (p, R); S (n, m): dq = S z; twist (6, m): the tool moves by it [m, rad].
    rcond = m / (|J_l| |S|), of Frobenius norms, J_l the task Jacobian in metres: from 0, singular, to 1; smooth, and
    the same in metres and millimetres. Its slope (n,) is that of log rcond^2 by q.
    """
    e, task = turning(strategy), strategy.task
    geometric = task._geometric_twin
    n, m, k = task.n, task.m, e.kinematics
    p, R, length = symbol("p", 3), symbol("R", 3, 3), symbol("length", 1)
    scale = vertcat(*(length if angular else SX(1) for angular in task._angular))
    identity = SX.eye(n)
    solution = e.rate(identity[:m, :], identity[m:, :])
    Y = solution.X / (SX.ones(n, 1) @ vertcat(scale, SX.ones(n - m, 1)).T)  # the inverse of the extended Jacobian A
    S, J = Y[:, :m], e.J * (scale @ SX.ones(1, n))
    large, fast = sumsqr(J), sumsqr(S)
    # d |S|^2 = -2 <Y^T S S^T, dA>: no solve is differentiated
    weights = 2 * (Y.T @ (S @ S.T)) / fast
    weights[:m, :] = weights[:m, :] - 2 * J / large
    held = symbol("weights", n, n)
    slope = gradient(dot(held, vertcat(J, e.planes)), e.q)
    outputs = {
        "e": geometric._error_expression(k, p, R) * scale,
        "S": S,
        "rcond2": m * m / (large * fast),
        "slope": substitute(slope, held, weights).T,
        "twist": k.jacobian @ S,
        "p": k.position,
        "R": k.rotation,
    }
    return Function("edge", {"q": e.q, "p": p, "R": R, "length": length}, outputs, solution.system)


@dataclass(frozen=True, eq=False)
class Look:
    """What the edge function says of a posture q on the way to a goal, with the constraints.

    Of k constraints, `which` tells their numbers: 0 is rcond, then all lower limits, then all upper ones. c (k,) [m] is
    how far the tool may move until they hold, A (k, m) their slopes by z, of length 1; sizes (k,) those before.
    """

    q: Vector
    e: Vector
    S: Matrix
    rcond: float
    twist: Matrix
    position: Vector
    rotation: Matrix
    which: Indices
    c: Vector
    A: Matrix
    sizes: Vector

    @property
    def numbers(self) -> tuple[Vector, Vector, Vector, Vector, Vector]:
        """(q, e, rcond, position and rotation, the distance from each constraint), as native code gives them."""
        slack = np.full(2 * len(self.q) + 1, np.inf)
        slack[self.which] = self.c
        return self.q, self.e, np.array([self.rcond]), np.concatenate([self.position, self.rotation.ravel()]), slack

    @property
    def excess(self) -> float:
        """How far outside the constraints q is [m]."""
        return max(0.0, -float(self.c.min(initial=0.0)))

    @property
    def distance(self) -> float:
        """|e| [m]."""
        return float(self.e @ self.e) ** 0.5

    def merit(self, weight: float) -> float:
        """What a step must lessen: |e|^2 / 2, and the excess with a weight."""
        return float(self.e @ self.e) / 2 + weight * self.excess


@dataclass(frozen=True, eq=False)
class Edge(Value):
    """What the tool can reach on the leaf through a start, and how to move there.

    length [m]: what a radian counts; margin: rcond to keep; lower, upper (n,): limits, infinite where there is none.
    """

    strategy: HolonomicStrategy
    q0: Vector
    length: float
    margin: float
    lower: Vector
    upper: Vector

    @cached_property
    def leaf(self) -> Vector:
        """The level g(start) (r,)."""
        return frozen(leaf_value(self.strategy, self.q0))

    @cached_property
    def side(self) -> float:
        """The sign of det [J; J_g] on the branch."""
        return float(leaf_step(self.strategy)(self.q0, *self.tool(self.q0), self.leaf)[3])

    @cached_property
    def tries(self) -> int:
        """Pieces of one step of the tool tried at most; where native code has stretches none of 400 took over 3,000."""
        return FEW if along(self.strategy) is None else 5_000

    @cached_property
    def context(self) -> Vector:
        """All of it in a row, for native code."""
        p, R = self.tool(self.q0)
        parts = self.q0, p, R.ravel(), self.leaf, self.lower, self.upper, [self.side, self.length, self.margin]
        return np.concatenate(parts)

    @cached_property
    def linear(self) -> Flags:
        """Which rows of e are positions (m,)."""
        return ~np.array(self.strategy.task._angular)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What the constraints are called: "rcond", and the joints, for their lower and for their upper limits."""
        return "rcond", *2 * self.strategy.task.robot.joint_names

    @cached_property
    def _bounded(self) -> Flags:
        return np.concatenate([[True], np.isfinite(self.lower), np.isfinite(self.upper)])

    def tool(self, q: Vector) -> Goal:
        """(position, rotation) of the tool."""
        return self.strategy.task._place(q)

    def look(self, q: Vector, goal: Goal, scaled: Look | None = None) -> Look:
        """At a posture; `scaled`: a look whose choice of constraints and whose sizes are kept."""
        e, S, rcond2, slope, twist, p, R = edge_function(self.strategy)(q, *goal, np.array([self.length]))
        S, square = np.reshape(S, (len(q), -1)), float(rcond2) / self.margin**2
        A = np.vstack([square * np.reshape(slope, -1) @ S, S, -S])
        c = np.concatenate([[square - 1], q - self.lower, self.upper - q])
        if scaled is None:
            sizes = np.where(self._bounded, np.linalg.norm(A, axis=1), 0.0)
            which = np.flatnonzero(sizes > UNMOVED * sizes.max(initial=0.0))
            sizes = sizes[which]
        else:
            which, sizes = scaled.which, scaled.sizes
        tool = np.reshape(twist, (6, -1)), p, R
        constraints = which, c[which] / sizes, A[which] / sizes[:, None], sizes
        return Look(q, np.atleast_1d(e), S, float(rcond2) ** 0.5, *tool, *constraints)

    @cached_property
    def ray(self) -> bool:
        """Whether straight paths from the start are rays."""
        return on_ray(self.strategy, self.q0)

    def walk(self, q: Vector, path: LeafPath, tries: int) -> tuple[Vector, bool]:
        """From q along a way, in pieces shown to keep to the branch: how far it got, True where to its end."""
        walk = leaf_walk(self.strategy, q, tries, on_ray(self.strategy, q), folds=True)  # new: it knows where it was
        q, ended = walk(q, path)
        return q, ended is PathEnd.REACHED

    def glance(self, q: Vector, path: LeafPath) -> tuple[Vector, bool]:
        """The same by Newton steps alone: quick, and not shown to keep to the branch."""
        rate, share, width, last = leaf_step(self.strategy)(q, *path.at(BEGUN))[0] / BEGUN, 0.0, 1.0, q
        while width >= NARROW:
            end = min(1.0, share + width)
            begun = q + (end - share) * rate
            posture = self.solved(begun, *path.at(end))
            width = (end - share) / 2
            if posture is None:
                continue
            off = float(np.abs(posture - begun).max())
            width *= min(8.0, max(0.5, (2 * LEAP / max(off, 1e-300)) ** 0.5))  # for a half of the leap, next time
            if off > LEAP:
                continue
            last = posture if end - share >= COARSE else last
            rate, q, share = (posture - q) / (end - share), posture, end
            if end == 1.0:
                return q, True
        return last, False

    def path(self, begin: Goal, v: Vector, turn: Vector, goal: Goal | None) -> LeafPath:
        """From where the tool is along v, turning by `turn`; to a goal to the last bit, where there is one."""
        return self.straight(begin, StraightPath(*begin, v, turn).at(1.0) if goal is None else goal)

    def straight(self, begin: Goal, goal: Goal) -> LeafPath:
        """The straight path of the tool."""
        return straight_path(self.strategy.task, begin, goal, (self.leaf, self.leaf))

    def joined(self, q: Vector, tool: Goal, end: Look) -> bool:
        """True where the straight path of the tool between two postures is shown to lead from one to the other."""
        posture, reached = self.walk(q, self.straight(tool, (end.position, end.rotation)), self.tries)
        return reached and float(np.abs(posture - end.q).max()) <= SAME

    def moved(self, look: Look, z: Vector | None, share: float, goal: Goal, careful: bool) -> Look | None:
        """The look after a share of a motion z of the tool, or, without z, of the straight path to the goal.

        None where that leads nowhere. careful: only where it is shown to keep to the branch.
        """
        if z is None:
            p, R = completed(self.strategy.task, goal, (look.position, look.rotation))
            twist = np.concatenate([p - look.position, rotation_vector(R @ look.rotation.T)])
        else:
            twist = look.twist @ z
        end = goal if z is None and share == 1.0 else None
        path = self.path((look.position, look.rotation), share * twist[:3], share * twist[3:], end)
        if careful:
            q, reached = self.walk(look.q, path, self.tries)
            return self.look(q, goal) if reached else None
        posture = self.solved(look.q + share * (look.S @ (look.e if z is None else z)), *path.at(1.0))
        return None if posture is None else self.look(posture, goal)

    def onto(self, q: Vector, goal: Goal) -> Look | None:
        """The look at the posture of the leaf nearby that has the tool pose of q; None where there is none."""
        posture = self.solved(q, *self.tool(q), self.leaf)
        return None if posture is None else self.look(posture, goal)

    def solved(self, q: Vector, p: Vector, R: Matrix, c: Vector) -> Vector | None:
        """The posture at a tool pose on a leaf to which Newton contracts from q."""
        solution = newton_on_leaf(leaf_step(self.strategy), q, p, R, c, self.side)
        return None if solution is None else solution[0]
