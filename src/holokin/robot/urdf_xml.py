"""What kinematics and masses need of a URDF's XML."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from ..errors import RobotFileError, brief, shown
from .text_files import read_whole

LONGEST_URDF = 50_000_000
"""Bytes of a URDF: a hundred times those of a humanoid."""

MOST_LINKS = 20_000
"""Links, and joints, of a URDF: some seconds. A humanoid with hands has a hundred."""

_KEPT = {
    "link", "link/inertial", *(f"link/inertial/{part}" for part in ("origin", "mass", "inertia")),
    "joint", *(f"joint/{part}" for part in ("parent", "child", "origin", "axis", "limit", "mimic")),
    "joint/safety_controller",
}  # fmt: skip
"""The elements of a URDF that kinematics and masses need."""

_SHAPES = {
    "link/collision", "link/collision/origin", "link/collision/geometry",
    *(f"link/collision/geometry/{kind}" for kind in ("box", "cylinder", "sphere", "mesh")),
}  # fmt: skip
"""Those of the shapes of links."""

_VISUALS = {
    "material", "material/color", *(shape.replace("collision", "visual") for shape in _SHAPES),
    "link/visual/material", "link/visual/material/color",
}  # fmt: skip
"""Those of what links look like, but for textures."""

_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3}, "axis": {"xyz": 3}, "limit": {"lower": 1, "upper": 1, "velocity": 1, "effort": 1},
    "mimic": {"multiplier": 1, "offset": 1}, "safety_controller": {"soft_lower_limit": 1, "soft_upper_limit": 1},
    "mass": {"value": 1}, "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "sphere": {"radius": 1},
}  # fmt: skip
"""Elements of a URDF -> their attributes that are numbers, and how many."""


class Misread(ValueError):
    """An attribute of a URDF that is no numbers, or not as many as it must be: the fact and the cure."""

    def __init__(self, fact: str, cure: str) -> None:
        self.fact, self.cure = fact, cure
        super().__init__(fact)


def read_model(path: str | Path) -> bytes:
    """The bytes of a URDF, a xacro or an MJCF file. Raises: RobotFileError."""

    def refuse(_key: str, fact: str, cure: str) -> RobotFileError:
        missing = fact == "there is no such file"
        return RobotFileError(path, fact, "check the path; `holokin robots` lists the catalogue" if missing else cure)

    return read_whole(Path(path), LONGEST_URDF, refuse)


def essentials(data: bytes, path: str | Path, shapes: bool = False, visuals: bool = False) -> ElementTree.Element:
    """The XML of a URDF's links, masses and joints alone, with `shapes` and `visuals` these too.

    All else is skipped, so the reader behind meets no mesh, no stranger's tag and no odd encoding; of a file that is
    no XML to the end it would read what it can, which may be half an arm. Blank lines and comments before <?xml ...?>,
    where XML has none, do no harm. Raises: RobotFileError.
    """
    before, mark, rest = data.partition(b"<?xml")
    strange = re.sub(rb"<!--.*?-->", b"", before, flags=re.DOTALL).strip(b" \t\r\n" + BOM_UTF8)
    if mark and not strange:
        declared, closed, rest = rest.partition(b"?>")
        data = mark + declared + closed + before.replace(BOM_UTF8, b"") + rest  # so that lines keep their numbers
    wanted = _KEPT | (_SHAPES if shapes else set()) | (_VISUALS if visuals else set())
    root: ElementTree.Element | None = None
    tags: list[str] = []
    kept: list[ElementTree.Element] = []
    counts = {"link": 0, "joint": 0}

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal root
        if tag in counts:
            counts[tag] += 1
            if counts[tag] > MOST_LINKS:
                raise RobotFileError(path, f"has more than {MOST_LINKS:,} {tag}s", "give the URDF of a robot")
        if not tags:
            root = ElementTree.Element(tag, attributes)
            kept.append(root)
        elif len(kept) == len(tags) and "/".join([*tags[1:], tag]) in wanted:
            kept.append(ElementTree.SubElement(kept[-1], tag, attributes))
        tags.append(tag)

    def end(_tag: str) -> None:
        if len(kept) == len(tags):
            kept.pop()
        tags.pop()

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(data, True)
    except expat.ExpatError as problem:
        if root is None:
            cure = "give the URDF file of a robot (.urdf)"
            cure = (
                f"delete what stands before its <?xml ...?>, {shown(strange.decode(errors='replace'), 60)}"
                if mark and strange
                else cure
            )
            raise RobotFileError(path, f"is not XML, so no URDF ({problem})", cure) from None
        raise RobotFileError(path, f"is not XML ({problem})", "correct the line it names") from None
    except (LookupError, ValueError) as problem:  # an encoding unknown to Python, or of several bytes a character
        raise RobotFileError(path, f"declares an encoding that is not read ({problem})", "save it as UTF-8") from None
    if root is None or root.tag != "robot":
        found = root.tag if root is not None else "missing"
        raise RobotFileError(path, f"is not a URDF, its root is <{brief(found, 60)}>", "give a URDF of a robot")
    return root


def check_numbers(root: ElementTree.Element) -> None:
    """Raises: Misread: an attribute of a link or a joint is not as many numbers as it must be."""
    for owner in root:
        for element in owner.iter():
            for name, count in _NUMBERS.get(element.tag, {}).items():
                if (text := element.get(name)) is not None and (found := _misread(text, count)):
                    where = (
                        f"{owner.tag} {shown(owner.get('name', ''), 100)} has <{element.tag} {name}={shown(text, 100)}>"
                    )
                    raise Misread(f"{where}, {found[0]}", found[1])


def all_threes(root: ElementTree.Element) -> bool:
    """Whether all vectors have three numbers: yourdfpy takes the first three of four."""
    tags = ("origin", "axis", "box")
    texts = (element.get(name, "0 0 0") for tag in tags for element in root.iter(tag) for name in _NUMBERS[tag])
    return all(len(text.split()) == 3 for text in texts)


def _misread(text: str, count: int) -> tuple[str, str] | None:
    """Why a text is not so many numbers, and the cure; None where it is."""
    words = text.split()
    try:
        found = len([float(word) for word in words])
    except ValueError:
        if "${" in text or "$(" in text:
            return "an expression of xacro", "expand it: give the file a name that ends in .xacro; or write the numbers"
        if "," in text:
            return "with a comma", "write a decimal point, and blanks between numbers"
        return "which is no number" if count == 1 else "which are no numbers", "write plain numbers, in m and rad"
    if found == count:
        return None
    said = f"{found} number{'s' * (found != 1)} where {count} must stand" if found else "without a number"
    return said, "write three numbers with blanks between them" if count == 3 else "write one number"


def turned_joints(root: ElementTree.Element) -> dict[str, list[float]]:
    """Joints of a URDF -> the roll, pitch and yaw of their origins, where these have some."""
    found = {
        joint.get("name", ""): origin.get("rpy") for joint in root.iter("joint") for origin in joint.iter("origin")
    }
    return {name: [float(word) for word in rpy.split()] for name, rpy in found.items() if rpy}
