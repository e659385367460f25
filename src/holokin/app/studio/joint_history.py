"""What a law's joints did since its loop began, in bounded memory: thinned out as it gets longer."""

from __future__ import annotations

import numpy as np

from ...base.types import Matrix, Vector

ROWS = 4096
"""Samples that are kept; when they are full every second one is dropped, so that a plot shows all of a long run."""


class History:
    """Instants and joints. Rows that were shown are never written to again, so views of them stay true."""

    def __init__(self, joints: int, rows: int = ROWS) -> None:
        self._t, self._q = np.empty(rows), np.empty((rows, joints))
        self._count, self._seen, self._every = 0, 0, 1

    def add(self, t: Vector, q: Matrix) -> None:
        """Samples at instants (k,) of joints (k, n)."""
        for row in range(-self._seen % self._every, len(t), 1):
            if (self._seen + row) % self._every:
                continue
            if self._count == len(self._t):
                self._thin()
                if (self._seen + row) % self._every:
                    continue
            self._t[self._count], self._q[self._count] = t[row], q[row]
            self._count += 1
        self._seen += len(t)

    def _thin(self) -> None:
        """Keep every second row, in new arrays."""
        t, q, rows = self._t[::2], self._q[::2], len(self._t)
        self._t, self._q = np.empty(rows), np.empty((rows, q.shape[1]))
        self._t[: len(t)], self._q[: len(t)] = t, q
        self._count, self._every = len(t), 2 * self._every

    def view(self) -> tuple[Vector, Matrix]:
        """(t (k,), q (k, n)): views that nobody can write to."""
        t, q = self._t[: self._count], self._q[: self._count]
        t.flags.writeable = q.flags.writeable = False
        return t, q
