"""What every worker does: reads the robots and paths, asks its library sample after sample, writes the joints.

A worker runs in its library's environment, with NumPy and without holokin:

    python libraries.py COURSE_FOLDER ANSWER_FOLDER LIBRARY

The robot is perfect: it is where the last answer put it. An answer that is missing leaves it there. A run begins with a
call at the pose of the start: where a library has a posture of its own for that pose, the run begins there.
"""

from __future__ import annotations

import json
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


def placed(arm: Arm, kinematics: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Of a library with a robot of its own: (A, B) with kinematics(q) = A pose(q) B at all postures of the check.

    Raises: LookupError: its robot is another one.
    """
    q, poses = arm.check["q"], arm.check["poses"]
    base, tool = np.eye(4), np.linalg.solve(poses[0], kinematics(q[0]))
    for posture, pose in zip(q, poses, strict=True):
        if np.abs(kinematics(posture) - base @ pose @ tool).max() > SAME:
            raise LookupError("its robot is another one than ours")
    return base, tool


def _all_runs(setting: Setting, arm: Arm) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    joints: dict[str, np.ndarray] = {}
    medians, pinv, missing, first = [], [], 0, 0.0
    for name, run in arm.runs.items():
        try:
            q, seconds, held = _one_run(setting, arm, run)
        except Exception as problem:  # noqa: BLE001  another library may throw anything: the page says what
            return joints, {"fault": f"{type(problem).__name__}: {problem}".splitlines()[0][:200]}
        joints[name] = q
        missing += 0 if name.startswith("tour") else held
        first = first or seconds[0]
        medians.append(float(np.median(seconds[1:])))
        pinv.append(_pinv_seconds())
    told = {"fault": "", "missing": missing, "first_seconds": first}
    return joints, told | {"call_us": 1e6 * min(medians), "pinv_us": 1e6 * min(pinv)}


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


def _pinv_seconds() -> float:
    """What NumPy's pinv of a 6x7 matrix takes here and now: says how busy the machine is."""
    J, seconds = np.random.default_rng(0).normal(size=(6, 7)), []
    for _ in range(200):
        begun = time.perf_counter()
        np.linalg.pinv(J)
        seconds.append(time.perf_counter() - begun)
    return float(np.median(seconds))
