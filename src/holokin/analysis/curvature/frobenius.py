"""Is a strategy, or a bare distribution, involutive? The paper's (4), with a figure and a witness. [SY88]"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, EmptyRegionError, HolokinError, ShapeError, SingularityError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Matrix, Vector, whole
from ...strategies import HolonomicStrategy, Jump, NumericStrategy, Strategy, jumps_of, may_jump
from ...symbolic import SX, Function, factorise, horzcat, norm_2, other_operations, pairwise_brackets, symbol, written
from .curvature_of_planes import curvature_function, curvature_unit, pairs
from .curvature_search import Scan, examine, maximised, merged, scan
from .numeric_verdict import numeric_verdict
from .region import Region
from .verdict import Evidence, Verdict

THOROUGH = 65_536
"""Postures that `thorough=True` looks at: half a second for a Panda, most of it for compiling."""

JUMPS_FROM = 64
"""Postures from which places are sought where the formula of a law turns over."""


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

    Where the formula of a law jumps, by an if_else, a floor, ... of the user's, its two sides are compared as well.

    Right for geometric Jacobians too, since the vertical part of the brackets is tested (theory 1.1), and
    free of null-space bases (theory 5.1). `Verdict` says what is known of the postures between (theory 5.2).

    Args:
        region: box in joint space, for instance `around(q0, 0.3)`.
        samples: postures to look at; those that are singular, or where round-off hides all, are left out and counted.
        thorough: look at 65,536 postures, or as many as it says, then climb to where the curvature is largest from
            those where it stands out of its round-off most. For laws with exp, tanh, if_else, ... in them. Of a law
            that is a Python function: a number, which is all that is looked at.
        tolerance: largest relative defect [1/rad] that counts as zero.

    Raises:
        EmptyRegionError: every sampled posture is singular, or round-off hides its curvature.
        ShapeError: the region has not n joints. ArgumentError: a number of postures that is not whole and at least 1.
    """
    if isinstance(strategy, NumericStrategy):
        return _judged_by_values(strategy, region, whole("samples", samples), thorough, tolerance, seed)
    return _judged(_subject(strategy), region, whole("samples", samples), thorough, tolerance, seed)


def involutivity_at(strategy: Strategy, Q: Matrix, *, tolerance: float = TOLERANCES.holonomic) -> Verdict:
    """`involutivity` at given postures (k, n). Raises: EmptyRegionError."""
    region = Region(Q.min(axis=0), Q.max(axis=0))
    if isinstance(strategy, NumericStrategy):
        return numeric_verdict(strategy, Q, region, tolerance)
    subject = _subject(strategy)
    return _verdict(subject, scan(subject.relative, Q), region, tolerance)


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
        EmptyRegionError: the distribution loses rank everywhere. ShapeError: B has not n rows.
    """
    q = symbol("q", whole("n", n))
    B = written("the distribution", distribution, q)
    if B.shape[0] != n:
        raise ShapeError("the distribution", (n, "k"), B.shape)
    units = horzcat(*(B[:, a] / norm_2(B[:, a]) for a in range(B.shape[1])))  # so that the scale of B does not count
    frame = factorise(units)
    basis = frame.thin_q()
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

    name = f"distribution of rank {B.shape[1]}"
    refusal = lambda _q: HolokinError("the distribution loses rank")  # noqa: E731
    subject = _Subject(name, n, values, planes, ["/joint unit"] * len(planes), [], refusal, *_evidence(B, q))
    area = region if region is not None else Region(np.full(n, -1.0), np.full(n, 1.0))
    return _judged(subject, area, whole("samples", samples), thorough, tolerance, seed)


def _subject(strategy: Strategy) -> _Subject:
    task, function = strategy.task, curvature_function(strategy)
    planes = pairs(task.m) or [(0, 0)]

    def values(Q: Matrix) -> tuple[Array, Matrix, Vector]:
        F, G, rcond, margin = function.batch(Q)
        scale = _scale(G.reshape(len(Q), task.n, task.m), planes)
        return F.reshape(len(Q), task.n, -1), scale, np.minimum(rcond, margin)

    def refusal(q: Vector) -> Exception | None:
        try:
            strategy(q)
        except SingularityError as first:
            return first
        return None

    e = strategy.expressions
    # Lemma III.1: range G is the null space of an exact J_g
    evidence = (Evidence.CONSTRAINT, ()) if isinstance(strategy, HolonomicStrategy) else _evidence(e.planes, e.q)
    units, rows = (
        [curvature_unit(strategy, i, j) for i, j in planes],
        list(zip(task.row_names, task.units, strict=True)),
    )
    name = f"{strategy.name!r}, {task.name}"
    return _Subject(
        name, task.n, values, planes, units, rows, refusal, *evidence,
        lambda Q, region: jumps_of(strategy, Q, region.lower, region.upper), may_jump(strategy),
    )  # fmt: skip


def _evidence(planes: SX, q: SX) -> tuple[Evidence, tuple[str, ...]]:
    others = other_operations(planes, q)
    return (Evidence.SAMPLED if others else Evidence.TRIGONOMETRIC), others


def _scale(fields: Array, planes: list[tuple[int, int]]) -> Matrix:
    """|G_i| |G_j| (k, p) of fields (k, n, m)."""
    lengths = np.linalg.norm(fields, axis=1)
    return np.stack([lengths[:, i] * lengths[:, j] for i, j in planes], axis=1)


def _judged_by_values(
    strategy: NumericStrategy, region: Region, samples: int, thorough: bool | int, tolerance: float, seed: int
) -> Verdict:
    if region.n != strategy.task.n:
        raise ShapeError("the region", (strategy.task.n,), (region.n,))
    if thorough is True:
        cure = f"{strategy.name!r} is a Python function, some 100 calls a posture: say how many, as thorough=1000"
        raise ArgumentError("thorough", thorough, cure)
    count = samples if thorough is False else max(samples, whole("thorough", thorough))
    return numeric_verdict(strategy, region.sample(count, seed), region, tolerance)


def _judged(
    subject: _Subject, region: Region, samples: int, thorough: bool | int, tolerance: float, seed: int
) -> Verdict:
    if region.n != subject.n:
        raise ShapeError("the region", (subject.n,), (region.n,))
    if thorough is not False:
        samples = max(samples, THOROUGH if thorough is True else whole("thorough", thorough))
    seen = scan(subject.relative, region.sample(samples, seed))
    if thorough is not False:
        found = maximised(subject.relative, region, seen)
        seen = merged(seen, scan(subject.relative, found)) if len(found) else seen
    return _verdict(subject, seen, region, tolerance)


def _verdict(subject: _Subject, seen: Scan, region: Region, tolerance: float) -> Verdict:
    found = examine(subject.relative, seen, tolerance)
    if found is None:
        best = f"rcond at most {np.nanmax(seen.rcond, initial=0.0):.1e}, and round-off hides the curvature"
        raise EmptyRegionError(len(seen.Q), subject.refusal(seen.Q[0]) or HolokinError(best))
    witness, plane = seen.Q[found.row], subject.planes[found.plane]
    F, scale, _ = subject.values(witness[None])
    jumps = subject.jumps(seen.Q[:: -(-len(seen.Q) // JUMPS_FROM)], region) if subject.may_jump else ()
    return Verdict(
        holonomic=not (found.shown or any(jump.planes for jump in jumps)),
        defect=float(found.size * scale[0, found.plane]),
        unit=subject.units[found.plane],
        relative=found.size,
        tolerance=found.allowed,
        witness=witness,
        plane=plane,
        direction=F[0, :, found.plane],
        samples=int((seen.sound & ~found.undecided).sum()),
        singular=int((~seen.sound).sum()),
        undecided=int(found.undecided.sum()),
        region=region,
        evidence=subject.evidence,
        others=subject.others,
        subject=subject.name,
        jumps=jumps,
        may_jump=subject.may_jump,
        curved=found.shown,
        rows=tuple(subject.rows[k] for k in plane) if subject.rows else (),
    )
