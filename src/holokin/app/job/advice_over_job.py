"""A job written again, with the best law of an advice before its own strategies."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.design import Advice
from ...base.errors import HolokinError
from ...motion.ik import inverse
from .runner import run_job
from .schema import Job
from .toml_text import robot_name, table, toml, toml_key, write_new

SAME = 1e-9
"""Difference of two start postures [joint units of the file] that are one."""

NAME = "advised"
"""What the strategy is called in the job."""


def write_over(path: FilePath, advice: Advice, keys: Mapping[str, Any], file: FilePath) -> str:
    """Write a job again, to a new file, with the best law of an advice before its strategies.

    Args:
        keys: the content of the job. file: where it lies, from where its paths count.

    Returns:
        What the law does not do on the path of the job, in words; empty where it does all.

    Raises:
        JobError: the file exists. WriteError.
    """
    moved = _moved(keys, file, path)
    remark = _begin(advice, moved)
    text = _text(advice, moved)
    write_new(path, text)
    return "; ".join(said for said in (remark, _trouble(text, path)) if said)


def _begin(advice: Advice, keys: dict[str, Any]) -> str:
    """Let a job begin on the leaf of the best law, with the tool where it was at the start; what is said of that."""
    law, robot = advice.best, advice.task.robot
    degrees = bool(keys["start"].get("degrees", False))
    scales = np.where(robot.hinges & degrees, np.pi / 180, 1.0)
    q0 = scales * np.asarray(keys["start"]["q"], dtype=float)
    if np.abs(q0 - law.q0).max() <= SAME:
        return ""
    try:
        begins = inverse(law.strategy, law.q0, limits=True)(advice.task.pose(q0))
    except HolokinError as problem:
        return f"the leaf of the law does not reach the tool pose of the start ({problem}): give the job another start"
    keys["start"] = {"q": (begins / scales).tolist()} | ({"degrees": True} if degrees else {})
    return "" if np.abs(begins - q0).max() <= SAME else "the job begins on the leaf of the law, its tool where it was"


def _text(advice: Advice, keys: dict[str, Any]) -> str:
    """The job in TOML: its plain keys, its tables, the strategies, and what is expected of them."""
    law = advice.best
    named = {NAME: dict(law.keys)} | {k: v for k, v in keys.pop("strategies").items() if k != NAME}
    wanted = {NAME: {"holonomic": True}} | {k: v for k, v in keys.pop("expect", {}).items() if k != NAME}
    plain = [f"{key} = {toml(value)}" for key, value in keys.items() if not isinstance(value, Mapping)]
    found = ["\n".join(plain) + "\n"]
    found += [table(key, value) for key, value in keys.items() if isinstance(value, Mapping)]
    found += [table(f"strategies.{toml_key(key)}", value) for key, value in named.items()]
    found += [table(f"expect.{toml_key(key)}", value) for key, value in wanted.items()]
    return "\n".join(found)


def _moved(keys: Mapping[str, Any], file: FilePath, path: FilePath) -> dict[str, Any]:
    """The content of a job with the files that it names, for a job in another folder."""

    def beside(given: Mapping[str, Any], key: str) -> dict[str, Any]:
        name = given.get(key)
        if not isinstance(name, str) or not FilePath(name).suffix:
            return dict(given)
        return dict(given) | {key: robot_name(str(file.parent / name), path)}

    found = dict(keys) | {"robot": beside(keys["robot"], "name"), "path": beside(keys["path"], "file")}
    if "parts" in found["robot"]:
        found["robot"]["parts"] = [beside(part, "name") for part in found["robot"]["parts"]]
    if "others" in found["path"]:
        found["path"]["others"] = [beside(other, "file") for other in found["path"]["others"]]
    if "workspace" in keys:
        found["workspace"] = beside(keys["workspace"], "file")
    return found


def _trouble(text: str, path: FilePath) -> str:
    """What the law of an advice does not do on the path of the job, in words; empty where it does all."""
    keys = tomllib.loads(text) | {"verdict": {"samples": 1}}  # it is known to be holonomic
    keys.pop("workspace", None)
    for part in ("strategies", "expect"):
        keys[part] = {NAME: keys[part][NAME]}
    try:
        found = run_job(path.stem, Job.model_validate(keys), path).strategies[0]
    except HolokinError as problem:
        return f"the law cannot be run on the path of the job: {problem}"
    if found.passed:
        return ""
    report = found.motion_check
    said = [found.trouble] if found.trouble else []
    said += [report.trouble] if report is not None and report.trouble else []
    return f"on the path of the job the law does not do all that is asked: {'; '.join(said) or found.status.value}"
