"""[strategies.NAME]: one model a kind. Its fields are the keys of the job file, `build` makes the strategy.

A new kind is one more class here, in `AnyStrategy`: `kind`, its keys, each with a default unless needed, and `build`.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from ... import strategies
from ...analysis.coverage import Coordinates, Polynomial, chart_of
from ...analysis.curvature import ball, ball_postures
from ...base.errors import ArgumentError, BranchError, SingularityError, UnknownNameError, posture_text
from ...base.types import Vector, finite
from ...robot.formats.urdf import parse_toml
from ...strategies import HolonomicStrategy, Strategy, constraints
from ...strategies.constraints import Constraint
from ...strategies.tasks.task import Task
from ...symbolic import Function, symbol
from .tables import (
    Few,
    Formulas,
    Joints,
    Length,
    Number,
    Numbers,
    Positive,
    Table,
    by_kind,
    column,
    filled,
    matrix,
    of_pose,
)

# Runge-Kutta steps of a radial strategy: each lengthens the expressions; beyond these the error is round-off
MOST_RADIAL_STEPS = 100
# degree of a fitted polynomial, and postures that it is fitted to: in 7 variables degree 6 has 1,715 terms
MOST_DEGREE, MOST_FITTED = 6, 10_000
MOST_TERMS = 500  # terms of a designed strategy's polynomial: of degree 4 in six coordinates it has 210


def _rectangular(rows: Any) -> Any:
    if isinstance(rows, list) and len({len(row) for row in rows}) != 1:
        raise ValueError("a matrix needs rows, all of one length; give each row as many entries")
    return rows


FormulaRows = Annotated[list[Formulas], Few, AfterValidator(_rectangular)]
NumberRows = Annotated[list[Numbers], Few, AfterValidator(_rectangular)]
Gain = Annotated[Number | Annotated[list[Numbers], Few], AfterValidator(_rectangular)]
Springs = Positive | Annotated[list[Positive], Few]
Posture = Annotated[list[Length], Few]
Three = Annotated[list[Number], Field(min_length=3, max_length=3)]
Coefficients = Annotated[list[Number], Field(max_length=MOST_TERMS)]


class StrategyTable(Table):
    """What every strategy of a job may have. Formulas name joints by q1, q2, ..., or by the joints' names."""

    method: Literal["velocity", "leaf"] | None = None
    invariant: Formulas = Field(default=[])

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """The strategy of a task, called `name`; `q0` (n,) is the start posture. Raises: HolokinError."""
        raise NotImplementedError  # by `Fitted` alone, which is made of another strategy: `fit`

    def invariants(self, task: Task) -> Function | None:
        """q -> the invariants (k,) that the strategy's joint paths must keep, if the job names any."""
        if not self.invariant:
            return None
        q = symbol("q", task.n)
        return Function("invariant", {"q": q}, {"value": column(self.invariant, task.robot)(q)})


class ConstraintTable(StrategyTable):
    """A strategy that keeps a constraint g(q)."""

    level: Number | Numbers | None = None

    @abstractmethod
    def constraint(self, task: Task) -> Constraint:
        """The constraint. Raises: HolokinError."""

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """The extended Jacobian of the constraint."""
        return strategies.holonomic(task, self.constraint(task), name=name)


class MoorePenrose(StrategyTable):
    """The pseudo-inverse: least joint speed."""

    kind: Literal["moore-penrose"]

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `moore_penrose`."""
        return strategies.moore_penrose(task, name=name)


class Weighted(StrategyTable):
    """Least dq^T weight dq."""

    kind: Literal["weighted"]
    weight: FormulaRows

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `weighted`."""
        return strategies.weighted(task, matrix(self.weight, task.robot), name=name)


class InertiaWeighted(StrategyTable):
    """Least kinetic energy."""

    kind: Literal["inertia-weighted"]

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `inertia_weighted`."""
        return strategies.inertia_weighted(task, name=name)


class Impedance(StrategyTable):
    """The arm on springs, pulled along at its tool."""

    kind: Literal["impedance"]
    preferred: Posture
    stiffness: Springs = 1.0
    force: Literal["pseudo-inverse", "stiffness"] = "pseudo-inverse"

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `impedance`, of the posture cost."""
        springs = constraints.posture_cost(self.preferred, self.stiffness)
        return strategies.impedance(task, springs, force=self.force, name=name)


class NullBasis(StrategyTable):
    """The paper's general form."""

    kind: Literal["null-basis"]
    N_G: FormulaRows

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `null_basis`."""
        return strategies.null_basis(task, matrix(self.N_G, task.robot), name=name)


class RightInverse(StrategyTable):
    """Any right inverse of J, written down."""

    kind: Literal["right-inverse"]
    G: FormulaRows

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `right_inverse`."""
        return strategies.right_inverse(task, matrix(self.G, task.robot), name=name)


class Pfaffian(StrategyTable):
    """Rows A(q) dq = 0 that need not be integrable."""

    kind: Literal["pfaffian"]
    A: FormulaRows

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `pfaffian`."""
        return strategies.pfaffian(task, matrix(self.A, task.robot), name=name)


class CoupledTwist(StrategyTable):
    """Angular velocity against velocity."""

    kind: Literal["coupled-twist"]
    gain: Gain

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `coupled_twist`."""
        return strategies.coupled_twist(task, self.gain, name=name)


class Custom(ConstraintTable):
    """A constraint of formulas."""

    kind: Literal["custom"]
    g: Formulas

    def constraint(self, task: Task) -> Constraint:
        """As `custom`."""
        return constraints.custom(column(self.g, task.robot), len(self.g))


class Linear(ConstraintTable):
    """matrix times q."""

    kind: Literal["linear"]
    matrix: NumberRows

    def constraint(self, task: Task) -> Constraint:
        """As `linear`."""
        return constraints.linear(self.matrix)


class Lock(ConstraintTable):
    """Joints that stay where they are, or follow the tool's pose."""

    kind: Literal["lock"]
    joints: Joints
    follows: Formulas | None = None

    def constraint(self, task: Task) -> Constraint:
        """As `lock`."""
        return constraints.lock(*self.joints, follows=None if self.follows is None else of_pose(self.follows))


class Coupled(ConstraintTable):
    """Orientation angles that follow the position."""

    kind: Literal["coupled"]
    gain: Gain
    orientation: Literal["zyz", "rpy", "rotation-vector"] = "zyz"

    def constraint(self, task: Task) -> Constraint:
        """As `coupled`."""
        return constraints.coupled(self.gain, self.orientation)


class ArmAngle(ConstraintTable):
    """The angle of the plane shoulder-elbow-wrist."""

    kind: Literal["arm-angle"]
    definition: Literal["stereographic", "conventional"] = "stereographic"
    joints: Annotated[list[str | int | tuple[str | int, Three]], Field(min_length=3, max_length=3)] | None = None
    reference: Three = Field(default=[0.0, 0.0, 1.0])
    pole: Three | None = None
    tip: str | None = None

    def constraint(self, task: Task) -> Constraint:
        """As `arm_angle`."""
        return constraints.arm_angle(
            definition=self.definition, joints=self.joints, reference=self.reference, pole=self.pole, tip=self.tip
        )


class Height(ConstraintTable):
    """The height of joints."""

    kind: Literal["height"]
    joints: Joints

    def constraint(self, task: Task) -> Constraint:
        """As `height`."""
        return constraints.height(*self.joints)


class Stationary(ConstraintTable):
    """The self-motion's share of the gradient of a cost."""

    kind: Literal["stationary"]
    cost: Literal["posture", "centring", "manipulability", "gravity"]
    preferred: Posture | None = None
    stiffness: Springs = 1.0
    free: Joints | None = None

    @model_validator(mode="after")
    def _springs_of_a_posture(self) -> Stationary:
        if (self.cost == "posture") != (self.preferred is not None):
            raise ValueError("cost = 'posture' and preferred go together; add or leave out preferred")
        if "stiffness" in self.model_fields_set and self.cost != "posture":
            raise ValueError(f"cost = {self.cost!r} has no stiffness; leave it out")
        return self

    def constraint(self, task: Task) -> Constraint:
        """As `stationary`."""
        match self.cost:
            case "centring":
                cost = constraints.centring_cost()
            case "manipulability":
                cost = constraints.manipulability_cost()
            case "gravity":
                cost = constraints.gravity_cost()
            case _:
                cost = constraints.posture_cost(self.preferred or [], self.stiffness)
        return constraints.stationary(cost, free=None if self.free is None else tuple(self.free))


AnyConstraint = Annotated[
    Custom | Linear | Lock | Coupled | ArmAngle | Height | Stationary, Field(discriminator="kind")
]


class Stack(ConstraintTable):
    """Constraints one below the other."""

    kind: Literal["stack"]
    constraints: Annotated[list[AnyConstraint], Field(min_length=1), Few]

    def constraint(self, task: Task) -> Constraint:
        """As `stack`."""
        return constraints.stack(*(table.constraint(task) for table in self.constraints))


class Designed(ConstraintTable):
    """A base constraint less a polynomial of the tool pose, as `design` finds it."""

    kind: Literal["designed"]
    base: AnyConstraint | Stack
    reference: Annotated[list[Numbers], Field(min_length=3, max_length=3), AfterValidator(_rectangular)]
    directions: NumberRows
    middle: Numbers
    scale: Annotated[list[Positive], Few]
    coefficients: Annotated[list[Coefficients], Few, AfterValidator(_rectangular)]

    def constraint(self, task: Task) -> Constraint:
        """As `tilted`, by a `Polynomial`. Raises: ShapeError."""
        chart = chart_of(task, finite("reference", self.reference, (3, 3)))
        P = finite("directions", self.directions, (task.m, len(self.scale)))
        middle, scale = finite("middle", self.middle, (task.m,)), np.array(self.scale)
        u = Coordinates(chart, P, middle, scale, np.full(len(scale), np.nan))
        base = self.base.constraint(task)
        C = finite("coefficients", self.coefficients, (base.rows, "terms"))
        return constraints.tilted(base, Polynomial(u, C), chart=chart)


class Radial(StrategyTable):
    """The radial strategy of the pseudo-inverse, or of a weighted one, around the start posture."""

    kind: Literal["radial"]
    weight: FormulaRows | None = None
    steps: Annotated[int, Field(ge=1, le=MOST_RADIAL_STEPS)] = 4

    def build(self, task: Task, q0: Vector, name: str) -> Strategy:
        """As `radial`."""
        if self.weight is None:
            given = strategies.moore_penrose(task)
        else:
            given = strategies.weighted(task, matrix(self.weight, task.robot))
        return strategies.radial(given, q0, steps=self.steps, name=name)


class Fitted(StrategyTable):
    """A strategy of the job with leaves, as a polynomial in a ball of tool positions about the start posture."""

    kind: Literal["fitted"]
    of: str
    radius: Positive = 0.1
    turn_deg: Annotated[float, Field(ge=0, le=180)] = 0.0
    along: Annotated[Number, Field(ge=0)] = 0.2
    degree: Annotated[int, Field(ge=1, le=MOST_DEGREE)] = 4
    samples: Annotated[int, Field(ge=1, le=MOST_FITTED)] = 200

    def fit(self, given: Strategy, q0: Vector, name: str) -> Strategy:
        """As `fitted`, to postures of `ball_postures`. Raises: HolokinError."""
        task = given.task
        along = self.along if task.n - task.m == 1 else 0.0
        region = ball(q0, self.radius, along=along, turn=float(np.deg2rad(self.turn_deg)))
        positions = tuple(i for i, row in enumerate(task.rows) if row < 3)
        rows = positions if positions and not self.turn_deg else None
        if not isinstance(given, HolonomicStrategy):
            cure = 'it has no leaves: name one that has, as of kind = "lock", "arm-angle" or "radial"'
            raise ArgumentError("of", self.of, cure)
        try:
            Q = ball_postures(given, region, self.samples)
            return strategies.fitted(given, Q, degree=self.degree, rows=rows, name=name)
        except SingularityError as problem:
            turned = f", tools turned by up to {self.turn_deg:g} degrees" if self.turn_deg else ""
            posture = posture_text(problem.q, task.robot.joint_names)
            fact = f"{self.of!r} is singular within {self.radius:g} m of the start{turned}: at {posture}"
            smaller = "radius, turn_deg or along" if self.turn_deg else "radius or along"
            raise BranchError(fact, f"fit it to a smaller region: give a smaller {smaller}") from problem


AnyStrategy = Annotated[
    MoorePenrose
    | Weighted
    | InertiaWeighted
    | Impedance
    | NullBasis
    | RightInverse
    | Pfaffian
    | CoupledTwist
    | Radial
    | Fitted
    | Custom
    | Linear
    | Lock
    | Coupled
    | ArmAngle
    | Height
    | Stationary
    | Stack
    | Designed,
    Field(discriminator="kind"),
]

KINDS: dict[str, type[StrategyTable]] = by_kind(get_args(get_args(AnyStrategy)[0]))
"""Every kind of strategy that a job may hold, and its model."""


def keys_of(model: type[StrategyTable]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(keys that a kind needs, keys that it may have) besides `kind`, `method` and `invariant`."""
    own = [key for key in model.model_fields if key not in ("kind", *StrategyTable.model_fields)]
    own.sort(key=lambda key: key == "level")
    needed = tuple(key for key in own if model.model_fields[key].is_required())
    return needed, tuple(key for key in own if key not in needed)


# the key that words without one are for
FIRST = {"lock": "joints", "height": "joints", "linear": "matrix", "stationary": "cost", "radial": "steps"}

EXAMPLE = (
    'write a kind and its keys as in a job, such as "lock joint3", "linear 1 0 -1 0 0 0 0", "arm-angle", '
    '"stationary manipulability" or "height joints=[4]"'
)
"""What may be typed."""


def strategy_of_keys(keys: dict[str, Any], task: Task, q0: Vector, name: str) -> Strategy:
    """The strategy of the keys of a table, with its kind. Raises: UnknownNameError; ArgumentError; as it raises."""
    kind = str(keys.get("kind"))
    known = {name: model for name, model in KINDS.items() if model is not Fitted}
    if kind not in known:
        raise UnknownNameError("kind of strategy", kind, known)
    return filled(known[kind], "strategy", keys).build(task, q0, name)


def leaf_of_words(text: str, task: Task, q0: Vector) -> Strategy:
    """The strategy with leaves of a text like "lock joint3": its kind, and behind it values, or keys as TOML has them.

    Where nothing is redundant any strategy serves.

    Args:
        text: words of `lock` and `height` are joints, by name or number; of `linear` one row of numbers; of
            `stationary` the cost. Other keys: `height joints=[4]`, `arm-angle definition="conventional"`.

    Raises:
        UnknownNameError: no such kind. ArgumentError: words that are not understood, no leaves; as the strategy raises.
    """
    kind, _, rest = text.strip().partition(" ")
    keys = {"kind": kind} | (_keys(text, kind, rest.strip()) if kind in KINDS else {})
    strategy = strategy_of_keys(keys, task, q0, text.strip())
    if task.n > task.m and not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("--strategy", text, "it has no leaves, so a pose has many joints: name one such as lock")
    return strategy


def _keys(text: str, kind: str, rest: str) -> dict[str, Any]:
    """The keys of a kind, of the words behind it. Raises: ArgumentError."""
    if "=" in rest:
        return parse_toml(
            "\n".join(_assignments(rest)),
            lambda _, fact, _cure: ArgumentError("--strategy", text, f"{EXAMPLE}; it {fact}"),
        )
    words = rest.replace(",", " ").split()
    if not words:
        return {}
    needed, _ = keys_of(KINDS[kind])
    key = FIRST.get(kind)
    if key is None:
        have = f"; {kind} needs {', '.join(needed)}" if needed else ""
        raise ArgumentError("--strategy", text, EXAMPLE + have)
    if key == "joints":
        return {key: [int(word) if word.isdigit() else word for word in words]}
    if key in ("cost", "steps"):
        if len(words) > 1:
            raise ArgumentError("--strategy", text, f"{EXAMPLE}; give one {key}")
        return {key: int(words[0]) if words[0].isdigit() else words[0]}
    try:
        return {key: [[float(word) for word in words]]}
    except ValueError:
        raise ArgumentError("--strategy", text, f"{EXAMPLE}; {kind} takes numbers") from None


def _assignments(text: str) -> list[str]:
    """The pieces key=value of a text, cut before each key that is outside of brackets and quotes."""
    pieces, depth, quoted, start = [], 0, "", 0
    for i, c in enumerate(text):
        if quoted:
            quoted = "" if c == quoted else quoted
        elif c in "\"'":
            quoted = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        elif c == " " and not depth and "=" in text[i:] and text[i + 1 :].split("=")[0].strip().isidentifier():
            pieces.append(text[start:i])
            start = i + 1
    return [*pieces, text[start:]]
