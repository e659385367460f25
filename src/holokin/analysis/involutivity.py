"""Is a strategy, or a bare distribution, involutive? The paper's (4), with a figure and a witness. [SY88]"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import EmptyRegionError, HolokinError, ShapeError, SingularityError
from ..strategy import Strategy
from ..symbolic import Function, as_expression, factorise, horzcat, pairwise_brackets, symbol
from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Matrix, Vector, whole
from .curvature import curvature_function, pairs
from .region import Region

ROUND_OFF = 100 * float(np.finfo(float).eps)
"""Round-off of a curvature at conditioning 1, with a margin: two solves and two derivatives."""

JUDGED = 1e-4
"""Conditioning below which curvature is not judged: its round-off, ROUND_OFF / conditioning^2, would pass 1e-6."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What `involutivity` found.

    `witness` is the posture, and `plane` = (i, j) the plane, where the curvature stands out most: `defect`
    [`unit`] is |F_ij| there and `relative` [1/rad] |F_ij| / (|G_i| |G_j|), free of the task's units: how fast
    the planes turn out of themselves per joint motion along them. It decides: holonomic <=> relative <=
    `tolerance`, which near singularities grows with the round-off of F, as 1/conditioning^2.
    F is an analytic function of q, so if it is not zero everywhere a random posture shows it; the sampling
    is there for the size, not for the yes or no. `singular` postures were left out.
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
    subject: str = field(default="strategy")
    rows: tuple[tuple[str, str], ...] = ()
    """(name, unit) of the two task rows of `plane`; none for a bare distribution."""

    @property
    def sentence(self) -> str:
        """The verdict for everybody."""
        if not self.rows:
            word, where = ("involutive", "stay in it") if self.holonomic else ("NOT involutive", "leave it")
            return f"{self.subject} is {word}: the Lie brackets of its fields {where}"
        if self.holonomic:
            return f"{self.subject}, is holonomic: after any closed path of the tool the joints are back at their start"
        sides = " by ".join(f"0.1 {unit}" for _, unit in self.rows)
        joint = self.unit.partition("/")[0].replace("joint unit", "m or rad")
        return (
            f"{self.subject}, is NOT holonomic: a small loop of the tool in {self._plane}, of {sides}, leaves the "
            f"joints about {0.01 * self.defect:.2g} {joint} away from their start, and each further round adds to it"
        )

    @property
    def details(self) -> str:
        """The figures behind the sentence."""
        at = ", ".join(f"{value:.4g}" for value in self.witness)
        skipped = f", {self.singular} singular ones left out" if self.singular else ""
        return (
            f"defect {self.defect:.3g} {self.unit} in {self._plane} at q = [{at}]; {self.relative:.2g} per rad "
            f"of joint motion, where up to {self.tolerance:.0e} counts as zero; {self.samples} postures judged{skipped}"
        )

    @property
    def _plane(self) -> str:
        names = [name for name, _ in self.rows] or [f"field {k + 1}" for k in self.plane]
        return f"the {'-'.join(dict.fromkeys(names))} {'plane' if self.rows else 'bracket'}"

    def __str__(self) -> str:
        return f"{self.sentence}\n  {self.details}"


def involutivity(
    strategy: Strategy, region: Region, *, samples: int = 64, tolerance: float = TOLERANCES.holonomic, seed: int = 0
) -> Verdict:
    """Whether [G_i, G_j] lies in range G for all i, j over a region: the condition (4) of the paper.

    Right for geometric Jacobians too, since the vertical part of the brackets is tested (theory 1.1), and
    free of null-space bases (theory 5.1).

    Args:
        region: box in joint space, for instance `around(q0, 0.3)`.
        samples: postures to look at; singular ones are counted and left out.
        tolerance: largest relative defect [1/rad] that counts as zero.

    Raises:
        EmptyRegionError: every sampled posture is singular. ShapeError: the region has not n joints.
        ArgumentError: `samples` is not a whole number of at least 1.
    """
    task = strategy.task
    if region.n != task.n:
        raise ShapeError("the region", (task.n,), (region.n,))
    Q = region.sample(whole("samples", samples), seed)
    F, G, conditioning, margin = curvature_function(strategy).batch(Q)
    F, G = F.reshape(len(Q), task.n, -1), G.reshape(len(Q), task.n, task.m)
    figure = np.minimum(conditioning, margin)
    sound = figure > JUDGED
    if not sound.any():
        try:
            strategy(Q[0])
        except SingularityError as first:
            raise EmptyRegionError(len(Q), first) from first
        raise EmptyRegionError(len(Q), HolokinError(f"conditioning {figure.max():.1e}, too low to judge curvature"))
    lengths = np.linalg.norm(G[sound], axis=1)
    planes = pairs(task.m) or [(0, 0)]
    scale = np.stack([lengths[:, i] * lengths[:, j] for i, j in planes], axis=1)
    units = [_unit(strategy, i, j) for i, j in planes]
    allowed = np.maximum(tolerance, ROUND_OFF / figure[sound] ** 2)
    return _verdict(Q, F, sound, scale, planes, units, allowed, f"{strategy.name}, {task.name}", task)


def involutivity_of(
    distribution: Callable[[Any], Any],
    n: int,
    region: Region | None = None,
    *,
    samples: int = 64,
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

    Raises:
        EmptyRegionError: the distribution loses rank everywhere. ShapeError: B has not n rows.
    """
    q = symbol("q", n)
    B = as_expression(distribution(q))
    if B.shape[0] != n:
        raise ShapeError("the distribution", (n, "k"), B.shape)
    Q_frame = factorise(B)
    basis = Q_frame.thin_q()
    brackets = pairwise_brackets(B, q)
    normal = [v - basis @ (basis.T @ v) for v in brackets.values()] or [0 * q]
    outputs = {"F": horzcat(*normal), "B": B, "conditioning": Q_frame.conditioning()}
    area = region if region is not None else Region(np.full(n, -1.0), np.full(n, 1.0))
    Q = area.sample(whole("samples", samples), seed)
    F, frames, conditioning = Function("distribution", {"q": q}, outputs).batch(Q)
    sound = conditioning > JUDGED
    if not sound.any():
        raise EmptyRegionError(len(Q), HolokinError("the distribution loses rank"))
    lengths = np.linalg.norm(frames.reshape(len(Q), n, -1)[sound], axis=1)
    planes = list(brackets) or [(0, 0)]
    scale = np.stack([lengths[:, a] * lengths[:, b] for a, b in planes], axis=1)
    F = F.reshape(len(Q), n, -1)
    F[sound] /= scale[:, None, :]
    units = ["/joint unit"] * len(planes)
    allowed = np.maximum(tolerance, ROUND_OFF / conditioning[sound] ** 2)
    return _verdict(Q, F, sound, np.ones_like(scale), planes, units, allowed, f"distribution of rank {B.shape[1]}")


def _verdict(
    Q: Matrix, F: np.ndarray, sound: np.ndarray, scale: np.ndarray, planes: list[tuple[int, int]], units: list[str],
    allowed: Vector, subject: str, task: Task | None = None,
) -> Verdict:  # fmt: skip
    sizes = np.linalg.norm(F[sound], axis=1)
    relative = sizes / scale
    excess = relative / allowed[:, None]
    k, p = np.unravel_index(int(np.argmax(excess)), relative.shape)
    worst = np.flatnonzero(sound)[k]
    return Verdict(
        holonomic=bool(excess[k, p] <= 1.0),
        defect=float(sizes[k, p]),
        unit=units[p],
        relative=float(relative[k, p]),
        tolerance=float(allowed[k]),
        witness=Q[worst],
        plane=planes[p],
        direction=F[worst, :, p],
        samples=int(sound.sum()),
        singular=int((~sound).sum()),
        subject=subject,
        rows=() if task is None else tuple((task.row_names[k], task.units[k]) for k in planes[p]),
    )


def _unit(strategy: Strategy, i: int, j: int) -> str:
    kinds = {c.unit for c in strategy.task.robot.coordinates}
    joint = kinds.pop() if len(kinds) == 1 else "joint unit"
    a, b = strategy.task.units[i], strategy.task.units[j]
    return f"{joint}/{a}^2" if a == b else f"{joint}/({a} {b})"
