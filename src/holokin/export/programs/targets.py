"""Targets of robot programs: which moves and samples of a timed motion they are, on which axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ...base.arguments import check, check_counts
from ...base.errors import ArgumentError, ExportError, UnknownNameError
from ...base.types import Indices, Matrix, Value, Vector, number, positive
from ...motion import TimedTrajectory
from ...robot import FARTHEST
from .moves import FINER, KINDS, PLACES, Dialect, Kind, ProcessLines, ToolDeviation, ToolMotion, ToolTolerance, finer

# --- Which samples of a timed motion become targets of a program, and by which moves the controller goes between them.


@dataclass(frozen=True)
class Move:
    """From sample a to sample b; a circular one by way of sample `via`.

    `length` [m] is the tool's way, and `speed` [m/s] its speed on linear and circular moves: NaN where nobody asked.
    """

    kind: Kind
    a: int
    b: int
    via: int = -1
    speed: float = float("nan")
    length: float = float("nan")


def farthest(fits: Callable[[int], bool], first: int, end: int) -> int:
    """The last sample up to `end` that fits, by doubling and halving; the next one always does."""
    good, bad, step = first + 1, end + 1, 1
    while good + step < bad:
        if fits(good + step):
            good, step = good + step, 2 * step
        else:
            bad = good + step
            break
    while good < end and bad - good > 1:
        middle = min((good + bad) // 2, end)
        good, bad = (middle, bad) if fits(middle) else (good, middle)
    return good


def _fixed_samples(timed: TimedTrajectory, more: Indices | tuple[int, ...] = ()) -> list[int]:
    """Samples that are targets in any case: the start, the end, corners, and where cycles begin."""
    return sorted({0, *timed.marks, *timed.stops, *map(int, more), len(timed) - 1})


def tool_moves(
    timed: TimedTrajectory,
    tolerance: ToolTolerance,
    own: Indices,
    more: tuple[int, ...] = (),
    kinds: tuple[Kind, ...] = KINDS,
) -> tuple[list[Move], ToolDeviation]:
    """The moves that keep a tool within its tolerance, each as long as may be, and how far they are from the motion.

    Args:
        own: the joints (a,) that the controller's own inverse moves.
        more: samples that must be targets too.
        kinds: the moves that the language has.

    Where two samples that follow each other are not within the tolerance, the move between them is a joint move all
    the same: there is none shorter.
    """
    motion = ToolMotion.of(timed, tolerance, own)
    candidates: list[Kind] = ["linear", "circular", "joint"]
    candidates = [kind for kind in candidates if kind == "joint" or (tolerance.linear and kind in kinds)]
    moves: list[Move] = []
    largest = ToolDeviation()
    for end in _fixed_samples(timed, more)[1:]:
        while (a := moves[-1].b if moves else 0) < end:
            # The move that leads farthest, of equal ones the first; an entry is the joints' own way.
            allowed = candidates if a >= timed.begin else candidates[-1:]
            ends = {kind: _last_sample(motion, tolerance, kind, a, end) for kind in allowed}
            kind = max(allowed, key=ends.__getitem__)
            kind, b = (kind if ends[kind] > a + 1 else "joint"), ends[kind]
            first, last = FINER * a, FINER * b
            via = motion.middle(first, last) // FINER if kind == "circular" else -1
            speed = float("nan") if kind == "joint" else motion.steady(first, last)
            moves.append(Move(kind, a, b, via, speed, float(motion.way[last] - motion.way[first])))
            largest |= measured(motion, kind, a, b)
    share = float(motion.has_speed.mean())
    return moves, replace(largest, compared=share, kept=largest.within(tolerance))


def measured(motion: ToolMotion, kind: Kind, a: int, b: int, looks: int | None = None) -> ToolDeviation:
    """How far a move from sample a to sample b is from the motion, with its joints, at some instants or all."""
    first, last, rows = _instants(a, b, looks)
    deviation = motion.deviation(kind, first, last, rows)
    return deviation | ToolDeviation(joints=motion.joint_deviation(kind, first, last, rows))


def _instants(a: int, b: int, looks: int | None) -> tuple[int, int, Indices]:
    """The instants of sample a and of sample b, and some of those from one to the other, or all."""
    first, last = FINER * a, FINER * b
    return first, last, np.unique(np.linspace(first, last, looks or last - first + 1).astype(int))


def _last_sample(motion: ToolMotion, tolerance: ToolTolerance, kind: Kind, a: int, end: int) -> int:
    """The last sample to which one move of a kind from sample a keeps the tolerance; the next one if none does."""

    def within(b: int, looks: int | None = None) -> bool:
        first, last, rows = _instants(a, b, looks)
        if not motion.deviation(kind, first, last, rows).within(tolerance):
            return False
        if motion.load(kind, first, last, rows) > 1.0 + tolerance.speed:
            return False
        return motion.joint_deviation(kind, first, last, rows) <= tolerance.joints

    # As far as 33 instants of the move are within; then all must be.
    b = farthest(lambda b: within(b, 33), a, end)
    while b > a + 1 and not within(b):
        b = a + max(1, (b - a) * 7 // 8)
    # A tool that moves by less than 0.1 mm turns in place, and has no speed in m/s.
    moved = np.ptp(motion.p[FINER * a : FINER * b + 1], axis=0).max()
    return b if kind == "joint" or moved > 1e-4 else a + 1


Entry = str | float
"""Of an axis: the joint that it moves, or the value [rad or m] at which it stands still."""


@dataclass(frozen=True, eq=False)
class Wiring(Value):
    """How a controller's axes are moved by the joints: axis = sign * joint + offset [rad or m].

    Attributes:
        axes: of the robot itself, in the controller's order: joints by name, or values at which an axis stands still.
            By default the joints in the order of the trajectory.
        external: of external axes, the same.
        signs: -1 for the joints that the controller counts the other way round, by name.
        offsets: the controller's value where the joint is at 0 [rad or m], by name.
    """

    axes: Sequence[Entry] | None = None
    external: Sequence[Entry] = ()
    signs: Mapping[str, int] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        check("axes", Sequence[Entry] | None, self.axes)
        check("external", Sequence[Entry], self.external)
        check_counts(self.signs, self.offsets, {})


@dataclass(frozen=True, eq=False)
class Targets(Value):
    """Targets of a program, and the moves to them.

    Attributes:
        timed, wiring, dialect, lines: of what, for which axes, in which language, with which lines of the process.
        t, q: instants (k,) and the controller's axes (k, axes + external) [rad or m].
        samples: which samples of the timed motion they are.
        lengths: which axes are in metres.
        stops: which targets are stops. own: how many axes are the robot's own.
        deviation: how far joints are off if they move evenly between.
        moves: how the controller goes to each but the first (k - 1).
        via: the axes on the way of circular moves, by their place in `moves`.
        tool: how far the tool is off; None where nobody asked.
        asked: whether linear moves were asked for.
        on, off: the targets at which the process begins and ends.
    """

    timed: TimedTrajectory
    wiring: Wiring
    dialect: Dialect
    lines: ProcessLines
    t: Vector
    q: Matrix
    samples: tuple[int, ...]
    lengths: tuple[bool, ...]
    stops: tuple[bool, ...]
    own: int
    deviation: float
    moves: tuple[Move, ...]
    via: Mapping[int, Vector]
    tool: ToolDeviation | None
    asked: bool
    on: int
    off: int

    def shown(self, axes: Matrix | Vector | None = None) -> Matrix:
        """Axes in degrees and millimetres: those of all targets (k, axes + external), or given ones."""
        q = self.q if axes is None else axes
        return np.where(np.array(self.lengths), 1e3 * q, np.rad2deg(q)) + 0.0

    @property
    def seconds(self) -> Vector:
        """From each target to the next (k - 1,); of linear and circular moves without the ramps."""
        even = [m.length / m.speed if m.kind != "joint" else np.nan for m in self.moves]
        return np.where(np.isfinite(even), even, np.diff(self.t))

    @property
    def linear(self) -> bool:
        """Whether there are linear or circular moves."""
        return any(move.kind != "joint" for move in self.moves)


def targets(
    timed: TimedTrajectory,
    wiring: Wiring | None,
    dialect: Dialect,
    tolerance: float | ToolTolerance | None,
    lines: ProcessLines | None,
) -> Targets:
    """As few samples as keep the motion within a tolerance of the trajectory, as a controller moves between them.

    Args:
        wiring: of the controller's axes; by default one for each joint.
        dialect: of the language, which says how many axes it holds, and which moves it has.
        tolerance: of the joints [rad or m], or of the tool; None for all samples. Starts, ends and corners are always
            targets.
        lines: of the process; those where it begins and ends need targets. By default none.

    Raises:
        ExportError: the program's language cannot hold the robot, or has no linear moves for it.
        ArgumentError: bad wiring; a tolerance of another robot's tool.
    """
    wiring, lines = wiring or Wiring(), lines or ProcessLines()
    q, lengths = wired(timed, wiring, dialect, timed.q)
    window = _window(timed, lines)
    more = window if lines.on or lines.off else ()
    # The moves, and the samples to which they lead.
    tool, linear = None, False
    if isinstance(tolerance, ToolTolerance):
        moves, tool = tool_moves(timed, tolerance, _of_arm(timed, wiring, tolerance), more, dialect.kinds)
        linear = tolerance.linear and "linear" in dialect.kinds
    else:
        some = None if tolerance is None else chosen(timed, positive("tolerance", tolerance), more).tolist()
        moves = [Move("joint", a, b) for a, b in pairwise(range(len(timed)) if some is None else some)]
    picked = np.array([0, *(move.b for move in moves)])
    # Where lines stand the robot stops, so that they come in time.
    stops = np.isin(picked, [*timed.stops, *more])
    via = {i: q[move.via] for i, move in enumerate(moves) if move.kind == "circular"}
    of, own = (timed, wiring, dialect, lines), q.shape[1] - len(wiring.external)
    axes = timed.t[picked], q[picked], tuple(picked.tolist()), lengths, tuple(stops.tolist()), own
    on, off = np.searchsorted(picked, window).tolist()
    return Targets(*of, *axes, deviation(timed, picked), tuple(moves), via, tool, linear, on, off)


MILLISECOND = 1e-3
"""Seconds of a cycle of controllers that take a row a cycle."""


def every_millisecond(timed: TimedTrajectory, wiring: Wiring | None, dialect: Dialect) -> tuple[Targets, Matrix]:
    """(all samples as targets, axes (k, own) at every millisecond), between samples as of `finer`.

    Raises: ArgumentError: the step of the motion is no whole number of milliseconds. As `targets`.
    """
    each = round(timed.dt / MILLISECOND)
    if each < 1 or abs(each * MILLISECOND - timed.dt) > 1e-9:
        raise ArgumentError("dt of the trajectory", timed.dt, "retime it with whole milliseconds, as dt=0.004")
    goals = targets(timed, wiring, dialect, None, None)
    q, _ = wired(timed, goals.wiring, dialect, finer(timed, each)[1])
    bend = float(np.abs(np.diff(q, 2, axis=0)).max()) / 8  # a parabola over its chord
    return replace(goals, deviation=bend), q


def table(columns: Sequence[str], rows: Matrix, digits: int) -> str:
    """A text of comma-separated columns with their names."""
    return "\n".join([",".join(columns), *(",".join(f"{x:.{digits}f}" for x in row) for row in rows + 0.0), ""])


def _window(timed: TimedTrajectory, lines: ProcessLines) -> tuple[int, int]:
    """The samples at which the process begins and ends: those nearest to the path's postures at these times."""
    if lines.window is None:
        return timed.begin, len(timed) - 1
    rows = slice(timed.begin, len(timed))
    speed = timed.path_speed[rows]
    gone = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * timed.dt)])
    ends = []
    for t in lines.window:
        posture = [np.interp(t, timed.untimed.t, column) for column in timed.untimed.q.T]
        apart = np.abs(timed.q[rows] - posture).max(axis=1)
        apart[np.abs(gone - t) > 0.05 * gone[-1]] = np.inf  # the path may come by there again
        ends.append(timed.begin + int(np.argmin(apart)))
    on, off = ends
    return on, off


def speed_shares(goals: Targets, speeds: Sequence[float] | None) -> Vector:
    """The share of its axes' greatest speeds that each move takes (k - 1,), if all axes start and end together.

    Args:
        speeds: of the joints (n,) [rad/s or m/s], as the controller knows them; by default the limits of the motion.

    Raises:
        ArgumentError: a moving joint without one.
    """
    timed = goals.timed
    known = timed.limits.velocity if speeds is None else np.array([positive("a speed of axes", v) for v in speeds])
    if known.shape != timed.limits.velocity.shape:
        raise ArgumentError("the speeds of axes", speeds, f"give one for each of {', '.join(timed.joint_names)}")
    moved = np.abs(np.diff(timed.q[list(goals.samples)], axis=0))
    endless = ~np.isfinite(known) & (moved.max(axis=0) > 0)
    if endless.any():
        name = timed.joint_names[int(np.argmax(endless))]
        raise ArgumentError(f"the greatest speed of {name}", None, "give speeds=, of the controller's axes")
    return (moved / known).max(axis=1) / goals.seconds


def zones(goals: Targets, zone: float) -> tuple[Vector, int]:
    """Radii [m] at which targets are passed (k,): 0 at stops, else the zone, but at most half of a move beside it.

    And at how many targets it is less for that reason. Moves whose length nobody knows leave it as it is.
    """
    steps = np.array([move.length for move in goals.moves])
    near = np.fmin(np.append(np.inf, steps), np.append(steps, np.inf)) / 2
    radii = np.fmin(zone, near)
    radii[[0, *np.flatnonzero(goals.stops).tolist(), -1]] = 0.0
    return radii, int(((radii > 0) & (radii < zone)).sum())


def with_lines(goals: Targets, moves: Sequence[Sequence[str]]) -> list[str]:
    """The lines that move to each target (k,), with those of the process between. Raises: ArgumentError: a bad line."""
    before, on, off, after = (goals.dialect.written(getattr(goals.lines, place)) for place in PLACES)
    text = list(before)
    for i, moved in enumerate(moves):
        text += moved
        text += on if i == goals.on else []
        text += off if i == goals.off else []
    return text + after


def _of_arm(timed: TimedTrajectory, wiring: Wiring, tolerance: ToolTolerance) -> Indices:
    """The joints that the controller's own inverse moves. Raises: ExportError: linear moves do not fix these joints."""
    names = list(timed.joint_names)
    axes = [name for name in names if name not in wiring.external] if wiring.axes is None else wiring.axes
    own = np.array(sorted(names.index(axis) for axis in axes if isinstance(axis, str)))
    if tolerance.linear and tolerance.part is not None:
        fact = f"a linear move of the arm is a line in the room, and not on {tolerance.part.other}, which moves"
        raise ExportError(fact, "write joint moves: leave out linear")
    if tolerance.linear and (len(own) != 6 or np.ptp(own) != 5):
        fact = f"a linear move to a pose does not say where {len(own)} joints are"
        raise ExportError(f"{fact}, but those of six axes one after another", "write joint moves: leave out linear")
    return own


def chosen(timed: TimedTrajectory, tolerance: float, more: tuple[int, ...] = ()) -> Indices:
    """Indices of samples between which straight lines stay within a tolerance: each step as long as may be."""
    q, indices = finer(timed)[1], [0]
    for end in _fixed_samples(timed, more)[1:]:
        while (last := indices[-1]) < end:
            indices.append(farthest(lambda b, a=last: _off(q, a, b) <= tolerance, last, end))
    return np.array(indices)


def _off(q: Matrix, a: int, b: int) -> float:
    """How far joints q (k, n) at `FINER` instants a step are from even motion between two samples [joint units]."""
    rows = q[FINER * a : FINER * b + 1]
    share = np.linspace(0.0, 1.0, len(rows))[:, None]
    return float(np.abs(rows - (rows[0] + share * (rows[-1] - rows[0]))).max())


def deviation(timed: TimedTrajectory, picked: Indices) -> float:
    """How far even motion between picked samples is from the timed motion [joint units]."""
    q = finer(timed)[1]
    return max(_off(q, int(a), int(b)) for a, b in pairwise(picked))


def wired(timed: TimedTrajectory, wiring: Wiring, dialect: Dialect, q: Matrix) -> tuple[Matrix, tuple[bool, ...]]:
    """(axes (k, own + external) of joints q (k, n), which are lengths). Raises: ExportError, ArgumentError."""
    # As many axes as the language holds.
    names = list(timed.joint_names)
    axes, external = wiring.axes, wiring.external
    language, own, most = dialect.language, dialect.own or (len(names),), dialect.external
    if axes is None:
        axes = tuple(name for name in names if name not in external)
    counts = " or ".join(map(str, own))
    held = f"{language} holds {counts} axes of a robot" + (f" and {most} external ones" if most else "")
    if len(axes) not in own:
        cure = f"name the {counts} in axes=, joints or fixed values" + (", and the others in external=" if most else "")
        raise ExportError(f"{held}, but {len(axes)} are given: {', '.join(map(str, axes))}", cure)
    if len(external) > most:
        cure = f"name at most {most}" if most else "export to another language, or lock joints in the robot"
        raise ExportError(f"{held}, but {len(external)} external are given: {', '.join(map(str, external))}", cure)
    # Each joint on one axis.
    used = [entry for entry in (*axes, *external) if isinstance(entry, str)]
    if sorted(used) != sorted(names):
        wrong = [u for u in used if u not in names] + [n for n in names if used.count(n) != 1]
        raise ArgumentError("the joints of axes and external", wrong[0], f"name each of {', '.join(names)} once")
    for name in (*wiring.signs, *wiring.offsets):
        if name not in names:
            raise UnknownNameError("joint of signs or offsets", name, names)
    # What each axis does: sign * joint + offset, or nothing.
    columns, lengths = [], []
    for k, entry in enumerate((*axes, *external)):
        joint = names.index(entry) if isinstance(entry, str) else None
        is_length = joint is not None and timed.joint_units[joint] == "m"
        if is_length and k < len(axes) and not dialect.sliding:
            raise ExportError(f"{entry} slides, which no axis of a robot in {language} does", "name it in external=")
        column = q[:, joint] if joint is not None else np.full(len(q), _still(entry))
        columns.append(wiring.signs.get(str(entry), 1) * column + wiring.offsets.get(str(entry), 0.0))
        lengths.append(is_length)
    return np.column_stack(columns), tuple(lengths)


def _still(entry: Entry) -> float:
    """The value at which an axis stands still. Raises: ArgumentError."""
    value = number("the value of an axis", entry)
    if not abs(value) <= FARTHEST:
        raise ArgumentError("the value of an axis", value, f"give one within {FARTHEST:g} rad or m")
    return value
