"""The entry of a job: from its start posture to where its path begins, timed and checked like the path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from ...base.errors import ArgumentError, BranchError, PathError, SingularityError, posture_text
from ...base.types import Value, Vector
from ...motion import TimedTrajectory, approach, retime
from ...motion.checks import CheckReport
from ...motion.timed_trajectory import with_entry
from ...motion.trajectory import Trajectory
from ...path import Path
from ...path.synchronized_paths import AnyPath
from ...robot import Robot
from ...strategies import Strategy
from .job_parts import naming
from .motion_tables import TimingTable
from .schema import Job


@dataclass(frozen=True, eq=False)
class Entry(Value):
    """The posture q0 (n,) at the start of the path, and the way to it; None where the path begins at once."""

    q0: Vector
    walk: Trajectory | None = None

    def timed(self, timing: TimingTable, robot: Robot) -> TimedTrajectory | None:
        """The entry with the limits and the profile of a job, at most as fast as `approach` goes."""
        if self.walk is None:
            return None
        return retime(self.walk, robot, **timing.model_dump() | {"speed": 1.0, "endless": False})

    def before(self, motion: TimedTrajectory, timing: TimingTable, robot: Robot) -> TimedTrajectory:
        """A timed motion of the path with the entry before it."""
        entry = self.timed(timing, robot)
        return motion if entry is None else with_entry(entry, motion)


def build_entry(job: Job, strategy: Strategy, path: AnyPath, q0: Vector) -> Entry:
    """The entry of a job from a start posture (n,).

    Raises:
        BranchError where it leads nowhere; ArgumentError: paths of several frames.
    """
    if job.path.entry is None:
        return Entry(q0)
    if not isinstance(path, Path):
        cure = "leave it out, and begin where all paths do"
        raise ArgumentError("the entry to the paths of several frames", job.path.entry, cure)
    try:
        walk = approach(strategy, path, q0, by=job.path.entry)
    except (SingularityError, PathError) as problem:
        fact, _, cure = str(problem).rpartition("; ")
        raise BranchError(f"the entry to the path failed: {fact}", cure) from problem
    return Entry(walk.q[-1], walk if len(walk.q) > 1 else None)


def entry_report(job: Job, file: FilePath, strategy: Strategy, entry: Entry) -> tuple[str, CheckReport | None]:
    """A sentence on an entry, and what the job's [checks] find on it; an empty one where there is no entry."""
    walk, robot = entry.walk, strategy.task.robot
    if walk is None:
        return "", None
    motion = walk if job.timing is None else entry.timed(job.timing, robot) or walk
    turned = np.ptp(walk.q, axis=0)
    most = int(np.argmax(turned))
    name, units, printed = robot.joint_names[most], [c.unit for c in robot.coordinates], job.printed_units
    at = posture_text(entry.q0 * printed.factors(units), robot.joint_names)
    told = f"{strategy.name} enters the path by {job.path.entry} in {motion.t[-1]:.3g} s, at {at}"
    told += f"; on this way {name} moves most, by {printed.said(turned[most], units[most], 3)}"
    if job.checks is None:
        return f"{told}. The way there is not checked: the job has no [checks].", None
    with naming(file, "checks"):
        found = job.checks.checked(motion, robot, strategy.task)
    if found.passed:
        return f"{told}. [checks] find nothing on the way there.", found
    trouble = found.findings[0].printed(printed) if found.findings else found.unread
    return f"{told}. [checks] find on the way there: {trouble}.", found
