"""`Verdict`: what `involutivity` found, where, and what is known beyond the postures judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError, posture_text
from ...base.types import ArrayLike, Matrix, NoTruthValue, Result, Value, Vector, finite, whole
from ...path.workspaces import sobol
from ...strategies import Jump


@dataclass(frozen=True, eq=False)
class Region(Value):
    """All q with lower <= q <= upper, (n,) each."""

    lower: Vector
    upper: Vector

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.lower)

    @property
    def center(self) -> Vector:
        """Middle of the box (n,)."""
        return (self.lower + self.upper) / 2

    def __str__(self) -> str:
        return self.told()

    @typed
    def told(self, names: Sequence[str] = ()) -> str:
        """The middle +- half the sides; with the joints' names, if they are given."""
        half = (self.upper - self.lower) / 2
        sides = [f"{v:.4g}" for v in half]
        about = posture_text(self.center, names)
        return f"{about} +- {sides[0] if len(set(sides)) == 1 else '[' + ', '.join(sides) + ']'}"

    @typed
    def sample(self, count: int, seed: int = 0) -> Matrix:
        """`count` postures (count, n): the centre, then a scrambled Sobol sequence, the same for the same seed.

        Raises:
            ArgumentError unless count is a whole number, at least 1.
        """
        count, seed = whole("samples", count), whole("seed", seed, 0)
        postures = self.lower + sobol(self.n, count, seed) * (self.upper - self.lower)
        return np.vstack([self.center, postures])[:count]


@typed
def box(lower: ArrayLike, upper: ArrayLike) -> Region:
    """The region lower <= q <= upper. Raises: ShapeError, NotFiniteError, ArgumentError if lower > upper."""
    low, high = finite("lower", lower, ("n",)), finite("upper", upper, ("n",))
    if not len(low) or low.shape != high.shape:
        raise ShapeError("the corners of a region", "(n,) twice", (low.shape, high.shape))
    if (low > high).any():
        raise ArgumentError("lower", low.tolist(), f"it must not exceed upper, {high.tolist()}")
    return Region(low, high)


@typed
def around(q: ArrayLike, radius: ArrayLike) -> Region:
    """The box q +- radius, radius a number or (n,) [joint units]."""
    center, half = finite("q", q, ("n",)), finite("radius", radius)
    if half.shape not in ((), center.shape):
        raise ShapeError("radius", center.shape, half.shape, "give one number, or one a joint")
    return box(center - half, center + half)


@dataclass(frozen=True, eq=False)
class Ball(Value):
    """Tool positions within `radius` [m] of the tool at the posture `start` (n,), orientation kept there.

    `along` [joint units]: postures of the self-motion through the start, up to so far each way, belong to it too.
    `turn` [rad]: so do tools that are turned by up to so much, about any axis.
    """

    start: Vector
    radius: float
    along: float = 0.0
    turn: float = 0.0


@typed
def ball(start: ArrayLike, radius: float, *, along: float = 0.0, turn: float = 0.0) -> Ball:
    """The region of tool positions about a posture. Raises: NotFiniteError, ArgumentError for a bad radius."""
    q = finite("the start of a ball", start, ("n",))
    if not (0 < radius < np.inf and 0 <= along < np.inf and 0 <= turn <= np.pi):
        cure = "give a positive radius in metres, and a turn of at most pi"
        raise ArgumentError("the (radius, along, turn) of a ball", (radius, along, turn), cure)
    return Ball(q, float(radius), float(along), float(turn))


class Evidence(Enum):
    """What is known of the postures between those judged, when no curvature was found."""

    CONSTRAINT = (
        "it keeps a function g(q) of the joints constant, so wherever that is smooth and no posture singular small "
        "loops cannot make the joints drift: the samples check the program alone"
    )
    TRIGONOMETRIC = (
        "its planes are written with + - * / sin and cos alone, so on every connected set of regular postures its "
        "curvature, in exact numbers, vanishes throughout or only on a thin set; in a small place between the samples "
        "it can still stand out, as with high powers; thorough=True looks at more"
    )
    SAMPLED = (
        "nothing is known of the postures between, since its planes are also written with {others}, with which "
        "curvature can be confined to a small place; thorough=True looks at more"
    )
    DIFFERENCES = (
        "nothing is known of the postures between, and jumps are not sought, since it is a Python function; a whole "
        "number for `thorough` looks at so many postures"
    )


@dataclass(frozen=True)
class Accuracy(Result):
    """How well curvature is known that was computed by differences of values.

    error: what a relative curvature [1/rad] may be wrong by, at the worst posture judged. noise: of the values of G,
    a standard deviation [their units]. step: the shortest one of the differences [joint units].
    """

    error: float
    noise: float
    step: float

    def __str__(self) -> str:
        return (
            f"by differences of values with a noise of {self.noise:.0e}, over steps down to {self.step:.0e}, it is "
            f"known to {self.error:.0e} per rad"
        )


@dataclass(frozen=True, eq=False)
class Verdict(NoTruthValue, Value, ask="`.holonomic`"):
    """What `involutivity` found at the postures that it judged.

    `witness` is the posture, and `plane` = (i, j) the plane, where the curvature stands out most: `defect`
    [`unit`] is |F_ij| there and `relative` [1/rad] |F_ij| / (|G_i| |G_j|), free of the task's units: how fast
    the planes turn out of themselves per joint motion along them. It decides: not holonomic <=> at a posture judged
    relative > `tolerance` and it stands out of its round-off, which is measured there (see `roundoff`). A holonomic
    verdict's `tolerance` is what counts as zero at its witness, that round-off included.

    `samples` postures were judged; `singular` ones were left out, and `undecided` ones, at which round-off passes 1e-6.
    A verdict of holonomic holds for the postures judged; `evidence` says what is known of those between. For
    operations `others` in the planes (exp, tanh, if_else, ...) that is nothing: an analytic bump narrower than the
    gaps between the samples is not seen.

    `may_jump` names the operations of the strategy's formula that may jump (if_else, floor, ...). Places where they
    turn over are sought in the region, and `jumps` holds those where g jumps, or where the planes do so that the two
    sides lead the joints elsewhere: then the strategy is not holonomic, whether it is `curved` or not. A jump of g
    alone leaves it holonomic between the jumps; a leaf ends there, and `follow` and `ik` stop.

    Even with no curvature anywhere in the region, only small closed paths of the tool are sure to bring the joints
    back: one round a cusp, or round a place where the strategy is not defined, may not (theory 7.3). On the PPR arm
    dq_3 = d(atan2(y, x)) / 2 is holonomic, and one round of the origin turns q_3 by pi.
    """

    holonomic: bool
    defect: float
    unit: str
    relative: float
    tolerance: float
    witness: Vector
    plane: tuple[int, int]
    direction: Vector
    samples: int
    singular: int
    undecided: int
    region: Region
    evidence: Evidence
    others: tuple[str, ...] = ()
    subject: str = field(default="strategy")
    jumps: tuple[Jump, ...] = ()
    may_jump: tuple[str, ...] = ()
    curved: bool = False
    rows: tuple[tuple[str, str], ...] = ()
    """(name, unit) of the two task rows of `plane`; none for a bare distribution."""
    accuracy: Accuracy | None = None
    """How well the curvature is known of a strategy that is a Python function; None of a formula, to round-off."""

    @property
    def sentence(self) -> str:
        """The verdict for everybody."""
        if not self.rows:
            word, where = ("involutive", "stay in it") if self.holonomic else ("NOT involutive", "leave it")
            place = f" at the {self.samples} postures judged" if self.holonomic else ""
            return f"{self.subject} is {word}{place}: the Lie brackets of its fields {where}"
        if self.holonomic:
            return (
                f"{self.subject}, is holonomic at the {self.samples} postures judged{self._between}: where that holds, "
                "small closed paths of the tool bring the joints back to their start"
            )
        if not self.curved:
            jump = max(self.jumps, key=lambda one: one.planes)
            return (
                f"{self.subject}, is NOT holonomic: its planes jump at q = {posture_text(jump.q)} ({jump.what}), where "
                f"the two sides lead the joints elsewhere, by {jump.planes:.2g} of their motion: a loop of the tool "
                "across that place leaves them away from their start"
            )
        sides = " by ".join(f"0.1 {unit}" for _, unit in self.rows)
        joint = self.unit.partition("/")[0].replace("joint unit", "m or rad")
        return (
            f"{self.subject}, is NOT holonomic: at one posture (the witness) the curvature says that a small loop of "
            f"the tool of {sides} in {self._plane} leaves the joints about {0.01 * self.defect:.2g} {joint} away from "
            "their start"
        )

    @property
    def reach(self) -> str:
        """What the verdict says of the postures between those judged, and of long closed paths."""
        if not self.holonomic:
            return "one posture is enough to show it"
        between = self.evidence.value.format(others=", ".join(self.others))
        if self.may_jump and not self.jumps:
            between += f"; its formula may jump ({', '.join(self.may_jump)}): no jump was found within the region"
        return between + ("; a long closed path of the tool may end with other joints" if self.rows else "")

    @property
    def details(self) -> str:
        """The figures behind the sentence, and how far it reaches."""
        return self.told()

    @typed
    def told(self, names: Sequence[str] = ()) -> str:
        """`details`, with the joints' names (n,) where postures stand, if they are given."""
        place = f"{'' if names else 'q = '}{posture_text(self.witness, names)}"
        left = [f"{self.singular} singular ones"] if self.singular else []
        left += [f"{self.undecided} whose curvature round-off hides"] if self.undecided else []
        skipped = f", {' and '.join(left)} left out" if left else ""
        known = "" if self.accuracy is None else f"; {self.accuracy}"
        return (
            f"defect {self.defect:.3g} {self.unit} in {self._plane} at {place}; {self.relative:.2g} per rad "
            f"of joint motion, where up to {self.tolerance:.0e} counts as zero{known}; {self.samples} postures judged"
            f"{skipped}, within {self.region.told(names)}; {self.reach}"
        )

    @property
    def _between(self) -> str:
        """What is to be said of jumps of g."""
        if not self.jumps:
            return ""
        jump = max(self.jumps, key=lambda one: one.level)
        return (
            f", between the jumps of its g, as by {jump.level:.3g} at q = {posture_text(jump.q)} ({jump.what}), where "
            "leaves end and `follow` and `ik` stop"
        )

    @property
    def _plane(self) -> str:
        names = [name for name, _ in self.rows] or [f"field {k + 1}" for k in self.plane]
        return f"the {'-'.join(dict.fromkeys(names))} {'plane' if self.rows else 'bracket'}"

    def __str__(self) -> str:
        return f"{self.sentence}\n  {self.details}"
