"""Models made to fill time or memory are refused by counts, before anything is built; MuJoCo confirms the counts."""

from __future__ import annotations

import struct
import time
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import RobotFileError
from holokin.robot.formats.mjcf import sizes_of

mujoco = pytest.importorskip("mujoco")

ARM = '<body name="arm"><joint/><geom size=".1"/></body>'


def model(inside: str = "", before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{ARM}{inside}</worldbody></mujoco>"


BOMBS = {
    "replicas": (model(f'<replicate count="3000000">{ARM}</replicate>'), r"e\+06 bodies"),
    "nested replicas": (
        model('<replicate count="200"><replicate count="200"><replicate count="200"><geom size=".1"/></replicate>'
              "</replicate></replicate>"), r"e\+06 elements"),
    "a flexible body": (model('<flexcomp name="f" type="grid" count="400 400 400" spacing="1 1 1"/>'), r"e\+07 bodies"),
    "flexible bodies of ten": (model('<replicate count="100"><flexcomp name="f" type="grid"/></replicate>'), "bodies"),
    "keyframes": (model(before='<size nkey="1000000000"/>'), "<size nkey="),
    "user data": (model(before='<size nuser_body="1000000000"/>'), "<size nuser_body="),
    "a texture": (model(before='<asset><texture name="t" type="cube" builtin="flat" width="20000" height="20000"/>'
                        "</asset>"), "pixels"),
    "a field": (model(before='<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>'), "cells"),
    "a mesh": (
        model(before='<asset><mesh name="m" builtin="supersphere" params="20000 1 1"/></asset>'), "<mesh params="),
    "in a comment that is none": (
        model(f'<site name="<!--"/><replicate count="3000000">{ARM}</replicate><site name="-->"/>'),
        "bodies|is not XML"),
    "in another encoding": (
        '<?xml version="1.0" encoding="cp037"?>' + model(f'<replicate count="3000000">{ARM}</replicate>'), "bodies"),
}  # fmt: skip


@pytest.mark.parametrize("name", BOMBS)
def test_a_short_text_that_makes_a_giant_is_refused_at_once(name: str, tmp_path: Path) -> None:
    text, words = BOMBS[name]
    (tmp_path / "giant.xml").write_text(text)
    begun = time.process_time()
    with pytest.raises(RobotFileError, match=words):
        hk.load(tmp_path / "giant.xml", tip="arm")
    with pytest.raises(RobotFileError, match=words):
        hk.robot.from_mjcf(text[text.index("<mujoco") :], tip="arm")
    assert time.process_time() - begun < 2  # what is refused by hand takes minutes


def test_giants_of_several_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(model(f"{ARM.replace('arm', 'a')}" * 40).replace('name="a"', ""))
    for one, other in ("ba", "cb"):
        names = [f'<model name="{other}" file="{other}.xml"/>', f'<attach model="{other}" body="arm" prefix="']
        text = model("".join(f'{names[1]}{one}{i}"/>' for i in range(40)), f"<asset>{names[0]}</asset>")
        (tmp_path / f"{one}.xml").write_text(text)
    with pytest.raises(RobotFileError, match="bodies"):
        hk.load(tmp_path / "c.xml", tip="arm")
    declared = "<mujoco><asset><model name='b' file='b.xml'/></asset></mujoco>"
    (tmp_path / "assets.xml").write_text(declared)
    attached = "".join(f'<attach model="b" body="arm" prefix="{i}"/>' for i in range(60))
    (tmp_path / "d.xml").write_text(model(attached, '<include file="assets.xml"/>'))
    with pytest.raises(RobotFileError, match="bodies"):
        hk.load(tmp_path / "d.xml", tip="arm")
    itself = '<asset><model name="e" file="e.xml"/></asset>'
    (tmp_path / "e.xml").write_text(model('<attach model="e" body="arm" prefix="x"/>' * 3, itself))
    with pytest.raises(RobotFileError, match=r"attaches e\.xml to itself"):
        hk.load(tmp_path / "e.xml", tip="arm")
    (tmp_path / "f.xml").write_text(f'<mujoco><worldbody>{ARM}</worldbody><include file="f.xml"/></mujoco>')
    with pytest.raises(RobotFileError):
        hk.load(tmp_path / "f.xml", tip="arm")


def test_a_picture_of_few_bytes_and_many_pixels_is_refused(tmp_path: Path) -> None:
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 60_000, 60_000)
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "t.png").write_bytes(head + bytes(100))
    text = '<compiler texturedir="pictures"/><asset><texture name="t" type="2d" file="t.png"/></asset>'
    (tmp_path / "arm.xml").write_text(model(before=text))
    with pytest.raises(RobotFileError, match=r"3.6e\+09 pixels"):
        hk.load(tmp_path / "arm.xml", tip="arm")


@pytest.mark.parametrize("seed", range(8))
def test_the_counts_are_those_of_mujoco(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)

    def grown(depth: int) -> str:
        parts = [f'<body pos="0 0 {rng.random():.2f}"><geom size=".1"/>{grown(depth - 1) if depth else ""}</body>']
        if depth and rng.random() < 0.7:
            parts.append(f'<replicate count="{rng.integers(1, 6)}">{grown(depth - 1)}</replicate>')
        if rng.random() < 0.3:
            parts.append("<!-- -- a comment -- with hyphens -->")
        return "".join(parts)

    (tmp_path / "part.xml").write_text(f"<mujoco><worldbody><body name='p'>{grown(2)}</body></worldbody></mujoco>")
    attached = "".join(f"<attach model='part' body='p' prefix='{i}'/>" for i in range(rng.integers(1, 4)))
    asset = "<asset><model name='part' file='part.xml'/></asset>"
    (tmp_path / "whole.xml").write_text(f"<mujoco>{asset}<worldbody>{grown(3)}{attached}</worldbody></mujoco>")
    made = mujoco.MjSpec.from_file(str(tmp_path / "whole.xml")).compile()
    counted = sizes_of((tmp_path / "whole.xml").read_bytes(), "whole.xml", tmp_path)
    assert counted.bodies == made.nbody - 1  # but for the world
    count = " ".join(map(str, rng.integers(2, 5, 3)))
    grid = f'type="grid" count="{count}" spacing="1 1 1" dim="3" radius=".01"'
    flexible = model(f'<flexcomp name="f" {grid}><pin id="0"/></flexcomp>')
    assert sizes_of(flexible.encode(), "", tmp_path).bodies >= mujoco.MjModel.from_xml_string(flexible).nbody - 1


def test_a_urdf_of_entities_or_of_a_million_links_is_refused(tmp_path: Path) -> None:
    entities = "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12))
    laughs = f'<!DOCTYPE r [<!ENTITY a "ha">{entities}]><robot name="r">&m;</robot>'
    many = f'<robot name="r">{"".join(f"""<link name="l{i}"/>""" for i in range(100_000))}</robot>'
    begun = time.process_time()
    for text, words in ((laughs, "amplification"), (many, "more than 20,000 links")):
        (tmp_path / "giant.urdf").write_text(text)
        with pytest.raises(RobotFileError, match=words):
            hk.load(tmp_path / "giant.urdf")
    assert time.process_time() - begun < 2
