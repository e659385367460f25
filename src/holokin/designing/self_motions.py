"""Self-motions at many tool poses, walked all at once: straight lines among the postures that hold the tool.

dq/ds = v, where v is the last direction without its part that moves the tool. With one redundant joint that is the
self-motion itself, with several a line in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..symbolic import wrapped
from ..task import Task
from ..types import Array, Flags, Indices, Matrix, Value, Vector

STEP = 0.2
"""Arc length [joint units] of a step: two Newton steps correct it to round-off."""

SAME = 1e-6
"""Correction [joint units] of a posture that holds its pose already, at most."""

SAME_WAY = 0.9
"""Cosine between two directions in one place from which on they are one: else the curve comes by, and is not closed."""


@dataclass(frozen=True, eq=False)
class SelfMotions(Value):
    """The postures that hold the tool at poses p (S, 3), R (S, 3, 3)."""

    task: Task
    p: Matrix
    R: Array

    def best(
        self, least: Callable[[Matrix], Matrix], Q: Matrix, v: Matrix, step: float, length: float
    ) -> tuple[Matrix, Array]:
        """The least of some costs (kinds, S) on walks both ways from Q (S, n), and its postures (kinds, S, n).

        Args:
            least: postures (k, n) -> costs (kinds, k). v: directions (S, n) to begin with.
        """
        values = least(Q)
        best, closed = np.array([Q] * len(values)), np.zeros(len(Q), dtype=bool)
        for sign in (1.0, -1.0):
            i = np.flatnonzero(~closed)
            if not len(i):
                break
            at, along, _ = self._step(Q[i], sign * v[i], i, np.zeros(len(i)))
            first = along
            for k in range(int(np.ceil(length / step))):
                at, along, sound = self._step(at, along, i, np.full(len(i), step))
                back = (self._away(at, Q[i]) < 0.6 * step) & (np.sum(along * first, axis=1) > SAME_WAY) & (k > 2)
                closed[i[back & (np.linalg.norm(at - Q[i], axis=1) < step)]] = True  # else a hinge has made a turn
                on = sound & ~back
                i, at, along, first = i[on], at[on], along[on], first[on]
                if not len(i):
                    break
                found = least(at)
                for kind, better in enumerate(found < values[:, i]):
                    values[kind, i[better]], best[kind, i[better]] = found[kind, better], at[better]
        return values, best

    def walked(self, Q: Matrix, v: Matrix, lengths: Vector) -> tuple[Matrix, Flags]:
        """Postures (S, n) so far [joint units] along the self-motions through Q (S, n), and which walks got there."""
        every, steps = np.arange(len(Q)), int(np.ceil(np.abs(lengths).max() / STEP))
        at, along, sound = self._step(Q, v, every, np.zeros(len(Q)))
        for _ in range(steps):
            at, along, here = self._step(at, along, every, lengths / steps)
            sound &= here
        return at, sound

    def _away(self, q: Matrix, start: Matrix) -> Vector:
        """How far postures (k, n) are from others [joint units], full turns of hinges taken off."""
        off, hinges = q - start, self.task.robot.hinges
        off[:, hinges] = wrapped(off[:, hinges])
        return np.linalg.norm(off, axis=1)

    def _step(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        """One step of postures (k, n) along their directions: (postures, directions there, which of them hold)."""
        start = q
        q = q + length[:, None] * v
        for _ in range(2):
            J = self.task.jacobian_batch(q)[0]
            e = self.task.error_function.batch(q, self.p[i], self.R[i]).reshape(len(q), -1)
            found = right_inverse(J, np.stack([e, np.einsum("kmn,kn->km", J, v)], axis=2))
            q, v = q + found[:, :, 0], v - found[:, :, 1]
            v = v / np.linalg.norm(v, axis=1, keepdims=True)
        sound = np.isfinite(q).all(axis=1) & (np.linalg.norm(q - start, axis=1) < 2 * np.abs(length) + SAME)
        q = np.where(sound[:, None], q, start)
        return q, v, sound


def right_inverse(J: Array, wanted: Array, weights: Array | float = 1.0) -> Array:
    """The least weighted dq (S, n, k) with J dq = wanted (S, m, k); weights (n,) or (S, n)."""
    T = np.swapaxes(J, 1, 2) / np.asarray(weights)[..., None]
    with np.errstate(all="ignore"):
        try:
            return T @ np.linalg.solve(J @ T, wanted)
        except np.linalg.LinAlgError:  # one of them is singular to the last bit
            return T @ np.linalg.pinv(J @ T) @ wanted
