"""Which cases are sent together: so many that a batch takes about a second, by the seconds of the rows that came."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import islice

from .one_case import Row

SECONDS = 1.0
"""That a batch is to take, at least: sending one costs milliseconds, and what a kill loses is a batch."""

RATE = 100.0
"""Batches in a second, at most: for each the client and the scheduler of a cluster take seven milliseconds."""

SHARE = 4
"""Batches that are left for each worker, at least, so that all end together."""

MOST = 4096
"""Cases of a batch."""

Batch = tuple[int, ...]
"""Numbers of cases."""


def lasting(workers: int) -> float:
    """Seconds that a batch is to take, with so many workers."""
    return max(SECONDS, workers / RATE)


class Batches:
    """Numbers of cases that wait, taken in batches.

    The first batches are all laws of one loop. The later ones follow the mean of the seconds of a case; what a worker
    hands back, since it took too long, is taken again.
    """

    def __init__(self, numbers: Iterable[int], count: int, laws: int = 1) -> None:
        self._numbers, self._back, self._laws = iter(numbers), deque[int](), laws
        self.left, self.seconds = count, float("nan")

    def take(self, workers: int) -> Batch:
        """The next batch, for one of so many workers; empty where none is left."""
        batch = [self._back.popleft() for _ in range(min(self.size(workers), len(self._back)))]
        batch += islice(self._numbers, self.size(workers) - len(batch))
        self.left = max(0, self.left - len(batch))
        return tuple(batch)

    def size(self, workers: int) -> int:
        """Cases of the next batch: of whole loops, if they are few enough."""
        wanted = lasting(workers) / self.seconds if self.seconds > 0 else self._laws
        wanted = int(min(wanted, MOST, self.left / (SHARE * max(workers, 1))))
        return max(1, wanted - wanted % self._laws if wanted > self._laws else wanted)

    def came(self, batch: Batch, rows: Sequence[Row]) -> None:
        """What became of a batch: cases without a row wait again. Later rows count more in the mean."""
        if rows:
            mean = sum(row.seconds for row in rows) / len(rows)
            self.seconds = (self.seconds + mean) / 2 if self.seconds > 0 else mean
        there = {row.number for row in rows}
        self.again(number for number in batch if number not in there)

    def again(self, batch: Iterable[int]) -> None:
        """Cases to be taken again, before all others."""
        before = len(self._back)
        self._back.extendleft(reversed(tuple(batch)))
        self.left += len(self._back) - before
