"""Postures at equal tool poses, cycle by cycle: the directions in which they can differ, and the noise there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Array, Matrix, Vector
from ...symbolic.null_space import null_space

MOST_GAIN = 3.0
"""Encoder noise along the path, times how fast the spare joints run beside the tool, is taken to grow by no more than
this: at the tips of a path the tool's direction, and with it the gain, is not known."""


@dataclass(frozen=True, eq=False)
class Visits:
    """Postures `joints` (k, P, n) at P tool poses, visited in the cycles number `when` (k,).

    axes (P, n, d): spare directions, orthonormal; moves (k, P, n): joint moves that brought the postures to the
    poses; noise (P, d), move_noise (P,): standard deviation of encoder noise along the axes, and in the moves (of all
    joints together).
    """

    joints: Array
    axes: Array
    when: Vector
    moves: Array
    noise: Matrix
    move_noise: Vector

    def __len__(self) -> int:
        return len(self.joints)

    @cached_property
    def y(self) -> Array:
        """Coordinates along the axes (k, P, d), less their mean over the cycles."""
        return np.einsum("kpn,pnd->kpd", self.joints - self.joints.mean(axis=0), self.axes)

    @property
    def lever(self) -> Matrix:
        """Largest joint's share in each axis (P, d)."""
        return np.abs(self.axes).max(axis=1)

    def last(self, count: int) -> Visits:
        """The last cycles alone."""
        when = self.when[-count:] - self.when[-count]
        return Visits(self.joints[-count:], self.axes, when, self.moves[-count:], self.noise, self.move_noise)


def spare_axes(jacobian: Array) -> Array:
    """Orthonormal null spaces (P, n, d) of Jacobians (P, m, n), turned as little as can be from one to the next.

    Where no direction is spare, all joints are: whatever differs at equal tool poses is then looked for in each.
    """
    count, m, n = jacobian.shape
    if n <= m:
        return np.tile(np.eye(n), (count, 1, 1))
    axes = null_space(jacobian).copy()
    if n - m == 1:
        signs = np.sign(np.einsum("pn,pn->p", axes[1:, :, 0], axes[:-1, :, 0]))
        axes[1:] *= np.cumprod(np.where(signs < 0, -1.0, 1.0))[:, None, None]
        return axes
    for p in range(1, count):
        u, _, v = np.linalg.svd(axes[p].T @ axes[p - 1])
        axes[p] = axes[p] @ u @ v
    return axes


def encoder_noise(
    jacobian: Array, axes: Array, rate: Matrix, weights: Vector, level: Vector
) -> tuple[Matrix, Matrix, Vector]:
    r"""Standard deviations (P, d) along the axes and (P, n) of the joints that encoder noise leaves at a tool pose, and
    (P,) of the move there, all joints together.

    The pose is looked for along the path, so noise e moves the visit by $-q' (q'^T M e) / (q'^T M q')$ with
    $M = J^T W J$; what is off the path is taken out by the pseudo-inverse.

    Args:
        jacobian (P, m, n), rate (P, n): dq by phase. weights (m,): of the task rows in the distance of two poses.
        level (n,): of the joints' encoders [joint units].
    """
    towards = np.einsum("pmn,m,pml,pl->pn", jacobian, weights, jacobian, rate)
    size = np.maximum(np.einsum("pn,pn->p", rate, towards), 1e-300)
    ahead = np.einsum("pnd,pn->pd", axes, rate) / size[:, None]
    across = axes.transpose(0, 2, 1) - ahead[:, :, None] * towards[:, None, :]  # (P, d, n)
    plain = np.sqrt(np.einsum("pnd,n->pd", axes**2, level**2))
    along = np.sqrt(np.einsum("pdn,n->pd", across**2, level**2))
    capped = np.minimum(along, MOST_GAIN * plain)
    scale = capped / np.maximum(along, 1e-300)
    joints = np.einsum("pnd,pd,pdl->pnl", axes, scale, across)
    n = len(level)
    whole = np.eye(n) - rate[:, :, None] * (towards / size[:, None])[:, None, :]
    off = whole - axes @ (axes.transpose(0, 2, 1) @ whole) if axes.shape[2] < n else np.zeros_like(whole)
    moves = np.minimum(np.sqrt(np.einsum("pnl,l->p", off**2, level**2)), MOST_GAIN * np.linalg.norm(level))
    return capped, np.sqrt(np.einsum("pnl,l->pn", joints**2, level**2)), moves
