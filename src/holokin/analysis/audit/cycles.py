"""Cycles of a recorded tool path, found by themselves: whatever the speed, pauses, way in, way out and direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.errors import FileError
from ...base.types import Array, Indices, Matrix, Vector, runs
from ...robot import Robot
from .arcs import (
    BLOCK,
    FREE,
    NOISE_STEPS,
    WHOLE,
    Period,
    ToolMotion,
    ToolPath,
    find_period,
    repeating,
    tool_path,
    with_gaps_closed,
)
from .logs import Recording

# Default length [m/rad] at which a turn of the tool counts like a move: from the wrist to the tool of a usual arm.
LENGTH_SCALE = 0.1

PHASES = 64  # points of equal tool pose that are compared, evenly along the path
_TEMPLATE = 256  # points of a template, at least
_FINE = 80  # of them in the loop's extent: a long loop, such as a raster, needs more than a circle
_MOST_TEMPLATE = 20_000
_SITES = 2000  # searched at one time
_STRAY = 0.04  # share of the loop's size by which the tool may leave the path before a cycle is lost
_SHORT = 0.015  # share of a cycle that may lack at its ends: the tool gap there is measured and corrected


@dataclass(frozen=True, eq=False)
class Cycles:
    """Rounds of the tool on one closed path, in the order of time.

    start, stop (c,): sample positions at which each begins and ends (12.4: 0.4 of the path from sample 12 to 13);
    direction (c,): 1 as the first cycle runs, -1 against it; duration, moving (c,) [s], with and without pauses;
    phase (P + 1,) from 0 to 1: equal tool poses; s (c, P + 1) [m] arc lengths of `path` and q (c, P + 1, n)
    postures there, always along `direction` = 1;
    residual (c,) [m]: largest distance of the tool from the first cycle (turns by the length scale);
    sampling [m]: how much of that the samples, at most, leave open, since the tool may turn between two of them;
    length [m] of one; size [m], its extent; mirror: phase about which the path runs back on itself, or None;
    left_out: cycles that span a gap in time; path: the tool's path by arc length.
    """

    start: Vector
    stop: Vector
    direction: Indices
    duration: Vector
    moving: Vector
    phase: Vector
    s: Matrix
    q: Array
    residual: Vector
    sampling: float
    length: float
    size: float
    mirror: float | None
    left_out: int
    path: ToolPath

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True, eq=False)
class _Track:
    """A stretch on the template: anchors first..last with phases that rise (direction 1) or fall (-1)."""

    s: Vector
    phase: Vector
    direction: int


def find_cycles(
    recording: Recording,
    robot: Robot,
    *,
    tip: str | None = None,
    axes: Matrix = WHOLE,
    length_scale: float = LENGTH_SCALE,
) -> Cycles:
    """Find the cycles of a recording.

    Args:
        axes: those of the tool (3, a), as columns, whose directions belong to its path: `WHOLE`, the orientation;
            `FREE`, none; or the one about which the tool may spin.
        length_scale: [m/rad], what one radian of turn counts beside metres in the distance of two poses.

    Raises:
        FileError: the tool does not move, repeats no path, or runs fewer than two whole cycles.
    """
    # A period of the tool's path, from a part of the log.
    motion = ToolMotion(robot, recording.q, tip, axes, length_scale)
    extent, noise = motion.extent_and_noise()
    if extent < max(1e-6, 4 * NOISE_STEPS * noise):
        fact = f"the tool moves by {extent:.2g} m only, with {noise:.2g} m of noise"
        raise FileError(recording.source, fact, "log a motion of the arm, check tip and unit")
    period = find_period(motion, noise, max(extent / 400, NOISE_STEPS * noise))
    if period is None:
        raise _no_cycles(recording, robot, tip, axes, length_scale)
    # The path over all of the log, and one round of it as the template.
    points = int(np.clip(_FINE * period.length / extent, _TEMPLATE, _MOST_TEMPLATE))
    path = tool_path(motion, max(period.length / points, NOISE_STEPS * noise), noise)
    begin, length = _begin_of(path, *_first_round(path, period), noise, 0.1 * extent)
    template = path.point(begin + length * np.arange(points) / points)
    mirror = _mirror(template)
    size = float(np.linalg.norm(template.max(axis=0) - template.min(axis=0)))
    if mirror is not None:
        turn = begin + mirror * length
        if np.linalg.norm(path.point(turn) - path.point(turn + length / 2)) < _STRAY * size:
            begin, length, mirror = turn, length / 2, None  # there and back round a closed loop: two cycles
            template = path.point(begin + length * np.arange(points) / points)
    # The rounds of the log along the template.
    tracks = _tracks(path, template, length, max(_STRAY * size, 1.5 * path.step), mirror)
    return _cut(recording, path, tracks, begin, length, size, mirror, points)


def _no_cycles(recording: Recording, robot: Robot, tip: str | None, axes: Matrix, length_scale: float) -> FileError:
    fact = "the tool repeats no path in the same direction, so there are fewer than two cycles"
    cure = "log at least two whole cycles, check tip and unit"
    if axes.shape[1]:
        try:
            find_cycles(recording, robot, tip=tip, axes=FREE, length_scale=length_scale)
        except FileError:
            pass
        else:
            fact = "the pose of the tool repeats no path, but its position does"
            cure = "pass --position (orientation=False) if the orientation is free, --axis z if the tool may spin"
    return FileError(recording.source, fact, cure)


def _first_round(path: ToolPath, period: Period) -> tuple[float, float]:
    """Arc length at which the repeating begins, and that of a round."""
    begin, end = path.arc(np.array([period.begin, period.end]))
    length = float(end - begin)
    if not period.whole:  # the period was found in a part of the log: the rounds before that part count too
        unit = length / PHASES
        run = repeating(path.point(np.asarray(np.arange(0.0, path.length, unit), dtype=float)), PHASES)
        begin = unit * run[0] if run is not None else begin
    return float(begin), length


def _begin_of(path: ToolPath, begin: float, length: float, noise: float, most: float) -> tuple[float, float]:
    """Arc length at which the repeating begins, to the last anchor, and the length of the round from there; points that
    correspond are looked for within `most` [m]."""
    first, last = max(0.0, begin - 0.2 * length), min(begin + length, path.length - length)
    grid = np.asarray(np.arange(first, last, path.step / 2), dtype=float)
    lag = length
    if len(grid) > 4:
        z = path.point(grid)
        ahead = np.minimum(nearest(path, z, grid + length, min(0.02 * length, most)), path.length)
        gap = np.linalg.norm(path.point(ahead) - z, axis=1)
        along = np.einsum("ij,ij->i", path.point.slope(ahead), path.point.slope(grid))
        against = along < -0.5  # beyond a turn: the path back
        inside = grid >= begin + 0.2 * length
        usual = np.median(gap[inside]) if inside.any() else np.median(gap)
        sound = (gap <= 5 * usual + 2 * noise + 0.1 * path.step) & ~against
        alike = runs(with_gaps_closed(sound, round(0.01 * length / path.step)))  # a corner does not end it
        alike = alike[alike[:, 1] - alike[:, 0] >= 0.1 * length / (path.step / 2)]
        begin = float(grid[alike[0, 0]]) if len(alike) else begin
        lag = float(np.median(ahead - grid))
    begin = 0.0 if begin < path.step else begin
    there = path.point(np.array([begin]))
    stop = nearest(path, there, np.array([min(begin + lag, path.length)]), min(0.02 * lag, most))
    return begin, float(stop[0]) - begin


def nearest(path: ToolPath, target: Matrix, guess: Vector, reach: float) -> Vector:
    """Arc lengths near the guesses (k,), at most `reach` [m] away, at which the tool is closest to targets (k, d)."""
    rows = range(0, len(guess), _SITES)
    parts = [_nearest(path, target[i : i + _SITES], guess[i : i + _SITES], reach) for i in rows]
    return np.concatenate(parts) if parts else np.empty(0)


def _nearest(path: ToolPath, target: Matrix, guess: Vector, reach: float) -> Vector:
    low, high = np.maximum(guess - reach, 0.0), np.minimum(guess + reach, path.length + path.beyond)
    count = int(np.clip(2 * reach / path.step, 8, 80)) // 2 * 2 + 1
    tries = np.clip(guess + np.linspace(-1, 1, count)[:, None] * reach, low, high)
    distance = np.linalg.norm(path.point(tries) - target, axis=2)
    s = np.take_along_axis(tries, np.argmin(distance, axis=0)[None], axis=0)[0]
    best = distance.min(axis=0)
    width = 2 * reach / (count - 1)
    for _ in range(18):  # halving search: sure at corners, where Newton's method swings
        width /= 1.6
        for side in (-1, 1):
            trial = np.clip(s + side * width, low, high)
            d = np.linalg.norm(path.point(trial) - target, axis=1)
            better = d < best
            s, best = np.where(better, trial, s), np.where(better, d, best)
    return s


def _mirror(template: Matrix) -> float | None:
    """Phase about which the closed path runs back on itself, z(a + u) = z(a - u) for all u; None if about none."""
    z = template - template.mean(axis=0)
    spectrum = np.fft.fft(z, axis=0)
    products = np.fft.ifft(spectrum**2, axis=0).real.sum(axis=1)  # sum over i of z(i) . z(m - i)
    m = int(np.argmax(products))
    energy = float((z**2).sum())
    return m / 2 / len(z) if 2 * (energy - products[m]) < (2 * _STRAY) ** 2 * energy else None


def _tracks(path: ToolPath, template: Matrix, length: float, width: float, mirror: float | None) -> list[_Track]:
    """Stretches of the log that run along the template, forward or backward, each as long as it goes."""
    from scipy.spatial import KDTree

    # The nearest point of the template to each anchor, and the cosine between the tool's and the template's directions.
    count = len(template)
    distance, closest = KDTree(template).query(path.z)
    facing = np.asarray(closest)
    ahead = np.roll(template, -2, axis=0) - np.roll(template, 2, axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-300)
    way = np.empty(len(path.z))
    for i in range(0, len(path.z), BLOCK):
        j = min(i + BLOCK, len(path.z))
        early, late = max(i - 1, 0), min(j + 1, len(path.z))
        moves = np.gradient(path.z[early:late], axis=0)[i - early : j - early]
        moves /= np.maximum(np.linalg.norm(moves, axis=1, keepdims=True), 1e-300)
        way[i:j] = np.einsum("ij,ij->i", moves, ahead[facing[i:j]])
    # From each anchor that surely runs along the template, the track is followed on and back.
    seeds = (distance < width) & (np.abs(way) > 0.8)
    tracker = _Tracker(path, template, length, width, distance <= width, facing)
    out: list[_Track] = []
    j, done = 0, 0
    while j < len(path.z):
        if not seeds[j]:
            j += 1
            continue
        sign, closest_row = (1 if way[j] > 0 else -1), int(facing[j])
        if mirror is not None and sign < 0:  # the path back is the second half of the path itself
            sign, closest_row = 1, round(2 * mirror * count - closest_row) % count
        later = tracker.run(j, closest_row, sign, 1, len(path.z) - 1)
        earlier = tracker.run(j, closest_row, sign, -1, done)
        # Its part from the lowest to the highest phase: what stood before a turn belongs to no track.
        phases = np.array([*earlier[:0:-1], *later]) * sign
        anchors = np.arange(j - len(earlier) + 1, j + len(later))
        low = int(np.flatnonzero(phases == phases.min())[-1])
        high = int(np.flatnonzero(phases == phases.max())[0])
        if high > low:
            keep = slice(low, high + 1)
            out.append(_Track(path.s[anchors[keep]], phases[keep] * sign / count, sign))
        done = int(anchors[max(high, 0)])
        j = max(done, j) + 1
    return out


class _Tracker:
    """Follows the template from anchor to anchor."""

    def __init__(
        self, path: ToolPath, template: Matrix, length: float, width: float, near: Array, facing: Indices
    ) -> None:
        self.z, self.template, self.width = path.z, template, width
        self.windows = ((2.0 * np.diff(path.s) / length * len(template)).astype(int) + 3).tolist()
        self.near, self.facing = near.tolist(), facing.tolist()  # lists of small numbers: quick, and not large

    def run(self, j: int, row: int, sign: int, time: int, limit: int) -> list[int]:
        """Template indices, unwrapped, of the anchors from j on (time = 1) or back (-1), until the tool leaves it."""
        count, way = len(self.template), sign * time
        rows = [row]
        while j != limit:
            window = self.windows[j if time > 0 else j - 1]
            j += time
            if not self.near[j]:
                break
            ahead = (self.facing[j] - row) * way % count
            if ahead > window:  # the nearest of all points is another pass; look at those in reach
                indices = row + way * np.arange(window + 1)
                gap = self.template[indices % count] - self.z[j]
                d = np.einsum("ij,ij->i", gap, gap)
                ahead = int(np.argmin(d))
                if d[ahead] > self.width * self.width:
                    break
            row += way * ahead
            rows.append(row)
        return rows


def _cut(
    recording: Recording,
    path: ToolPath,
    tracks: list[_Track],
    begin: float,
    length: float,
    size: float,
    mirror: float | None,
    points: int,
) -> Cycles:
    """Whole rounds of the tracks, at `PHASES` equal tool poses."""
    # The whole rounds of each track: arc lengths at equal phases.
    phase = np.arange(PHASES + 1) / PHASES
    target = path.point(begin + length * phase)
    target[-1] = target[0]
    rounds, direction = [], []
    for track in tracks:
        rising = np.maximum.accumulate(track.phase * track.direction)
        edge = np.unique(rising, return_index=True)
        first, last = int(np.ceil(rising[0] - _SHORT)), int(np.floor(rising[-1] + _SHORT))
        for k in range(first, last):
            rounds.append(np.interp(k + phase, edge[0], track.s[edge[1]]))
            direction.append(track.direction)
    # Those within which a gap in time lies are left out.
    where = path.index.astype(float)
    gaps = np.interp(recording.gaps + 0.5, where, path.s) if len(recording.gaps) else np.empty(0)
    whole = [i for i, r in enumerate(rounds) if not ((gaps > r[0]) & (gaps < r[-1])).any()]
    left_out = len(rounds) - len(whole)
    if len(whole) < 2:
        fact = f"it holds {len(whole)} whole cycles of a path of {length:.3g} m, {left_out} more span gaps"
        raise FileError(recording.source, fact, "log at least two whole cycles")
    # Where the tool is nearest to the first cycle's poses, and the postures there.
    ways = np.array([direction[i] for i in whole])
    targets = np.concatenate([target if d > 0 else target[::-1] for d in ways])
    s = nearest(path, targets, np.concatenate([rounds[i] for i in whole]), 2.5 * path.step + 2 * length / points)
    residual = np.linalg.norm(path.point(s) - targets, axis=1).reshape(len(whole), -1).max(axis=1)
    sampling = _sampling(path, s)
    s = s.reshape(len(whole), -1)
    q = path.posture(s)
    # How long each lasts, with and without the time that steps between anchors last longer than ten usual ones.
    times = recording.t[path.index]
    steps = np.diff(times)
    usual = float(np.median(steps))
    start, stop = s[:, 0].copy(), s[:, -1].copy()
    duration = np.interp(stop, path.s, times) - np.interp(start, path.s, times)
    rest = np.concatenate([[0.0], np.cumsum(np.where(steps > 10 * usual, steps - usual, 0.0))])
    moving = duration - (np.interp(stop, path.s, rest) - np.interp(start, path.s, rest))
    back = ways < 0
    q[back], s[back] = q[back, ::-1], s[back, ::-1]
    return Cycles(
        np.interp(start, path.s, where), np.interp(stop, path.s, where), ways, duration, moving, phase, s, q, residual,
        sampling, length, size, mirror, left_out, path,
    )  # fmt: skip


def _sampling(path: ToolPath, s: Vector) -> float:
    """How far off its samples' curve the tool may have been at arc lengths s: h |t' - t| / 4, of the tangents h before
    and after, for samples h apart. So far the chord of two samples cuts off a corner between them."""
    per_anchor = np.diff(path.s) / np.maximum(np.diff(path.index), 1)
    interval = np.clip(np.searchsorted(path.s, s, side="right") - 1, 0, len(per_anchor) - 1)
    h = per_anchor[interval]
    reach = np.maximum(h, np.diff(path.s)[interval])  # a tangent is known from anchor to anchor
    turn = np.linalg.norm(path.point.slope(s + reach) - path.point.slope(s - reach), axis=1)
    return float((h * np.minimum(turn, 2.0)).max() / 4)


_POINTS = 512
_APART = 0.03  # share of a cycle by which two passes lie apart at least: less is the path's own neighbourhood
_MEETS = 2e-3  # share of the path's size up to which two passes meet; the rest is corrected and counted as noise
_MOST = 64


def crossings(cycles: Cycles) -> tuple[Vector, Vector]:
    """Arc lengths (k,), (k,) of the two passes of each crossing in the last cycle; none for a retraced path.

    Candidates are local minima of the distance between two points of the cycle, refined by stepping from one pass
    to the nearest point of the other until both rest.
    """
    none = np.empty(0)
    path = cycles.path
    begin, end = sorted((float(cycles.s[-1, 0]), float(cycles.s[-1, -1])))
    spacing = (end - begin) / _POINTS
    if cycles.mirror is not None or spacing <= 0:
        return none, none
    s = np.asarray(begin + spacing * np.arange(_POINTS), dtype=float)
    z = path.point(s)
    squares = (z**2).sum(axis=1)
    d = np.sqrt(np.maximum(squares[:, None] + squares - 2 * z @ z.T, 0.0))
    low = np.ones_like(d, dtype=bool)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            low &= d <= np.roll(d, (i, j), axis=(0, 1))
    lag = np.arange(_POINTS) - np.arange(_POINTS)[:, None]
    apart = (lag > _APART * _POINTS) & (lag < (1 - _APART) * _POINTS)
    a, b = np.nonzero(low & apart & (d < 2 * spacing))
    chosen = np.argsort(d[a, b], kind="stable")[:_MOST]
    first, second = s[a[chosen]], s[b[chosen]]
    for _ in range(12):
        first = np.asarray(np.clip(nearest(path, path.point(second), first, 2 * spacing), begin, end), dtype=float)
        second = np.asarray(np.clip(nearest(path, path.point(first), second, 2 * spacing), begin, end), dtype=float)
    gap = np.linalg.norm(path.point(first) - path.point(second), axis=1)
    meets = gap < max(_MEETS * cycles.size, float(cycles.residual.max()))
    return first[meets], second[meets]
