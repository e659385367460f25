"""G-code for a machine whose axes are the joints: G1 in inverse time.

Grammar: LinuxCNC, "G-Code" (G21, G90, G93, G1, G4, G61, G64, M2, M64, M65) and "RS274/NGC overview" (words, comments).
"""

from __future__ import annotations

from collections.abc import Sequence

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import not_negative
from ...motion import TimedTrajectory
from .moves import Dialect, ProcessLines, ToolTolerance
from .robot_program import Program, header, program_name
from .targets import Wiring, targets, with_lines

SLIDING, TURNING = "XYZUVW", "ABC"
"""The letters of axes, in the order in which joints take them."""

DIALECT = Dialect(
    "G-code",
    "{state} P{number}",
    "G4 P{seconds:g}",
    ("M65", "M64"),
    own=(),
    sliding=True,
    kinds=("joint",),
    forbidden=r"%|^[oO]",
    longest=250,
)


@typed
def to_gcode(
    timed: TimedTrajectory,
    *,
    name: str | None = None,
    about: str = "",
    wiring: Wiring | None = None,
    tolerance: float | ToolTolerance = 2e-3,
    lines: ProcessLines | None = None,
    zone: float = 0.0,
    letters: Sequence[str] | None = None,
) -> Program:
    """A G-code program NAME.ngc: every joint is an axis of the machine, in mm or degrees, with trivial kinematics.

    Each G1 has its time as inverse time (G93, F in 1/min). The first move goes to the start in ten seconds.

    Args:
        name: of the file.
        about: a line of the header: the strategy.
        wiring: of the axes.
        tolerance: of the joints [rad or m], see `Program.deviation`, or of the tool.
        lines: of the process. "output 3 on" is M64 P3.
        zone: [m] by which corners between moves may be cut (G64 P); 0 for exact paths (G61).
        letters: of the axes; by default X, Y, Z, U, V, W of sliding ones and A, B, C of turning ones.

    Raises:
        ArgumentError: more axes than letters; bad names, wiring or lines.
    """
    goals = targets(timed, wiring, DIALECT, tolerance, lines)
    short = program_name(name, about, 64, goals)
    axes = _letters(goals.lengths, letters)
    mode = f"G64 P{1e3 * zone:g}" if not_negative("zone", zone) else "G61"
    # after the dash no comment begins with the word of a file: LinuxCNC takes py, msg and log there for commands
    head = header(timed, about, goals, ["mm and degrees; F is 1/minutes (G93)"])
    facts = [f"; - {line}" for line in head.lines]
    seconds = [10.0, *goals.seconds.tolist()]
    moves = [
        [" ".join(["G1", *(f"{a}{x:.6f}" for a, x in zip(axes, row, strict=True)), f"F{60 / t:.6f}"])]
        for row, t in zip(goals.shown(), seconds, strict=True)
    ]
    body = with_lines(goals, moves)
    text = "\n".join([*facts, "G21 G90 G93", mode, *body, "G94", "M2", ""])
    return head.program({f"{short}.ngc": text}, goals)


def _letters(lengths: tuple[bool, ...], given: Sequence[str] | None) -> list[str]:
    """A letter for each axis. Raises: ArgumentError."""
    if given is not None:
        if len(given) != len(lengths) or len(set(given)) != len(given) or not set(given) <= set(SLIDING + TURNING):
            cure = f"give {len(lengths)} different ones of {', '.join(SLIDING + TURNING)}"
            raise ArgumentError("the letters of the axes", list(given), cure)
        return list(given)
    sliding, turning = iter(SLIDING), iter(TURNING)
    letters = [next(sliding if length else turning, "") for length in lengths]
    if "" in letters:
        cure = "G-code has six sliding axes and three turning ones: give letters="
        raise ArgumentError("the axes", len(lengths), cure)
    return letters
