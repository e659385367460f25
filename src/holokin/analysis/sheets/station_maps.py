"""Maps of whole arms without closed forms: rules for a joint, fitted to where it may be on branches."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.resources import files

import numpy as np

from ...base.errors import ArgumentError, NativeError
from ...base.progress import progress
from ...base.types import Array, Matrix, Vector
from ...motion.ik.arm_map import digest
from ...motion.ik.leaf import leaf_step
from ...motion.ik.stations import Hand, StationMap, strategy_of, takes_stations
from ...motion.self_motions.self_motions import SelfMotions, self_motions_at
from ...robot import with_limits
from ...strategies.tasks import pose
from ...strategies.tasks.task import Task
from ...symbolic.native.toolchain import cache_folder, keep
from ...symbolic.native.toolchain import kept as kept_bytes
from ..coverage.starts import Candidate
from .level_fit import fitted, polynomial, served_weight
from .level_ranges import LinkedBranch, branches_by_curves, widest
from .sheet import nearby, turn_length

SAMPLES, TRIED_ON, NEIGHBOURS = 1_200, 200, 6
"""Poses of postures, evenly drawn within the limits; those by which the joint is chosen; neighbours of each."""

STATIONS = 120
"""Of the poses those whose postures are kept: with all of them no more poses are served."""

LOOKED = 400
"""Poses by which it is told what the sheets serve."""

LEAST = 0.01
"""Share of the poses below which a branch has no sheet."""

SHEETS, GAIN = 16, 0.002
"""The most of a map, and the share of the poses that each must add."""

TRIED, SERVED = 3, 0.02
"""Branches to which a rule is fitted for the next sheet: those with most to gain; weight of a pose served before."""

LEVELS = 64
"""Constant levels of which the best begins a fit."""

FORMAT = 1
"""Of a map's file: changed when those of before cannot be read."""


def station_map(task: Task) -> StationMap | None:
    """The map of an arm without closed forms, kept from an earlier call, or made and kept; None of other arms."""
    own, path = digest(task.robot, task.tip), None
    folder = files("holokin.robot").joinpath("data", "stations")
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if (found := read_map(task, own, entry.read_bytes())) is not None:
            return found
    with suppress(NativeError):
        path = cache_folder() / f"stations-{own}.npz"
        data = kept_bytes(path)
        if data is not None and (found := read_map(task, own, data)) is not None:
            return found
    if not takes_stations(task):
        return None
    with progress(f"map of {task.robot.name}", 1.0, words=True) as report:
        found = make_station_map(task, report=report)
    if path is not None:
        with suppress(NativeError):
            keep(path, map_bytes(found))
    return found


def map_bytes(found: StationMap) -> bytes:
    """A map as a file of NumPy."""
    about = {"format": FORMAT, "arm": digest(found.task.robot, found.task.tip), "joint": found.joint}
    file, about = io.BytesIO(), about | {"share": found.share, "rules": found.rules, "sides": found.sides}
    np.savez_compressed(file, stations=found.stations.astype(np.float16), **about)
    return file.getvalue()


def read_map(task: Task, arm: str, data: bytes) -> StationMap | None:
    """The map of a file; None where it is not one of this version and of the arm with this digest."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            if (int(file["format"]), str(file["arm"])) != (FORMAT, arm):
                return None
            joint, rules, sides = int(file["joint"]), file["rules"], file["sides"]
            stations, share = file["stations"].astype(float), float(file["share"])
            fits = rules.shape == (len(sides), 28) and 0 < joint < task.n
    except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile):
        return None
    fits &= stations.ndim == 3 and stations.shape[::2] == (len(rules), task.n) and np.isfinite(rules).all()
    return StationMap(task, joint, rules, sides, stations, share) if fits else None


def make_station_map(
    task: Task, samples: int = SAMPLES, report: Callable[[float, str], None] = lambda _share, _words: None
) -> StationMap:
    """The map of an arm, made anew: the same of the same joints and limits.

    Raises: ArgumentError: no joint has a branch, as where the limits are narrow.
    """
    robot, rng = task.robot, np.random.default_rng(0)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    free = np.arange(robot.n) == 0
    # Nothing that is fitted depends on the first joint: it is taken to turn freely, and the hand to one side.
    arm = with_limits(robot, lower=np.where(free, -np.inf, robot.lower), upper=np.where(free, np.inf, robot.upper))
    whole, hand = pose(arm, tip=task.tip), Hand(task)
    q = np.where(free, 0.0, rng.uniform(low, high, (samples, robot.n)))
    q[:, 0] = _aside(hand, robot.pose(q, task.tip))
    T = robot.pose(q, task.tip)
    report(0.0, "self-motions of poses")
    motions = self_motions_at(whole, np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3]))
    report(0.4, "which joint is to follow")
    few = _first(motions, TRIED_ON)
    room = [np.median(widest(strategy_of(whole, k), few)) for k in range(1, robot.n)]
    joint = 1 + int(np.argmax(room))
    strategy = strategy_of(whole, joint)
    report(0.5, f"where {robot.joint_names[joint]} may be")
    near = nearby(T, turn_length(task), NEIGHBOURS)
    branches = branches_by_curves(Candidate("", {}, whole, strategy), T, near, None, motions, LEAST)
    f = hand.terms(hand.arrows(T))
    # Sheet after sheet, each of which serves the most of what those before do not.
    left, rules, stations = np.ones(samples, dtype=bool), [], []
    while len(rules) < SHEETS:
        report(0.7, f"{len(rules)} sheets serve {1 - left.mean():.1%}")
        weights = np.where(left, 1.0, SERVED)
        best, most = None, 0.0
        for i in np.argsort([-weights[b.pose].sum() for b in branches], kind="stable")[:TRIED].tolist():
            rule = _fitted(f, branches[i], weights)
            postures = branches[i].postures(np.arange(samples), f @ rule)
            gain = weights @ np.isfinite(postures).all(axis=1)
            if gain > most:
                best, most = (rule, postures), gain
        if best is None or (left & np.isfinite(best[1]).all(axis=1)).sum() < GAIN * samples:
            break
        rules.append(best[0])
        stations.append(best[1])
        left &= ~np.isfinite(best[1]).all(axis=1)
    if not rules:
        cure = "give wider ones: hk.with_limits(robot, lower=..., upper=...)"
        raise ArgumentError("the joint limits", f"so narrow that no sheet of {robot.name!r} was found", cure)
    every = np.array(stations)
    sides = []
    for postures in every:
        i = np.flatnonzero(np.isfinite(postures).all(axis=1))[0]
        sides.append(
            float(leaf_step(strategy)(postures[i], T[i, :3, 3], T[i, :3, :3], postures[i, joint : joint + 1])[3])
        )
    # Few stations are enough, and it does not matter where they are to a thousandth.
    some = np.flatnonzero(np.isfinite(every).all(axis=2).any(axis=0))[:STATIONS]
    few = every[:, some].astype(np.float16).astype(float)
    found = StationMap(task, joint, np.array(rules), np.array(sides), few, 0.0)
    # What it serves of other poses.
    report(0.95, "what the sheets serve")
    calls, others = found.kernel(True), robot.pose(rng.uniform(low, high, (LOOKED, robot.n)), task.tip)
    return replace(found, share=float(np.mean([calls.place(T)[-1] < len(found) for T in others])))


def _aside(hand: Hand, T: Array) -> Vector:
    """How far (k,) the first joint has to turn from 0 for the hand to be on one side."""
    place = hand.arrows(T)[:, 0]
    across = np.linalg.svd(hand.axis[None])[2][1:]
    return -np.arctan2(place @ np.cross(hand.axis, across[0]), place @ across[0])


def _first(motions: SelfMotions, count: int) -> SelfMotions:
    """Those of the first poses."""
    rows = motions.pose < count
    curves = motions.curve[rows].max(initial=-1) + 1
    p, R = motions.p[:count], motions.R[:count]
    return SelfMotions(
        motions.task, p, R, motions.q[rows], motions.pose[rows], motions.curve[rows], motions.closed[:curves]
    )


def _fitted(f: Matrix, branch: LinkedBranch, weights: Vector) -> Vector:
    """The rule (m,) whose level lies in the branch's intervals at most of the poses' weight. f: of all poses (k, m)."""
    ranges, scale, x = branch.ranges, np.abs(f).max(axis=0), np.zeros(f.shape[1])
    levels = np.linspace(branch.low.min(), branch.high.max(), LEVELS)
    hits = [served_weight(np.full(len(ranges.pose), c), ranges, weights, np.subtract) for c in levels]
    x[0] = scale[0] * levels[int(np.argmax(hits))]
    x = fitted(polynomial, x, f / scale, ranges, weights, np.subtract)
    return np.array([float(f"{number:.6g}") for number in x / scale])
