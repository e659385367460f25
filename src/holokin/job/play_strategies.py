"""A job's strategies on physics: each is played; its log is then audited."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

from ..errors import HolokinError
from ..motion import drift
from ..path.synchronized_paths import paths_of
from ..physics_simulation import play
from ..reports.physics_report import PhysicsResult, Played
from ..robot import knows_masses, servo, weighed
from ..tasks.task import of_one_tool
from .job_parts import build_begin, build_strategy, build_tasks, naming
from .path_entry import build_entry
from .physics_table import PhysicsTable
from .schema import Job
from .several_paths import build_paths


def simulate_job(
    name: str, job: Job, file: FilePath, changes: dict[str, Any], say: Callable[[str], None] = lambda _text: None
) -> PhysicsResult:
    """Play every strategy of a job on physics.

    Args:
        changes: keys of [physics] to take instead of the job's.
        say: hears what is going on.

    Raises:
        HolokinError: bad input, or a strategy that cannot be run.
    """
    table = (job.physics or PhysicsTable()).changed(changes)
    robot, start, (task, *_) = build_tasks(job, file)
    with naming(file, "task"):
        of_one_tool(task, "a simulation")
    with naming(file, "path"):
        (path,) = paths_of(build_paths(job.path, task, start, file))
    cycles = table.cycles if path.closed else 1
    with naming(file, "physics"):
        push = table.force(robot, path, cycles)
    heavy = weighed(robot, table.density)
    played: list[Played] = []
    for label, its in job.strategies.items():
        say(label)
        with naming(file, "strategies", label):
            strategy = build_strategy(job, label, task, start, label)
            begin, _ = build_begin(its, strategy, start)
            begin = build_entry(job, strategy, path, begin).q0
            drive = servo(heavy, table.servo, begin, frequency=table.frequency, compensated=table.compensated)
            run = play(
                strategy, path, begin, servo=drive, feedback=table.feedback, cycles=cycles, dt=table.dt,
                gain=table.gain, noise=table.noise, push=push, density=table.density,
            )  # fmt: skip
        predicted = None
        if path.closed and run.cycles:
            say(f"{label}: kinematics")
            try:
                predicted = drift(strategy, path, begin, cycles=run.cycles, samples=job.path.samples).since_start
            except HolokinError:  # it stops where the run stopped, or just before
                predicted = None
        played.append(Played(label, run, predicted))
    masses = (
        "" if knows_masses(robot) else f"solid capsules of {table.density:g} kg/m^3, since {robot.name} has no masses"
    )
    settings = table.model_dump() | {"push": [0.0, 0.0, 0.0] if push is None else push.force.tolist()}
    return PhysicsResult(name, job.title, robot, tuple(played), masses, settings)
