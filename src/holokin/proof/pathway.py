"""The proof of a path: cells along it, halved where the test fails, and glued.

Neighbouring cells overlap, and the root at the end of one must lie where the next one's is the only root; so the roots
make one smooth curve of joints. Where a path's pieces meet, and where a closed path ends, its poses agree but for round-off
of at most `SEAM`, which the test carries as a slack.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..path import Path
from ..strategies import HolonomicStrategy
from ..symbolic.intervals import Interval
from ..trajectory import Trajectory
from ..types import Array, Indices, Matrix, Value, Vector, kept
from .certificate import Proven
from .equation import Equation
from .targets import Stretch
from .tube import Cells, Findings, centred, examined

SEAM = 1e-12
"""Metres, and lengths of the columns of rotations, by which the ends of joined pieces may differ."""

OVERLAP = 1 + 1e-9
"""Cells are this much longer than their share, so that neighbours share poses whatever the rounding of their ends."""

SHORTEST = 1e-7
"""Joint motion [joint units] of a cell below which it is not halved: the leaf is singular there."""

LONE = 3.3
"""A root is looked for where it is the only one within this many times the bound of its distance from the predictor, so
that cells can be glued: the predictors of neighbours are apart by the sum of their bounds at most."""

TUBE = 0.25
"""The radius of a tube at first, times omega."""

AIM = 0.33
"""What e, the change of [J; J_g] within a cell, is to be: the test ends at 1, and cells far below it are many."""


@dataclass(frozen=True, eq=False)
class Guess(Value):
    """Joints near the leaf as a function of the path: splines through a trajectory, one a piece."""

    splines: tuple[Callable[[Array], Matrix], ...]
    rows: Matrix
    """Of `Path.table`."""
    ends: Vector
    """Share of each piece up to which it was followed, 1 for all but the last."""

    @staticmethod
    def of(path: Path, walk: Trajectory, samples: int, rotation: Matrix) -> Guess:
        """From the postures of `follow`, which may have ended early."""
        from scipy.interpolate import make_interp_spline

        counts = path.counts(samples)
        rows, splines, ends, first = path.table(rotation), [], [], 0
        for count in counts.tolist():
            got = min(count, len(walk.q) - 1 - first)
            if got < 1:
                break
            u = np.arange(got + 1) / count
            splines.append(make_interp_spline(u, walk.q[first : first + got + 1], k=min(3, got)))
            ends.append(got / count)
            first += count
        return Guess(tuple(splines), rows[: len(splines)], np.array(ends))

    def at(self, piece: Indices, u: Vector) -> Matrix:
        """Joints (k, n) at the shares u (k,) of pieces (k,)."""
        return np.array([self.splines[i](x) for i, x in zip(piece.tolist(), u.tolist(), strict=True)])

    def numbers(self, piece: Indices, low: Vector, high: Vector) -> Matrix:
        """Of the family `Stretch`, of shares from low to high."""
        middle, half = (low + high) / 2, (high - low) / 2 * OVERLAP
        return np.array(
            [Stretch.of(self.rows[i], m, h) for i, m, h in zip(piece.tolist(), middle, half, strict=True)]
        )


@dataclass(frozen=True, eq=False)
class Covered(Value):
    """Cells that were proven, in order, with where each lies; and why no more were."""

    cells: Cells
    findings: Findings
    piece: Indices
    low: Vector
    high: Vector
    status: Proven
    place: tuple[int, float]
    """(piece, share of it) up to which all is proven."""


def first_cells(equation: Equation, guess: Guess, c: Vector) -> tuple[Indices, Vector, Vector, Vector]:
    """(piece, low, high, rho) of cells in which e is about `AIM`, from omega at sampled postures."""
    piece = np.repeat(np.arange(len(guess.splines)), 9)
    u = np.tile(np.linspace(0, 1, 9), len(guess.splines)) * np.repeat(guess.ends, 9)
    q = guess.at(piece, u)
    still = Cells(
        q, np.zeros((len(q), equation.n, 1)), np.zeros((len(q), equation.n, 1)),
        guess.numbers(piece, u, u), np.full(len(q), 1e-6),
    )  # fmt: skip
    omega = np.minimum(examined(equation, still, c).omega, 1e6)
    pieces, lows, highs, rhos = [], [], [], []
    for i, end in enumerate(guess.ends.tolist()):
        here = piece == i
        fine = np.linspace(0, end, 257)
        q = guess.splines[i](fine)
        way = np.linalg.norm(np.diff(q, axis=0), axis=1)
        bend = np.interp((fine[1:] + fine[:-1]) / 2, u[here], omega[here])
        total = np.concatenate([[0.0], np.cumsum(way * bend)])
        count = max(1, int(np.ceil(total[-1] / (2 * AIM))))
        edges = np.interp(np.linspace(0, total[-1], count + 1), total, fine) if total[-1] > 0 else np.array([0.0, end])
        edges[0], edges[-1] = 0.0, end
        pieces.append(np.full(count, i))
        lows.append(edges[:-1])
        highs.append(edges[1:])
        rhos.append(TUBE / np.interp((edges[1:] + edges[:-1]) / 2, u[here], omega[here]))
    return np.concatenate(pieces), np.concatenate(lows), np.concatenate(highs), np.concatenate(rhos)


@kept
def equation_of(strategy: HolonomicStrategy, turning: bool) -> Equation:
    """Its equation along paths, made once."""
    return Equation(strategy, Stretch(turning))


def covered(
    strategy: HolonomicStrategy, guess: Guess, c: Vector, limits: Interval | None, budget: int,
    say: Callable[[int], None] = lambda _n: None,
) -> tuple[Equation, Covered]:  # fmt: skip
    """Cells over all that the guess spans, as far as they can be proven."""
    equation = equation_of(strategy, bool(guess.rows[:, 13:16].any()))
    piece, low, high, rho = first_cells(equation, guess, c)
    again = np.zeros(len(piece), dtype=bool)  # tried before, with a wider tube
    done: list[tuple[Indices, Vector, Vector, Cells, Findings]] = []
    stopped, reasons = [], []
    spent = 0
    while len(piece):
        if spent + len(piece) > budget:
            stopped += list(zip(piece.tolist(), low.tolist(), strict=True))
            reasons += [Proven.BUDGET] * len(piece)
            break
        spent += len(piece)
        numbers = guess.numbers(piece, low, high)
        cells = centred(equation, guess.at(piece, (low + high) / 2), numbers, c, rho, newtons=1)
        found = examined(equation, cells, c, SEAM)
        good = found.passed & (LONE * found.r <= found.alone)
        inside = np.ones(len(piece), dtype=bool)
        if limits is not None:
            inside = ((found.low >= limits.low) & (found.high <= limits.high)).all(axis=1)
        proven = good & inside
        done.append((piece[proven], low[proven], high[proven], cells.only(proven), found.only(proven)))
        say(sum(len(part[0]) for part in done))
        far = np.linalg.norm(cells.reach, axis=1)
        final = ~proven & ~(far > SHORTEST)
        for i in np.flatnonzero(final):
            stopped.append((int(piece[i]), float(low[i])))
            reasons.append(Proven.LIMIT if good[i] else Proven.SINGULAR)
        left = ~proven & ~final
        if stopped:  # nothing behind the first place that cannot be proven is of use
            first = min(stopped)
            left &= (piece < first[0]) | ((piece == first[0]) & (low < first[1]))
        need = np.where(np.isfinite(found.eta), 4 * found.eta, 0.0)  # r is at least eta
        narrower = np.maximum(np.minimum(rho / 4, TUBE / np.clip(found.omega, 1e-3, 1e9)), need)
        retried = left & ~good & ~again & (narrower < 0.9 * rho)
        split = left & ~retried
        middle = (low[split] + high[split]) / 2
        low, high, rho, piece, again = (
            np.concatenate([low[retried], low[split], middle]),
            np.concatenate([high[retried], middle, high[split]]),
            np.concatenate([narrower[retried], *2 * [np.maximum(rho / 2, need)[split]]]),
            np.concatenate([piece[retried], *2 * [piece[split]]]),
            np.concatenate([np.ones(retried.sum(), dtype=bool), np.zeros(2 * split.sum(), dtype=bool)]),
        )
    return equation, _ordered(done, stopped, reasons, guess)


def _ordered(
    done: list[tuple[Indices, Vector, Vector, Cells, Findings]], stopped: list[tuple[int, float]],
    reasons: list[Proven], guess: Guess,
) -> Covered:  # fmt: skip
    from dataclasses import fields

    piece, low, high = (np.concatenate([part[i] for part in done]) for i in range(3))
    cells = Cells(*(np.concatenate([getattr(p[3], f.name) for p in done]) for f in fields(Cells)))
    found = Findings(*(np.concatenate([getattr(p[4], f.name) for p in done]) for f in fields(Findings)))
    order = np.lexsort((low, piece))
    status, place = Proven.WHOLE, (len(guess.ends) - 1, float(guess.ends[-1]))
    if stopped:
        first = min(range(len(stopped)), key=lambda i: stopped[i])
        status, place = reasons[first], stopped[first]
        order = np.array([i for i in order if (piece[i], low[i]) < place], dtype=int)
    return Covered(cells.only(order), found.only(order), piece[order], low[order], high[order], status, place)


def glued(found: Covered) -> Array:
    """(k - 1,) True where the root at the end of a cell is the only root that the next cell has at its beginning."""
    k, d = len(found.cells), found.cells.V.shape[2]
    if k < 2:
        return np.ones(0, dtype=bool)
    last, first = found.cells.predicted(np.ones((k, d))), found.cells.predicted(-np.ones((k, d)))
    apart = np.linalg.norm(last[:-1] - first[1:], axis=1) + found.findings.r[:-1] + 1e-13
    return apart <= found.findings.alone[1:] * (1 - 1e-12)


def closing(found: Covered, revolute: Array) -> tuple[Vector, float]:
    """(whole turns (n,) of the joints, a bound of what is missing besides them); infinite if that is not shown.

    The root at the end must be the only root that the first cell has at its beginning.
    """
    d = found.cells.V.shape[2]
    last = found.cells.predicted(np.ones((len(found.cells), d)))[-1]
    first = found.cells.predicted(-np.ones((len(found.cells), d)))[0]
    turns = np.where(revolute, np.rint((last - first) / (2 * np.pi)), 0.0)
    apart = float(np.linalg.norm(last - 2 * np.pi * turns - first)) + float(found.findings.r[-1]) + 1e-13
    if not apart <= found.findings.alone[0] * (1 - 1e-12):
        return turns, np.inf
    Y = float(np.linalg.norm(found.findings.Y[0])) * (1 + 1e-12)
    return turns, Y * SEAM / (1 - float(found.findings.e[0]))
