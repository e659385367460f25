"""A step of LeRobot's pipelines: a tool pose of a teleoperator or a policy in, joints on one leaf out."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, MissingExtraError, UnknownNameError
from ..base.poses import pose_from
from ..base.types import ArrayLike, Matrix, Vector
from ..motion.ik import InverseKinematics

# Entries of an action that hold the tool pose: a point [m], and a rotation vector [rad] in the frame of the base.
POSE = ("x", "y", "z", "wx", "wy", "wz")


@typed
def lerobot_step(
    ik: InverseKinematics,
    *,
    degrees: bool = True,
    step: ArrayLike | None = None,
    prefix: str = "ee",
    motors: Mapping[str, str] | None = None,
) -> Any:
    """A step for `RobotProcessorPipeline`: `ee.x` to `ee.wz` of an action become joints, by `ik.nearest`.

    It takes the place of LeRobot's `InverseKinematicsEEToJoints`, and needs no measured joints. Each call begins at the
    last answer; a pose out of reach gives the nearest pose of the leaf. `ee.gripper_pos` becomes `gripper.pos`, and
    other entries stay. `reset()`, as pipelines call it between episodes, goes back to the start of `ik`.
    After a call, `last` is its `Nearest`: the status, and what is missing.

    Args:
        ik: of a task with the whole orientation, as `hk.ik(strategy, q0)`.
        degrees: the unit of hinges in the robot's actions.
        step: how far each joint may move in a call [rad or m], as of `ik.nearest`: its speed limit times the period.
        prefix: what stands before the point in the names of the pose's entries.
        motors: joint -> name of its motor; by default they have the same names.

    Raises:
        MissingExtraError: lerobot is not installed. ArgumentError, UnknownNameError: motors of other joints.
    """
    robot = ik.strategy.task.robot
    names = {joint: joint for joint in robot.joint_names} | dict(motors or {})
    for joint in names:
        if joint not in robot.joint_names:
            raise UnknownNameError(f"joint of {robot.name!r}", joint, robot.joint_names)
    if len(set(names.values())) < len(names):
        raise ArgumentError("motors", dict(motors or {}), "give each joint a motor of its own")
    scales = np.where(robot.hinges & degrees, 180 / np.pi, 1.0)
    return _step_class()(ik, tuple(names[joint] for joint in robot.joint_names), scales, step, prefix)


def _pose_of(action: dict[str, Any], prefix: str) -> Matrix:
    """The pose (4, 4) that an action holds, whose entries are taken out of it. Raises: ArgumentError."""
    from scipy.spatial.transform import Rotation

    missing = [f"{prefix}.{name}" for name in POSE if action.get(f"{prefix}.{name}") is None]
    if missing:
        raise ArgumentError("the entries of an action", list(action), f"it needs {', '.join(missing)}")
    values = np.array([float(action.pop(f"{prefix}.{name}")) for name in POSE])
    return pose_from(values[:3], Rotation.from_rotvec(values[3:]).as_matrix() if np.isfinite(values).all() else np.nan)


@cache
def _step_class() -> Any:
    """The class of the step, a child of LeRobot's own. Raises: MissingExtraError."""
    try:
        from lerobot.configs.types import FeatureType, PipelineFeatureType, PolicyFeature  # type: ignore[import]
        from lerobot.processor import RobotActionProcessorStep  # type: ignore[import]
    except ImportError:
        raise MissingExtraError("the package lerobot itself (pip install lerobot)", "lerobot") from None

    # Made when it is asked for, since only lerobot itself has its parent.
    class PoseToJointsOnLeaf(RobotActionProcessorStep):
        """A tool pose becomes joints on one leaf."""

        def __init__(
            self, ik: InverseKinematics, motors: tuple[str, ...], scales: Vector, step: ArrayLike | None, prefix: str
        ) -> None:
            self.ik, self.motors, self.scales, self.step, self.prefix = ik, motors, scales, step, prefix
            self.reset()

        def action(self, action: dict[str, Any]) -> dict[str, Any]:
            """The action with joints in place of the pose."""
            out = dict(action)
            pose = _pose_of(out, self.prefix)
            self.last = self.ik.nearest(pose, self.q, step=self.step)
            self.q = self.last.q
            if f"{self.prefix}.gripper_pos" in out:
                out["gripper.pos"] = float(out.pop(f"{self.prefix}.gripper_pos"))
            values = (float(v) for v in self.q * self.scales)
            return out | {f"{motor}.pos": value for motor, value in zip(self.motors, values, strict=True)}

        def transform_features(self, features: dict[Any, dict[str, Any]]) -> dict[Any, dict[str, Any]]:
            """The entries of an action after this step."""
            actions = features[PipelineFeatureType.ACTION]
            for name in (*POSE, "gripper_pos"):
                there = actions.pop(f"{self.prefix}.{name}", None)
                if name == "gripper_pos" and there is not None:
                    actions["gripper.pos"] = there
            for motor in self.motors:
                actions[f"{motor}.pos"] = PolicyFeature(type=FeatureType.ACTION, shape=(1,))
            return features

        def reset(self) -> None:
            """Begin again at the start."""
            self.q, self.last = self.ik.q0, None

    return PoseToJointsOnLeaf
