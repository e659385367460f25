"""Runs inside an environment that has LeRobot: makes datasets, reads them, and drives a pipeline. It prints JSON.

python in_lerobot.py make FOLDER EPISODES.npz [video]    a dataset of LeRobot's own making
python in_lerobot.py read FOLDER                         what LeRobot's loader finds in it
python in_lerobot.py drive POSES.npz                     a loop of a pipeline with holokin's step
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import torch

for _name in ("nms", "qnms"):  # a torchvision made for CUDA does not define them beside a torch without
    torch.library.define(f"torchvision::{_name}", "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")

from lerobot.datasets.compute_stats import compute_episode_stats  # noqa: E402
from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402

NAMES = [*(f"panda_joint{i}.pos" for i in range(1, 8)), "gripper.pos"]
VIDEO = "observation.images.top"


def make(folder: Path, file: Path, video: bool) -> None:
    """A dataset of the episodes in a file: arrays state-0, action-0, state-1, ... (k, 8)."""
    features = {
        name: {"dtype": "float32", "shape": (8,), "names": NAMES} for name in ("observation.state", "action")
    }  # fmt: skip
    if video:
        features[VIDEO] = {"dtype": "video", "shape": (64, 96, 3), "names": ["height", "width", "channels"]}
    data = LeRobotDataset.create("test/test", 30, features, root=folder, robot_type="panda", use_videos=video)
    arrays = np.load(file)
    for e in range(len(arrays.files) // 2):
        for i, (state, action) in enumerate(zip(arrays[f"state-{e}"], arrays[f"action-{e}"], strict=True)):
            frame = {"observation.state": state.astype(np.float32), "action": action.astype(np.float32)}
            if video:
                frame[VIDEO] = np.full((64, 96, 3), (20 * e + 3 * i) % 256, np.uint8)
            _add(data, frame)
        data.save_episode()
    if hasattr(data, "finalize"):
        data.finalize()


def _add(data: LeRobotDataset, frame: dict) -> None:
    try:
        data.add_frame(frame | {"task": "circle"})
    except (TypeError, ValueError):  # 0.3 takes the task beside the frame
        data.add_frame(frame, task="circle")


def read(folder: Path) -> dict:
    """What the loader says, and a digest of all its columns."""
    data = LeRobotDataset("test/test", root=folder)
    videos = [
        data.root / data.meta.get_video_file_path(e, VIDEO) for e in range(data.num_episodes) if data.meta.video_keys
    ]
    rows = data.hf_dataset if videos else data  # an item of a video is decoded, which takes FFmpeg and torchcodec
    items = [rows[i] for i in range(len(data))]
    arrays = {name: np.stack([np.asarray(one[name]) for one in items]) for name in items[0] if name != "task"}
    features = {name: one for name, one in data.meta.features.items() if one["dtype"] not in ("video", "image")}
    episodes = np.ravel(arrays["episode_index"])
    stats = []
    for e in np.unique(episodes):
        mine = {name: arrays[name][episodes == e] for name in features}
        found = compute_episode_stats(mine, features)
        stats.append({n: {k: np.ravel(v).tolist() for k, v in one.items()} for n, one in found.items()})
    return {
        "frames": len(data), "episodes": int(data.num_episodes), "version": data.meta.info["codebase_version"],
        "features": {n: [f["dtype"], list(f["shape"]), f["names"]] for n, f in data.meta.features.items()},
        "stats": {n: {k: np.ravel(v).tolist() for k, v in one.items()} for n, one in data.meta.stats.items()},
        "episode stats": stats, "tasks": [str(one.get("task")) for one in items],
        "columns": {n: v.reshape(len(v), -1).tolist() for n, v in arrays.items()},
        "videos": [hashlib.sha256(file.read_bytes()).hexdigest() for file in videos],
    }  # fmt: skip


def drive(file: Path) -> dict:
    """Actions with poses through a RobotProcessorPipeline that has holokin's step between two of LeRobot's kind."""
    from lerobot.configs.types import FeatureType, PipelineFeatureType, PolicyFeature
    from lerobot.processor import RobotAction, RobotObservation, RobotProcessorPipeline
    from lerobot.processor.converters import robot_action_observation_to_transition, transition_to_robot_action

    import holokin as hk
    from holokin.learning import lerobot_step

    robot = hk.load("panda")
    given = np.load(file)
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), given["q0"])
    step = lerobot_step(ik, degrees=True)
    pipeline = RobotProcessorPipeline[tuple[RobotAction, RobotObservation], RobotAction](
        steps=[step], to_transition=robot_action_observation_to_transition, to_output=transition_to_robot_action
    )
    entries = ("x", "y", "z", "wx", "wy", "wz")
    runs = []
    for _ in range(2):
        pipeline.reset()
        out, status = [], []
        for row in given["poses"]:
            action = {f"ee.{name}": float(v) for name, v in zip(entries, row, strict=True)} | {"ee.gripper_pos": 40.0}
            answer = pipeline((action, {"unused.pos": 0.0}))
            out.append([answer[f"{joint}.pos"] for joint in robot.joint_names] + [answer["gripper.pos"]])
            status.append(step.last.status.name)
        runs.append(out)
    kinds = {f"ee.{name}": PolicyFeature(type=FeatureType.ACTION, shape=(1,)) for name in (*entries, "gripper_pos")}
    features = pipeline.transform_features({PipelineFeatureType.ACTION: kinds, PipelineFeatureType.OBSERVATION: {}})
    left = sorted(features[PipelineFeatureType.ACTION])
    return {"joints": runs[0], "again": runs[1], "status": status, "entries": sorted(answer), "features": left}


if __name__ == "__main__":
    what, place = sys.argv[1], Path(sys.argv[2])
    if what == "make":
        make(place, Path(sys.argv[3]), "video" in sys.argv[4:])
    else:
        print(json.dumps(read(place) if what == "read" else drive(place)))
