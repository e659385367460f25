"""What kinematics and masses need of a URDF's XML."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from ..errors import RobotFileError, brief
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


def read_model(path: str | Path) -> bytes:
    """The bytes of a URDF, a xacro or an MJCF file. Raises: RobotFileError."""

    def refuse(_key: str, fact: str, cure: str) -> RobotFileError:
        missing = fact == "there is no such file"
        return RobotFileError(path, fact, "check the path; `holokin robots` lists the catalogue" if missing else cure)

    return read_whole(Path(path), LONGEST_URDF, refuse)


def essentials(data: bytes, path: str | Path, shapes: bool = False, visuals: bool = False) -> bytes:
    """The XML of a URDF's links, masses and joints alone, with `shapes` and `visuals` these too, in UTF-8.

    All else is skipped, so the reader behind meets no mesh, no stranger's tag and no odd encoding; of a file that is
    no XML to the end it would read what it can, which may be half an arm. Raises: RobotFileError.
    """
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
            raise RobotFileError(path, "is not XML, so no URDF", "give the URDF file of a robot (.urdf)") from None
        raise RobotFileError(path, f"is not XML ({problem})", "correct the line it names") from None
    except (LookupError, ValueError) as problem:  # an encoding unknown to Python, or of several bytes a character
        raise RobotFileError(path, f"declares an encoding that is not read ({problem})", "save it as UTF-8") from None
    if root is None or root.tag != "robot":
        found = root.tag if root is not None else "missing"
        raise RobotFileError(path, f"is not a URDF, its root is <{brief(found, 60)}>", "give a URDF of a robot")
    return ElementTree.tostring(root, encoding="utf-8")
