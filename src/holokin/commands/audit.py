"""`holokin audit`: judges a log of joint motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .check import Columns, Degrees, RobotName, TimeColumn, TipName, Topic
from .outcome import show, show_rich

if TYPE_CHECKING:
    from ..auditing import LogAudit

Logs = Annotated[
    list[Path], typer.Argument(help="CSV files, rosbag2 folders, .mcap, .db3 or .bag files: several are one log.")
]


def audit(
    log: Logs,
    robot: RobotName,
    tip: TipName = None,
    position: Annotated[
        bool, typer.Option("--position", help="The tool's orientation is free: look at its position alone.")
    ] = False,
    axis: Annotated[
        str | None, typer.Option(help='The tool may spin about this axis: x, y, z or a direction like "0 0.5 1".')
    ] = None,
    degrees: Degrees = None,
    topic: Topic = None,
    columns: Columns = None,
    time: TimeColumn = None,
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Leave out rows of a CSV that cannot be read, and count them.")
    ] = False,
    split: Annotated[
        bool, typer.Option("--split", help="Audit each run of the log: cut where the clock is set back or all rests.")
    ] = False,
    idle: Annotated[float, typer.Option(help="With --split: the rest in s at which it is cut.")] = 5.0,
    tolerance: Annotated[float, typer.Option(help="Joint distance in rad or m that counts as equal.")] = 1e-3,
    json: Annotated[Path | None, typer.Option("--json", help="Write the findings to this file.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Write a figure to this file (.png, .svg, .pdf).")] = None,
) -> None:
    """Judge a log of joint motion: are the joints the same after each cycle of the tool?

    Exits 0 when they are in all that the log tests, 1 when they are not, 2 when the log does not decide, and on
    bad input. Of several runs the gravest counts; a run without two cycles is named, and counts only if all are so.
    """
    from ..auditing import audit_recording
    from ..errors import ArgumentError, RecordingError
    from ..job import axis_of
    from ..output.log_report import log_figure, print_log_audit, save_log_audits
    from ..output.plots import write_figure
    from ..recording import read_runs
    from ..robot import is_model, load

    if position and axis is not None:
        raise ArgumentError("--position beside --axis", axis, "give one of them")
    arm = load(robot, tip=tip if is_model(robot) else None)
    runs = read_runs(
        log, arm, split=split, idle=idle, degrees=degrees, topic=topic, columns=columns, time=time, skip_bad=skip_bad
    )
    about = None if axis is None else axis_of(axis)
    found: list[LogAudit] = []
    left_out: list[RecordingError] = []
    for run in runs:
        try:
            found.append(
                audit_recording(
                    run, arm, tip=tip, orientation=False if position else None, axis=about, tolerance=tolerance
                )
            )
        except RecordingError as problem:
            left_out.append(problem)
    if not found:
        raise left_out[0]
    if json is not None:
        save_log_audits(found, json)
    if plot is not None:
        for k, one in enumerate(found):
            file = plot if len(found) == 1 else plot.with_stem(f"{plot.stem}-{k + 1}")
            write_figure(lambda one=one: log_figure(one), file)
    for one in found:
        show_rich(lambda console, one=one: print_log_audit(one, console))
    for problem in left_out:
        show(f"not audited: {problem.path}: {problem.fact}")
    codes = {one.exit_code for one in found}
    raise typer.Exit(1 if 1 in codes else 2 if 2 in codes else 0)
