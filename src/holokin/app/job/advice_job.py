"""Advice over a job, or over a robot and a box: what is asked, and the job file that is written and tried."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from ...analysis.coverage.starts import task_of_kind
from ...analysis.coverage.tool_chain import Chain, chain_to_tool
from ...analysis.design import Advice
from ...analysis.design.advice_case import advise_chain
from ...base.errors import ArgumentError, HolokinError
from ...base.types import Value, Vector
from ...motion.checks import Scene
from ...motion.ik import ik
from ...path.workspaces import Box, PoseRange, Workspace, workspace
from ...robot import Robot
from ...strategies.tasks.task import Task
from .job_parts import build_robot, build_tasks
from .paths_job import run_paths
from .runner import is_job, open_one_job, run_job, workspace_of_job
from .schema import job_of, job_table
from .templates import check_new, circle_job, job_text, passes, robot_name, write_new

# --- Axes and postures as one types them beside a command.


def axis_of(text: str) -> str | list[float]:
    """An axis of the tool, "x", "y", "z" or three numbers. Raises: ArgumentError."""
    if text in ("x", "y", "z"):
        return text
    numbers = numbers_of(text)
    if numbers is None or len(numbers) != 3:
        raise ArgumentError("--axis", text, 'write x, y or z, or a direction in the tool\'s frame like "0 0.5 1"')
    return numbers


def posture_of(text: str, robot: Robot, degrees: bool) -> list[float]:
    """A posture [rad, m] of numbers with blanks or commas between them. Raises: ArgumentError."""
    numbers = numbers_of(text)
    if numbers is None:
        cure = "give numbers with blanks between them, in rad and m; with --degrees in degrees and m"
        raise ArgumentError("the start posture", text, cure)
    if len(numbers) != robot.n:
        return numbers  # who checks the posture says how many there should be
    return (np.array(numbers) * np.where(robot.hinges & degrees, np.pi / 180, 1.0)).tolist()


def numbers_of(text: str) -> list[float] | None:
    """Finite numbers with blanks or commas between them; None where the text has anything else."""
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
    return numbers if np.isfinite(numbers).all() else None


# --- What is asked of `holokin advise`: a robot with a box in which it works, or a job, which says all of it.


@dataclass(frozen=True, eq=False)
class Question(Value):
    """A chain, its task, and where it works among what.

    scene: what it is to keep clear of, None where nothing is asked. shown: the robot for pictures.
    chosen: what nobody gave. keys: the tables that say all this in a job; the whole job where there is one, which is
    in `file`.
    """

    chain: Chain
    task: Task
    workspace: Workspace | None
    q0: Vector | None
    scene: Scene | None
    shown: Robot
    chosen: tuple[str, ...]
    keys: Mapping[str, Any]
    file: FilePath | None


def question(
    name: str, *, box: str | None = None, tilt: float | None = None, tip: str | None = None, base: str | None = None,
    task: Literal["pose", "axis", "position"] | None = None, trust_units: bool = False, any_start: bool = False,
) -> Question:  # fmt: skip
    """What is asked about a robot or a job. Raises: as `load`, `open_job`; ArgumentError.

    Args:
        name: of a robot or a job.
        box: of a robot: "X Y Z HX HY HZ" [m], the centre and half the sides. tilt: of the tool in it [deg].
        tip, base, trust_units: of a robot, as of `load`. task: "pose", "axis" or "position".
        any_start: of a job: whether it may begin in another posture, its tool where it is at the start.
    """
    if is_job(name):
        options = {"--box": box, "--tilt": tilt, "--tip": tip, "--base": base, "--task": task}
        for option, value in (options | {"--trust-units": trust_units or None}).items():
            if value is not None:
                raise ArgumentError(f"{option} beside a job", value, f"a job says all of it: write it into {name}")
        return _of_job(name, any_start)
    if any_start:
        raise ArgumentError("--any-start", True, "it is of a job: for a robot each start is tried")
    chain = chain_to_tool(name, tip, base, trust_units)
    keys = {"name": name, "tip": chain.tip if chain.base else None, "base": base, "trust_units": trust_units or None}
    if box is None and tilt is not None:
        raise ArgumentError("--tilt without --box", tilt, "give the box in which the tool leans, too")
    space = None if box is None else _typed_box(box, tilt or 0.0, chain.robot.planar)
    given = {"tip": not chain.chosen, "task": task is not None, "q0": False, "workspace": space is not None}
    chosen = tuple(word for word, is_given in given.items() if not is_given)
    table = {key: value for key, value in keys.items() if value}
    goal = task_of_kind(chain.robot, None, task)
    return Question(chain, goal, space, None, None, chain.robot, chosen, {"robot": table}, None)


def _of_job(name: str, any_start: bool) -> Question:
    _, job, file = open_one_job(name)
    own = build_robot(job, file)
    robot, start, (task, *_) = build_tasks(job, file, own)
    if task.n == task.m:
        cure = 'write orientation = "axis" into [task] if the tool may spin about its axis, or kind = "position"'
        raise ArgumentError(f"the number of redundant joints of {robot.name!r} for the job's task", 0, cure)
    space = workspace_of_job(job, task, start, file)
    chain = Chain(robot, None, task.tip or robot.tips[0].name, (), False)
    keys = job_table(file)
    scene, shown = (None, own) if job.checks is None else (job.checks.keeps_clear(robot), job.checks.drawn(own))
    chosen = ("q0",) if any_start else ()
    return Question(chain, task, space, None if any_start else start, scene, shown, chosen, keys, file)


def _typed_box(text: str, tilt: float, planar: bool) -> Workspace:
    """The box of a text, with the tool down, or in a plane as the base. Raises: ArgumentError."""
    numbers = numbers_of(text)
    if numbers is None or len(numbers) not in (4, 6):
        cure = 'write "X Y Z HX HY HZ", its centre and half its sides in metres; in a plane "X Y HX HY"'
        raise ArgumentError("--box", text, cure)
    half = len(numbers) // 2
    rotation = np.eye(3) if planar else None
    return workspace(box=(numbers[:half], numbers[half:]), rotation=rotation, tilt=np.deg2rad(tilt))


# --- A job written again, with the best strategy of an advice before its own strategies.

SAME = 1e-9  # difference of two start postures [joint units of the file] that are one
ADVISED = "advised"  # what the strategy is called in the job


def write_over(path: FilePath, advice: Advice, keys: Mapping[str, Any], file: FilePath) -> str:
    """Write a job again, to a new file, with the best strategy of an advice before its strategies.

    Args:
        keys: the content of the job. file: where it lies, from where its paths count.

    Returns:
        What the strategy does not do on the path of the job, in words; empty where it does all.

    Raises:
        JobError: the file exists. WriteError.
    """
    moved = moved_job(keys, file, path)
    remark = _begin(advice, moved)
    moved["strategies"] = {ADVISED: dict(advice.best.keys)} | _but_advised(moved["strategies"])
    if not isinstance(moved["path"], list):
        moved["expect"] = {ADVISED: {"holonomic": True}} | _but_advised(moved.get("expect", {}))
    text = job_text(moved)
    write_new(path, text)
    return "; ".join(filter(None, (remark, _trouble(text, path))))


def _but_advised(tables: Mapping[str, Any]) -> dict[str, Any]:
    return {name: keys for name, keys in tables.items() if name != ADVISED}


def _begin(advice: Advice, keys: dict[str, Any]) -> str:
    """Let a job begin on the leaf of the best strategy, its tool where it was at the start; what is said of that."""
    best, robot = advice.best, advice.task.robot
    degrees = bool(keys["start"].get("degrees", False))
    scales = np.where(robot.hinges & degrees, np.pi / 180, 1.0)
    q0 = scales * np.asarray(keys["start"]["q"], dtype=float)
    if np.abs(q0 - best.q0).max() <= SAME:
        return ""
    try:
        begin = ik(best.strategy, best.q0, limits=True)(advice.task.pose(q0))
    except HolokinError as problem:
        fact = f"the leaf of the strategy does not reach the tool pose of the start ({problem})"
        return f"{fact}: give the job another start"
    keys["start"] = {"q": (begin / scales).tolist()} | ({"degrees": True} if degrees else {})
    moved = np.abs(begin - q0).max() > SAME
    return "the job begins on the leaf of the strategy, its tool where it was" if moved else ""


def moved_job(keys: Mapping[str, Any], file: FilePath, path: FilePath) -> dict[str, Any]:
    """The content of a job with the files that it names, for a job in another folder."""

    def beside(given: Mapping[str, Any], key: str = "file") -> dict[str, Any]:
        name = given.get(key)
        if not isinstance(name, str) or not FilePath(name).suffix:
            return dict(given)
        return dict(given) | {key: robot_name(str(file.parent / name), path)}

    def every(given: Mapping[str, Any], key: str, of: str = "file") -> dict[str, Any]:
        return dict(given) | ({key: [beside(one, of) for one in given[key]]} if key in given else {})

    moved = dict(keys) | {"robot": every(beside(keys["robot"], "name"), "parts", "name")}
    paths = keys["path"] if isinstance(keys["path"], list) else [keys["path"]]
    paths = [every(beside(one), "others") for one in paths]
    moved["path"] = paths if isinstance(keys["path"], list) else paths[0]
    moved |= {part: beside(keys[part]) for part in ("every_path", "workspace", "sheets") if part in keys}
    if "checks" in keys:
        moved["checks"] = every(beside(keys["checks"], "srdf"), "obstacles")
        for one in moved["checks"].get("obstacles", []):
            if isinstance(one.get("pieces"), list):
                one["pieces"] = [robot_name(str(file.parent / piece), path) for piece in one["pieces"]]
    return moved


def _trouble(text: str, path: FilePath) -> str:
    """What the strategy of an advice does not do on the path of the job, in words; empty where it does all."""
    keys = tomllib.loads(text)
    several, whole = isinstance(keys["path"], list), "paths" if isinstance(keys["path"], list) else "path"
    keys["strategies"] = {ADVISED: keys["strategies"][ADVISED]}
    keys.pop("workspace", None)
    if not several:
        keys |= {"verdict": {"samples": 1}, "expect": {ADVISED: keys["expect"][ADVISED]}}  # it is known to be holonomic
    try:
        job = job_of(path, keys)
        if several:
            (found,) = run_paths(path.stem, job, path).rules
            troubles = [f"{name} is left out: {why}" for name, why in found.left_out.items()]
        else:
            (found,) = run_job(path.stem, job, path).strategies
            report = found.motion_check
            troubles = list(filter(None, (found.trouble, "" if report is None else report.trouble)))
            troubles = troubles or [found.status.value]
    except HolokinError as problem:
        return f"the strategy cannot be run on the {whole} of the job: {problem}"
    return (
        ""
        if found.passed
        else f"on the {whole} of the job the strategy does not do all that is asked: {'; '.join(troubles)}"
    )


# --- `holokin advise`: the advice, and the job that is written of it.

SHARE = 0.5  # radius of the circle over the least half side of the workspace, to begin with
LARGEST = 0.1  # its largest radius [m]
SMALLER = 3  # times that the circle is made smaller, by half each, until both strategies follow it to its end
# What an advice takes, on two cores that do nothing else.
DURATION = "some seconds, with several redundant joints up to two minutes"


def advise_command(
    name: str,
    asked: Question,
    out: FilePath | None,
    progress: Callable[[str], None],
    announce: Callable[[str], None],
    levels: bool = False,
) -> tuple[Advice, Callable[[], tuple[FilePath, str]]]:
    """What `holokin advise` does: (advice, what writes its job and returns the file and a remark).

    Args:
        name: of a robot or a job. asked: about it. progress: hears what is going on. announce: hears, before the work
            begins, what is looked at and how long that takes. levels: as of `advise`.

    Raises:
        JobError, WriteError: the file exists, or cannot be written; said before anything is looked at. As `advise`.
    """
    path = out or FilePath(f"advice-{FilePath(name).stem}.toml")
    check_new(path)
    announce(f"{asked.chain}. This takes {DURATION}.")
    advice = advise_chain(
        asked.chain,
        asked.task,
        asked.workspace,
        asked.q0,
        chosen=asked.chosen,
        scene=asked.scene,
        progress=progress,
        levels=levels,
    )

    def write() -> tuple[FilePath, str]:
        if asked.file is not None:
            return path, write_over(path, advice, asked.keys, asked.file)
        _write_advice(path, advice, asked)
        return path, ""

    return advice, write


def proof_command(advice: Advice, asked: Question, job: FilePath) -> str:
    """The command that proves what the advice looked at pose by pose: over its box, or along the path of the job; empty
    where no proof is made of the strategy.
    """
    if not advice.certify_by:
        return ""
    space = advice.workspace
    box = asked.file is None and isinstance(space, PoseRange) and isinstance(space.solid, Box)
    return f"holokin certify {job}{' --workspace' if box and advice.best.served.all() else ''}"


def _write_advice(path: FilePath, advice: Advice, asked: Question) -> None:
    """Write a job of the best strategy of an advice, beside the pseudo-inverse, to a new file.

    Both are followed round a circle in the workspace before it is written; what must stay true of the best is expected.

    Raises:
        JobError: the file exists, or is no .toml. ArgumentError: no circle was found. WriteError.
    """
    best, task, space = advice.best, advice.task, advice.workspace
    robot = dict(asked.keys["robot"])
    robot["name"] = robot_name(robot["name"], path) if FilePath(robot["name"]).suffix else robot["name"]
    tables = {
        **({"workspace": _workspace_keys(space)} if isinstance(space, PoseRange) else {}),
        f"strategies.{ADVISED}": dict(best.keys),
        "strategies.moore-penrose": {"kind": "moore-penrose"},
        f"expect.{ADVISED}": {"holonomic": True, "drift_total": {"below": 1e-6}},
    }
    # The largest circle that the strategies follow: half as large each time.
    half = space.solid.half if isinstance(space, PoseRange) else np.array([LARGEST])
    largest = min(LARGEST, SHARE * float(half[half > 0].min()))
    for k in range(SMALLER):
        radius = float(f"{largest / 2**k:.1g}")
        title, about = f"{task.robot.name}: {best.name}", " ".join(advice.reasons)
        text = circle_job(title, about, robot, task, best.q0, radius, tables)
        if passes(text, path):
            write_new(path, text)
            return
    cure = "none was found that the strategy follows: write a path of your own"
    raise ArgumentError("the circle of the job", None, cure)


def _workspace_keys(space: PoseRange) -> dict[str, Any]:
    """[workspace] of a workspace."""
    names = {"sides": "half", "height": "half_height"}
    sizes = {names.get(f.name, f.name): getattr(space.solid, f.name) for f in fields(space.solid)}
    keys = {key: np.asarray(value).tolist() for key, value in sizes.items()}
    turns = {"tilt_deg": round(float(np.degrees(space.tilt)), 9), "spin_deg": round(float(np.degrees(space.spin)), 9)}
    return {"kind": type(space.solid).__name__.lower(), **keys, "rotation": space.rotation.tolist(), **turns}
