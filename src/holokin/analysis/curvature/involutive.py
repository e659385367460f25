"""Is a strategy, or a bare distribution, involutive? The paper's (4), with a figure and a witness. [SY88]"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError, ShapeError, SingularityError, UndecidedError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Matrix, Vector, joined, whole
from ...strategies import HolonomicStrategy, Jump, NumericStrategy, Strategy, jumps_of, may_jump
from ...symbolic import SX, Function, factorise, horzcat, norm_2, other_operations, pairwise_brackets, symbol, written
from .curvature_of_planes import (
    OUTSIDE,
    MeasuredCurvature,
    curvature_function,
    curvature_unit,
    measured_curvature,
    pairs,
)
from .verdict import Accuracy, Evidence, Region, Verdict

# --- Round-off, measured instead of guessed: what a nudge of the posture scatters is not there. [Vig93]
#
# Near singularities, its own or those on the way of a transport, a computed curvature is noise of any size. Moving the
# posture by a hair changes every rounding on the way and the true value hardly: the mean over some such copies against
# their scatter tells the two apart. Over 30,000 curvatures of holonomic strategies on five robots, down to a rcond of
# 1e-10, the mean was at most 2.2 times the scatter; of strategies that are not holonomic it was at least 10,000 times
# down to 1e-4.

COPIES = 16
"""Copies of a posture that are compared: their mean is known to a quarter of their scatter."""

SHOWN = 10.0
"""Mean over scatter from which a value is there: five times the most that round-off made, see above."""


def nudged(Q: Matrix, seed: int = 0) -> Array:
    """COPIES postures a hair from each of Q (k, n): (k, COPIES, n), the same for the same seed."""
    noise = np.random.default_rng(seed).standard_normal((len(Q), COPIES, Q.shape[1]))
    # 1.5e-11 joint units, for joints beyond 1 times the joint: 60,000 times the last digit, so that all digits lost on
    # the way are drawn anew, and too small to change a curvature by more than round-off does
    return Q[:, None, :] + 2.0**-36 * np.maximum(1.0, np.abs(Q))[:, None, :] * noise


def measured(field: Callable[[Matrix], Array], Q: Matrix) -> tuple[Array, Matrix]:
    """Mean (k, n, p) and scatter (k, p) of p vectors, field: (j, n) -> (j, n, p), about each posture of Q (k, n)."""
    copies = nudged(Q)
    values = field(copies.reshape(-1, Q.shape[1]))
    return spread(values.reshape(len(Q), COPIES, *values.shape[1:]))


def spread(values: Array) -> tuple[Array, Matrix]:
    """Mean (k, n, p), and root mean square distance from it (k, p), of vectors (k, COPIES, n, p)."""
    with np.errstate(all="ignore"):  # what is not finite is not shown, and says so by its scatter
        mean = values.mean(axis=1)
        return mean, np.sqrt(((values - mean[:, None]) ** 2).sum(axis=2).mean(axis=1))


def is_shown(size: Array | float, scatter: Array | float) -> Any:
    """Where a size stands out of its scatter; a scatter that is no number shows nothing."""
    return size > SHOWN * scatter


def noise(scatter: Array) -> Array:
    """The largest size that round-off of this scatter may give; infinite where it is no number."""
    return np.where(np.isfinite(scatter), SHOWN * scatter, np.inf)


# --- Where does curvature stand out of its round-off? Looking at postures, and climbing from the best.

HIDDEN_ROUNDOFF = 1e-6
"""Relative round-off [1/rad] above which a posture tells nothing: the weakest defect that matters could hide in it."""

PIECE = 65_536
"""Postures that are evaluated at once, so that memory does not grow with their number."""

Field = Callable[[Matrix], tuple[Array, Vector]]
"""Postures (k, n) -> relative curvature (k, n, p) in p planes, rcond (k,)."""


@dataclass(frozen=True, eq=False)
class Scan:
    """Relative curvature (k, p), sizes only, at postures Q (k, n); `sound` (k,): regular enough to be judged."""

    Q: Matrix
    sizes: Matrix
    rcond: Vector
    sound: Flags


@dataclass(frozen=True, eq=False)
class Extreme:
    """What stands out most, of all postures judged: row of Q and plane, size, and the size that counts as zero there.

    `undecided` (k,): postures whose curvature round-off hides; of those that were looked at twice, if any is shown.
    """

    shown: bool
    row: int
    plane: int
    size: float
    allowed: float
    undecided: Flags


def _scan(field: Field, Q: Matrix) -> Scan:
    """The relative curvature at every posture."""
    parts = [field(Q[i : i + PIECE]) for i in range(0, len(Q), PIECE)]
    with np.errstate(all="ignore"):
        sizes = np.concatenate([np.linalg.norm(F, axis=1) for F, _ in parts])
    rcond = np.concatenate([rcond for _, rcond in parts])
    # From an rcond of 1e-7 down curvature is not judged: a nudge of 1e-11 would be a step towards the singularity
    return Scan(Q, sizes, rcond, (rcond > 1e-7) & np.isfinite(sizes).all(axis=1))


def examine(field: Field, seen: Scan, tolerance: float) -> Extreme | None:
    """The largest curvature above `tolerance` that is more than round-off, or else the one that comes nearest to it.

    Whatever passes the tolerance is looked at again, the largest first, until one stands out of its round-off.
    None: no posture can be judged.
    """
    sizes, allowed, undecided = seen.sizes.copy(), np.full(seen.sizes.shape, tolerance), np.zeros(len(seen.Q), bool)
    highest = sizes.max(axis=1)
    doubtful = np.flatnonzero(seen.sound & (highest > tolerance))
    doubtful = doubtful[np.argsort(-highest[doubtful])]
    # A few first, since a real curvature shows at once, then the rest
    for rows in np.split(doubtful, [8, 128, *range(2176, len(doubtful), 2048)]):
        if not len(rows):
            break
        mean, scatter = measured(lambda Q: field(Q)[0], seen.Q[rows])
        with np.errstate(all="ignore"):
            size = np.linalg.norm(mean, axis=1)
        clear = is_shown(size, scatter)
        standing = np.where(clear & (size > tolerance), seen.sizes[rows], 0.0)
        undecided[rows] = (~clear & (noise(scatter) > HIDDEN_ROUNDOFF)).any(axis=1)
        if standing.any():
            k, p = np.unravel_index(int(np.argmax(standing)), standing.shape)
            undecided[rows] &= ~standing.any(axis=1)
            return Extreme(True, int(rows[k]), int(p), float(standing[k, p]), tolerance, undecided)
        sizes[rows], allowed[rows] = size, np.maximum(tolerance, noise(scatter))
    # None stands out: the one nearest to what is allowed there
    counted = np.flatnonzero(seen.sound & ~undecided)
    if not len(counted):
        return None
    k, p = np.unravel_index(int(np.argmax(sizes[counted] / allowed[counted])), (len(counted), sizes.shape[1]))
    row = int(counted[k])
    return Extreme(False, row, int(p), float(sizes[row, p]), float(allowed[row, p]), undecided)


def _maximised(field: Field, region: Region, seen: Scan) -> Matrix:
    """Postures (j, n) of the region to which log |F| rises from those seen where it stands out of round-off most.

    A curvature far below any tolerance counts: its tail leads to where it is large.
    """
    # One in 16 postures is looked at again, at 16 nudged copies, which doubles the work
    order = np.flatnonzero(seen.sound)
    quiet = seen.sizes[order].max(axis=1) * seen.rcond[order] ** 2  # round-off grows as 1 / rcond^2
    rows = order[np.argsort(-quiet)][: -(-len(seen.Q) // 16)]
    if not len(rows):
        return seen.Q[:0]
    mean, scatter = measured(lambda Q: field(Q)[0], seen.Q[rows])
    # Climb from the 16 best whose mean is over 3 times the scatter: round-off alone made 2.2 at most
    size = np.linalg.norm(mean, axis=1)
    signal = np.where(size > 3.0 * scatter, size, 0.0).max(axis=1)
    best = np.argsort(-signal)[:16]
    return _climb(field, region, seen.Q[rows[best[signal[best] > 0]]])


def _climb(field: Field, region: Region, Q: Matrix) -> Matrix:
    """Where 60 steps uphill lead; from a tenth of the region they fall or grow, by 0.4 or 1.5, to where it ends."""
    if not len(Q):
        return Q
    width, n = region.upper - region.lower, region.n
    step, height = np.full(len(Q), 0.1), _height(field, Q)
    # Differences of log |F| over a 256th of the region; they are exact for a Gaussian of any width
    shift = 1 / 256 * width * np.eye(n)
    for _ in range(60):
        beside = np.stack([Q[:, None] + shift, Q[:, None] - shift], axis=1)  # (j, 2, n, n)
        levels = _height(field, np.clip(beside, region.lower, region.upper).reshape(-1, n)).reshape(len(Q), 2, n)
        slope = np.nan_to_num(levels[:, 0] - levels[:, 1], nan=0.0, posinf=0.0, neginf=0.0)
        slope /= np.maximum(np.linalg.norm(slope, axis=1), 1e-300)[:, None]
        trial = np.clip(Q + step[:, None] * slope * width, region.lower, region.upper)
        risen = _height(field, trial)
        better = risen > height
        Q, height = np.where(better[:, None], trial, Q), np.where(better, risen, height)
        step *= np.where(better, 1.5, 0.4)
    return Q


def _height(field: Field, Q: Matrix) -> Vector:
    """log of the largest relative curvature; -inf where it is zero or not judged."""
    seen = _scan(field, Q)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(seen.sound, np.log(seen.sizes.max(axis=1)), -np.inf)


# --- Is a strategy holonomic that is a Python function? As `involutivity`, with derivatives by differences.

SURE = 3.0
"""Curvature over its error from which it is there. The errors are estimated with care: over 3,800 curvatures of
strategies in double and single precision and with noise of 1e-8 and 1e-10 the true ones were at most 0.64 of them."""


@dataclass(frozen=True, eq=False)
class _Measured:
    """A posture: its curvature, and relative to |G_i| |G_j| the sizes and errors (p,) of the planes."""

    q: Vector
    curvature: MeasuredCurvature
    sizes: Vector
    errors: Vector

    def is_judged(self, tolerance: float) -> bool:
        """Whether curvature is shown here, or none that matters could hide: the weakest real defect that we know is
        above 1e-3 per rad, see `TOLERANCES.holonomic`."""
        shown = self.sizes > np.maximum(tolerance, SURE * self.errors)
        return bool(shown.any() or (SURE * self.errors < 1e-3).all())


def _numeric_verdict(strategy: NumericStrategy, Q: Matrix, region: Region, tolerance: float) -> Verdict:
    """The verdict at postures Q (k, n).

    Raises:
        UndecidedError: none can be judged. ArgumentError, ShapeError: J G is not 1 at one, or G has another shape.
    """
    task, planes = strategy.task, pairs(strategy.task.m) or [(0, 0)]
    # The curvature at each posture, and which of them can be judged
    seen: list[_Measured] = []
    refused: HolokinError | None = None
    for q in Q:
        try:
            curvature, lengths = measured_curvature(strategy, q), np.linalg.norm(strategy(q), axis=0)
        except OUTSIDE as problem:
            refused = refused or problem
            continue
        scale = np.array([lengths[i] * lengths[j] for i, j in planes])
        sizes, errors = (np.array([F[plane] for plane in planes]) / scale for F in (curvature.sizes, curvature.error))
        seen.append(_Measured(q, curvature, sizes, errors))
    judged = [posture for posture in seen if posture.is_judged(tolerance)]
    if not judged:
        least = min((float(posture.errors.max()) for posture in seen), default=np.inf)
        why = HolokinError(f"its curvature is known to {least:.1e} per rad only, which could hide a real one")
        raise UndecidedError(
            f"all {len(Q)} sampled postures of the region are singular or nearly so, and nothing can be judged",
            "move or enlarge the region",
            first=refused or why,
        )
    # The witness: the largest curvature that stands out of its error, or else the one that comes nearest to it
    sizes = np.array([posture.sizes for posture in judged])
    allowed = np.maximum(tolerance, SURE * np.array([posture.errors for posture in judged]))
    holonomic = not (sizes > allowed).any()
    measure = sizes / allowed if holonomic else np.where(sizes > allowed, sizes, 0.0)
    row, p = np.unravel_index(int(measure.argmax()), measure.shape)
    witness, (i, j) = judged[row], planes[p]
    names = list(zip(task.row_names, task.units, strict=True))
    return Verdict(
        holonomic=holonomic,
        defect=float(witness.curvature.sizes[i, j]),
        unit=curvature_unit(strategy, i, j),
        relative=float(witness.sizes[p]),
        tolerance=float(allowed[row, p]),
        witness=witness.q,
        plane=(i, j),
        direction=witness.curvature.F[:, i, j],
        samples=len(judged),
        singular=len(Q) - len(seen),
        undecided=len(seen) - len(judged),
        region=region,
        evidence=Evidence.DIFFERENCES,
        subject=f"{strategy.name!r}, {task.name}",
        curved=not holonomic,
        rows=(names[i], names[j]),
        accuracy=Accuracy(
            error=max(float(posture.errors.max()) for posture in judged),
            noise=max(posture.curvature.noise for posture in judged),
            step=min(posture.curvature.step for posture in judged),
        ),
    )


@dataclass(frozen=True, eq=False)
class _Subject:
    """What is judged: `values`: Q (k, n) -> (F (k, n, p), its scale (k, p), rcond (k,)), and words for it."""

    name: str
    n: int
    values: Callable[[Matrix], tuple[Array, Matrix, Vector]]
    planes: list[tuple[int, int]]
    units: list[str]
    rows: list[tuple[str, str]]
    refusal: Callable[[Vector], Exception | None]
    evidence: Evidence
    others: tuple[str, ...]
    jumps: Callable[[Matrix, Region], tuple[Jump, ...]] = lambda _Q, _region: ()
    may_jump: tuple[str, ...] = ()

    def relative(self, Q: Matrix) -> tuple[Array, Vector]:
        """F over its scale, free of units, (k, n, p), and rcond (k,)."""
        F, scale, rcond = self.values(Q)
        with np.errstate(all="ignore"):
            return F / scale[:, None, :], rcond


@typed
def involutivity(
    strategy: Strategy,
    region: Region,
    *,
    samples: int = 64,
    thorough: bool | int = False,
    tolerance: float = TOLERANCES.holonomic,
    seed: int = 0,
) -> Verdict:
    """Whether [G_i, G_j] lies in range G for all i, j at postures of a region: the condition (4) of the paper.

    Where the formula of a strategy jumps, by an if_else, a floor, ... of the user's, its two sides are compared as
    well.

    Right for geometric Jacobians too, since the vertical part of the brackets is tested (theory 1.1), and
    free of null-space bases (theory 5.1). `Verdict` says what is known of the postures between (theory 5.2).

    Args:
        region: box in joint space, for instance `around(q0, 0.3)`.
        samples: postures to look at; those that are singular, or where round-off hides all, are left out and counted.
        thorough: look at 65,536 postures, or as many as it says, then climb to where the curvature is largest from
            those where it stands out of its round-off most. For strategies with exp, tanh, if_else, ... in them. Of a
            strategy that is a Python function: a number, which is all that is looked at.
        tolerance: largest relative defect [1/rad] that counts as zero.

    Raises:
        UndecidedError: every sampled posture is singular, or round-off hides its curvature.
        ShapeError: the region has not n joints. ArgumentError: a number of postures that is not whole and at least 1.
    """
    if not isinstance(strategy, NumericStrategy):
        return _judged(_subject(strategy), region, whole("samples", samples), thorough, tolerance, seed)
    # Of a Python function: postures alone, and as many as are asked for
    if region.n != strategy.task.n:
        raise ShapeError("the region", (strategy.task.n,), (region.n,))
    if thorough is True:
        cure = f"{strategy.name!r} is a Python function, some 100 calls a posture: say how many, as thorough=1000"
        raise ArgumentError("thorough", thorough, cure)
    count = max(whole("samples", samples), whole("thorough", thorough) if thorough is not False else 1)
    return _numeric_verdict(strategy, region.sample(count, seed), region, tolerance)


def involutivity_at(strategy: Strategy, Q: Matrix, *, tolerance: float = TOLERANCES.holonomic) -> Verdict:
    """`involutivity` at given postures (k, n). Raises: UndecidedError."""
    region = Region(Q.min(axis=0), Q.max(axis=0))
    if isinstance(strategy, NumericStrategy):
        return _numeric_verdict(strategy, Q, region, tolerance)
    subject = _subject(strategy)
    return _verdict(subject, _scan(subject.relative, Q), region, tolerance)


@typed
def involutivity_of(
    distribution: Callable[[Any], Any],
    n: int,
    region: Region | None = None,
    *,
    samples: int = 64,
    thorough: bool | int = False,
    tolerance: float = TOLERANCES.holonomic,
    seed: int = 0,
) -> Verdict:
    """Whether a bare distribution span B(q) is involutive, for instance B = N_G, or W J^T (Proposition 1 of [RM93]).

    The figure is the part of [B_a, B_b] normal to span B, over |B_a| |B_b| [1/joint unit]; both `defect`
    and `relative` hold it.

    Args:
        distribution: q -> CasADi expression (n, k), or nested lists.
        n: number of joints.
        region: box to look in; by default |q_i| <= 1.
        samples, thorough, tolerance, seed: as for `involutivity`.

    Raises:
        UndecidedError: the distribution loses rank everywhere. ShapeError: B has not n rows.
    """
    # The distribution, with fields of length one, so that the scale of B does not count
    q = symbol("q", whole("n", n))
    B = written("the distribution", distribution, q)
    if B.shape[0] != n:
        raise ShapeError("the distribution", (n, "k"), B.shape)
    frame = factorise(horzcat(*(B[:, a] / norm_2(B[:, a]) for a in range(B.shape[1]))))
    basis = frame.thin_q()
    # What of the brackets is normal to it.
    # Lemma III.1, Proposition 1: with B = N, and with B = W J^T, this is what they speak of
    brackets = pairwise_brackets(B, q)
    normal = [v - basis @ (basis.T @ v) for v in brackets.values()] or [0 * q]  # (4)
    planes = list(brackets) or [(0, 0)]
    function = Function("distribution", {"q": q}, {"F": horzcat(*normal), "B": B, "rcond": frame.rcond()})

    def values(Q: Matrix) -> tuple[Array, Matrix, Vector]:
        F, fields, rcond = function.batch(Q)
        with np.errstate(all="ignore"):
            F = F.reshape(len(Q), n, -1) / _scale(fields.reshape(len(Q), n, -1), planes)[:, None, :]
        return F, np.ones((len(Q), len(planes))), rcond

    # Judged as a strategy is
    name, problem = f"distribution of rank {B.shape[1]}", HolokinError("the distribution loses rank")
    subject = _Subject(name, n, values, planes, ["/joint unit"] * len(planes), [], lambda _q: problem, *_evidence(B, q))
    region = region if region is not None else Region(np.full(n, -1.0), np.full(n, 1.0))
    return _judged(subject, region, whole("samples", samples), thorough, tolerance, seed)


def _subject(strategy: Strategy) -> _Subject:
    """A strategy that is a formula."""
    task, function, e = strategy.task, curvature_function(strategy), strategy.expressions
    planes = pairs(task.m) or [(0, 0)]

    def values(Q: Matrix) -> tuple[Array, Matrix, Vector]:
        F, G, rcond, margin = function.batch(Q)
        scale = _scale(G.reshape(len(Q), task.n, task.m), planes)
        return F.reshape(len(Q), task.n, -1), scale, np.minimum(rcond, margin)

    def refusal(q: Vector) -> Exception | None:
        try:
            strategy(q)
        except SingularityError as problem:
            return problem
        return None

    # Lemma III.1: range G is the null space of an exact J_g
    exact = isinstance(strategy, HolonomicStrategy)
    evidence, others = (Evidence.CONSTRAINT, ()) if exact else _evidence(e.planes, e.q)
    return _Subject(
        name=f"{strategy.name!r}, {task.name}",
        n=task.n,
        values=values,
        planes=planes,
        units=[curvature_unit(strategy, i, j) for i, j in planes],
        rows=list(zip(task.row_names, task.units, strict=True)),
        refusal=refusal,
        evidence=evidence,
        others=others,
        jumps=lambda Q, region: jumps_of(strategy, Q, region.lower, region.upper),
        may_jump=may_jump(strategy),
    )


def _evidence(planes: SX, q: SX) -> tuple[Evidence, tuple[str, ...]]:
    others = other_operations(planes, q)
    return (Evidence.SAMPLED if others else Evidence.TRIGONOMETRIC), others


def _scale(fields: Array, planes: list[tuple[int, int]]) -> Matrix:
    """|G_i| |G_j| (k, p) of fields (k, n, m)."""
    lengths = np.linalg.norm(fields, axis=1)
    return np.stack([lengths[:, i] * lengths[:, j] for i, j in planes], axis=1)


def _judged(
    subject: _Subject, region: Region, samples: int, thorough: bool | int, tolerance: float, seed: int
) -> Verdict:
    """The verdict on a region: from its samples, and if it is to be thorough from where the curvature is largest."""
    if region.n != subject.n:
        raise ShapeError("the region", (subject.n,), (region.n,))
    if thorough is not False:
        samples = max(samples, 65_536 if thorough is True else whole("thorough", thorough))
    seen = _scan(subject.relative, region.sample(samples, seed))
    if thorough is not False:
        highest = _maximised(subject.relative, region, seen)
        seen = joined(seen, _scan(subject.relative, highest)) if len(highest) else seen
    return _verdict(subject, seen, region, tolerance)


def _verdict(subject: _Subject, seen: Scan, region: Region, tolerance: float) -> Verdict:
    """The verdict at the postures that were looked at."""
    extreme = examine(subject.relative, seen, tolerance)
    if extreme is None:
        best = f"rcond at most {np.nanmax(seen.rcond, initial=0.0):.1e}, and round-off hides the curvature"
        raise UndecidedError(
            f"all {len(seen.Q)} sampled postures of the region are singular or nearly so, and nothing can be judged",
            "move or enlarge the region",
            first=subject.refusal(seen.Q[0]) or HolokinError(best),
        )
    witness, plane = seen.Q[extreme.row], subject.planes[extreme.plane]
    F, scale, _ = subject.values(witness[None])
    # Places where the formula turns over are sought from some 64 of the postures
    jumps = subject.jumps(seen.Q[:: -(-len(seen.Q) // 64)], region) if subject.may_jump else ()
    return Verdict(
        holonomic=not (extreme.shown or any(jump.planes for jump in jumps)),
        defect=float(extreme.size * scale[0, extreme.plane]),
        unit=subject.units[extreme.plane],
        relative=extreme.size,
        tolerance=extreme.allowed,
        witness=witness,
        plane=plane,
        direction=F[0, :, extreme.plane],
        samples=int((seen.sound & ~extreme.undecided).sum()),
        singular=int((~seen.sound).sum()),
        undecided=int(extreme.undecided.sum()),
        region=region,
        evidence=subject.evidence,
        others=subject.others,
        subject=subject.name,
        jumps=jumps,
        may_jump=subject.may_jump,
        curved=extreme.shown,
        rows=tuple(subject.rows[k] for k in plane) if subject.rows else (),
    )
