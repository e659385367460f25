"""The elements of a URDF, read from its XML as frozen values."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from ...base.errors import RobotFileError, brief, shown
from ...base.types import Matrix, Vector
from .text_files import read_whole

LONGEST_URDF = 50_000_000
"""Bytes of a URDF: a hundred times those of a humanoid."""

MOST_LINKS = 20_000
"""Links, and joints, of a URDF: some seconds. A humanoid with hands has a hundred."""

_WANTED = {
    "link", "link/inertial", *(f"link/inertial/{part}" for part in ("origin", "mass", "inertia")),
    "joint", *(f"joint/{part}" for part in ("parent", "child", "origin", "axis", "limit", "mimic")),
    "joint/safety_controller",
    *(f"link/{shape}{part}" for shape in ("collision", "visual") for part in ("", "/origin", "/geometry")),
    *(f"link/{shape}/geometry/{kind}" for shape in ("collision", "visual")
      for kind in ("box", "cylinder", "sphere", "mesh")),
    "material", "material/color", "link/visual/material", "link/visual/material/color",
}  # fmt: skip
"""The elements of a URDF that are read: kinematics, masses, shapes, and what links look like but for textures."""


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


def essentials(data: bytes, path: str | Path) -> ElementTree.Element:
    """The XML of a URDF's links, masses, shapes, looks and joints alone; all else is skipped.

    Blank lines and comments before <?xml ...?>, where XML has none, do no harm. Raises: RobotFileError.
    """
    before, mark, rest = data.partition(b"<?xml")
    strange = re.sub(rb"<!--.*?-->", b"", before, flags=re.DOTALL).strip(b" \t\r\n" + BOM_UTF8)
    if mark and not strange:
        declared, closed, rest = rest.partition(b"?>")
        data = mark + declared + closed + before.replace(BOM_UTF8, b"") + rest  # so that lines keep their numbers
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
        elif len(kept) == len(tags) and "/".join([*tags[1:], tag]) in _WANTED:
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


@dataclass(frozen=True, eq=False)
class Solid:
    """What stands in a <geometry>: a box of a size (3,), a cylinder, a sphere or a mesh in a file; [m]."""

    size: Vector | None = None
    radius: float | None = None
    length: float | None = None
    filename: str | None = None
    scale: Vector | None = None


@dataclass(frozen=True)
class Geometry:
    """A <geometry>, of one of four kinds."""

    box: Solid | None = None
    cylinder: Solid | None = None
    sphere: Solid | None = None
    mesh: Solid | None = None


@dataclass(frozen=True, eq=False)
class Color:
    """A <color>, None where it makes no sense."""

    rgba: Vector | None


@dataclass(frozen=True)
class Material:
    """A <material>."""

    name: str | None
    color: Color | None


@dataclass(frozen=True, eq=False)
class Element:
    """A <collision> or a <visual>."""

    origin: Matrix | None
    geometry: Geometry
    material: Material | None


@dataclass(frozen=True, eq=False)
class Inertial:
    """An <inertial>."""

    origin: Matrix | None
    mass: float | None
    inertia: Matrix | None


@dataclass(frozen=True)
class Link:
    """A <link>; an element that cannot be read is None."""

    name: str
    inertial: Inertial | None
    collisions: tuple[Element | None, ...]
    visuals: tuple[Element | None, ...]


@dataclass(frozen=True)
class Limit:
    """A <limit>, or the soft limits of a <safety_controller>."""

    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None
    soft_lower_limit: float | None = None
    soft_upper_limit: float | None = None


@dataclass(frozen=True)
class Mimic:
    """A <mimic>."""

    joint: str | None
    multiplier: float | None
    offset: float | None


@dataclass(frozen=True, eq=False)
class Joint:
    """A <joint>."""

    name: str
    type: str | None
    parent: str | None
    child: str | None
    origin: Matrix | None
    axis: Vector | None
    limit: Limit | None
    mimic: Mimic | None
    safety_controller: Limit | None


@dataclass(frozen=True)
class Model:
    """A <robot>. Its parts have the names that those of `yourdfpy.URDF.robot` have."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    materials: tuple[Material, ...]


def model_of(root: ElementTree.Element) -> Model:
    """The robot of the XML of a URDF. Raises: Misread."""
    name = _name(root)
    links, joints = tuple(map(_link, root.findall("link"))), tuple(map(_joint, root.findall("joint")))
    return Model(name, links, joints, tuple(map(_material, root.findall("material"))))


def _name(owner: ElementTree.Element) -> str:
    name = owner.get("name")
    if name is None:
        raise Misread(
            f"is not a URDF that can be read (a <{owner.tag}> lacks its 'name')", "check it with `check_urdf`"
        )
    return name


def _link(link: ElementTree.Element) -> Link:
    name, inertial = _name(link), link.find("inertial")
    collisions, visuals = (tuple(_element(link, e) for e in link.findall(tag)) for tag in ("collision", "visual"))
    return Link(name, None if inertial is None else _inertial(link, inertial), collisions, visuals)


def _inertial(link: ElementTree.Element, inertial: ElementTree.Element) -> Inertial:
    """What is not written of a mass is 0, of its moments about an axis 1."""
    origin, weight, moments = _origin(link, inertial), inertial.find("mass"), inertial.find("inertia")
    mass = None if weight is None else _number(link, weight, "value", 0.0)
    if moments is None:
        return Inertial(origin, mass, None)
    xx, yy, zz = (_number(link, moments, name, 1.0) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (_number(link, moments, name, 0.0) for name in ("ixy", "ixz", "iyz"))
    return Inertial(origin, mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float))


def _element(link: ElementTree.Element, element: ElementTree.Element) -> Element | None:
    """None where it cannot be read, which must not hinder the kinematics."""
    geometry, material = element.find("geometry"), element.find("material")
    if geometry is None or not len(geometry):
        return None
    try:
        solid = Geometry(**{geometry[0].tag: _solid(link, geometry[0])})
        return Element(_origin(link, element), solid, None if material is None else _material(material))
    except Misread:
        return None


def _solid(link: ElementTree.Element, solid: ElementTree.Element) -> Solid:
    if solid.tag == "mesh":
        scale = solid.get("scale", "").replace(",", " ").split()
        values = _values(link, solid, "scale", " ".join(scale * 3 if len(scale) == 1 else scale), 3) if scale else None
        return Solid(filename=solid.get("filename"), scale=values)
    if solid.tag == "box":
        return Solid(size=_values(link, solid, "size", solid.get("size", ""), 3))
    radius = float(_values(link, solid, "radius", solid.get("radius", ""), 1)[0])
    if solid.tag == "sphere":
        return Solid(radius=radius)
    return Solid(radius=radius, length=float(_values(link, solid, "length", solid.get("length", ""), 1)[0]))


def _material(material: ElementTree.Element) -> Material:
    color, rgba = material.find("color"), None
    if color is not None:
        with suppress(ValueError):
            rgba = np.array([float(word) for word in color.get("rgba", "1 1 1 1").split()])
    return Material(material.get("name"), None if color is None else Color(rgba))


def _joint(joint: ElementTree.Element) -> Joint:
    name, axis, mimic = _name(joint), joint.find("axis"), joint.find("mimic")
    along = None if axis is None else _values(joint, axis, "xyz", axis.get("xyz", "1 0 0"), 3)
    limit = _limit(joint, "limit", "lower", "upper", "velocity", "effort")
    soft = _limit(joint, "safety_controller", "soft_lower_limit", "soft_upper_limit")
    follows = None
    if mimic is not None:
        gain, shift = _number(joint, mimic, "multiplier", 1.0), _number(joint, mimic, "offset", 0.0)
        follows = Mimic(mimic.get("joint"), gain, shift)
    parent, child = _end(joint, "parent"), _end(joint, "child")
    return Joint(name, joint.get("type"), parent, child, _origin(joint, joint), along, limit, follows, soft)


def _end(joint: ElementTree.Element, tag: str) -> str | None:
    if (end := joint.find(tag)) is not None:
        return end.get("link")
    fact = f"is not a URDF that can be read (joint {shown(joint.get('name', ''), 100)} lacks its <{tag}>)"
    raise Misread(fact, "check it with `check_urdf`")


def _limit(joint: ElementTree.Element, tag: str, *names: str) -> Limit | None:
    element = joint.find(tag)
    return None if element is None else Limit(**{name: _number(joint, element, name) for name in names})


def _origin(owner: ElementTree.Element, element: ElementTree.Element) -> Matrix | None:
    """The pose (4, 4) of an <origin>: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    origin = element.find("origin")
    if origin is None:
        return None
    xyz, rpy = (_values(owner, origin, name, origin.get(name, "0 0 0"), 3) for name in ("xyz", "rpy"))
    with np.errstate(invalid="ignore"):  # an infinite angle is told by what needs the origin
        (si, sj, sk), (ci, cj, ck) = np.sin(rpy), np.cos(rpy)
    T = np.eye(4)
    T[:3, 0] = cj * ck, cj * sk, -sj
    T[:3, 1] = sj * (si * ck) - ci * sk, sj * (si * sk) + ci * ck, cj * si
    T[:3, 2] = sj * (ci * ck) + si * sk, sj * (ci * sk) - si * ck, cj * ci
    T[:3, 3] = xyz
    return T + 0.0  # no -0


def _number(
    owner: ElementTree.Element, element: ElementTree.Element, name: str, missing: float | None = None
) -> float | None:
    text = element.get(name)
    return missing if text is None else float(_values(owner, element, name, text, 1)[0])


def _values(owner: ElementTree.Element, element: ElementTree.Element, name: str, text: str, count: int) -> Vector:
    """The numbers (count,) of an attribute of a link or a joint. Raises: Misread."""
    words = text.split()
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values, reason = None, "which is no number" if count == 1 else "which are no numbers"
        cure = "write plain numbers, in m and rad"
        if "${" in text or "$(" in text:
            reason = "an expression of xacro"
            cure = "expand it: give the file a name that ends in .xacro; or write the numbers"
        elif "," in text:
            reason, cure = "with a comma", "write a decimal point, and blanks between numbers"
    else:
        if len(values) == count:
            return values
        cure = "write three numbers with blanks between them" if count == 3 else "write one number"
        reason = (
            f"{len(words)} number{'s' * (len(words) != 1)} where {count} must stand" if words else "without a number"
        )
    where = f"{owner.tag} {shown(owner.get('name', ''), 100)} has <{element.tag} {name}={shown(text, 100)}>"
    raise Misread(f"{where}, {reason}", cure)


def turned_joints(root: ElementTree.Element) -> dict[str, list[float]]:
    """Joints of a URDF -> the roll, pitch and yaw of their origins, where these have some."""
    found = {
        joint.get("name", ""): origin.get("rpy") for joint in root.iter("joint") for origin in joint.iter("origin")
    }
    return {name: [float(word) for word in rpy.split()] for name, rpy in found.items() if rpy}
