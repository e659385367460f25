"""LeRobot itself: its loader reads what `retarget` writes, and its pipelines run holokin's step.

This takes environments with LeRobot, which weighs gigabytes. HOLOKIN_LEROBOT names a folder for them; what is not there
is made: `HOLOKIN_LEROBOT=~/lerobot pytest -m campaign tests/learning/test_lerobot_itself.py`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from golden_lerobot import Q0, episodes, facts, in_lerobot
from holokin.analysis.audit.logs import joint_feature, read_dataset
from holokin.learning import retarget

PLACE = os.environ.get("HOLOKIN_LEROBOT")
VERSIONS = {"v2.1": "0.3.3", "v3.0": "0.4.4"}
NEEDED = {
    "v2.1": ["datasets<=3.6.0", "av>=14.2,<16", "gymnasium<1"],
    "v3.0": ["datasets>=4,<5", "av>=15,<16", "gymnasium", "accelerate", "pyserial", "casadi"],
}  # fmt: skip
"""Besides torch, what its loader and its pipelines import, and of v3.0 what holokin does."""

COMMON = [
    "huggingface-hub>=0.34.2,<0.36", "jsonlines", "draccus==0.10.0", "einops", "deepdiff", "packaging", "termcolor",
    "opencv-python-headless", "torchvision>=0.28,<0.29", "imageio[ffmpeg]", "safetensors", "scipy", "numpy",
]  # fmt: skip

pytestmark = [pytest.mark.campaign, pytest.mark.skipif(not PLACE, reason="HOLOKIN_LEROBOT names no folder")]


def python_of(version: str) -> str:
    """The Python of an environment with LeRobot, made if it is not there."""
    place = Path(PLACE or "").expanduser() / f"lerobot-{version}"
    python = place / "bin" / "python"
    if not (place / "complete").exists():
        subprocess.run([sys.executable, "-m", "venv", str(place)], check=True)
        for wanted in (["torch>=2.13,<2.14"], COMMON + NEEDED[version], ["--no-deps", f"lerobot=={VERSIONS[version]}"]):
            subprocess.run([str(python), "-m", "pip", "install", "-q", *wanted], check=True, timeout=1800)
        (place / "complete").touch()
    return str(python)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
@pytest.mark.parametrize("bad", ["refuse", "skip"])
def test_lerobots_loader_reads_what_is_written_and_finds_its_statistics(tmp_path: Path, version: str, bad: str) -> None:
    python, robot = python_of(version), hk.load("panda")
    episodes(tmp_path / "episodes.npz", 3, 24)
    if bad == "skip":  # an episode that ends out of reach of the leaf
        arrays = dict(np.load(tmp_path / "episodes.npz"))
        arrays["state-1"][-1, :7] = [2.2, 0.0, -0.9, -0.1, -1.1, 0.7, 2.2]
        np.savez(tmp_path / "episodes.npz", **arrays)
    in_lerobot(python, "make", str(tmp_path / "old"), str(tmp_path / "episodes.npz"), "video")
    data = read_dataset(tmp_path / "old")
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), Q0, limits=True)
    sources = [joint_feature(data, robot, name) for name in ("observation.state", "action")]
    done = retarget(data, ik, sources, tmp_path / "new", bad=bad)
    assert done.left_out == ((1,) if bad == "skip" else ())
    old, new = (in_lerobot(python, "read", str(tmp_path / name)) for name in ("old", "new"))
    keep = np.isin(np.ravel(old["columns"]["episode_index"]), done.left_out, invert=True)
    assert (new["frames"], new["features"], new["version"]) == (int(keep.sum()), old["features"], version)
    assert new["videos"] == [v for e, v in enumerate(old["videos"]) if e not in done.left_out]
    for name in ("timestamp", "frame_index", "task_index"):
        assert np.array_equal(np.array(new["columns"][name]), np.array(old["columns"][name])[keep]), name
    for name in ("observation.state", "action"):
        was, now = (np.array(one["columns"][name]) for one in (old, new))
        assert np.array_equal(now[:, 7], was[keep][:, 7])
        assert np.abs(robot.pose_batch(now[:, :7])[0] - robot.pose_batch(was[keep][:, :7])[0]).max() < 1e-6
        assert np.abs(now[:, 2] - Q0[2]).max() < 1e-7
    check_statistics(new)


def check_statistics(new: dict) -> None:
    """What stands in the metadata, beside what LeRobot computes of the rows and averages over the episodes."""
    count = np.array([one["action"]["count"][0] for one in new["episode stats"]], float)
    for name in ("observation.state", "action", "index", "episode_index"):
        wide = np.ptp(np.array(new["columns"][name]), axis=0).max()
        for what, found in new["stats"][name].items():
            each = np.array([one[name][what] for one in new["episode stats"]])
            mean = np.tensordot(count / count.sum(), each, axes=1)
            if what in ("min", "max"):
                assert np.allclose(found, each.min(0) if what == "min" else each.max(0), atol=1e-6), (name, what)
            elif what == "mean" or what.startswith("q"):
                assert np.abs(mean - found).max() <= max(wide / 5000, 2e-5), (name, what)
            elif what == "count":
                assert found == [int(count.sum())]


def test_a_loop_of_lerobots_pipeline_keeps_the_joints_on_one_leaf(tmp_path: Path) -> None:
    """A circle that leaves the reach of the arm for a while, and one pose that is none; then the same again."""
    robot = hk.load("panda")
    start, rows = robot.pose(Q0), []
    turn = Rotation.from_matrix(start[:3, :3]).as_rotvec()
    for k, angle in enumerate(np.linspace(0, 2 * np.pi, 60)):
        place = start[:3, 3] + [-0.1 + 0.1 * np.cos(angle) + (1.0 if 20 <= k < 25 else 0.0), 0.1 * np.sin(angle), 0.0]
        rows.append([np.nan] * 6 if k == 40 else [*place, *turn])
    np.savez(tmp_path / "poses.npz", q0=Q0, poses=np.array(rows))
    found = in_lerobot(python_of("v3.0"), "drive", str(tmp_path / "poses.npz"))
    wanted = ["REACHED"] * 20 + ["CLAMPED"] * 5 + ["REACHED"] * 15 + ["NOT_FINITE"] + ["REACHED"] * 19
    assert found["status"] == wanted
    joints, named = np.array(found["joints"]), [*(f"{joint}.pos" for joint in robot.joint_names), "gripper.pos"]
    assert found["joints"] == found["again"]
    assert found["entries"] == found["features"] == sorted(named)
    assert (joints[:, 7] == 40.0).all() and np.array_equal(joints[40], joints[39])
    q = np.deg2rad(joints[:, :7])
    assert np.abs(q[:, 2] - Q0[2]).max() < 1e-9 and np.abs(q[-1] - Q0).max() < 1e-6
    reached = np.array(found["status"]) == "REACHED"
    assert np.abs(robot.pose_batch(q[reached])[0] - np.array(rows)[reached, :3]).max() < 1e-6


def test_the_golden_facts_are_those_of_today(tmp_path: Path) -> None:
    """LeRobot reads in the golden dataset what stands in the file of its facts."""
    import json

    golden = Path(__file__).parents[1] / "golden"
    robot, version = hk.load("panda"), "v3.0"
    data = read_dataset(golden / f"lerobot-{version}")
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), Q0, limits=True)
    retarget(data, ik, [joint_feature(data, robot, name) for name in ("observation.state", "action")], tmp_path / "new")
    found = facts(python_of(version), golden / f"lerobot-{version}", tmp_path / "new")
    assert found["columns"] == json.loads((golden / f"lerobot-{version}.json").read_text())["columns"]
