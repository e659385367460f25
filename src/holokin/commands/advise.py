"""`holokin advise`: finds the law for a robot and its work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .outcome import ending, show, show_rich
from .robot_options import (
    Base,
    BasePose,
    Floor,
    JointLimits,
    Obstacles,
    RobotOrJob,
    Task,
    TaskKind,
    Tip,
    Tool,
    TrustUnits,
    WorkspaceWords,
)


def advise(
    robot: RobotOrJob,
    workspace: WorkspaceWords = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    task: Task = None,
    axis: Annotated[
        str | None, typer.Option(help='With the task axis: x, y, z or a direction in its frame, like "0 0.5 1".')
    ] = None,
    position: Annotated[bool, typer.Option("--position", help="The same as --task position.")] = False,
    tool: Tool = None,
    base_pose: BasePose = None,
    limit: JointLimits = None,
    floor: Floor = None,
    obstacle: Obstacles = None,
    clearance: Annotated[
        float | None, typer.Option(help="Distance [m] that links keep from these and from each other; or 0.01.")
    ] = None,
    q0: Annotated[
        str | None, typer.Option(help="The posture to begin at, in rad and m, like '0 -0.8 0 -2.4 0 1.6 0.8'.")
    ] = None,
    degrees: Annotated[bool, typer.Option("--degrees", help="--q0 and --limit are in degrees and m.")] = False,
    levels: Annotated[
        bool, typer.Option("--levels", help="Also say which levels of the best law serve the workspace.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="The job file to write, ending in .toml; with a picture of its name.")
    ] = None,
) -> None:
    """Find the law for a robot and its work: all that fit are compared on a workspace.

    Of a job it takes the robot, its tool and mounting, the task, the start, the path or the workspace, and the
    obstacles. Prints a table and why the best law is, and writes a job with it, by default advice-<robot>.toml, and a
    picture. Exits 0 when that is done, 2 on bad input.
    """
    from ..errors import ArgumentError
    from ..job.advice_job import advise_command, proof_command
    from ..job.advice_question import Typed
    from ..reports.advice_report import advice_figure, print_advice
    from ..reports.plots import write_figure

    if position and task not in (None, TaskKind.POSITION):
        raise ArgumentError("--position beside --task", task.value, "give one of them")
    kind = TaskKind.POSITION if position else task
    typed = Typed(
        workspace, tip, base, kind.value if kind else None, axis, q0, degrees, tool, base_pose, tuple(limit or ()),
        floor, tuple(obstacle or ()), clearance, trust_units,
    )  # fmt: skip
    with ending().telling() as say:
        found, asked, write = advise_command(robot, typed, out, say, say.announce, levels)
        show_rich(lambda console: print_advice(found, console))
        say("trying the job")
        job, remark = write()
        picture = job.with_suffix(".png")
        say("drawing")
        write_figure(lambda: advice_figure(found, asked.obstacles, asked.shown), picture)
    if remark:
        show(f"  Note: {remark}")
    show(f"wrote {job} and {picture} after {found.seconds:.0f} s; then: holokin run {job}")
    if proof := proof_command(found, asked, job):
        show(f"certify it by: {proof}")
