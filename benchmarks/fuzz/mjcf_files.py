"""MJCF files: broken bytes, missing, doubled and moved elements, odd numbers and names, giants."""

from __future__ import annotations

import copy
import random
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

import holokin as hk
from benchmarks.fuzz.jobs import broken

SOUND = """<mujoco model="arm"><compiler angle="radian" meshdir="meshes"/><option timestep="0.01"/>
<default><joint damping="1"/><default class="a"><geom rgba="1 0 0 1"/></default></default>
<asset><texture name="t" type="2d" builtin="flat" width="4" height="4"/><material name="m" texture="t"/>
<mesh name="s" builtin="sphere" params="1"/><hfield name="h" nrow="3" ncol="3" size="1 1 1 1"/></asset>
<worldbody><body name="b1" pos="0 0 0.3"><joint name="j1" axis="0 0 1" range="-2 2"/>
<inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.1 0.1"/>
<body name="b2" pos="0 0 0.3" euler="0.1 0 0"><joint name="j2" type="slide" axis="1 0 0" range="-1 1"/>
<geom type="capsule" size="0.03 0.1" material="m"/><body name="b3" pos="0.4 0 0" quat="1 0 0.1 0">
<joint name="j3" axis="0 1 0" ref="0.2"/><geom type="mesh" mesh="s" class="a"/><site name="tool" pos="0 0 0.1"/>
<replicate count="2" offset="0.1 0 0"><geom size="0.01"/></replicate></body></body></body>
<body name="b4" pos="1 0 0"><joint name="j4"/><geom size="0.1"/></body></worldbody>
<equality><joint joint1="j4" joint2="j1" polycoef="0 1 0 0 0"/></equality>
<actuator><motor joint="j1"/></actuator><keyframe><key name="k" qpos="0 0 0 0"/></keyframe></mujoco>"""
"""An arm of three joints, and one that follows."""

_VALUES = (
    "", "0", "1", "-1", "nan", "inf", "1e200", "-1e308", "1e400", "9" * 500, "0 0 0", "1 2", "1 2 3 4", "a", "j1", "b3",
    "ball", "free", "hinge", "100000", "x" * 5000, "[/red]", "日本", "0x10", "true", "../../etc/passwd", "3000000",
)  # fmt: skip
_TAGS = (
    "body", "joint", "geom", "site", "freejoint", "frame", "replicate", "attach", "include", "composite", "flexcomp",
    "inertial", "camera", "light", "weld", "connect", "tendon", "x", "mesh", "size", "default", "compiler",
)  # fmt: skip


def _mutated(chance: random.Random) -> bytes:
    root = ElementTree.fromstring(SOUND)
    for _ in range(chance.choice((1, 1, 2, 3))):
        every = [(parent, child) for parent in root.iter() for child in parent]
        if not every:
            break
        parent, child = chance.choice(every)
        match chance.randrange(6):
            case 0:
                parent.remove(child)
            case 1:
                parent.append(copy.deepcopy(child))
            case 2:
                chance.choice(every)[0].append(copy.deepcopy(child))
            case 3:
                child.tag = chance.choice(_TAGS)
            case 4 if child.attrib:
                del child.attrib[chance.choice(list(child.attrib))]
            case _:
                names = [
                    *child.attrib,
                    "name",
                    "class",
                    "count",
                    "range",
                    "pos",
                    "quat",
                    "type",
                    "size",
                    "mass",
                    "file",
                ]
                child.set(chance.choice(names), chance.choice(_VALUES))
    return ElementTree.tostring(root)


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, read for its tips and as a robot, and moved a little."""
    chance = random.Random(seed)
    data = _mutated(chance) if chance.random() < 0.7 else broken(SOUND.encode(), chance)
    file = folder / "arm.xml"
    file.write_bytes(data)
    tips = hk.robot.model_tips(file)
    robot = hk.load(file, tip=chance.choice([*tips, "tool"]))
    q = np.clip(0.1, robot.lower, robot.upper)
    if not (np.isfinite(robot.jacobian(q)).all() and np.isfinite(robot.pose(q)).all()):
        raise ValueError("kinematics that are not finite")
