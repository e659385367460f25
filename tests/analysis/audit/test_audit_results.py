"""What audits, sheets and retargeting answer says its verdict in its first line, and is plain data."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from handmade_sheets import planar_map
from holokin import learning
from holokin.analysis import audit, sheets
from holokin.analysis.audit.logs import Recording, joint_feature, read_dataset
from holokin.base.types import NoTruthValue
from small_datasets import write_dataset

ARM = hk.load("planar-3r")
TASK = hk.position(ARM)
Q0 = np.array([0.3, 0.8, 0.5])
LOCKED, PINV = hk.holonomic(TASK, hk.lock(2)), hk.moore_penrose(TASK)


def walk(strategy: hk.Strategy, cycles: int = 4) -> hk.Trajectory:
    start = ARM.pose(Q0)[:3, 3]
    return hk.follow(strategy, hk.circle(start, start - [0.6, 0, 0]), Q0, samples=60, cycles=cycles)


def dataset(folder: Path, strategy: hk.Strategy) -> Any:
    q, names = walk(strategy).q, [f"{joint}.pos" for joint in ARM.joint_names]
    episodes = [{"observation.state": q[60 * e : 60 * e + 61]} for e in range(4)]
    return read_dataset(write_dataset(folder, episodes, {"observation.state": names}))


def log_audit(strategy: hk.Strategy) -> audit.LogAudit:
    q = walk(strategy).q
    return hk.audit_recording(Recording(ARM.joint_names, 0.05 * np.arange(len(q)), q, "log.csv"), ARM)


def dataset_audit(folder: Path, strategy: hk.Strategy) -> audit.DatasetAudit:
    data = dataset(folder, strategy)
    return audit.audit_dataset(data, ARM, joint_feature(data, ARM, "observation.state"), orientation=False)


def retargeted(folder: Path, **limits: float) -> learning.Retargeted:
    data, robot = dataset(folder / "old", PINV), hk.with_limits(ARM, **limits)
    ik = hk.ik(hk.holonomic(hk.position(robot), hk.lock(2)), Q0, limits=True)
    return learning.retarget(data, ik, [joint_feature(data, ARM, "observation.state")], folder / "new")


@cache
def small_map() -> sheets.Sheets:
    return planar_map(12)


def quarter() -> hk.Path:
    return hk.path.arc([2.4, 0, 0], [0, 0, 0], np.pi / 2)


RESULTS: dict[str, tuple[type, Callable[[Path], Any], str]] = {
    "a strategy that repeats": (
        audit.Audit,
        lambda _: hk.audit(LOCKED, q0=Q0, dt=0.1, cycles=3),
        "lock: repeats",
    ),
    "a log that repeats": (audit.LogAudit, lambda _: log_audit(LOCKED), "repeats: the joints were the same"),
    "a log that drifts": (audit.LogAudit, lambda _: log_audit(PINV), "differs: the joints did not repeat"),
    "a dataset that repeats": (audit.DatasetAudit, lambda at: dataset_audit(at, LOCKED), "repeats: the joints are"),
    "a dataset that drifts": (audit.DatasetAudit, lambda at: dataset_audit(at, PINV), "differs: at "),
    "equal poses": (audit.EqualPoses, lambda at: dataset_audit(at, LOCKED).pairs, "the joints differ at 0 of "),
    "a still motion": (sheets.StillMotion, lambda _: still(True), "a motion of "),
    "no still motion": (sheets.StillMotion, lambda _: still(False), "no motion: no joint is redundant"),
    "a map": (sheets.Sheets, lambda _: small_map(), "3 sheets serve "),
    "answers of a map": (sheets.SheetAnswers, lambda _: answers(), "2 of 3 poses are served; 2 by sheet 0"),
    "seams": (sheets.Seams, lambda _: small_map().seams(), "3 of 3 pairs of sheets have a seam"),
    "a path": (sheets.SheetMotion, lambda _: small_map().follow(quarter(), samples=20), "1 sheet, 0 changes"),
    "a dataset on one leaf": (learning.Retargeted, retargeted, "244 frames of observation.state written to "),
    "bad frames": (learning.Retargeted, lambda at: retargeted(at, upper=0.81), "no dataset was written; the joints"),
}
"""Name -> its class, how it comes about, and how its first line begins."""


def still(redundant: bool) -> sheets.StillMotion:
    task = TASK if redundant else hk.pose(hk.with_limits(ARM, lower=-9.0, upper=9.0))
    q = hk.strategies.self_motion_curve(task, Q0, length=0.3).q[-1] if redundant else Q0 + [2 * np.pi, 0, 0]
    return sheets.self_motion_between(task, Q0, q)


def answers() -> sheets.SheetAnswers:
    found, far = small_map(), np.eye(4)
    far[0, 3] = 9.0
    return found.batch(np.concatenate([found.poses[found.labels == 0][:2], [far]]))


@pytest.mark.parametrize("name", RESULTS)
def test_the_first_line_of_a_result_is_its_verdict_and_it_is_plain_data(name: str, tmp_path: Path) -> None:
    kind, make, begins = RESULTS[name]
    result = make(tmp_path)
    assert type(result) is kind
    assert str(result).splitlines()[0].startswith(begins)
    if isinstance(result, NoTruthValue):
        assert json.loads(json.dumps(result.to_dict(), allow_nan=False))


def test_every_result_of_these_rooms_is_in_the_table() -> None:
    public = [getattr(room, name) for room in (audit, sheets, learning) for name in room.__all__]
    results = {one for one in public if inspect.isclass(one) and issubclass(one, NoTruthValue)}
    assert {one for one in results if not issubclass(one, Enum)} - {kind for kind, *_ in RESULTS.values()} == {
        audit.Finding
    }
