"""Is a strategy holonomic that is a Python function? As `involutivity`, with derivatives by differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.errors import EmptyRegionError, HolokinError
from ...base.types import Matrix, Vector
from ...strategies import NumericStrategy
from .curvature_of_planes import curvature_unit, pairs
from .numeric_curvature import OUTSIDE, MeasuredCurvature, measured_curvature
from .region import Region
from .verdict import Accuracy, Evidence, Verdict

SURE = 3.0
"""Curvature over its error from which it is there. The errors are estimated with care: over 3,800 curvatures of laws in
double and single precision and with noise of 1e-8 and 1e-10 the true ones were at most 0.64 of them."""

HIDDEN = 1e-3
"""Relative curvature [1/rad] that may hide in the error of a posture which is judged: the weakest real defect that we
know is above it, see `TOLERANCES.holonomic`."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """A posture: its curvature, and relative to |G_i| |G_j| the sizes and errors (p,) of the planes."""

    q: Vector
    found: MeasuredCurvature
    sizes: Vector
    errors: Vector


def numeric_verdict(strategy: NumericStrategy, Q: Matrix, region: Region, tolerance: float) -> Verdict:
    """The verdict at postures Q (k, n).

    Raises:
        EmptyRegionError: none can be judged. ArgumentError, ShapeError: J G is not 1 at one, or G has another shape.
    """
    task, planes = strategy.task, pairs(strategy.task.m) or [(0, 0)]
    seen: list[_Seen] = []
    refused: HolokinError | None = None
    for q in Q:
        try:
            found, lengths = measured_curvature(strategy, q), np.linalg.norm(strategy(q), axis=0)
        except OUTSIDE as problem:
            refused = refused or problem
            continue
        scale = np.array([lengths[i] * lengths[j] for i, j in planes])
        sizes, errors = (np.array([table[plane] for plane in planes]) / scale for table in (found.sizes, found.error))
        seen.append(_Seen(q, found, sizes, errors))
    judged = [one for one in seen if _is_judged(one, tolerance)]
    if not judged:
        least = min((float(one.errors.max()) for one in seen), default=np.inf)
        why = HolokinError(f"its curvature is known to {least:.1e} per rad only, which could hide a real one")
        raise EmptyRegionError(len(Q), refused or why)
    stands = [one.sizes / np.maximum(tolerance, SURE * one.errors) for one in judged]
    holonomic = not any((ratio > 1).any() for ratio in stands)
    most = stands if holonomic else [np.where(r > 1, one.sizes, 0.0) for r, one in zip(stands, judged, strict=True)]
    row = int(np.argmax([measure.max() for measure in most]))
    witness, p = judged[row], int(np.argmax(most[row]))
    allowed = max(tolerance, SURE * float(witness.errors[p]))
    i, j = planes[p]
    names = list(zip(task.row_names, task.units, strict=True))
    return Verdict(
        holonomic=holonomic,
        defect=float(witness.found.sizes[i, j]),
        unit=curvature_unit(strategy, i, j),
        relative=float(witness.sizes[p]),
        tolerance=allowed,
        witness=witness.q,
        plane=(i, j),
        direction=witness.found.F[:, i, j],
        samples=len(judged),
        singular=len(Q) - len(seen),
        undecided=len(seen) - len(judged),
        region=region,
        evidence=Evidence.DIFFERENCES,
        subject=f"{strategy.name!r}, {task.name}",
        curved=not holonomic,
        rows=(names[i], names[j]),
        accuracy=Accuracy(
            error=max(float(one.errors.max()) for one in judged),
            noise=max(one.found.noise for one in judged),
            step=min(one.found.step for one in judged),
        ),
    )


def _is_judged(one: _Seen, tolerance: float) -> bool:
    """Whether curvature is shown at a posture, or none that matters could hide there."""
    shown = one.sizes > np.maximum(tolerance, SURE * one.errors)
    return bool(shown.any() or (SURE * one.errors < HIDDEN).all())
