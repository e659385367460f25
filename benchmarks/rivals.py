"""Joints of a pose from nothing, and along paths: `hk.ik(robot)` beside other libraries. A section of docs/measured.md.

Every library runs in an environment of its own, made as those of the league, pinned to one core. All get the same
URDF and the same poses. They answer in turns, a tenth of all each time, so that what else runs on the machine meets all
alike. One measure is taken of the joints of all, by holokin's kinematics.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk
from benchmarks.league.courses import ranges_of, straight, write_arm
from benchmarks.league.played import ENTRIES, OURS, WORKERS, Entry, NoEnvironment, python_of, reason_of
from benchmarks.league.scores import tool_errors
from benchmarks.page import Given, table, us, versions, wrapped
from holokin.motion.self_motions.self_motions import self_motions_at
from holokin.robot import to_urdf

ARMS = {
    "panda": "Panda",
    "fr3": "FR3",
    "iiwa14": "iiwa 14",
    "xarm7": "xArm 7",
    "openarm-left": "OpenArm",
    "gen3": "Gen3",
}
ORDER = (
    OURS.name,
    *("ssik", "EAIK", "frankik", "TRAC-IK", "roboticstoolbox", "newton", "PyRoki", "pink", "mink", "placo"),
)
ALL = {entry.name: replace(entry, script=WORKERS / "rivals.py") for entry in [*ENTRIES, Entry("EAIK", ("EAIK",))]}
LIBRARIES = {name: ALL[name] for name in ORDER}
"""Those of the league that find joints of a pose or are well known, and EAIK."""

TURNS = 10
POSES, LEGS, CIRCLES = 400, 40, 5
LENGTH, TILT, RADIUS, SPACING = 0.2, np.radians(30), 0.1, 0.002
"""Of a leg [m] and its turn [rad], of a circle [m], and between samples [m]."""

BEYOND = 1e-6
"""An answer counts up to this beyond a joint limit [rad]."""

JUMP = 0.2
"""A joint that moves by more between two samples jumps [rad]."""

HOME = 1e-14
"""Joints nearer to those before have come home [rad]."""

SECONDS = 300.0
"""How long a library may take for a reply."""


# --- What all get: poses of random postures, straight legs out and back, circles twice round.


def turned(robot: hk.Robot, q: np.ndarray) -> np.ndarray:
    """Postures (k, n) by whole turns as near to the middle of the joint ranges as can be."""
    middle = sum(ranges_of(robot)) / 2
    return q - 2 * np.pi * np.round((q - middle) / (2 * np.pi)) * robot.hinges


def reached(robot: hk.Robot, poses: np.ndarray) -> bool:
    """Whether each of the poses (k, 4, 4) has a posture within the limits, by all self-motions of the arm there."""
    all_of = self_motions_at(hk.pose(robot), poses[:, :3, 3], poses[:, :3, :3])
    within = robot.within(turned(robot, all_of.q))
    return len(np.unique(all_of.pose[within])) == len(poses)


def leg(first: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Poses (k, 4, 4): straight in a random direction, turned about a random axis by up to TILT, and back."""
    way, axis = rng.normal(size=(2, 3))
    last = first.copy()
    last[:3, 3] += LENGTH * way / np.linalg.norm(way)
    turn = Rotation.from_rotvec(rng.uniform(0, TILT) * axis / np.linalg.norm(axis))
    last[:3, :3] = turn.as_matrix() @ first[:3, :3]
    out = np.concatenate([first[None], straight(first, last, round(LENGTH / SPACING))])
    return np.concatenate([out, out[-2::-1]])


def circle(first: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Poses (k, 4, 4): twice round a horizontal circle at constant orientation."""
    to, count = rng.uniform(0, 2 * np.pi), round(2 * np.pi * RADIUS / SPACING)
    angles = to + 2 * np.pi * (np.arange(2 * count + 1) % count) / count
    poses = np.repeat(first[None], len(angles), axis=0)
    poses[:, 0, 3] += RADIUS * (np.cos(angles) - np.cos(to))
    poses[:, 1, 3] += RADIUS * (np.sin(angles) - np.sin(to))
    return poses


def exponentials(robot: hk.Robot) -> dict[str, np.ndarray]:
    """The arm as a product of exponentials, for libraries that take it so: axes (n, 3) at zero, the steps (n + 1, 3)
    from the base to each and to the tool, and how the tool is turned (4, 4)."""
    home, J = robot.pose(np.zeros(robot.n)), robot.jacobian(np.zeros(robot.n)).T
    points = home[:3, 3] - np.cross(J[:, :3], J[:, 3:])
    steps = np.diff(np.vstack([np.zeros(3), points, home[:3, 3]]), axis=0)
    home[:3, 3] = 0.0
    return {"check/axes": J[:, 3:].copy(), "check/steps": steps, "check/turn": home}


def drawn(robot: hk.Robot, make: Callable, count: int, rng: np.random.Generator) -> Iterator[tuple[np.ndarray, ...]]:
    """(start, poses) of paths that begin at random postures; five poses along each are reached within the limits."""
    low, high = ranges_of(robot)
    while count:
        start = rng.uniform(low, high)
        poses = make(robot.pose(start), rng)
        if reached(robot, poses[np.linspace(0, len(poses) // 2, 5).astype(int)]):
            count -= 1
            yield start, poses


def write_rivals_course(folder: Path, arms: Sequence[str]) -> None:
    """Write course.json, and of each arm its URDF, its MJCF and the arrays of its runs.

    In a second URDF endless joints have two turns, for libraries that would write each as two numbers.
    """
    told = []
    for name in arms:
        robot, rng = hk.load(name), np.random.default_rng(1)
        arrays = {"poses/poses": robot.pose(rng.uniform(*ranges_of(robot), (POSES, robot.n)))} | exponentials(robot)
        for kind, make, count in (("leg", leg, LEGS), ("circle", circle, CIRCLES)):
            for k, (start, path) in enumerate(drawn(robot, make, count, rng)):
                arrays |= {f"{kind} {k}/start": start, f"{kind} {k}/poses": path}
        told.append(write_arm(folder, name, robot, np.array(sum(ranges_of(robot)) / 2), arrays))
        low, high = (np.clip(limits, -2 * np.pi, 2 * np.pi) for limits in (robot.lower, robot.upper))
        turns = hk.with_limits(robot, lower=low, upper=high)
        (folder / f"{name}-turns.urdf").write_text(to_urdf(turns), "utf-8")
    (folder / "course.json").write_text(json.dumps(told), "utf-8")


# --- One library: its process answers a command with a line.


class Stopped(Exception):
    """A library's process has ended or takes too long: the message says why in one line."""


class Process:
    """The process of a library, pinned to a core."""

    def __init__(self, entry: Entry, python: Path, course: Path, answers: Path, core: int | None) -> None:
        answers.mkdir(parents=True)
        self.answers, self._said = answers, answers / "said.txt"
        command = [str(python), str(entry.script), str(course), str(answers), entry.name]
        with self._said.open("wb") as said:
            one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, text=True, env=os.environ | one
            )
        if core is not None:
            os.sched_setaffinity(self._process.pid, {core})

    def tell(self, command: str) -> dict[str, Any]:
        """Give a command and wait for the reply. Raises: Stopped."""
        process, timer = self._process, Timer(SECONDS, self._process.kill)
        begun = time.monotonic()
        timer.start()
        try:
            print(command, file=process.stdin, flush=True)
            reply = process.stdout.readline() if process.stdout else ""
        except BrokenPipeError:
            reply = ""
        finally:
            timer.cancel()
        if not reply:
            process.wait()
            late = f"no reply in {SECONDS:g} s" if time.monotonic() - begun >= SECONDS else ""
            raise Stopped(late or reason_of(self._said.read_text("utf-8", "replace")))
        return json.loads(reply)

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()


# --- What the joints did.


@dataclass(frozen=True)
class Walk:
    """A path that was followed. ends (j, n): the joints at its first pose, each time that the tool is there.

    whole: an answer at every sample, on the path and within the limits. step: the largest change of a joint [rad].
    """

    whole: bool
    step: float
    ends: np.ndarray

    @property
    def even(self) -> bool:
        """Whole, and without a jump."""
        return self.whole and self.step <= JUMP

    def away(self, k: int) -> float:
        """How far the largest joint is at the k-th return from where it was one return before [rad]."""
        return float(np.abs(self.ends[k] - self.ends[k - 1]).max())


def right(robot: hk.Robot, q: np.ndarray, poses: np.ndarray, within: float) -> np.ndarray:
    """(k,) True where joints (k, n) are there, have the tool [m, rad] within this of its pose, and keep the limits."""
    there = np.asarray(np.isfinite(q).all(axis=1))
    q = np.where(there[:, None], q, 0.0)
    place, turn = tool_errors(robot, q, poses)
    return there & (place < within) & (turn < within) & (robot.beyond(q) <= BEYOND).all(axis=1)


def walked(robot: hk.Robot, q: np.ndarray, poses: np.ndarray, within: float, returns: int) -> Walk:
    """Measure joints (k, n) along poses (k, 4, 4) that come back to the first one so many times, evenly."""
    ends = q[:: (len(q) - 1) // returns]
    return Walk(bool(right(robot, q, poses, within).all()), float(np.abs(np.diff(q, axis=0)).max()), ends)


@dataclass(frozen=True)
class Mark:
    """What one way of a library did on one arm; times in s. Without `found` it needs a start."""

    library: str
    way: str
    arm: str
    settings: str
    found: int | None
    seconds: np.ndarray
    legs: tuple[Walk, ...]
    circles: tuple[Walk, ...]
    step_seconds: np.ndarray

    @property
    def name(self) -> str:
        """As it is named on the page."""
        return f"{self.library}, {self.way}"


def marked(library: str, arm: str, ways: Sequence[Sequence[Any]], course: Path, answers: Path) -> list[Mark]:
    """Measure what a library's process wrote of one arm."""
    robot, marks = hk.load(arm), []
    with np.load(course / f"{arm}.npz") as given, np.load(answers / f"{arm}.npz") as written:
        for i, (way, settings, finds, within) in enumerate(ways):
            rows = [written[key] for key in written.files if key.startswith(f"{i}/poses")]
            answered = np.concatenate(rows or [np.zeros((0, robot.n + 1))])
            good = right(robot, turned(robot, answered[:, :-1]), given["poses/poses"][: len(answered)], within)
            walks: dict[str, list[Walk]] = {"leg": [], "circle": []}
            seconds = []
            for key in [key for key in written.files if key.split("/")[0] == str(i) and "poses" not in key]:
                run, returns = key.split("/")[1], 1 if "leg" in key else 2
                q, poses = written[key][:, :-1], given[f"{run}/poses"]
                walks[run.split()[0]].append(walked(robot, q, poses, within, returns))
                seconds.append(written[key][np.isfinite(q).all(axis=1), -1])
            marks.append(
                Mark(
                    library, way, arm, settings, int(good.sum()) if finds else None, answered[:, -1],
                    tuple(walks["leg"]), tuple(walks["circle"]), np.concatenate(seconds or [np.zeros(0)]),
                )
            )  # fmt: skip
    return marks


# --- All libraries in turns.


@dataclass(frozen=True)
class Run:
    """All that was measured, the versions, and what is missing with the reason."""

    marks: list[Mark]
    versions: dict[str, str]
    missing: list[str]


def run(
    entries: Sequence[Entry], arms: Sequence[str], course: Path, environments: Path, home: Path, tenths: int = TURNS
) -> Run:
    """Ask all libraries about all arms; about so many tenths of the poses and paths."""
    found, living = Run([], {}, []), {}
    core = max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    try:
        for entry in entries:
            try:
                living[entry.name] = Process(entry, python_of(entry, environments), course, home / entry.name, core)
            except NoEnvironment as problem:
                found.missing.append(f"{entry.name} (it cannot be installed: {problem})")
        for arm in arms:
            _one_arm(arm, living, course, found, tenths)
    finally:
        for process in living.values():
            process.close()
    return found


def _one_arm(arm: str, living: dict[str, Process], course: Path, found: Run, tenths: int) -> None:
    ways: dict[str, Any] = {}

    def tell(name: str, command: str) -> dict[str, Any] | None:
        try:
            return living[name].tell(command)
        except Stopped as problem:
            found.missing.append(f"{name} stopped on the {ARMS[arm]} ({problem})")
            living.pop(name).close()
            ways.pop(name, None)
            return None

    for name in list(living):
        if (reply := tell(name, f"arm {arm}")) is None:
            continue
        found.versions.update(reply["versions"])
        if "fault" in reply:
            found.missing.append(f"{name} on the {ARMS[arm]} ({reply['fault']})")
        if reply["ways"]:
            ways[name] = reply["ways"]
    for turn in range(tenths):
        print(f"{arm}: turn {turn + 1} of {tenths}", flush=True)
        for name in list(ways):
            tell(name, f"turn {turn} {TURNS}")
    for name in list(ways):
        if tell(name, "keep") is not None:
            found.marks.extend(marked(name, arm, ways[name], course, living[name].answers))


# --- The section of docs/measured.md.


def _without_a_start(mark: Mark) -> str:
    if mark.found is None:
        return ""
    return f"{mark.found}: {us(np.median(mark.seconds))} ({us(np.percentile(mark.seconds, 99))})"


def found_table(marks: Sequence[Mark]) -> str:
    """Without a start: a row a way that needs none, a column an arm."""
    arms = [arm for arm in ARMS if any(mark.arm == arm for mark in marks)]
    rows = []
    for name in dict.fromkeys(mark.name for mark in marks):
        cells = {mark.arm: _without_a_start(mark) for mark in marks if mark.name == name}
        if any(cells.values()):
            rows.append([name, *(cells.get(arm, "-") for arm in arms)])
    return table(("library", *(ARMS[arm] for arm in arms)), rows)


def paths_table(marks: Sequence[Mark]) -> str:
    """Along paths: a row a way, all arms that it knows together."""
    rows = []
    for name in dict.fromkeys(mark.name for mark in marks):
        of = [mark for mark in marks if mark.name == name]
        legs, circles = ([walk for mark in of for walk in getattr(mark, kind)] for kind in ("legs", "circles"))
        even, round_trips = [walk for walk in legs if walk.even], [walk for walk in circles if walk.even]
        away = [walk.away(1) for walk in even]
        home = f"{sum(a < HOME for a in away)} ({max(away):.0e})" if away else "-"
        drift = ", ".join(f"{max(walk.away(k) for walk in round_trips):.0e}" for k in (1, 2)) if round_trips else "-"
        times = [np.median(mark.step_seconds) for mark in of if len(mark.step_seconds)]
        jumps = sum(walk.whole and not walk.even for walk in legs)
        cells = [f"{len(even)} of {len(legs)}", str(jumps), home, f"{len(round_trips)} of {len(circles)}", drift]
        rows.append([name, *cells, f"{us(min(times))} to {us(max(times))}" if times else "-"])
    return table(("library", "whole legs", "with a jump", "home", "circles", "loops miss", "a step [us]"), rows)


def better(marks: Sequence[Mark]) -> Iterator[str]:
    """Sentences: on what others are better than holokin."""
    times: tuple[tuple[str, Callable[[Mark], float]], ...] = (
        ("find more poses without a start", lambda m: float(-1 if m.found is None else m.found)),
        ("take less time for it", lambda m: -np.inf if m.found is None else -float(np.median(m.seconds))),
        ("take less time for a step", lambda m: -float(np.median(m.step_seconds if len(m.step_seconds) else np.inf))),
    )
    for what, measure in times:
        ours = {m.arm: -np.inf for m in marks}
        for mark in (mark for mark in marks if mark.library == OURS.name):
            ours[mark.arm] = max(ours[mark.arm], measure(mark))
        others = {m.name: None for m in marks if m.library != OURS.name and measure(m) > ours[m.arm]}
        yield f"On some arm these {what} than holokin: {', '.join(others)}." if others else f"None {what} than holokin."
    for kind in ("legs", "circles"):
        whole: dict[str, int] = {}
        for mark in marks:
            whole[mark.name] = whole.get(mark.name, 0) + sum(walk.even for walk in getattr(mark, kind))
        ours_best = max((many for name, many in whole.items() if name.startswith(OURS.name)), default=0)
        more = sorted(((many, name) for name, many in whole.items() if many > ours_best), reverse=True)
        told = ", ".join(f"{name.split(',')[0]} {many}" for many, name in more)
        yield f"More {kind} are whole with {told}, against {ours_best}." if more else f"None has more whole {kind}."


def rivals_text(found: Run) -> list[str]:
    """The blocks of the section."""
    marks = found.marks
    poses, legs, circles = (
        max(map(count, marks), default=0)
        for count in (lambda m: len(m.seconds), lambda m: len(m.legs), lambda m: len(m.circles))
    )
    return [
        "## Rivals",
        wrapped(
            f"""Which library finds joints of a pose when it is given nothing else, how long does it take, and what do
            its joints do along a path? Here is `hk.ik(robot)`, of [inverse kinematics](inverse.md#without-a-start),
            beside libraries at the settings of their own examples and documents, or at better ones. Each runs in an
            environment of its own, all on one core in turns, with the same URDF and the same poses; their forward
            kinematics are compared with ours first. {" ".join(better(marks))} A library that goes on from its last
            answer may pass where `ik.near(pose, q)` has to jump: that keeps to one of few sheets of the arm, and
            changes to another where this one ends."""
        ),
        wrapped(
            f"""Of {poses} poses of postures that are drawn evenly within the limits, so that each has an answer: how
            many got one, with the tool within 1e-5 m and rad and the joints within their limits; then the median time
            of a call from Python by the wall clock [us], and in brackets 99 % under, other work of the machine
            included."""
        ),
        found_table(marks),
        wrapped(
            f"""Of each arm {legs} straight legs of {LENGTH} m, out and back, turned by up to {np.degrees(TILT):.0f}
            degrees, and {circles} horizontal circles of {RADIUS} m, twice round, a sample every {1e3 * SPACING:g} mm.
            They begin at random postures, and have postures within the limits along them, perhaps not on one
            continuous path. *Whole*: an answer at every sample, and no joint moves by more than {JUMP} rad between
            two. *With a jump*: an answer everywhere, but for a jump. *Home*: of the whole legs those after which the
            joints are those of before within {HOME:g} rad, and the largest difference. *Loops miss*: the largest
            difference after the first and after the second loop of the whole circles. *A step*: the medians of the
            arms."""
        ),
        paths_table(marks),
        wrapped("How they were asked: " + "; ".join(f"{name}: {told}" for name, told in _settings(marks)) + "."),
        *([wrapped("Not measured: " + "; ".join(found.missing) + ".")] if found.missing else []),
    ]


def _settings(marks: Sequence[Mark]) -> Iterator[tuple[str, str]]:
    for name in dict.fromkeys(mark.name for mark in marks):
        told: dict[str, list[str]] = {}
        for mark in (mark for mark in marks if mark.name == name):
            told.setdefault(mark.settings, []).append(ARMS[mark.arm])
        words = [text.replace("; ", ", ") for text in told]
        yield name, " or ".join(words)


def section(given: Given) -> tuple[list[str], str]:
    """Ask all libraries; the blocks of docs/measured.md, and the versions."""
    names, arms, tenths = ([OURS.name], ["panda"], 1) if given.quick else (list(LIBRARIES), list(ARMS), TURNS)
    with tempfile.TemporaryDirectory() as folder:
        course = Path(folder) / "course"
        course.mkdir()
        write_rivals_course(course, arms)
        found = run([LIBRARIES[name] for name in names], arms, course, given.environments, Path(folder), tenths)
    others = ", ".join(f"{name} {number}" for name, number in found.versions.items() if name != OURS.name)
    return rivals_text(found), f"{versions()}, {others}"
