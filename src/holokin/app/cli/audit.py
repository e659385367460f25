"""`holokin audit`: judges a log of joint motion, or a robot learning dataset."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from .check import TimeColumn, Topic
from .outcome import (
    Base,
    Columns,
    CountsTurns,
    Degrees,
    Offsets,
    RobotName,
    Scales,
    Signs,
    Tip,
    TrustUnits,
    counts_of_words,
    robot_of_option,
    show,
    show_rich,
)

if TYPE_CHECKING:
    from ...analysis.audit import LogAudit
    from ...robot import Robot

Logs = Annotated[
    list[Path],
    typer.Argument(
        help="CSV files, rosbag2 folders, .mcap, .db3 or .bag files: several are one log. Or the folder of a LeRobot "
        "dataset."
    ),
]
Episodes = Annotated[str | None, typer.Option(help="Of a dataset: the episodes, as 0:10,12 for 0 to 9, and 12.")]
Angles = Annotated[
    str | None, typer.Option(help="Of --poses: rad or deg, the unit of roll, pitch, yaw and rotation vectors.")
]
Order = Annotated[str | None, typer.Option(help="Of --poses with numbered quaternions: xyzw or wxyz.")]


def audit(
    log: Logs,
    robot: RobotName,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
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
    counts_turns: CountsTurns = False,
    signs: Signs = None,
    offsets: Offsets = None,
    scales: Scales = None,
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Leave out rows of a CSV that cannot be read, and count them.")
    ] = False,
    split: Annotated[
        bool, typer.Option("--split", help="Audit each run of the log: cut where the clock is set back or all rests.")
    ] = False,
    idle: Annotated[float, typer.Option(help="With --split: the rest in s at which it is cut.")] = 5.0,
    tolerance: Annotated[
        float | None,
        typer.Option(help="Joint distance in rad or m that counts as equal; by default 1e-3, of a dataset 1e-2."),
    ] = None,
    episodes: Episodes = None,
    column: Annotated[
        str | None, typer.Option(help="Of a dataset: the column with the joints, by default observation.state.")
    ] = None,
    poses: Annotated[
        str | None, typer.Option(help="Of a dataset: a column with tool poses, to compare instead of the joints' own.")
    ] = None,
    angles: Angles = None,
    order: Order = None,
    near: Annotated[
        float | None, typer.Option(help="Of a dataset: distance in m of tool poses that are compared, by default 5e-3.")
    ] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the findings to this file.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Write a figure to this file (.png, .svg, .pdf).")] = None,
) -> None:
    """Judge a log of joint motion: are the joints the same after each cycle of the tool?

    Of a LeRobot dataset: are the joints the same wherever the tool pose is, in all episodes?

    Exits 0 when they are in every comparison that the log allows, 1 when they are not, 2 when the log does not decide,
    and on bad input. Of several runs the gravest counts; a run without two cycles is named, and counts only if all are
    so.
    """
    from ...analysis.audit import audit_recording
    from ...analysis.audit.logs import is_dataset, read_runs
    from ...base.errors import ArgumentError, FileError

    # The robot, and how the log is read.
    if position and axis is not None:
        raise ArgumentError("--position beside --axis", axis, "give one of them")
    tool: dict[str, Any] = {"tip": tip, "orientation": False if position else None, "axis": None}
    if axis is not None:
        from ..job import axis_of  # it loads the reader of job files: 13 MB

        tool["axis"] = axis_of(axis)
    arm = robot_of_option(robot, tip, base, trust_units)
    of_dataset: dict[str, Any] = {
        "episodes": episodes,
        "column": column,
        "poses": poses,
        "angles": angles,
        "order": order,
    }
    of_dataset["near"] = near
    read = {"degrees": degrees, "columns": columns, "counts_turns": counts_turns}
    read |= counts_of_words(signs, offsets, scales)
    # A dataset, or a log of one run or several.
    if len(log) == 1 and is_dataset(log[0]):
        _refuse_options("a log", topic=topic, time=time, skip_bad=skip_bad or None, split=split or None)
        _audit_of_dataset(log[0], arm, tool, of_dataset, read, tolerance, json, plot)
    _refuse_options("a LeRobot dataset, which has meta/info.json", **of_dataset)
    from ..report.log_report import log_figure, print_audit, save_log_audits
    from ..report.plots import write_figure

    read |= {"split": split, "idle": idle, "topic": topic, "time": time, "skip_bad": skip_bad}
    audits: list[LogAudit] = []
    left_out: list[FileError] = []
    for run in read_runs(log, arm, **read):
        try:
            audits.append(audit_recording(run, arm, **tool, tolerance=1e-3 if tolerance is None else tolerance))
        except FileError as problem:
            left_out.append(problem)
    if not audits:
        raise left_out[0]
    # The findings: files, terminal, exit code.
    if json is not None:
        save_log_audits(audits, json)
    for k, verdict in enumerate(audits):
        if plot is not None:
            file = plot if len(audits) == 1 else plot.with_stem(f"{plot.stem}-{k + 1}")
            write_figure(lambda verdict=verdict: log_figure(verdict), file)
        show_rich(lambda console, verdict=verdict: print_audit(verdict, console))
    for problem in left_out:
        show(f"not audited: {problem.path}: {problem.fact}")
    codes = {verdict.exit_code for verdict in audits}
    raise typer.Exit(1 if 1 in codes else 2 if 2 in codes else 0)


# --- `holokin audit` of a LeRobot dataset: equal tool poses over its episodes.


def _refuse_options(what: str, **given: Any) -> None:
    """Raises: ArgumentError: an option that is only for something else."""
    from ...base.errors import ArgumentError

    for name, value in given.items():
        if value is not None:
            raise ArgumentError(f"--{name.replace('_', '-')}", value, f"it is only for {what}: leave it out")


def _audit_of_dataset(
    folder: Path,
    arm: Robot,
    tool: dict[str, Any],
    options: dict[str, Any],
    read: dict[str, Any],
    tolerance: float | None,
    json: Path | None,
    plot: Path | None,
) -> NoReturn:
    """Audit a dataset, and end the command. Raises: HolokinError."""
    from ...analysis.audit import audit_dataset
    from ...analysis.audit.logs import STATE, chosen_episodes, joint_feature, pose_feature, read_dataset
    from ...base.files import write_json
    from ..report.log_report import dataset_figure, print_audit

    # The columns and the episodes.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # pyarrow's own keeps 20 MB that it needs no more
    dataset = read_dataset(folder)
    joints = joint_feature(dataset, arm, options["column"] or STATE, **read)
    poses = None
    if options["poses"] is None:
        _refuse_options("--poses", angles=options["angles"], order=options["order"])
    else:
        poses = pose_feature(dataset, options["poses"], angles=options["angles"], order=options["order"])
    chosen = chosen_episodes(dataset, options["episodes"])
    # The audit and its findings.
    more = {"near": options["near"], "tolerance": tolerance}
    given = {name: value for name, value in more.items() if value is not None}
    audit = audit_dataset(dataset, arm, joints, poses=poses, episodes=chosen, **tool, **given)
    if json is not None:
        write_json(json, audit.to_dict())
    if plot is not None:
        from ..report.plots import write_figure

        write_figure(lambda: dataset_figure(audit), plot)
    show_rich(lambda console: print_audit(audit, console))
    raise typer.Exit(audit.exit_code)
