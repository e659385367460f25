"""URDF files: broken bytes, missing, doubled and moved elements, odd numbers, names, encodings and very deep XML."""

from __future__ import annotations

import copy
import random
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

import holokin as hk
from benchmarks.fuzz.jobs import broken

_JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
<origin xyz="0.1 0 0.3" rpy="0 0.4 0"/><axis xyz="{4}"/>{5}</joint>"""
_LINK = """<link name="{0}"><inertial><origin xyz="0 0 0.1"/><mass value="1.5"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="package://a/b.stl"/></geometry></visual></link>"""
_LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="1"/>'
SOUND = (
    '<?xml version="1.0"?>\n<robot name="arm">'
    + "".join(_LINK.format(name) for name in "abcdefg")
    + _JOINT.format("j1", "revolute", "a", "b", "0 0 1", _LIMIT)
    + _JOINT.format("j2", "prismatic", "b", "c", "1 0 0", _LIMIT)
    + _JOINT.format("j3", "continuous", "c", "d", "0 1 0", "")
    + _JOINT.format("j4", "fixed", "d", "e", "0 1 0", "")
    + _JOINT.format("j5", "revolute", "e", "f", "0 1 1", _LIMIT + '<mimic joint="j1" multiplier="-2" offset="0.1"/>')
    + _JOINT.format("j6", "revolute", "c", "g", "0 0 1", _LIMIT)
    + "</robot>"
)
"""A tree of six joints of all kinds that are read."""

_VALUES = (
    "", "0", "1", "-1", "nan", "inf", "1e200", "-1e308", "1e400", "9" * 5000, "0 0 0", "1 2", "1 2 3 4", "a",
    "g", "j1", "j3", "revolute", "planar", "fixed", "continuous", "x" * 5000, "[/red]", "日本", "0x10", "1_0",
    "&#10;", "１",
)  # fmt: skip
_CODES = (
    "utf-8", "UTF-16", "latin-1", "cp1252", "GB2312", "Shift_JIS", "euc-jp", "no-such", "utf-7", "idna",
    "punycode", "unicode_escape", "rot13", "cp037", "utf-8-sig", "ascii", "hz", "undefined", "UTF-32",
)  # fmt: skip


def _mutated(chance: random.Random) -> bytes:
    root = ElementTree.fromstring(SOUND)
    for _ in range(chance.choice((1, 1, 2, 3))):
        every = [(parent, child) for parent in root.iter() for child in parent]
        if not every:
            break
        parent, child = chance.choice(every)
        match chance.randrange(7):
            case 0:
                parent.remove(child)
            case 1:
                parent.append(copy.deepcopy(child))
            case 2:
                chance.choice(every)[0].append(copy.deepcopy(child))
            case 3:
                child.tag = chance.choice(("joint", "link", "mimic", "axis", "limit", "origin", "x", "gazebo"))
            case 4 if child.attrib:
                del child.attrib[chance.choice(list(child.attrib))]
            case 5:
                child.text = "x" * chance.choice((1, 10_000))
            case _:
                names = [*child.attrib, "lower", "velocity", "multiplier", "rpy", "xyz", "value", "ixx", "link"]
                child.set(chance.choice(names), chance.choice(_VALUES))
    return ElementTree.tostring(root)


def _coded(chance: random.Random) -> bytes:
    code = chance.choice(_CODES)
    text = SOUND.replace('"1.0"?>', f'"1.0" encoding="{code}"?>').replace('"arm"', '"ärm 日本"')
    try:
        return text.encode(chance.choice((code, "utf-8", "gb18030", "shift_jis")), "replace")
    except (LookupError, UnicodeError):
        return text.encode("utf-8")


def _wrapped(chance: random.Random) -> bytes:
    depth = chance.choice((10, 300, 3000))
    within = chance.choice(("<x>" * depth + "</x>" * depth, "<!--" + "x" * depth + "-->", "<x>" + "y" * depth + "</x>"))
    entity = '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c SYSTEM "/etc/passwd">]>'
    text = SOUND.replace('<joint name="j1"', within + chance.choice(("", "<x>&c;</x>", "<a:b/>")) + '<joint name="j1"')
    text = text.replace('"arm"', chance.choice(('"arm"', '"&b;"', '"&c;"')))
    return text.replace("?>\n", f"?>\n{entity}").encode()


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, read for its tips and as a robot, and moved a little."""
    chance = random.Random(seed)
    kind = chance.random()
    if kind < 0.55:
        data = _mutated(chance)
    elif kind < 0.8:
        data = broken(SOUND.encode(), chance)
    elif kind < 0.9:
        data = _coded(chance)
    else:
        data = _wrapped(chance)
    file = folder / f"{chance.choice(('arm', 'arm', 'x' * 245, '[b]', 'é'))}.urdf"
    file.write_bytes(data)
    tips = hk.robot.model_tips(file)
    held = {chance.choice(("j1", "j2", "j6")): chance.choice((0.0, 0.5, 9.0, 1e300))}
    locked = held if chance.random() < 0.3 else None
    base = chance.choice(("b", "f", "e")) if chance.random() < 0.3 else None
    robot = hk.from_urdf(file, tip=chance.choice([*tips, "f"]), base=base, locked=locked)
    q = np.clip(0.1, robot.lower, robot.upper)
    found = robot.jacobian(q)
    if not (np.isfinite(found).all() and np.isfinite(robot.pose(q)).all()):
        raise ValueError("kinematics that are not finite")
    hk.position(robot)
