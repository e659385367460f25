"""`holokin audit` of a LeRobot dataset: equal tool poses over its episodes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from .outcome import show_rich

if TYPE_CHECKING:
    from ...robot import Robot


def refuse_options(what: str, **given: Any) -> None:
    """Raises: ArgumentError: an option that is only for something else."""
    from ...base.errors import ArgumentError

    for name, value in given.items():
        if value is not None:
            raise ArgumentError(f"--{name.replace('_', '-')}", value, f"it is only for {what}: leave it out")


def audit_of_dataset(
    folder: Path, arm: Robot, tool: dict[str, Any], options: dict[str, Any], read: dict[str, Any],
    tolerance: float | None, json: Path | None, plot: Path | None,
) -> NoReturn:  # fmt: skip
    """Audit a dataset, and end the command. Raises: HolokinError."""
    from ...analysis.audit import audit_dataset
    from ...analysis.audit.logs import STATE, chosen_episodes, joint_feature, pose_feature, read_dataset
    from ...base.files import write_json
    from ..report.dataset_report import dataset_figure
    from ..report.log_report import print_audit

    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # pyarrow's own keeps 20 MB that it needs no more
    dataset = read_dataset(folder)
    joints = joint_feature(dataset, arm, options["column"] or STATE, **read)
    poses = None
    if options["poses"] is None:
        refuse_options("--poses", angles=options["angles"], order=options["order"])
    else:
        poses = pose_feature(dataset, options["poses"], angles=options["angles"], order=options["order"])
    chosen = chosen_episodes(dataset, options["episodes"])
    more = {"near": options["near"], "tolerance": tolerance}
    given = {name: value for name, value in more.items() if value is not None}
    found = audit_dataset(dataset, arm, joints, poses=poses, episodes=chosen, **tool, **given)
    if json is not None:
        write_json(json, found.summary())
    if plot is not None:
        from ..report.plots import write_figure

        write_figure(lambda: dataset_figure(found), plot)
    show_rich(lambda console: print_audit(found, console))
    raise typer.Exit(found.exit_code)
