"""URDF files: agreement with Pinocchio on every moving chain, on mimics, bases, limits and speeds."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import campaign, sampled, urdf, urdf_files
from holokin.base.errors import RobotFileError
from holokin.robot.formats import loading as reading
from holokin.robot.formats import urdf as urdf_reading

TOLERANCE = 1e-12
POSTURES = 3
MOVING = ("revolute", "continuous", "prismatic")
NOTHING_TO_COMPARE = {
    "quadrotor_base.urdf": "has no joints",
    "ur3.urdf": "lacks its 'name'",
    "iris_simple.urdf": "none of its joints moves",
}
"""Files of the package without a moving chain, and why; Pinocchio finds no joint in them either."""

MIMIC_OF_NOTHING = "alex_psyonic_hands.urdf"
"""A file whose finger tips mimic joints that it does not have: Pinocchio makes them independent, holokin refuses."""


@pytest.fixture(scope="module", autouse=True)
def read_once() -> Iterator[None]:
    """A file is read once, not again for each of its tips."""
    with pytest.MonkeyPatch.context() as patch:
        once = cache(urdf_reading.urdf_tree)
        for module in (urdf_reading, reading):
            patch.setattr(module, "urdf_tree", once)
        yield


@dataclass(frozen=True)
class Comparison:
    """The chains of one file: largest differences of pose and Jacobian by tip, chains refused, mimics folded."""

    pose: dict[str, float]
    jacobian: dict[str, float]
    refused: dict[str, str]
    mimics: int


@cache
def moving_chains(path: Path) -> dict[str, tuple[str, ...]] | str:
    """Tips with a moving joint of a file, or why there is nothing to compare."""
    try:
        tips = hk.robot.model_tips(path)
    except RobotFileError as problem:
        return str(problem)
    moving = {tip: joints for tip, joints in tips.items() if joints}
    return moving or "none of its joints moves"


def elements_of(path: Path) -> dict[str, ET.Element]:
    """The XML elements of the moving joints, read without yourdfpy."""
    joints = ET.parse(path).getroot().findall("joint")
    return {joint.get("name", ""): joint for joint in joints if joint.get("type") in MOVING}


def masters_of(path: Path) -> dict[str, tuple[str, float, float]]:
    """Every moving joint -> (joint it follows in the end, multiplier, offset)."""
    joints = elements_of(path)
    out = {}
    for name in joints:
        master, gain, shift = name, 1.0, 0.0
        while (mimic := joints[master].find("mimic")) is not None and mimic.get("joint") in joints:
            shift += gain * float(mimic.get("offset", "0"))
            gain *= float(mimic.get("multiplier", "1"))
            master = mimic.get("joint", "")
        out[name] = (master, gain, shift)
    return out


def own_range(model: pin.Model, element: ET.Element) -> tuple[float, float, float]:
    """(lower, upper, speed) of a joint itself: Pinocchio's, none where the file leaves it out; soft ones, too."""
    joint, limit = model.joints[model.getJointId(element.get("name", ""))], element.find("limit")
    speed = float(model.velocityLimit[joint.idx_v])
    if joint.nq == 2:
        return -np.inf, np.inf, speed or np.inf
    found = [float(side[joint.idx_q]) for side in (model.lowerPositionLimit, model.upperPositionLimit)]
    soft = element.find("safety_controller")
    for i, (key, worst, narrow) in enumerate((("lower", -np.inf, max), ("upper", np.inf, min))):
        if limit is None or limit.get(key) is None or abs(found[i]) >= 1e6:
            found[i] = worst
        if soft is not None and soft.get(f"soft_{key}_limit") is not None:
            found[i] = narrow(found[i], float(soft.get(f"soft_{key}_limit", "")))
    return found[0], found[1], speed or np.inf


def narrowed(path: Path, model: pin.Model, leader: str) -> tuple[float, float, float]:
    """(lower, upper, speed) of a joint such that it and all that follow it are within theirs."""
    lower, upper, speed = own_range(model, elements_of(path)[leader])
    for name, (master, gain, shift) in masters_of(path).items():
        if master == leader and name != leader and gain:
            low, high, most = own_range(model, elements_of(path)[name])
            if (low, high, most) == (0.0, 0.0, np.inf):
                continue  # never filled in
            ends = (low - shift) / gain, (high - shift) / gain
            lower, upper, speed = max(lower, min(ends)), min(upper, max(ends)), min(speed, most / abs(gain))
    return lower, upper, speed


def neutral_with(model: pin.Model, values: dict[str, float]) -> np.ndarray:
    """Pinocchio's posture with the given joint values; an unlimited hinge is a cosine and a sine there."""
    q = pin.neutral(model)
    for name, value in values.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return q


@cache
def compared(path: Path) -> Comparison:
    """Every moving chain of a file against Pinocchio, at random postures."""
    model = pin.buildModelFromUrdf(str(path))  # mimics are joints of their own there: set and folded here
    data = model.createData()
    masters = masters_of(path)
    assert set(masters) == set(model.names) - {"universe"}
    rng = np.random.default_rng(2011)
    pose, jacobian, refused, mimics = {}, {}, {}, 0
    for tip, chain in moving_chains(path).items():
        try:
            robot = hk.from_urdf(path, tip=tip)
        except RobotFileError as problem:
            refused[tip] = str(problem)
            continue
        assert set(robot.joint_names) == {masters[name][0] for name in chain}
        frame = model.getFrameId(tip, pin.BODY)
        fold = np.zeros((model.nv, robot.n))
        for name, (master, gain, _) in masters.items():
            if master in robot.joint_names:
                fold[model.joints[model.getJointId(name)].idx_v, robot.joint_index(master)] = gain
        mimics += sum(masters[name][0] != name for name in chain)
        worst = [0.0, 0.0]
        for _ in range(POSTURES):
            q = rng.uniform(-np.pi, np.pi, robot.n)
            free = dict.fromkeys(masters, 0.0) | {name: float(rng.uniform(-1, 1)) for name in masters}
            free |= dict(zip(robot.joint_names, q, strict=True))
            posture = neutral_with(model, {n: gain * free[m] + shift for n, (m, gain, shift) in masters.items()})
            pin.framesForwardKinematics(model, data, posture)
            T = data.oMf[frame].homogeneous
            J = pin.computeFrameJacobian(model, data, posture, frame, pin.LOCAL_WORLD_ALIGNED)
            others = [i for i in range(model.nv) if not fold[i].any()]
            assert not J[:, others].any()  # our coordinates are all that move the tip
            worst[0] = max(worst[0], float(np.abs(robot.pose(q) - T).max()))
            worst[1] = max(worst[1], float(np.abs(robot.jacobian(q) - J @ fold).max()))
        pose[tip], jacobian[tip] = worst
    return Comparison(pose, jacobian, refused, mimics)


@sampled(4, "path", urdf_files(), ids=lambda p: f"{p.parent.parent.name}-{p.stem}")
def test_every_moving_chain_agrees_with_pinocchio(path: Path) -> None:
    chains = moving_chains(path)
    if isinstance(chains, str):
        assert NOTHING_TO_COMPARE[path.name] in chains
        pytest.skip(f"{path.name}: {chains}")
    found = compared(path)
    assert max(found.pose.values(), default=0.0) < TOLERANCE, found.pose
    assert max(found.jacobian.values(), default=0.0) < TOLERANCE, found.jacobian
    assert len(found.pose) + len(found.refused) == len(chains)
    word = "mimics" if path.name == MIMIC_OF_NOTHING else "fill in its <limit>"
    assert all(word in problem for problem in found.refused.values())


@pytest.mark.campaign
def test_what_was_compared_is_not_little() -> None:
    files = [path for path in urdf_files() if not isinstance(moving_chains(path), str)]
    found = [compared(path) for path in files]
    assert len(urdf_files()) - len(files) <= len(NOTHING_TO_COMPARE)
    assert len(files) >= 66
    assert sum(len(c.pose) for c in found) >= 575
    assert sum(len(c.refused) for c in found) == 10
    assert sum(c.mimics for c in found) >= 60


@sampled(2, "name", ["panda.urdf", "baxter.urdf", "pr2.urdf", "tiago_pro.urdf"])
def test_mimic_joints_agree_with_pinocchios_own(name: str) -> None:
    path = urdf(name)
    model = pin.buildModelFromUrdf(str(path), mimic=True)
    data, rng = model.createData(), np.random.default_rng(4)
    mimicked = [n for n, (master, _, _) in masters_of(path).items() if master != n]
    tips = [tip for tip, joints in hk.robot.model_tips(path).items() if set(joints) & set(mimicked)]
    assert tips
    for tip in tips:
        robot = hk.from_urdf(path, tip=tip)
        q = rng.uniform(-1, 1, robot.n)
        posture = neutral_with(model, dict(zip(robot.joint_names, q, strict=True)))
        frame = model.getFrameId(tip, pin.BODY)
        pin.framesForwardKinematics(model, data, posture)
        assert np.abs(robot.pose(q) - data.oMf[frame].homogeneous).max() < TOLERANCE
        J = pin.computeFrameJacobian(model, data, posture, frame, pin.LOCAL_WORLD_ALIGNED)
        columns = [model.joints[model.getJointId(n)].idx_v for n in robot.joint_names]
        assert np.abs(robot.jacobian(q) - J[:, columns]).max() < TOLERANCE


def test_the_base_is_pinocchios_root() -> None:
    for path in urdf_files()[::4]:
        if isinstance(moving_chains(path), str):
            continue
        file = ET.parse(path).getroot()
        parents, children = ({e.get("link") for e in file.iterfind(f"joint/{side}")} for side in ("parent", "child"))
        (root,) = parents - children
        model = pin.buildModelFromUrdf(str(path))
        frame = model.frames[model.getFrameId(root, pin.BODY)]
        assert frame.parentJoint == 0
        assert np.array_equal(frame.placement.homogeneous, np.eye(4))


@pytest.mark.parametrize(("every", "least"), [(7, (90, 1, 0)), campaign(("every", "least"), (1, (1000, 20, 1)))])
def test_limits_and_speeds_are_pinocchios(every: int, least: tuple[int, int, int]) -> None:
    """Those of the joint itself and of all that follow it, soft limits included; where the file leaves a limit out,
    URDF means 0 and holokin means none, as from 1e6 on."""
    counts = {"given": 0, "left out": 0, "unlimited": 0}
    for path in urdf_files()[::every]:
        chains = moving_chains(path)
        if isinstance(chains, str) or not compared(path).pose:
            continue
        model, elements = pin.buildModelFromUrdf(str(path)), elements_of(path)
        robot = hk.from_urdf(path, tip=[tip for tip in chains if tip not in compared(path).refused])
        for c in robot.coordinates:
            joint, element = model.joints[model.getJointId(c.name)], elements[c.name]
            limit = element.find("limit")
            assert (c.lower, c.upper, c.max_velocity) == pytest.approx(narrowed(path, model, c.name), abs=1e-15)
            assert c.unit == ("m" if element.get("type") == "prismatic" else "rad")
            if joint.nq == 2:
                counts["unlimited"] += 1
            elif limit is None or limit.get("lower") is None:
                counts["left out"] += 1
            else:
                counts["given"] += 1
    assert all(counts[name] >= most for name, most in zip(("given", "unlimited", "left out"), least, strict=True))
