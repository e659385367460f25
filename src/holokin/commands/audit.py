"""`holokin audit`: judges a log of joint motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .check import Columns, Degrees, Log, RobotName, TimeColumn, TipName, Topic
from .outcome import show_rich


def audit(
    log: Log,
    robot: RobotName,
    tip: TipName = None,
    position: Annotated[
        bool, typer.Option("--position", help="The tool's orientation is free: look at its position alone.")
    ] = False,
    degrees: Degrees = None,
    topic: Topic = None,
    columns: Columns = None,
    time: TimeColumn = None,
    tolerance: Annotated[float, typer.Option(help="Joint distance in rad or m that counts as equal.")] = 1e-3,
    json: Annotated[Path | None, typer.Option("--json", help="Write the findings to this file.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Write a figure to this file (.png, .svg, .pdf).")] = None,
) -> None:
    """Judge a log of joint motion: are the joints the same after each cycle of the tool?

    Exits 0 when they are in all that the log tests, 1 when they are not, 2 when the log does not decide, and on
    bad input.
    """
    from ..auditing import audit_recording
    from ..output.log_report import log_figure, print_log_audit, save_log_audit
    from ..output.plots import write_figure
    from ..recording import read_recording
    from ..robot import is_model, load

    arm = load(robot, tip=tip if is_model(robot) else None)
    found = audit_recording(
        read_recording(log, arm, degrees=degrees, topic=topic, columns=columns, time=time), arm, tip=tip,
        orientation=False if position else None, tolerance=tolerance,
    )  # fmt: skip
    if json is not None:
        save_log_audit(found, json)
    if plot is not None:
        write_figure(lambda: log_figure(found), plot)
    show_rich(lambda console: print_log_audit(found, console))
    raise typer.Exit(found.exit_code)
