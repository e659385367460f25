"""False certificates about shapes, with the right SHA-256: each is rejected, or said to be about something else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from forged import Data, cells, changed, sealed
from holokin.base.errors import ArgumentError
from holokin.proof.recheck import recheck
from holokin.robot import Box, Capsule, Hull, LinkShape, with_capsules

pytest.importorskip("flint")

START = np.array([0.3, 0.9, 0.9])
WALL = hk.obstacle("wall", Box(np.array([0.1, 3.0, 1.0])), (-1.0, 0.0, 0.0))
POST = hk.obstacle("post", Capsule(0.05, 0.5), (1.2, -0.6, 0.0))


@pytest.fixture(scope="module")
def arm() -> hk.Robot:
    """A planar arm whose first link has two shapes, beside a base; it carries a gripper."""
    clad = with_capsules(hk.load("planar-3r"), 0.05)
    first = next(shape for shape in clad.shapes if shape.joint == 0)
    hump = np.random.default_rng(0).normal(size=(200, 3))
    hump = Hull(0.08 * hump / np.linalg.norm(hump, axis=1, keepdims=True))
    base = LinkShape("foot", -1, np.eye(4), Box(np.array([0.2, 0.2, 0.05])))
    return replace(clad, shapes=(*clad.shapes, replace(first, shape=hump), base))


@pytest.fixture(scope="module")
def proof(arm: hk.Robot) -> hk.proof.Certificate:
    held = hk.robot.with_shape(arm, "gripper", Box(np.array([0.05, 0.05, 0.05])))
    G = hk.holonomic(hk.position(held), hk.linear([[0, 1, -1]]))
    space = hk.workspace(box=(arm.pose(START)[:3, 3], [0.01, 0.01, 0.0]))
    found = hk.certify(G, space, START, scene=hk.Scene([WALL, POST], floor=-0.3))
    assert found.whole
    return found


def said(data: Data, file: Path, robot: hk.Robot) -> tuple[bool, str]:
    file.write_text(sealed(data), "utf-8")
    return recheck(file, robot=robot)


def shape(data: Data, link: str, number: int = 0) -> Data:
    return [s for s in data["clear"]["shapes"] if s["link"] == link][number]


def pairs(data: Data, *links: str) -> list[Data]:
    return [pair for pair in data["clear"]["pairs"] if sorted(pair["names"]) == sorted(links)]


def first(arm_data: Data) -> str:
    """The link with two shapes."""
    names = [s["link"] for s in arm_data["clear"]["shapes"]]
    return next(name for name in names if names.count(name) == 2)


def last(data: Data) -> str:
    return max((s for s in data["clear"]["shapes"] if s["link"] != "gripper"), key=lambda s: s["joint"])["link"]


def all_planes(data: Data, plane: list[float]) -> None:
    for cell in cells(data["pieces"][0]["cells"]):
        cell["planes"] = [plane for _ in cell["planes"]]


def without(data: Data, *which: int) -> None:
    """Some pairs are taken away, with their planes."""
    data["clear"]["pairs"] = [p for i, p in enumerate(data["clear"]["pairs"]) if i not in which]
    for cell in cells(data["pieces"][0]["cells"]):
        cell["planes"] = [p for i, p in enumerate(cell["planes"]) if i not in which]


def place(data: Data, pair: Data) -> int:
    return data["clear"]["pairs"].index(pair)


REJECTED: dict[str, Callable[[Data], Any]] = {
    "no planes": lambda d: all_planes(d, [0.0, 0.0, 0.0]),
    "a plane for all": lambda d: all_planes(d, [1.0, 0.0, 0.0]),
    "a distance that is too large": lambda d: pairs(d, "wall", last(d))[0].update(apart=3.0),
    "a distance below 0": lambda d: pairs(d, "wall", last(d))[0].update(apart=-1.0),
    "a thinner link": lambda d: shape(d, last(d)).update(radius=0.01),
    "a shorter link": lambda d: shape(d, last(d))["points"].pop(),
    "a link on another joint": lambda d: shape(d, last(d)).update(joint=0),
    "a link that stands still": lambda d: shape(d, last(d)).update(joint=-1),
    "a link as a half space": lambda d: shape(d, last(d)).update(joint=-1, normal=[0.0, 0.0, 1.0]),
    "a base that is smaller": lambda d: shape(d, "foot").update(points=[[0.0, 0.0, 0.0]]),
    "a base of another link's name": lambda d: shape(d, "foot").update(link=last(d)),
    "a link of another link's name": lambda d: shape(d, last(d)).update(link=first(d)),
    "a link of the wall's name": lambda d: shape(d, last(d)).update(link="wall"),
    "a corner of a mesh outside": lambda d: shape(d, first(d), 1)["holds"].append([1.0, 0.0, 0.0]),
    "a mesh without its corners": lambda d: shape(d, first(d), 1).update(holds=[]),
    "a mesh that is smaller": lambda d: shape(d, first(d), 1).update(radius=1e-3, holds=[]),
    "a radius below 0": lambda d: shape(d, "wall").update(radius=-0.1),
    "a longer arm": lambda d: d["clear"]["joints"][1]["origin"].__setitem__(0, 0.1),
    "an axis twice as long": lambda d: d["clear"]["joints"][1].update(axis=[0.0, 0.0, 2.0]),
    "an axis that does not turn": lambda d: d["clear"]["joints"][1].update(axis=[0.0, 0.0, 0.0]),
    "a joint of another coordinate": lambda d: d["clear"]["joints"][1].update(coordinate=0),
    "a gear": lambda d: d["clear"]["joints"][1].update(multiplier=0.0),
    "a joint that slides": lambda d: d["clear"]["joints"][1].update(kind="prismatic"),
    "a joint on the base": lambda d: d["clear"]["joints"][2].update(parent=-1),
    "a joint on one behind it": lambda d: d["clear"]["joints"][0].update(parent=2),
    "an offset": lambda d: d["clear"]["joints"][0].update(offset=0.3),
    "one of a link's shapes left out": lambda d: without(d, place(d, pairs(d, "wall", first(d))[1])),
    "one of a link's shapes twice": lambda d: pairs(d, "wall", first(d))[1].update(pairs(d, "wall", first(d))[0]),
    "names changed over": lambda d: pairs(d, "wall", last(d))[0].update(names=["post", last(d)]),
    "shapes changed over": lambda d: pairs(d, "wall", last(d))[0].update(shapes=pairs(d, "post", last(d))[0]["shapes"]),
    "a floor above the arm": lambda d: shape(d, "floor").update(points=[[0.0, 0.0, 1.0]]),
    "a floor upside down": lambda d: shape(d, "floor").update(normal=[0.0, 0.0, -1.0]),
    "a floor that is a table": lambda d: shape(d, "floor").update(link="table"),
}


@sampled(16, "name", REJECTED)
def test_a_false_certificate_about_shapes_is_rejected(
    name: str, proof: hk.proof.Certificate, arm: hk.Robot, tmp_path: Path
) -> None:
    try:
        rejected, text = said(changed(proof.data, REJECTED[name]), tmp_path / "bad.json", arm)
    except (hk.HolokinError, ValueError):  # no certificate
        return
    assert rejected, text


def _floor_to_the_side(data: Data) -> None:
    """The floor rises through the arm, and planes through its point lie so that the arm is beside it."""
    shape(data, "floor").update(points=[[0.0, -5.0, 0.5]])
    for cell in cells(data["pieces"][0]["cells"]):
        for i, pair in enumerate(data["clear"]["pairs"]):
            if "floor" in pair["names"]:
                cell["planes"][i] = [0.0, 1.0, 0.0]


def test_a_floor_is_no_point(proof: hk.proof.Certificate, arm: hk.Robot, tmp_path: Path) -> None:
    """With the point of a floor that rises through the arm, and vertical planes, nothing is verified."""
    assert said(changed(proof.data, _floor_to_the_side), tmp_path / "bad.json", arm)[0]


OTHER_WORDS: dict[str, tuple[Callable[[Data], Any], str]] = {
    "another wall": (lambda d: shape(d, "wall").update(points=[[-2.0, 0.0, 0.0]]), "wall stands still: -2 to -2 x"),
    "another post": (lambda d: shape(d, "post").update(radius=0.01), "post stands still: 1.19 to 1.21 x"),
    "a corner of the wall moved in": (lambda d: shape(d, "wall")["points"][0].__setitem__(1, 1.0), ""),
    "a corner of the gripper moved in": (lambda d: shape(d, "gripper")["points"][0].__setitem__(1, 0.0), ""),
    "a floor that is a point": (lambda d: shape(d, "floor").update(normal=[]), "floor stands still: 0 to 0"),
    "a wall that is not looked at": (
        lambda d: without(d, *(place(d, pair) for pair in d["clear"]["pairs"] if "wall" in pair["names"])),
        "it says nothing of 7 pairs",
    ),
    "a smaller distance": (lambda d: pairs(d, "wall", last(d))[0].update(apart=0.001), "0.001 m claimed"),
    "another gripper": (lambda d: shape(d, "gripper").update(link="pen"), "its own is pen (SHA-256"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHER_WORDS)
def test_a_certificate_about_something_else_is_verified_in_other_words(
    name: str, proof: hk.proof.Certificate, arm: hk.Robot, tmp_path: Path
) -> None:
    """What stands around the robot, and which pairs are looked at, is the file's: the checker tells it."""
    change, words = OTHER_WORDS[name]
    if name == "another gripper":
        old = change

        def change(data: Data) -> None:
            old(data)
            for pair in data["clear"]["pairs"]:
                pair["names"] = ["pen" if name == "gripper" else name for name in pair["names"]]

    good, text = said(proof.data, tmp_path / "good.json", arm)
    assert not good and (words not in text or not words)
    rejected, other = said(changed(proof.data, change), tmp_path / "other.json", arm)
    assert not rejected and words in other, other
    assert other != text


def test_the_checker_tells_of_which_pairs_nothing_is_said(
    proof: hk.proof.Certificate, arm: hk.Robot, tmp_path: Path
) -> None:
    """Of parent and child; the foot does not move against what stands still."""
    text = said(proof.data, tmp_path / "good.json", arm)[1]
    left = proof.demands.clear.looked_at.left_out
    assert len(left) == 3 and f"it says nothing of {len(left)} pairs" in text
    for one in left:
        assert " and ".join(sorted(one.pair)) in text
    assert "its own is gripper (SHA-256" in text


def test_what_stands_around_is_not_called_as_a_link(proof: hk.proof.Certificate, arm: hk.Robot) -> None:
    name = arm.shapes[0].link
    with pytest.raises(ArgumentError, match="no link"):
        hk.certify(proof.equation.strategy, proof.asked, START, scene=hk.Scene(obstacles=[replace(WALL, link=name)]))


def test_shapes_that_are_stretched_by_their_frames_are_refused(proof: hk.proof.Certificate) -> None:
    """Twice the frame is twice the points, but not twice the radius."""
    big = replace(POST, placement=POST.placement @ np.diag([2.0, 2.0, 2.0, 1.0]))
    with pytest.raises(ArgumentError, match="rotation"):
        hk.certify(proof.equation.strategy, proof.asked, START, scene=hk.Scene(obstacles=[big]))


def test_bounds_in_the_theorem_are_rounded_to_the_side_on_which_they_are_true(
    proof: hk.proof.Certificate, arm: hk.Robot
) -> None:
    """Over many clearances of walls no distance in words is larger than the one that is proven."""
    clear = proof.demands.clear
    for far in np.linspace(0.1, 0.2, 37):
        told = clear.words(np.full((1, len(clear.pairs)), far))
        assert far - 1e-3 < float(told.split(" m or more")[0].split()[-1]) <= far


def test_links_without_a_shape_are_named_in_the_theorem(arm: hk.Robot) -> None:
    """Of a robot whose last link has none."""
    bare = replace(arm, shapes=tuple(s for s in arm.shapes if s.joint < 2))
    G = hk.holonomic(hk.position(bare), hk.linear([[0, 1, -1]]))
    space = hk.workspace(box=(arm.pose(START)[:3, 3], [0.005, 0.005, 0.0]))
    found = hk.certify(G, space, START, scene=hk.Scene(obstacles=[WALL], clearance=0.01))
    assert found.whole and f"nothing is said of {bare.joint_names[2]}" in found.theorem
