"""URScript of Universal Robots: `servoj` at the controller's own step, or `movej`, `movel` and `movec` to few targets.

Grammar: Universal Robots, "The URScript Programming Language" (version 5): movej, movel, movec, servoj, stopj, set_tcp,
set_payload, set_digital_out, sleep; radians. movel and movec take joint positions, and compute the pose of them.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import Vector, finite, not_negative
from ...base.units import SI
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name
from .targets import Targets, Wiring, targets, with_lines, zones

STEPS = (0.002, 0.008)
"""Seconds of a control cycle: e-Series and later, CB3."""

DIALECT = Dialect(
    "URScript",
    "set_digital_out({number}, {state})",
    "sleep({seconds:g})",
    ("False", "True"),
    forbidden=r"^\s*(def|end|thread)\b",
    units=SI,
)


@typed
def to_urscript(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None,
    tolerance: float | ToolTolerance | None = None, lines: ProcessLines | None = None, zone: float = 0.001,
    tool: Sequence[float] | None = None, payload: float | None = None, lookahead_time: float = 0.1, gain: float = 300.0,
) -> Program:  # fmt: skip
    """A URScript function NAME.script in radians, which moves to the start first, and a line that calls it.

    Args:
        name: of the function.
        about: a line of the header: the strategy.
        wiring: of the controller's six axes.
        tolerance: None sends every sample by servoj, at the controller's own step of 2 or 8 ms, which the trajectory
            must have. Else few targets are sent, with times to joint moves and speeds to linear and circular ones: of
            the joints [rad], see `Program.deviation`, or of the tool.
        lines: of the process.
        zone: [m] radius at which the robot goes on to the next of few targets; at most half a move.
        tool: its pose in the flange, x, y, z [m] and a rotation vector [rad], for set_tcp; by default as set.
        payload: [kg]; by default that which is set.
        lookahead_time, gain: of "servoj": 0.03 to 0.2 s, 100 to 2000.

    Raises:
        ExportError: a robot of other than six axes. ArgumentError: bad names, step, wiring or lines.
    """
    not_negative("zone", zone)
    if not (0.03 <= lookahead_time <= 0.2 and 100 <= gain <= 2000):
        raise ArgumentError("(lookahead_time, gain)", (lookahead_time, gain), "see the docstring")
    # Every sample by servoj, or few targets with their blends.
    every = tolerance is None
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    if every and not any(abs(timed.dt - step) < 1e-12 for step in STEPS):
        cure = "retime it with dt=0.002 (e-Series) or dt=0.008 (CB3), or give a tolerance for few targets"
        raise ArgumentError("dt of the trajectory", timed.dt, cure)
    short = program_name(name, about, 64, goals)
    radii, less = zones(goals, zone)
    sentences = [f"servoj at {1e3 * timed.dt:g} ms" if every else _why_moves(timed)]
    sentences += [f"the blend is half a move at {less} targets, where that is less"] if less and not every else []
    # The program: its header, its settings and its moves.
    head = header(timed, about, goals, ["radians", *sentences])
    text = [f"  # {line}" for line in head.lines]
    if tool is not None:
        text.append(f"  set_tcp(p{_list(finite('tool', tool, (6,)))})")
    text += [f"  set_payload({not_negative('payload', payload):g})"] if payload is not None else []
    if every:
        more = f"0, 0, {timed.dt:g}, {lookahead_time:g}, {gain:g}"
        moves = [f"servoj({_list(row)}, {more})" for row in goals.q[1:]]
        moves[-1:] = [moves[-1] + "\n  stopj(2.0)"]
    else:
        moves = [_move(goals, i, radii[i + 1]) for i in range(len(goals.moves))]
    first = f"movej({_list(goals.q[0])}, a=0.5, v=0.25)"  # a quarter of what the language takes by default
    body = with_lines(goals, [[first], *([move] for move in moves)])
    text += [f"  {line}" for line in body]
    files = {f"{short}.script": "\n".join([f"def {short}():", *text, "end", f"{short}()", ""])}
    return head.program(files, goals, sentences)


def _why_moves(timed: TimedTrajectory) -> str:
    """That targets are few, and which steps would give every sample."""
    remark = "" if timed.dt in STEPS else f": {1e3 * timed.dt:g} ms is no step of servoj"
    return f"few targets{remark}; servoj would take every sample at 2 ms (e-Series) or 8 ms (CB3)"


def _move(goals: Targets, i: int, radius: float) -> str:
    move, end = goals.moves[i], _list(goals.q[i + 1])
    if move.kind == "joint":
        return f"movej({end}, t={goals.seconds[i]:.4f}, r={radius:.6g})"
    speed = f"a=1.2, v={move.speed:.6f}, r={radius:.6g}"
    return f"movel({end}, {speed})" if move.kind == "linear" else f"movec({_list(goals.via[i])}, {end}, {speed})"


def _list(row: Vector) -> str:
    return "[" + ", ".join(f"{x:.9f}" for x in row + 0.0) + "]"
