"""URScript of Universal Robots: `servoj` at the controller's own step, or `movej` to few targets.

Grammar: Universal Robots, "The URScript Programming Language" (version 5): movej, servoj, stopj; radians.
"""

from __future__ import annotations

from typing import Any

from ..base.arguments import typed
from ..base.types import Vector
from ..errors import ArgumentError
from ..motion import TimedTrajectory
from .robot_program import Program, Wiring, header, program_name, targets

STEPS = (0.002, 0.008)
"""Seconds of a control cycle: e-Series and later, CB3."""

APPROACH = "a=0.5, v=0.25"
"""Of the move to the start [rad/s^2, rad/s]: a quarter of what the language takes by default."""


@typed
def to_urscript(
    timed: TimedTrajectory, *, name: str | None = None, about: str = "", wiring: Wiring | None = None,
    style: str = "servoj", tolerance: float = 2e-3, blend: float = 0.001, lookahead_time: float = 0.1,
    gain: float = 300.0,
) -> Program:  # fmt: skip
    """A URScript function NAME.script in radians, which moves to the start first.

    Args:
        name: of the function.
        about: a line of the header: the law.
        wiring: of the controller's six axes.
        style: "servoj" sends every sample, at the controller's own step of 2 or 8 ms, which the trajectory must have;
            "movej" sends few targets with their times.
        tolerance: [rad] of "movej", see `Program.deviation`.
        blend: [m] radius at which "movej" goes on to the next target.
        lookahead_time, gain: of "servoj": 0.03 to 0.2 s, 100 to 2000.

    Raises:
        ExportError: a robot of other than six axes. ArgumentError: bad names, style, step or wiring.
    """
    wiring = wiring or Wiring()
    if style not in ("servoj", "movej"):
        raise ArgumentError("style", style, "use 'servoj' or 'movej'")
    if not (0.03 <= lookahead_time <= 0.2 and 100 <= gain <= 2000 and blend >= 0.0):
        raise ArgumentError("(lookahead_time, gain, blend)", (lookahead_time, gain, blend), "see the docstring")
    every = style == "servoj"
    found = targets(timed, wiring, 6, 0, "URScript", None if every else tolerance)
    if every and not any(abs(timed.dt - step) < 1e-12 for step in STEPS):
        raise ArgumentError("dt of the trajectory", timed.dt, "retime it with dt=0.002 (e-Series) or dt=0.008 (CB3)")
    short = program_name(name, about or "holokin", 64, "URScript")
    lines = [f"  # {line}" for line in header(timed, about, found, wiring, ["radians"])]
    lines.append(f"  movej({_list(found.q[0])}, {APPROACH})")
    last = len(found.q) - 1
    for i, seconds in enumerate(found.seconds, 1):
        if every:
            lines.append(f"  servoj({_list(found.q[i])}, 0, 0, {timed.dt:g}, {lookahead_time:g}, {gain:g})")
        else:
            radius = 0.0 if i == last or found.stops[i] else blend
            lines.append(f"  movej({_list(found.q[i])}, t={seconds:.4f}, r={radius:g})")
    lines += ["  stopj(2.0)"] * every
    files = {f"{short}.script": "\n".join([f"def {short}():", *lines, "end", ""])}
    return Program(files, len(found.q), found.deviation)


def by_step(timed: TimedTrajectory, **given: Any) -> Program:
    """As `to_urscript`: by "servoj" at the step of a controller, else by "movej"."""
    return to_urscript(timed, style="servoj" if timed.dt in STEPS else "movej", **given)


def _list(row: Vector) -> str:
    return "[" + ", ".join(f"{x:.9f}" for x in row + 0.0) + "]"
