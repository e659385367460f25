"""`holokin retarget`: a LeRobot dataset with its joints on one leaf."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from .audit import Angles, Order
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
    ending,
    robot_of_option,
    show,
)

if TYPE_CHECKING:
    from ...analysis.audit.logs import Dataset
    from ...base.types import Vector
    from ...robot import Robot


def retarget(
    dataset: Annotated[Path, typer.Argument(help="The folder of a LeRobot dataset, format v2.1 or v3.0.")],
    robot: RobotName,
    strategy: Annotated[
        str, typer.Option(help='A kind of a job and its keys: "lock joint3", "linear 1 0 -1 0 0 0 0", "arm-angle".')
    ],
    out: Annotated[
        Path | None, typer.Option(help="The folder of the new dataset, a new one; by default out/DATASET-retargeted.")
    ] = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    q0: Annotated[
        str | None, typer.Option("--q0", help="The posture that the leaf goes through; by default the first frame.")
    ] = None,
    position: Annotated[
        bool, typer.Option("--position", help="The tool's orientation is free: its position alone is kept.")
    ] = False,
    axis: Annotated[
        str | None, typer.Option(help='The tool may spin about this axis: x, y, z or a direction like "0 0.5 1".')
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(help="A column with the joints; by default observation.state and action. May be given again."),
    ] = None,
    poses: Annotated[
        list[str] | None,
        typer.Option(help="A column with tool poses: the joints go into a new column NAME.joints. May be given again."),
    ] = None,
    angles: Angles = None,
    order: Order = None,
    columns: Columns = None,
    degrees: Degrees = None,
    counts_turns: CountsTurns = False,
    signs: Signs = None,
    offsets: Offsets = None,
    scales: Scales = None,
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Leave out episodes with a pose that the leaf does not reach.")
    ] = False,
    nearest: Annotated[
        bool, typer.Option("--nearest", help="Take the nearest pose of the leaf for a pose that it does not reach.")
    ] = False,
    limits: Annotated[bool, typer.Option("--limits/--no-limits", help="Keep to the joint limits.")] = True,
    double: Annotated[
        bool, typer.Option("--double", help="Write joints in double precision; LeRobot's single rounds them.")
    ] = False,
) -> None:
    """Write a LeRobot dataset with its joints on one leaf: equal tool poses get equal joints.

    Exits 0 when the new dataset is written, 1 when poses have no joints and nothing was asked for them, 2 on bad input.
    """
    from ... import learning
    from ...analysis.audit.log_audit import task_of_tool
    from ...analysis.audit.logs import ACTION, STATE, read_dataset
    from ...base.errors import ArgumentError
    from ...motion.ik import ik
    from ..job import axis_of
    from ..job.strategy_tables import leaf_of_words

    # The dataset, its columns, and the leaf that they are put on.
    if skip_bad and nearest:
        raise ArgumentError("--nearest beside --skip-bad", True, "give one of them")
    arm = robot_of_option(robot, tip, base, trust_units)
    data = read_dataset(dataset)
    read: dict[str, Any] = {"columns": columns, "degrees": degrees, "counts_turns": counts_turns}
    read |= counts_of_words(signs, offsets, scales)
    sources = _sources(data, arm, column, poses or [], {"angles": angles, "order": order}, read)
    start = _start(data, arm, sources, q0, bool(degrees))
    whole = None if axis is not None else not position
    task, _ = task_of_tool(arm, tip, whole, None if axis is None else axis_of(axis), start)
    solver = ik(leaf_of_words(strategy, task, start), start, limits=limits)
    bad: Literal["refuse", "skip", "nearest"] = "skip" if skip_bad else "nearest" if nearest else "refuse"
    # The new dataset, and what to do where it was not written.
    with ending().telling("retarget") as say:
        say(f"{data.frames} frames")
        target = Path("out", f"{dataset.resolve().name}-retargeted") if out is None else out
        done = learning.retarget(data, solver, sources, target, tip=tip, bad=bad, double=double)
    show(str(done))
    for name in {STATE, ACTION} & set(data.features) - {source.name for source in sources}:
        show(f"{name} does not name the joints of {arm.name}, or was not asked for: it is as it was")
    if done.written is None:
        show("choose another strategy or q0, or say --skip-bad to leave out these episodes, or --nearest")
        raise typer.Exit(1)


def _sources(
    dataset: Dataset,
    arm: Robot,
    column: list[str] | None,
    poses: list[str],
    of_poses: dict[str, Any],
    read: dict[str, Any],
) -> list[Any]:
    """The columns that get joints. Raises: HolokinError."""
    from ...analysis.audit.logs import ACTION, STATE, has_joints, joint_feature, pose_feature
    from ...base.errors import ArgumentError
    from ...learning.retargeting import check_targets

    usual = [name for name in (STATE, ACTION) if name in dataset.features]
    named = [name for name in usual if read["columns"] is not None or has_joints(dataset, arm, name)]
    chosen = column or ([] if poses else named or usual)
    if not chosen and not poses:
        raise ArgumentError("the columns of joints", list(dataset.features), "name them by --column, or --poses")
    joints = [joint_feature(dataset, arm, name, **read) for name in dict.fromkeys(chosen)]
    if column is None:
        check_targets(dataset, arm, joints)
    return joints + [pose_feature(dataset, name, **of_poses) for name in dict.fromkeys(poses)]


def _start(dataset: Dataset, arm: Robot, sources: list[Any], q0: str | None, degrees: bool) -> Vector:
    """q0: as it is typed, or the first frame of the first column of joints. Raises: ArgumentError, FileError."""
    import numpy as np

    from ...analysis.audit.logs import JointFeature, Recording, joined_turns
    from ...analysis.audit.logs.datasets import postures_of, rows
    from ...base.errors import ArgumentError
    from ..job.advice_job import posture_of

    if q0 is not None:
        return arm.checked(np.array(posture_of(q0, arm, degrees)), "--q0")
    if not isinstance(sources[0], JointFeature):
        raise ArgumentError("--q0", None, "a dataset of tool poses has no first posture: give one")
    first = next(iter(rows(dataset, [sources[0].name], [0])))
    postures = postures_of(dataset, arm, sources[0], first.values[sources[0].name])
    times = np.asarray(dataset.period * np.arange(len(postures)), dtype=float)
    log = Recording(arm.joint_names, times, postures, str(dataset.folder))
    return joined_turns(log, arm, counted=sources[0].counts_turns).q[0]
