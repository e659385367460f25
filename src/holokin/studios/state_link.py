"""A link that opens the same state of a studio: a job as "Save as job" writes it, where the laws stand, what is shown.

A link may come from a stranger. So it is data alone: a job, checked as job files are, of a few tables; a robot of the
catalogue; and of files only the digest, which stands for a file that the studio shows already.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import tomllib
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Annotated, Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import ArgumentError
from ..job.job_file import job_of
from ..robot import catalogue
from .new_session import session_of_job
from .session import Session
from .session_job import to_job
from .setups import kept
from .shown_units import FASTEST, SI, SLOWEST, UNITS, View

LONGEST = 6000
"""Characters of a state: a request of a browser may have 8192."""

UNPACKED = 65_536
"""Bytes of a state as JSON."""

TABLES = frozenset({"title", "robot", "task", "start", "path", "strategies"})
"""Of a job that a link may hold: those that say what a studio shows."""

DIGEST = "sha256:"
"""Before what stands for a file."""

KEY, MARK = "state", "hk1."
"""The key of the address that has the state, and how a state begins."""

Number = Annotated[float, Field(allow_inf_nan=False)]
_WHAT = "the state of a link"
_WHOLE = "copy the whole link again, from `state=` to its end"


class _Data(BaseModel):
    """What a link holds."""

    model_config = ConfigDict(extra="forbid", strict=True)
    job: dict[str, Any]
    cycles: Annotated[int, Field(ge=1, le=10_000)] | None
    speed: Annotated[Number, Field(ge=SLOWEST, le=FASTEST)]
    units: str = SI.name
    solid: Annotated[str, Field(max_length=200)] = ""
    postures: Annotated[dict[str, list[Number]], Field(max_length=100)] = {}
    target: list[list[list[Number]]] | None = None


def state_text(session: Session, view: View | None = None) -> str:
    """The state of a session as a short text, for `session_of_state`: letters, digits, `-`, `_` and a dot.

    It holds the job that `to_job` writes, the number of cycles, where each law stands, and the view. Of a file of the
    robot or of the path it holds the SHA-256 alone.

    Raises:
        ArgumentError: a robot without a name or file; a state of too many points. As `to_job`.
    """
    shown, snap = view or View(), session.snapshot()
    data = _Data(
        job=_renamed(tomllib.loads(to_job(session)), _digest_of),
        cycles=snap.cycles,
        speed=min(max(shown.speed, SLOWEST), FASTEST),
        units=shown.units,
        solid=shown.solid,
        postures={law.name: law.q.tolist() for law in snap.laws},
        target=snap.target.tolist(),
    )
    packed = zlib.compress(data.model_dump_json().encode(), 9)
    text = MARK + base64.urlsafe_b64encode(packed).decode().rstrip("=")
    if len(text) > LONGEST:
        raise ArgumentError("the length of the link", len(text), f"more than {LONGEST} is too long: save the job")
    return text


def session_of_state(link: str, served: Session | None = None) -> Session:
    """The session that a link, or the text of a state, tells. Nothing is read but files that `served` shows already.

    Args:
        link: an address with `state=`, or what follows it. served: whose files the link may mean, by their SHA-256.

    Raises:
        ArgumentError: no state; a robot that is not of the catalogue; a file that is not one of `served`. JobError,
        HolokinError: as `session_of_job`.
    """
    data = _unpacked(link)
    if more := sorted(data.job.keys() - TABLES):
        raise ArgumentError(f"the table {more[0]!r} of a link", data.job[more[0]], "open what holds it as a job file")
    files = {} if served is None or served.origin is None else _files(served)
    _same_arguments(data.job, served)
    file = FilePath("the link.toml")
    job = job_of(file, _renamed(data.job, lambda name: _file_of(name, files)))
    session = session_of_job(job.title, job, file)
    session.set_cycles(data.cycles)
    session.view = View(data.units if data.units in UNITS else SI.name, data.solid, data.speed)
    _stand(session, data)
    return session


def is_link(text: str) -> bool:
    """Whether a text is an address with a state, or a state."""
    return text.startswith(MARK) or (text.startswith(("http://", "https://")) and f"{KEY}=" in text)


def state_in(address: str) -> str:
    """The state in the query of an address or path; empty if there is none."""
    found = parse_qs(urlsplit(address).query).get(KEY, [])
    return found[0] if len(found) == 1 else ""


def _unpacked(link: str) -> _Data:
    """What a link holds. Raises: ArgumentError."""
    text = link if link.startswith(MARK) else state_in(link)
    if not text.startswith(MARK) or len(text) > LONGEST:
        raise ArgumentError(_WHAT, link, f"it has `{KEY}={MARK}` and at most {LONGEST} characters: {_WHOLE}")
    packed = text.removeprefix(MARK)
    try:
        unpacking = zlib.decompressobj()
        plain = unpacking.decompress(base64.b64decode(packed + "=" * (-len(packed) % 4), b"-_", True), UNPACKED)
        if not unpacking.eof:
            raise ArgumentError(_WHAT, text, f"it is cut off, or larger than {UNPACKED} bytes: {_WHOLE}")
        return _Data.model_validate_json(plain)
    except ValidationError as problem:
        fault = problem.errors()[0]
        raise ArgumentError(
            f"{'.'.join(map(str, fault['loc'])) or 'the data'} of a link", fault["input"], _WHOLE
        ) from None
    except (binascii.Error, ValueError, zlib.error, RecursionError):
        raise ArgumentError(_WHAT, text, _WHOLE) from None


def _renamed(job: Mapping[str, Any], name: Callable[[str], str]) -> dict[str, Any]:
    """A job with other names of the robots and files that it may read. What has another form is left to its check."""

    def table(keys: Any, key: str, inner: str) -> Any:
        if not isinstance(keys, Mapping):
            return keys
        found = {k: name(v) if k == key and isinstance(v, str) else v for k, v in keys.items()}
        if isinstance(keys.get(inner), list):
            found[inner] = [table(one, key, inner) for one in keys[inner]]
        return found

    robot, path = job.get("robot"), job.get("path")
    no_links = isinstance(robot, Mapping) and "coordinates" in robot  # its name is a word
    found = dict(job) | ({} if no_links or robot is None else {"robot": table(robot, "name", "parts")})
    return found | ({} if path is None else {"path": table(path, "file", "others")})


def _digest_of(name: str) -> str:
    """What stands for a robot or a file in a link. Raises: ArgumentError: neither in the catalogue nor a file."""
    if name in catalogue():
        return name
    try:
        return DIGEST + hashlib.sha256(FilePath(name).read_bytes()).hexdigest()
    except OSError:
        cure = "a link holds robots of the catalogue, or the SHA-256 of a file: save the job"
        raise ArgumentError("what the link would name", name, cure) from None


def _file_of(name: str, files: Mapping[str, str]) -> str:
    """The robot or the file that a name in a link stands for. Raises: ArgumentError: one that must not be read."""
    if name in catalogue():
        return name
    if name in files:
        return files[name]
    if name.startswith(DIGEST):
        cure = "name the same file, byte for byte, before it: holokin studio FILE --state LINK"
        raise ArgumentError("the file of the link", name, cure)
    raise ArgumentError("the robot or file of the link", name, "a link names robots of the catalogue alone")


def _files(session: Session) -> dict[str, str]:
    """The files that a session shows, by what stands for them in a link."""
    found: dict[str, str] = {}

    def note(name: str) -> str:
        digest = _digest_of(name)
        found[digest] = name
        return digest

    _renamed(tomllib.loads(to_job(session)), note)
    return found


def _same_arguments(job: Mapping[str, Any], served: Session | None) -> None:
    """Raises: ArgumentError: arguments of a xacro file, which may choose what it reads, that are not those shown."""
    known = [] if served is None or served.origin is None else _arguments(served.origin.robot)
    for given in _arguments(job.get("robot", {})):
        if given not in known:
            raise ArgumentError("the args of the link's robot", given, "open the robot with the same ones first")


def _arguments(robot: Any) -> list[Any]:
    """The args of a robot and its parts."""
    if not isinstance(robot, Mapping):
        return []
    parts = robot.get("parts")
    inner = [one for part in parts for one in _arguments(part)] if isinstance(parts, list) else []
    return ([robot["args"]] if robot.get("args") else []) + inner


def _stand(session: Session, data: _Data) -> None:
    """Each law where it stood, if that is a posture of the robot; then each says how it stands to the target."""
    setup, robot = session.setup(), session.robot
    given = {name: np.array(q, dtype=float) for name, q in data.postures.items()}
    for q in given.values():
        robot.check_limits(robot.checked(q, "a posture of the link"))
    runs = tuple(replace(kept(run), q=given.get(run.law.name, run.q)) for run in setup.runs)
    session.restore(replace(setup, runs=runs))
    if data.target is not None:
        session.drag(data.target)
