"""Joints that follow others keep their own limits: random trees of followers, in URDF and in MJCF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import campaign
from holokin.base.errors import ArgumentError, RobotFileError

URDF_JOINT = """<joint name="{0.name}" type="revolute"><parent link="{0.parent}"/><child link="{0.name}_link"/>
<axis xyz="0 0 1"/><origin xyz="0.3 0 0"/><limit lower="{0.lower!r}" upper="{0.upper!r}" velocity="{0.speed!r}"
effort="1"/>{1}{2}</joint><link name="{0.name}_link"/>"""


@dataclass(frozen=True)
class Drawn:
    """A joint as it is drawn: its place in the tree, its limits, where it is at rest, and whom it follows."""

    name: str
    parent: str
    lower: float
    upper: float
    speed: float
    rest: float = 0.0
    leader: str = ""
    multiplier: float = 1.0
    offset: float = 0.0
    soft: tuple[float | None, float | None] | None = None


def draw(seed: int) -> list[Drawn]:
    """Two to nine joints in a tree. Each is a leader, or follows any other one, leaders and followers alike."""
    rng = np.random.default_rng(seed)
    joints: list[Drawn] = []
    for i in range(int(rng.integers(2, 10))):
        parent = f"{joints[int(rng.integers(i))].name}_link" if i and rng.random() < 0.8 else "ground"
        wide, middle, rest = rng.uniform(0.1, 1.5), rng.uniform(-0.2, 0.2), float(rng.choice([0.0, rng.uniform(-1, 1)]))
        own = Drawn(f"j{i}", parent, float(middle - wide), float(middle + wide), float(rng.uniform(0.5, 3.0)), rest)
        if rng.random() < 0.3:
            own = replace(own, soft=(own.lower + rng.uniform(-0.1, 0.1), own.upper + rng.uniform(-0.05, 0.2)))
        if i and rng.random() < 0.7:
            gain = float(rng.choice([0.0, 1.0, -1.0, 2.5, rng.uniform(-3, 3)], p=[0.1, 0.1, 0.2, 0.1, 0.5]))
            own = replace(own, leader=f"j{rng.integers(i)}", multiplier=gain, offset=float(rng.uniform(-0.6, 0.6)))
        joints.append(own)
    order = rng.permutation(len(joints))  # a leader may stand after its followers, and above or below them
    names = {f"j{i}": f"j{order[i]}" for i in range(len(joints))}
    links = {"ground": "ground"} | {f"{old}_link": f"{new}_link" for old, new in names.items()}
    return [replace(j, name=names[j.name], leader=names.get(j.leader, ""), parent=links[j.parent]) for j in joints]


def urdf_of(joints: list[Drawn]) -> str:
    def follows(j: Drawn) -> str:
        return f'<mimic joint="{j.leader}" multiplier="{j.multiplier!r}" offset="{j.offset!r}"/>' if j.leader else ""

    def soft(j: Drawn) -> str:
        given = zip(("lower", "upper"), j.soft or (None, None), strict=True)
        text = " ".join(f'soft_{which}_limit="{value!r}"' for which, value in given if value is not None)
        return f'<safety_controller k_velocity="1" {text}/>' if j.soft else ""

    inside = "".join(URDF_JOINT.format(j, follows(j), soft(j)) for j in joints)
    return f'<robot name="tree"><link name="ground"/>{inside}</robot>'


def mjcf_of(joints: list[Drawn]) -> str:
    def below(link: str) -> str:
        return "".join(
            f'<body name="{j.name}_link" pos="0.3 0 0"><geom size="0.01" mass="1"/><joint name="{j.name}" axis="0 0 1" '
            f'range="{j.lower!r} {j.upper!r}" ref="{j.rest!r}"/>{below(f"{j.name}_link")}</body>'
            for j in joints if j.parent == link
        )  # fmt: skip

    ties = "".join(
        f'<joint joint1="{j.name}" joint2="{j.leader}" polycoef="{j.offset!r} {j.multiplier!r} 0 0 0"/>'
        for j in joints if j.leader
    )  # fmt: skip
    world = f'<worldbody><body name="ground">{below("ground")}</body></worldbody>'
    return f'<mujoco><compiler angle="radian"/>{world}<equality>{ties}</equality></mujoco>'


def values(joints: list[Drawn], leader: str, q: np.ndarray) -> dict[str, np.ndarray]:
    """Where a leader at q, and all joints that follow it, are: motions from rest, q_f - rest = a (q_l - rest) + b."""
    at, found = {j.name: j for j in joints}, {leader: q}
    for _ in joints:
        for j in joints:
            if j.leader in found:
                found[j.name] = j.rest + j.multiplier * (found[j.leader] - at[j.leader].rest) + j.offset
    return found


def rates(joints: list[Drawn], leader: str) -> dict[str, float]:
    """How fast a leader at 1 rad/s makes each that follows it."""
    found = {leader: 1.0}
    for _ in joints:
        found |= {j.name: abs(j.multiplier) * found[j.leader] for j in joints if j.leader in found}
    return found


def known(joints: list[Drawn]) -> list[Drawn]:
    """The joints as a URDF has them: within their soft limits, and with no place of rest but 0."""
    soft = {j.name: j.soft or (j.lower, j.upper) for j in joints}
    return [
        replace(j, rest=0.0, lower=max(j.lower, soft[j.name][0]), upper=min(j.upper, soft[j.name][1])) for j in joints
    ]


def read(form: str, joints: list[Drawn], folder: Path) -> tuple[list[Drawn], hk.Robot]:
    """The joints as the form has them, and the robot of the chain to a link at which the tree ends."""
    inner = {j.parent for j in joints}
    tips = [f"{j.name}_link" for j in joints if f"{j.name}_link" not in inner]
    if form == "mjcf":
        return [replace(j, speed=np.inf) for j in joints], hk.robot.from_mjcf(
            mjcf_of(joints), tip=tips[:1], base="ground"
        )
    file = folder / "tree.urdf"
    file.write_text(urdf_of(joints))
    return known(joints), hk.from_urdf(file, tip=tips[:1], base="ground")


def least(joints: list[Drawn], leader: str) -> np.ndarray:
    """(k,) by how much the leader at each value of a grid, or what follows it, is inside its limits."""
    found = values(joints, leader, GRID)
    at = {j.name: j for j in joints}
    return np.min([np.minimum(x - at[n].lower, at[n].upper - x) for n, x in found.items()], axis=0)


GRID = np.linspace(-4.0, 4.0, 2001)


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
@pytest.mark.parametrize(("first", "count"), [(0, 24), campaign(("first", "count"), (100, 1500))])
def test_a_leader_is_within_its_limits_where_all_that_follow_it_are(
    form: str, first: int, count: int, tmp_path: Path
) -> None:
    told, empty = 0, 0
    for seed in range(first, first + count):
        drawn = draw(seed)
        try:
            joints, robot = read(form, drawn, tmp_path)
        except RobotFileError as problem:
            assert "never within its own limits" in str(problem), seed
            plain = known(drawn) if form == "urdf" else drawn
            assert any((least(plain, j.name) < 0).all() for j in plain if not j.leader), seed
            empty += 1
            continue
        at = {j.name: j for j in joints}
        for c in robot.coordinates:
            room = least(joints, c.name)
            inside = np.clip(GRID, c.lower, c.upper) == GRID
            assert (inside == (room >= 0))[np.abs(room) > 1e-12].all(), (seed, c.name)
            fastest = min(at[n].speed / r if r else np.inf for n, r in rates(joints, c.name).items())
            assert c.max_velocity == pytest.approx(fastest, rel=1e-12), (seed, c.name)
            told += len(rates(joints, c.name)) > 1
    assert told > count / 4
    assert empty > count / 20


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_what_is_written_keeps_the_limits_of_leaders_and_of_followers(form: str, tmp_path: Path) -> None:
    kept = 0
    for seed in range(20):
        try:
            joints, robot = read(form, draw(seed), tmp_path)
            text = hk.robot.to_urdf(robot) if form == "urdf" else hk.robot.to_mjcf(robot)
        except (RobotFileError, ArgumentError):
            continue  # limits that exclude each other, or a leader that the chain does not have
        (tmp_path / "written.urdf").write_text(text)
        tip = robot.tips[0].name
        again = (
            hk.from_urdf(tmp_path / "written.urdf", tip=tip) if form == "urdf" else hk.robot.from_mjcf(text, tip=tip)
        )
        assert [replace(c, max_velocity=1) for c in again.coordinates] == [
            replace(c, max_velocity=1) for c in robot.coordinates
        ]
        assert np.array_equal(again.max_velocity, robot.max_velocity)
        at = {j.name: j for j in joints}
        for element in ET.fromstring(text).iter("joint"):
            own = at.get(element.get("name", ""))
            if own is None or not own.leader or own.name in robot.joint_names:
                continue
            limit = element.find("limit")
            if form == "mjcf":
                found = [float(x) for x in element.get("range", "").split()] if element.get("range") else None
                wanted = [own.lower - own.rest, own.upper - own.rest]
            else:
                assert limit is not None
                found = [float(limit.get(key, "nan")) for key in ("lower", "upper", "velocity")]
                wanted = [own.lower, own.upper, own.speed]
            if found is not None:
                assert found == pytest.approx(wanted, abs=1e-15)
                kept += 1
    assert kept > 3


ARM = [
    Drawn("a", "ground", -2.0, 2.0, 1.0),
    Drawn("b", "a_link", -0.5, 1.0, 1.0, leader="a", multiplier=-2.0, offset=0.2),
    Drawn("c", "b_link", -9.0, 9.0, 1.0),
]


def test_a_leader_is_held_only_where_its_followers_may_be(tmp_path: Path) -> None:
    """-0.5 <= 0.2 - 2 a <= 1, so a is in [-0.4, 0.35]; a follower that is held itself asks for nothing."""
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_of(ARM))
    robot = hk.from_urdf(file)
    assert (robot.lower[0], robot.upper[0], robot.max_velocity[0]) == pytest.approx((-0.4, 0.35, 0.5))
    assert hk.from_urdf(file, locked={"a": 0.3}).n == 1
    with pytest.raises(ArgumentError, match=r"within its limits \[-0.4, 0.35\]"):
        hk.from_urdf(file, locked={"a": 0.4})
    free = hk.from_urdf(file, locked={"b": 0.1})
    assert (free.lower[0], free.upper[0], free.max_velocity[0]) == (-2.0, 2.0, 1.0)


@pytest.mark.parametrize(
    ("soft", "kept"),
    [
        ((-1.5, 1.0), (-1.5, 1.0)), ((-9.0, 9.0), (-2.0, 2.0)), ((-1.0, None), (-1.0, 2.0)),
        ((None, 0.5), (-2.0, 0.5)), ((None, None), (-2.0, 2.0)),
    ],
)  # fmt: skip
def test_soft_limits_narrow_a_joint_and_one_that_is_missing_does_not(
    soft: tuple[float | None, float | None], kept: tuple[float, float], tmp_path: Path
) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_of([replace(ARM[0], soft=soft)]))
    robot = hk.from_urdf(file)
    assert (robot.lower[0], robot.upper[0]) == kept
    file.write_text(file.read_text().replace("revolute", "continuous"))
    assert np.isinf([*hk.from_urdf(file).lower, *hk.from_urdf(file).upper]).all()  # no position of it is limited


def test_limits_that_exclude_each_other_or_were_never_filled_in_are_told(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_of([replace(ARM[0], soft=(3.0, 4.0))]))
    with pytest.raises(RobotFileError, match=r"range of joint 'a' is \(3.0, 2.0\); .*soft limits"):
        hk.from_urdf(file)
    bare = [replace(ARM[0], lower=0.0, upper=0.0, speed=0.0), replace(ARM[2], parent="a_link")]
    file.write_text(urdf_of(bare))
    with pytest.raises(RobotFileError, match=r"joint 'a' is from 0 to 0, at speed 0; fill in its <limit>, or hold"):
        hk.from_urdf(file)
    assert hk.from_urdf(file, locked={"a": 0.3}).joint_names == ("c",)
    file.write_text(urdf_of([ARM[0], replace(ARM[1], lower=0.0, upper=0.0, speed=0.0)]))
    assert hk.from_urdf(file).upper[0] == 2.0  # a follower without limits of its own
    degrees = [replace(j, lower=-170.0, upper=170.0, leader="") for j in ARM]
    file.write_text(urdf_of(degrees))
    with pytest.raises(RobotFileError, match="looks like degrees"):
        hk.from_urdf(file)
    file.write_text(urdf_of([degrees[0], ARM[1], degrees[2]]))
    assert hk.from_urdf(file).upper[1] == 170.0  # one hinge may be wound up, not all
