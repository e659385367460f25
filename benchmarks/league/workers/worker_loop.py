"""What every worker does: reads the robots and paths, asks its library sample after sample, writes the joints.

A worker runs in its library's environment, with NumPy and without holokin:

    python libraries.py COURSE_FOLDER ANSWER_FOLDER LIBRARY

The robot is perfect: it is where the last answer put it. An answer that is missing leaves it there. A run begins with a
call at the pose of the start: where a library has a posture of its own for that pose, the run begins there.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

SAME = 1e-9
"""Two robots are the same if their poses [m] agree to this."""

Step = Callable[[np.ndarray, np.ndarray, np.ndarray, float], "np.ndarray | None"]
"""(q, wanted pose (4, 4), wanted twist (6,), seconds h) -> the joints h later, or None where there is no answer."""


@dataclass(frozen=True)
class Arm:
    """A robot and what its tool does: files, names, limits, the start, the targets of each run."""

    name: str
    urdf: str
    mjcf: str
    base: str
    frame: str
    joints: list[str]
    lower: np.ndarray
    upper: np.ndarray
    speed: np.ndarray
    start: np.ndarray
    runs: dict[str, dict[str, np.ndarray]] = field(repr=False)
    check: dict[str, np.ndarray] = field(repr=False)
    """Postures `q` (k, n) and the poses of the tool there, `poses` (k, 4, 4)."""


@dataclass(frozen=True)
class Setting:
    """A way to use the library. `begin(arm)` starts a run from the arm's start and returns its step.

    example: the library's own examples use it so; `source` names the example.
    """

    name: str
    begin: Callable[[Arm], Step]
    example: bool = False
    source: str = ""


def serve(settings: Callable[[Arm], Iterable[Setting]], packages: Iterable[str]) -> None:
    """Run every setting on every arm, and keep what is done after each."""
    course, answers = map(Path, sys.argv[1:3])
    said: dict[str, Any] = {"versions": {name: version(name) for name in packages}, "settings": []}
    for arm in _arms(course):
        for setting in settings(arm):
            joints, told = _all_runs(setting, arm)
            file = f"{arm.name}-{len(said['settings'])}.npz"
            np.savez(answers / file, **joints)
            told |= {"arm": arm.name, "name": setting.name, "example": setting.example, "source": setting.source}
            said["settings"].append(told | {"file": file})
            (answers / "answer.json").write_text(json.dumps(said, indent=1), "utf-8")


def _arms(course: Path) -> Iterator[Arm]:
    for told in json.loads((course / "course.json").read_text("utf-8")):
        with np.load(course / f"{told['name']}.npz") as arrays:
            runs: dict[str, dict[str, np.ndarray]] = {}
            for key in arrays.files:
                run, _, what = key.rpartition("/")
                runs.setdefault(run, {})[what] = arrays[key]
        told |= {key: np.array(told[key], dtype=float) for key in ("lower", "upper", "speed", "start")}
        told |= {key: str(course / told[key]) for key in ("urdf", "mjcf")}
        yield Arm(**told, check=runs.pop("check"), runs=runs)


def placed(
    arm: Arm, kinematics: Callable[[np.ndarray], np.ndarray], within: float = SAME
) -> tuple[np.ndarray, np.ndarray]:
    """Of a library with a robot of its own: (A, B) with kinematics(q) = A pose(q) B at all postures of the check.

    Raises: LookupError: its robot is another one.
    """
    q, poses = arm.check["q"], arm.check["poses"]
    base, tool = np.eye(4), np.linalg.solve(poses[0], kinematics(q[0]))
    for posture, pose in zip(q, poses, strict=True):
        if np.abs(kinematics(posture) - base @ pose @ tool).max() > within:
            raise LookupError("its robot is another one than ours")
    return base, tool


def agrees(arm: Arm, kinematics: Callable[[np.ndarray], np.ndarray], within: float = SAME) -> None:
    """Compare the forward kinematics of a library with ours. Raises: LookupError: they differ."""
    apart = max(np.abs(kinematics(q) - pose).max() for q, pose in zip(arm.check["q"], arm.check["poses"], strict=True))
    if apart > within:
        raise LookupError(f"its forward kinematics differ from ours by {apart:.1e}")


def _all_runs(setting: Setting, arm: Arm) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    joints: dict[str, np.ndarray] = {}
    medians, missing = [], 0
    for name, run in arm.runs.items():
        try:
            q, seconds, held = _one_run(setting, arm, run)
        except Exception as problem:  # noqa: BLE001  another library may throw anything: the page says what
            return joints, {"fault": f"{type(problem).__name__}: {problem}".splitlines()[0][:200]}
        joints[name] = q
        missing += 0 if name.startswith("tour") else held
        medians.append(float(np.median(seconds[1:])))
    return joints, {"fault": "", "missing": missing, "call_us": 1e6 * min(medians)}


def _one_run(setting: Setting, arm: Arm, run: dict[str, np.ndarray]) -> tuple[np.ndarray, list[float], int]:
    """Joints (k + 1, n), seconds of each call, the first with what begins the run, and calls without an answer."""
    q, held, seconds, joints = arm.start.copy(), 0, [], []
    begun = time.perf_counter()
    step = setting.begin(arm)
    stand = (arm.check["poses"][0], np.zeros(6), run["h"][0])
    for pose, twist, h in [stand, *zip(run["poses"], run["twists"], run["h"], strict=True)]:
        begun = time.perf_counter() if seconds else begun
        try:
            answer = step(q.copy(), pose, twist, float(h))
        except Exception:
            if not seconds:
                raise
            answer = None
        seconds.append(time.perf_counter() - begun)
        if answer is None or not np.isfinite(answer).all():
            held += 1
        else:
            q = np.array(answer, dtype=float).reshape(len(arm.joints))
        joints.append(q)
    return np.array(joints), seconds, held


# --- Rivals in turns: a process that answers a part of its poses and paths each time that it is told to.


@dataclass(frozen=True)
class Way:
    """A way to ask a library. `find(pose)` needs no start; `follow(q)` begins at joints q and gives step(pose, q).

    Without `follow` it is followed by `find`. within: the tool error [m or rad] up to which an answer counts.
    """

    name: str
    settings: str
    find: Callable[[np.ndarray], np.ndarray | None] | None = None
    follow: Callable[[np.ndarray], Callable[[np.ndarray, np.ndarray], np.ndarray | None]] | None = None
    within: float = 1e-5

    def begin(self, runs: dict[str, dict[str, np.ndarray]]) -> None:
        """Call it once, so that what it compiles is there and what it throws is told."""
        if self.find:
            self.find(runs["poses"]["poses"][0])
        for run in (run for run in runs.values() if self.follow and "start" in run):
            self.follow(run["start"])(run["poses"][0], run["start"])
            return

    def walk(self, start: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints (k, n) and the seconds of each call along poses (k, 4, 4), NaN from the first missing answer on.

        The first pose is that of `start`, and is asked twice: where the library begins at joints of its own, it does.
        """
        find = self.find
        step = self.follow(start) if self.follow else lambda pose, q: find(pose) if find else None
        _, _, q = _timed(step, poses[0], start)
        found, seconds = np.full((len(poses), len(start)), np.nan), np.full(len(poses), np.nan)
        for k, pose in enumerate(poses):
            found[k], seconds[k], q = _timed(step, pose, q)
            if np.isnan(found[k, 0]):
                break
        return found, seconds


def _timed(
    step: Callable[[np.ndarray, np.ndarray], np.ndarray | None], pose: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, float, np.ndarray]:
    """The answer, NaN where there is none, the seconds that it took, and the last joints that there were."""
    begun = time.perf_counter()
    try:
        answer = step(pose, q)
    except Exception:  # noqa: BLE001  another library may throw anything: it has no answer then
        answer = None
    seconds = time.perf_counter() - begun
    if answer is None or not np.isfinite(answer).all():
        return np.full(len(q), np.nan), seconds, q
    answer = np.array(answer, dtype=float).reshape(len(q))
    return answer, seconds, answer


def answer_in_turns(ways: Callable[[Arm], Iterable[Way]], packages: Iterable[str]) -> None:
    """Read commands and answer each with a line: `arm NAME`, `turn K OF`, and `keep`, which writes the answers."""
    course, answers = map(Path, sys.argv[1:3])
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what a library prints is no reply
    arms = {arm.name: arm for arm in _arms(course)}
    arm, made, kept = next(iter(arms.values())), [], {}
    for line in sys.stdin:
        what, *rest = line.split()
        reply: dict[str, Any] = {}
        if what == "arm":
            arm, made, kept = arms[rest[0]], [], {}
            try:
                made = list(ways(arm))
                for way in made:
                    way.begin(arm.runs)
            except Exception as problem:  # noqa: BLE001  another library may throw anything: the page says what
                reply["fault"] = (
                    str(problem) if isinstance(problem, LookupError) else f"{type(problem).__name__}: {problem}"
                )
            reply["ways"] = [[way.name, way.settings, bool(way.find), way.within] for way in made]
            reply["versions"] = {name: version(name) for name in packages}
        elif what == "turn":
            for i, way in enumerate(made):
                for name, part in _part(arm, way, *map(int, rest)):
                    kept[f"{i}/{name}"] = part
        else:
            np.savez(answers / f"{arm.name}.npz", **kept)
        print(json.dumps(reply), file=replies, flush=True)


def _part(arm: Arm, way: Way, turn: int, turns: int) -> Iterator[tuple[str, np.ndarray]]:
    """Name and rows (k, n + 1), joints and seconds, of each run in this turn: poses, legs, circles in equal parts."""
    paths = [[name for name in arm.runs if name.startswith(kind)] for kind in ("leg", "circle")]
    poses = np.array_split(arm.runs["poses"]["poses"], turns)[turn]
    if way.find:
        find, zero = way.find, np.zeros(len(arm.joints))
        _timed(lambda pose, q: find(pose), poses[0], zero)  # another process had the core before
        found = [_timed(lambda pose, q: find(pose), pose, zero)[:2] for pose in poses]
        yield f"poses {turn}", np.array([[*q, seconds] for q, seconds in found])
    for name in (str(name) for names in paths for name in np.array_split(np.array(names), turns)[turn]):
        run = arm.runs[name]
        q, seconds = way.walk(run["start"], run["poses"])
        yield name, np.column_stack([q, seconds])
