"""Stretches of a path along a leaf that are shown to keep to its branch: tubes about curves, for native code.

The path of the tool and of the level is even: its rate xi is constant, in the task's geometric rows. Along it the
joints obey A(q) q' = xi, A = [J; J_g]. A stretch follows them from its middle c, at which Y = A^-1, by

    P(t) = c + t v + t^2 w + t^3 z,   |t| <= 1,   v = h Y xi,   w = -Y DA[v] v / 2,
    z = -Y (D^2 A[v, v] v / 2 + DA[w] v + 2 DA[v] w) / 3

(h: half its share of the way), and Taylor models enclose A over all q = P(t) + e, |e_i| <= radius:

    Y A(q) = 1 + t X1 + t^2 X2 + S,   (1 - t X1) Y A(q) = 1 + t^2 (X2 - X1^2) - t^3 X1 X2 + (1 - t X1) S.

With K a bound of what differs from 1 there, and eta one of (1 - t X1) Y E on the curve, in the largest joint:
eta + K radius <= radius, K < 1. By the contraction principle [Deu04, section 2.1] each pose of the stretch then has
one posture on the level within `radius` of the curve, it lies within eta / (1 - K), A is regular there, and so it moves
continuously. Stretches follow one another where one's posture lies within the other's radius.
"""

from __future__ import annotations

from ...base.errors import NativeError
from ...base.types import ROTATION, kept
from ...strategies import HolonomicStrategy
from ...strategies.tasks.frames import poses_expression
from ...strategies.tasks.free_motion import completing, leaves_free
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, TaylorModel, directional, horzcat, symbol, vertcat
from .branch import branch_code
from .leaf import REGULAR, leaf_rules
from .rays import rays_code

SLENDER = 0.02
"""Radius of a stretch over the largest joint's motion in half of it, to begin with and at most: then it is such that
what the curve misses and what A changes off it take as much room."""

SLENDEREST = 0.004
"""The same, at least: the middles of thinner ones take more Newton steps."""

CENTRED = 0.25
"""Newton correction in the middle of a stretch that may be left, over its radius."""

FULL = 0.98
"""Room that a stretch may take: below 1, for round-off."""

FIRST = 0.12
"""Largest joint's motion [joint unit] in half of the first stretch that is tried."""

SHORTEST = 2e-4
"""The same for the last one that is tried, before the pieces of `follow` take over: they get closer to a fold."""

WIDEST = 0.1
"""Half the width [joint unit] of a region about a posture that is tried for short ways, some steps of a loop."""

ALIKE = 0.4
"""Largest |1 - Y A| in a region: a way may be 1.4 / 0.6 times as long in it as Newton's first correction."""

WIDER = 1.3
"""How much wider than the last region the next one may be tried."""

AHEAD = 0.7
"""Share of its radius by which the middle of a region lies ahead of the posture for which it is made."""

STRETCHES = 2_000
"""Stretches of one way tried at most, before the pieces of `follow` take over."""

SHORT = 2_000
"""Operations of the extended Jacobian up to which it has Taylor models. Those of longer ones are so wide that stretches
are no longer than the pieces of `follow`, and take longer: that of `stationary` has 2,200 to 2,700. With Taylor
models, a law of a planar arm with 1,273 operations answers 100 times as fast as without."""

PIECES = 1_000
"""Pieces of `follow` that native code tries at most after the stretches, which end within some 1e-4 rad of a fold:
inverse kinematics is asked in loops, where no answer is better than a late one."""


@kept
def node(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, c) -> (Newton correction, rcond, margin, sign of det, A^-1) of the extended Jacobian A."""
    e, task = strategy.expressions, strategy.task
    (p, R), c, one = task.target_symbols(), symbol("c", task.n - task.m), SX.eye(task.n)
    found = e.rate(
        horzcat(task.error_expression(e.kinematics, p, R), one[: task.m, :]),
        horzcat(strategy.leaf_gap(c), one[task.m :, :]),
    )
    outputs = {
        "dq": found.X[:, 0], "rcond": found.rcond, "margin": strategy.margin_expression, "side": found.orientation,
        "inverse": found.X[:, 1:],
    }  # fmt: skip
    return Function("node", {"q": e.q, "p": p, "R": R, "c": c}, outputs, found.system)


@kept
def along(strategy: HolonomicStrategy) -> TaylorModel | None:
    """The Taylor models of the extended Jacobian; None where there are none, or its angular rows are not geometric."""
    e = strategy.expressions
    if not strategy.task.geometric or strategy.looped is not strategy:  # a loop has no Taylor models
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
    s, task, models = strategy, strategy.task, along(strategy)
    r = task.n - task.m
    rules = leaf_rules(1.0) if models is None else leaf_rules(1.0, PIECES)
    numbers = {
        "R": r, "FULL": FULL, "FIRST": FIRST, "SHORTEST": SHORTEST, "WIDEST": WIDEST, "ALIKE": ALIKE, "AHEAD": AHEAD,
        "WIDER": WIDER,
        "SLENDER": SLENDER, "SLENDEREST": SLENDEREST, "CENTRED": CENTRED, "ROTATION": ROTATION, "REGULAR": REGULAR,
        "RULES": f"{{{', '.join(repr(getattr(rules, key)) for key, *_ in rules._fields_)}}}",
    }  # fmt: skip
    if models is not None:
        numbers["STRETCHES"] = STRETCHES
    head = "".join(f"#define HK_{key} {value}\n" for key, value in numbers.items())
    angular = [int(flag) for flag in s.constraint.angular] if r else []
    for name, values in (("rows", list(task.rows)), ("angular", angular)):
        head += f"static const int hk_{name}[] = {{{', '.join(map(str, values or [0]))}}};\n"
    return head + branch_code(s) + rays_code(s) + free_code(task) + _place_code(s)


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


def _place_code(strategy: HolonomicStrategy) -> str:
    """C of the tool's pose and of the constraint, which poses.c needs."""
    e = strategy.expressions
    pose = Function("pose", {"q": e.q}, {"T": poses_expression(e.kinematics)})
    level = "static void hk_constraint_body(const hk_t *q, hk_t *g) { (void)q, (void)g; }\n"
    if strategy.task.n > strategy.task.m:
        level = strategy.constraint_value.c("hk_constraint_body")
    return pose.c("hk_pose_body") + level
