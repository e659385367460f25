"""An arm in MJCF with what MJCF has and URDF has not, and MuJoCo's own poses of its sites."""

from __future__ import annotations

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

ARM = """
<mujoco model="bench">
  <compiler angle="degree" eulerseq="xyz"/>
  <default><joint axis="0 1 1" armature="0.1" damping="2"/>
    <default class="wrist"><joint axis="1 0 0"/></default></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="cube" pos="2 0 0"><freejoint name="loose"/><geom size="0.1"/></body>
    <body name="trunk" pos="0.1 0.2 0.3" euler="10 20 30">
      <joint name="lift" type="slide" axis="0 0 2" range="-1 2" ref="0.25" limited="true"/>
      <joint name="turn" pos="0.05 -0.1 0.2" axis="1 2 3" ref="40" range="-170 170"/>
      <geom size="0.1"/>
      <body name="arm" pos="0.4 0 0.1" axisangle="1 1 0 50">
        <joint name="bend" pos="0 0.1 0"/>
        <geom type="capsule" size="0.05 0.2"/>
        <body pos="0 0 0.3">
          <joint class="wrist" pos="0.02 0 0"/>
          <geom size="0.05"/>
          <body name="tail" pos="0.1 0 0.2"><joint name="last" ref="-15" pos="0 0 -0.05"/><geom size="0.05"/>
            <site name="pen" pos="0.1 0.2 0.3" quat="1 2 3 4"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="last" joint2="bend" polycoef="0.2 -1.5 0 0 0"/></equality>
</mujoco>
"""
"""Anchors beside the body's origin, two joints on a body, references, a nameless joint, one that follows another."""


def site_pose(model: mujoco.MjModel, site: str, values: dict[int, float]) -> np.ndarray:
    """The pose (4, 4) of a site that MuJoCo computes, joints given by their number."""
    data = mujoco.MjData(model)
    for joint, value in values.items():
        data.qpos[model.jnt_qposadr[joint]] = value
    mujoco.mj_kinematics(model, data)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = data.site(site).xmat.reshape(3, 3), data.site(site).xpos
    return T
