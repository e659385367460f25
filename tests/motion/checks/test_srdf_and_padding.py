"""Pairs that an SRDF disables, links that are padded: what is then looked at, and how far things must be apart."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import RobotFileError, UnknownNameError
from holokin.motion.checks import Clearances
from holokin.robot import Capsule

LINK = """<link name="{name}"><collision><origin xyz="0.15 0 0"/><geometry><box size="0.3 0.04 0.04"/></geometry>
</collision></link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0.4 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>"""
SRDF = '<robot name="{robot}"><disable_collisions link1="{one}" link2="{other}" reason="Never"/>{more}</robot>'


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> hk.Robot:
    """Four boxes in a row, one after the other."""
    names = ["one", "two", "three", "four"]
    joints = [JOINT.format(name=f"j{i}", parent=a, child=b) for i, (a, b) in enumerate(pairwise(names))]
    text = f'<robot name="row">{"".join(LINK.format(name=name) for name in names)}{"".join(joints)}</robot>'
    file = tmp_path_factory.mktemp("arm") / "row.urdf"
    file.write_text(text)
    return hk.load(str(file))


def pairs(robot: hk.Robot, scene: hk.Scene) -> set[frozenset[str]]:
    return {frozenset(names) for names in Clearances.of(robot, scene).names}


def test_an_srdf_leaves_out_its_pairs_and_no_other(arm: hk.Robot, tmp_path: Path) -> None:
    file = tmp_path / "row.srdf"
    file.write_text(SRDF.format(robot="row", one="one", other="three", more=""))
    every = pairs(arm, hk.Scene())
    assert frozenset(("one", "three")) in every
    assert every - pairs(arm, hk.Scene.from_srdf(file)) == {frozenset(("one", "three"))}
    report = hk.check(np.zeros((1, 3)), hk.Scene.from_srdf(file), robot=arm)
    assert ("one", "three", "disabled in row.srdf") in {(*sorted(p.pair), p.reason) for p in report.left_out}
    # All pairs of a link, but for one that is enabled again.
    more = '<disable_default_collisions link="four"/><enable_collisions link1="four" link2="one"/>'
    file.write_text(SRDF.format(robot="row", one="two", other="one", more=more))
    assert pairs(arm, hk.Scene.from_srdf(file)) == {frozenset(("one", "three")), frozenset(("one", "four"))}


def test_an_srdf_of_another_robot_is_refused(arm: hk.Robot, tmp_path: Path) -> None:
    file = tmp_path / "other.srdf"
    for robot, one, said in (("ur10", "one", "of the robot 'ur10'"), ("row", "forearm", "names no link")):
        file.write_text(SRDF.format(robot=robot, one=one, other="hand", more=""))
        with pytest.raises(RobotFileError, match=said):
            hk.check(np.zeros((1, 3)), hk.Scene.from_srdf(file), robot=arm)
    file.write_text('<robot name="row"><disable_collisions link1="one"/></robot>')
    with pytest.raises(RobotFileError, match="without link1 or link2"):
        hk.Scene.from_srdf(file)


def test_a_padded_link_must_keep_its_padding_besides_the_clearance(arm: hk.Robot) -> None:
    # A ball of 20 mm beside the last box, whose side is 20 mm from its axis: between them are 30 mm.
    ball = hk.obstacle("ball", Capsule(0.02), [1.35, 0.07, 0.0])
    q = np.zeros((2, 3))
    for padding, passes in ((0.0, True), (0.018, True), (0.022, False)):
        scene = hk.Scene([ball], clearance=0.01, padding={"four": padding})
        report = hk.check(q, scene, robot=arm)
        assert report.passed is passes
        assert Clearances.of(arm, scene).clear(q).all() == passes
        least = Clearances.of(arm, scene).least(q, 1.0)[0]
        assert least == pytest.approx(0.03 - padding, abs=1e-6)  # what is left of it
        if not passes:
            (finding,) = report.findings
            assert (set(finding.what), round(finding.value, 6), round(finding.limit, 6)) == (
                {"four", "ball"},
                0.03,
                0.032,
            )
    with pytest.raises(UnknownNameError, match="fuor"):
        hk.check(q, hk.Scene(padding={"fuor": 0.01}), robot=arm)
