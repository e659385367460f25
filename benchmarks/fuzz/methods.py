"""Bad calls of every public method and of every function of the rooms, one argument spoilt at a time.

    python -m benchmarks.fuzz.methods

prints how many there were, and those that ended in an error that is not holokin's.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from holokin.errors import HolokinError

from .nouns import kit

BAD: dict[str, Any] = {
    "None": None, "text": "x", "nan": np.full(3, np.nan), "short": np.zeros(1), "empty": [], "object": object(),
    "-1": -1, "1e308": 1e308, "dict": {"a": 1}, "deep": [[[0.0]]],
}  # fmt: skip
"""What an argument is replaced by; another robot's task comes as well."""

QUICK = 53
"""Of so many calls one is made with --quick."""

MOST = 0.05
"""Share of calls that may raise what is not holokin's: 3.5 % did when it was last counted, 270 of 7,766."""

SECONDS = 5
"""Longest time of one call: longer ones are stopped and not counted."""


class _TooLongError(BaseException):
    """A call that took more than `SECONDS`."""


def _good() -> dict[str, Any]:
    """Arguments by their names, where these tell what they are."""
    k = kit()
    robot, task, held, q = k["robot"], k["task"], k["held"], k["q"]
    return {
        "q": q, "q0": q, "start": q, "robot": robot, "task": task, "strategy": held, "law": held, "Q": k["Q"],
        "path": k["loop"], "pose": k["pose"], "poses": np.array([k["pose"]]), "region": k["region"], "cycles": 1,
        "samples": 4, "dt": 0.02, "t": 0.0, "tip": None, "joint": robot.joint_names[0], "folder": "out", "file": "f",
        "path_a": k["line"], "path_b": k["line"], "points": np.eye(3), "point": np.zeros(3), "speed": 0.1,
        "name": "n", "unit": "m", "dx": np.zeros(task.m), "x": task(q), "walk": k["walk"], "trajectory": k["walk"],
        "shape": hk.robot.Capsule(0.1, 0.2), "constraint": hk.lock(2), "limits": False, "count": 2, "step": 0.02,
        "seed": 0, "n": 3, "plane": (0, 1), "twist": np.zeros(6), "position": np.zeros(3), "rotation": np.eye(3),
    }  # fmt: skip


def rooms() -> list[Any]:
    """The package and its public rooms."""
    return [hk, *(getattr(hk, name) for name in hk.__all__ if inspect.ismodule(getattr(hk, name)))]


def things() -> dict[str, Any]:
    """What has methods: nouns of every kind and what verbs answer."""
    k = kit()
    found = {key: value for key, value in k.items() if type(value).__module__.startswith("holokin")}
    robot, task, held, q = k["robot"], k["task"], k["held"], k["q"]
    made: dict[str, Callable[[], Any]] = {
        "ik": lambda: hk.inverse(held, q), "verdict": lambda: hk.involutivity(held, k["region"], samples=4),
        "controller": lambda: hk.controller(held, dt=0.02, start=q), "constraint": lambda: hk.lock(2),
        "shape": lambda: hk.robot.Capsule(0.1, 0.2), "check": lambda: hk.check(k["walk"], robot),
        "drift": lambda: hk.drift(held, k["loop"], q, samples=4), "timed": lambda: hk.retime(k["walk"], robot=robot),
        "postures": lambda: hk.all_postures(held, robot.pose(q), held.g(q), starts=8),
        "watch": lambda: hk.motion.LoopWatch(0.1), "status": lambda: hk.Status.COMPLETE, "pose task": lambda: task,
        "solutions": lambda: hk.inverse(held, q).batch(np.array([robot.pose(q)])),
    }  # fmt: skip
    for key, make in made.items():
        with contextlib.suppress(HolokinError, TypeError):
            found[key] = make()
    return found


def callables() -> Iterator[tuple[str, Callable[..., Any]]]:
    """(name, function) of every public function of the rooms and every public method of `things`."""
    seen = set()
    for room in rooms():
        for name in room.__all__:
            one = getattr(room, name)
            if inspect.isfunction(one) and one not in seen:
                seen.add(one)
                yield f"{room.__name__.partition('.')[2]}.{name}".lstrip("."), one
    known = set()
    for thing in things().values():
        for name in ("__call__", *(n for n in dir(type(thing)) if not n.startswith("_"))):
            owner = next((c for c in type(thing).__mro__ if name in vars(c)), None)
            if owner is None or not owner.__module__.startswith("holokin") or (owner, name) in known:
                continue
            known.add((owner, name))
            if inspect.isroutine(getattr(owner, name)) and callable(method := getattr(thing, name)):
                yield f"{owner.__name__}.{name}", method


HEAVY = {
    "studio", "audit", "advise", "design", "nearest", "coverage", "survey", "analysis.distance_to_repeatable",
    "analysis.winding", "motion.winding", "designing.coverage_slices", "designing.section_metrics", "certify",
    "proof.follow_certified", "catalogue", "designing.choose_tip", "designing.posture_reach",
}  # fmt: skip
"""Calls that take long, or open pages, where a bad argument is none; `calls` has them."""


def bad_calls() -> Iterator[tuple[str, Callable[[], Any]]]:
    """(name, call) of all: each argument in turn spoilt in every way."""
    good = _good()
    bad = {**BAD, "another robot's": hk.pose(hk.load("irb140"))}
    for name, function in callables():
        if name in HEAVY:
            continue
        try:
            parameters = list(inspect.signature(function).parameters.values())
        except (TypeError, ValueError):
            continue
        asked = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
        for spoilt in asked:
            for kind, value in bad.items():
                given, named = [], {}
                for p in asked:
                    if p is not spoilt and p.default is not p.empty:
                        continue
                    one = value if p is spoilt else good.get(p.name, value)
                    if p.kind is p.KEYWORD_ONLY or (p is spoilt and p.default is not p.empty):
                        named[p.name] = one
                    else:
                        given.append(one)
                yield f"{name}({spoilt.name}={kind})", lambda f=function, a=given, n=named: f(*a, **n)


def campaign(every: int = 1) -> tuple[int, list[tuple[str, str]]]:
    """Of each so many-th call (bad calls, those that raised what is not holokin's: (call, error))."""

    def stop(*_told: Any) -> None:
        raise _TooLongError

    count, faults, before = 0, [], Path.cwd()
    signal.signal(signal.SIGALRM, stop)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.chdir(folder)
        try:
            for name, call in islice(bad_calls(), 0, None, every):
                count += 1
                signal.alarm(SECONDS)
                try:
                    call()
                except (HolokinError, _TooLongError):
                    pass
                except BaseException as problem:  # noqa: BLE001  whatever it is, it is what is counted
                    faults.append((name, f"{type(problem).__name__}: {problem}"))
                finally:
                    signal.alarm(0)
        finally:
            os.chdir(before)
    return count, faults


def main() -> int:
    """Prints what raised; 1 where more than `MOST` of the calls did."""
    total, found = campaign(QUICK if "--quick" in sys.argv else 1)
    for call, error in found:
        print(f"{call}: {' '.join(error.split())[:120]}")
    print(f"{total} bad calls, {len(found)} raised errors that are not holokin's")
    return int(len(found) > MOST * total)


if __name__ == "__main__":
    sys.exit(main())
