"""`to_job`: a session as a job file, which `holokin run` runs to the same numbers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import ArgumentError
from ...strategies import HolonomicStrategy
from ..job.path_tables import MOST_STEPS
from ..job.toml_text import table, toml
from .session import Session
from .session_laws import Law

FILES = ("name", "file")
"""Keys of a job that may hold the name of a file."""


def to_job(session: Session, title: str | None = None) -> str:
    """The TOML text of a job: the robot, task, home, loop and laws of a session, on their leaves.

    `holokin run` of it follows the same steps from the same postures, so its drifts are those that the session shows.
    Laws that no job can say, such as control laws of your own, are left out and named in a comment.

    Files of the robot and the path are named by their full names.

    Raises:
        ArgumentError: no loop is set; no law that a job can say; or the robot was made in Python, so that no file or
            name of the catalogue tells it.
    """
    loop, laws, home = session.loop, session.laws, session.home
    if loop is None:
        raise ArgumentError("the loop", None, "set one first: a job has a path")
    if session.origin is None:
        cure = "a job names a robot of the catalogue or a file: open the session with that name"
        raise ArgumentError("the robot of the session", session.robot.name, cure)
    told = [law for law in laws if law.keys is not None]
    if not told:
        raise ArgumentError("the laws that a job can say", 0, "add one of the kinds that jobs have")
    snapshot = session.snapshot()
    cycles = snapshot.cycles or max(1, snapshot.cycle)
    path = {**loop.keys, "samples": loop.samples}
    if loop.path.closed:
        path["cycles"] = max(1, min(cycles, MOST_STEPS // loop.samples))
    lines = [f"title = {toml(title or session.title)}\n"]
    lines += [f"# {law.name} is a control law of your own: a job cannot say it." for law in laws if law.keys is None]
    lines.append(_part("robot", _placed(session.origin.robot, session.origin.folder)))
    lines.append(_part("task", session.origin.task))
    lines.append(f"# {', '.join(session.robot.joint_names)}\n{_part('start', {'q': home.tolist()})}")
    lines.append(_part("path", _placed(path, session.origin.folder)))
    written: set[str] = set()
    for law in told:
        label = law.label or law.name
        if label not in written:
            lines.append(_part(f"strategies.{toml(label)}", _keys(law)))
        written.add(label)
    return "\n".join(lines)


def _keys(law: Law) -> dict[str, Any]:
    """What a job says of a law, on its leaf."""
    keys = dict(law.keys or {})
    if law.level is not None and isinstance(law.rule, HolonomicStrategy):
        keys["level"] = float(law.level[0]) if len(law.level) == 1 else np.asarray(law.level).tolist()
    return keys


def _part(name: str, keys: Mapping[str, Any]) -> str:
    return table(name, {key: value for key, value in keys.items() if value is not None})


def _placed(keys: Mapping[str, Any], source: FilePath) -> dict[str, Any]:
    """The keys with the full names of files."""
    found: dict[str, Any] = {}
    for key, value in keys.items():
        if isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            value = [_placed(one, source) for one in value]
        elif key in FILES and isinstance(value, str) and FilePath(value).suffix:
            value = FilePath(os.path.normpath(source / value)).as_posix()
        found[key] = value
    return found
