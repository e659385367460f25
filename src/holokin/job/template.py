"""Job files to start from: a copy of a packaged job, or a job for a robot, tried before it is written."""

from __future__ import annotations

import json
import os
import tomllib
from importlib.resources import files
from pathlib import Path as FilePath

import numpy as np

from ..errors import ArgumentError, HolokinError, JobError, UnknownNameError
from ..files import replacing
from ..robot import Robot, catalogue, load
from ..task import Task, pose, position
from ..types import Matrix, Vector
from .runner import packaged_jobs, run_job
from .schema import Job

_COPIED = """# What follows holds for the job as copied. For another robot, start, path or strategy measure first
# (delete this part, run, read the table), then write here what must stay true.
"""
"""What a copied job says above its expectations."""

_POSTURES = 2000
"""Postures looked at for a start: among so many random ones of seven joints some are well conditioned."""

_TRIED = 4
"""Starts that are tried; each with circles of three sizes."""

_SHARE = 0.5
"""Share of a joint's range, about its middle, in which the start posture lies: a quarter is left on either side."""

_FREE = 1.2
"""Range [rad or m] on either side of zero for a joint without limits."""

_JOB = """title = {title}
about = \"\"\"
A circle of {radius:g} m, {cycles} times, {task}. The start posture is a regular one, well inside the
joint limits; all strategies below were followed to the end of the path when this file was written. Collisions were
not looked at.
\"\"\"

[robot]
name = {name}
{tip}
[task]
{kind}

[start]
# {joints}
q = {q}

[path]
kind = "circle"
center = [{center:g}, 0, 0]
relative = true
speed = 0.1
samples = {samples}
cycles = {cycles}

[strategies.moore-penrose]
kind = "moore-penrose"

[strategies.lock]
kind = "lock"
joints = [{locked}]

[strategies.radial]
kind = "radial"

# Run it and read the table, then write here what must stay true, for instance:
# [expect.lock]
# holonomic = true
# drift_total = {{ below = 1e-9 }}
"""

_SAMPLES, _CYCLES = 100, 2


def packaged_text(name: str) -> str:
    """The TOML text of a packaged job. Raises: UnknownNameError."""
    if name not in packaged_jobs():
        raise UnknownNameError("job", name, packaged_jobs())
    return files("holokin.job").joinpath("packaged", f"{name}.toml").read_text("utf-8")


def new_job(path: FilePath, template: str) -> None:
    """Write a copy of a packaged job to a new file.

    Raises:
        UnknownNameError: of the template. JobError: the file exists. WriteError: the system refuses it.
    """
    _write(path, packaged_text(template).replace("\n[expect.", f"\n{_COPIED}[expect.", 1))


def new_job_for(path: FilePath, robot: str, tip: str | None = None) -> None:
    """Write a job for a robot to a new file: a small circle from a regular start posture, with three strategies.

    Every strategy is followed round the circle before the file is written. Nothing is expected in it.

    Args:
        robot: a name of the catalogue, or a .urdf or .toml file. tip: as of `load`.

    Raises:
        JobError: the file exists. RobotFileError, UnknownNameError: of the robot. ArgumentError: a robot without
        redundancy, or one for which no such circle was found. WriteError: the system refuses the file.
    """
    _check(path)
    arm = load(robot, tip=tip)
    if arm.n < 2:
        raise ArgumentError(f"the number of joints of {arm.name!r}", arm.n, "a job needs two, to be redundant")
    task, words, kind = _task(arm)
    name = robot if robot in catalogue() else _from_folder(robot, path)
    scale = arm.n**-0.5 * sum(np.linalg.norm(joint.placement[:3, 3]) for joint in arm.joints) + 0.05
    for start in _starts(arm, task)[:_TRIED]:
        for share in (0.1, 0.03, 0.01):
            radius = float(f"{min(0.1, share * scale):.1g}")
            inward = -radius if arm.pose(start, task.tip)[0, 3] > 0 else radius
            text = _JOB.format(
                title=_quoted(f"{arm.name}, a circle of {radius:g} m"),
                radius=radius,
                cycles=_CYCLES,
                samples=_SAMPLES,
                task=words,
                name=_quoted(name),
                tip="" if tip is None else f"tip = {_quoted(tip)}\n",
                kind=kind,
                joints=", ".join(arm.joint_names).replace("\n", " "),
                q=start.tolist(),
                center=inward,
                locked=", ".join(_quoted(arm.joint_names[i]) for i in _locked(task, start)),
            )
            if _completes(text, path):
                _write(path, text)
                return
    raise ArgumentError(
        f"the circle for {arm.name!r}", None, "none was found that all strategies follow: copy a job with --from"
    )


def _completes(text: str, path: FilePath) -> bool:
    """Whether all strategies of a job follow its path to the end."""
    table = tomllib.loads(text) | {"verdict": {"samples": 1}}  # verdicts are not asked for here, and take longest
    try:
        return run_job(path.stem, Job.model_validate(table), path).passed
    except HolokinError:
        return False


def _task(robot: Robot) -> tuple[Task, str, str]:
    """(task, in words, in TOML) with fewer rows than joints: the pose, the position, or rows of it."""
    if robot.n > (3 if robot.planar else 6):
        return pose(robot), "with the tool's orientation held", 'kind = "pose"\norientation = "twist"'
    if robot.n > (2 if robot.planar else 3):
        return position(robot), "with the tool's orientation free", 'kind = "position"'
    rows = list(range(robot.n - 1))
    words = f"in {' and '.join('xy'[i] for i in rows)} alone"
    return position(robot, rows=rows), words, f'kind = "position"\nrows = {rows}'


def _starts(robot: Robot, task: Task) -> list[Vector]:
    """Start postures (n,), rounded to a hundredth, the best conditioned first."""
    lower = np.where(np.isfinite(robot.lower), robot.lower, -_FREE)
    upper = np.where(np.isfinite(robot.upper), robot.upper, _FREE)
    shares = np.random.default_rng(0).uniform((1 - _SHARE) / 2, (1 + _SHARE) / 2, (_POSTURES, robot.n))
    Q = np.round(lower + shares * (upper - lower), 2)
    Q = Q[((robot.lower <= Q) & (robot.upper >= Q)).all(axis=1)]
    return [Q[i] for i in np.argsort([-_regular(task, q) for q in Q])]


def _regular(task: Task, q: Vector) -> float:
    """How far [J; rows of the locked joints] is from singular at q, 1 at best: smallest singular value over largest."""
    J = task.jacobian(q)
    others = [i for i in range(task.n) if i not in _locked(task, q)]
    values = np.linalg.svd(J[:, others], compute_uv=False)
    return float(values[-1] / values[0]) if values[0] > 0 else 0.0


def _locked(task: Task, q: Vector) -> list[int]:
    """The r joints that determine the self-motion best: pivots of its basis N (n, r)."""
    N: Matrix = task.null_space(q).copy()
    chosen: list[int] = []
    for _ in range(task.n - task.m):
        sizes = np.linalg.norm(N, axis=1)
        sizes[chosen] = 0.0
        pivot = int(np.argmax(sizes))
        chosen.append(pivot)
        direction = N[pivot] / max(sizes[pivot], 1e-300)
        N = N - np.outer(N @ direction, direction)
    return sorted(chosen)


def _from_folder(robot: str, path: FilePath) -> str:
    """A robot file as a job in another folder names it: relative where it lies near, so that both can be moved."""
    try:
        near = FilePath(os.path.relpath(robot, path.parent))
    except ValueError:  # another drive
        near = FilePath(robot).absolute()
    return (near if near.parts.count("..") < 2 else FilePath(robot).absolute()).as_posix()


def _quoted(text: str) -> str:
    """A text as TOML writes it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _check(path: FilePath) -> None:
    if path.suffix.lower() != ".toml":
        raise JobError(path, "file", "does not end in .toml", "name it like my-job.toml")
    if os.path.lexists(path):
        raise JobError(path, "file", "exists already", "choose another name, or delete it first")


def _write(path: FilePath, text: str) -> None:
    _check(path)
    with replacing(path, new=True) as part:
        part.write_text(text, "utf-8")
