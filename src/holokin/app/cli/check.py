"""`holokin check`: a log, or a trajectory in a file, looked at for limits, collisions and the floor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
)

Log = Annotated[Path, typer.Argument(help="A CSV file, a rosbag2 folder, or a .mcap, .db3 or .bag file.")]
Topic = Annotated[
    str | None, typer.Option(help="JointState topic of a bag; by default /joint_states, or the only one.")
]
TimeColumn = Annotated[str | None, typer.Option(help="Name of the time column of a CSV.")]


def check(
    log: Log,
    robot: RobotName,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    floor: Annotated[float | None, typer.Option(help="Height of the floor [m] in the frame of the base.")] = None,
    clearance: Annotated[float, typer.Option(help="The least distance wanted [m].")] = 0.01,
    radius: Annotated[
        float | None, typer.Option(help="Of the capsules [m] that stand for links without shapes.")
    ] = None,
    margin: Annotated[float, typer.Option(help="How far joints keep from their limits [rad, m].")] = 0.0,
    allowed: Annotated[
        list[str] | None,
        typer.Option(
            "--allowed",
            help="Links, or a link and the floor, that may touch, like 'link5,hand' or 'hand,*'; may be given again.",
        ),
    ] = None,
    position: Annotated[
        bool, typer.Option("--position", help="The tool's orientation is free: singularities of its position alone.")
    ] = False,
    degrees: Degrees = None,
    topic: Topic = None,
    columns: Columns = None,
    time: TimeColumn = None,
    counts_turns: CountsTurns = False,
    signs: Signs = None,
    offsets: Offsets = None,
    scales: Scales = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write what is found to this file.")] = None,
) -> None:
    """Look at a motion for exceeded limits, singularities, self-collision and the floor.

    Exits 0 when nothing is found, 1 when something is or a shape could not be read, 2 on bad input.
    """
    from ...analysis.audit.logs import read_recording
    from ...base.errors import ArgumentError
    from ...motion import checks
    from ...robot import with_capsules
    from ...strategies.tasks.task_kinds import pose
    from ...strategies.tasks.task_kinds import position as position_of

    # What may touch, the robot and its motion.
    pairs = [tuple(part.strip() for part in text.split(",")) for text in allowed or []]
    for pair, text in zip(pairs, allowed or [], strict=True):
        if len(pair) != 2:
            raise ArgumentError("--allowed", text, "give two names, of links or the floor, with a comma between")
    arm = robot_of_option(robot, tip, base, trust_units)
    read = {"degrees": degrees, "topic": topic, "columns": columns, "time": time, "counts_turns": counts_turns}
    motion = read_recording(log, arm, **read, **counts_of_words(signs, offsets, scales))
    # The check.
    free = position or arm.n < 6
    scene = checks.Scene(floor=floor, clearance=clearance, allowed=[(a, b) for a, b in pairs])
    shaped = arm if radius is None else with_capsules(arm, radius)
    report = checks.check(
        motion, scene, task=position_of(shaped, tip=tip) if free else pose(shaped, tip=tip), margin=margin
    )
    if json is not None:
        report.save(json)
    show(report.table())
    raise typer.Exit(0 if report.passed else 1)
