"""Robots from URDF files: revolute, continuous, prismatic, fixed and mimic joints."""

from __future__ import annotations

import re
import tomllib
from codecs import BOM_UTF8
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError, RobotFileError, brief, shown
from ...base.types import Matrix, Vector
from ..chains import robot_of
from ..model import Robot
from ..shapes.visuals import Finder, collision_shapes, mesh_finder, slashed, urdf_visuals
from ..tree import Branch, Follow, Mass, Tree, checked

# --- Reading the files that people write: whole, of a bounded size, and TOML that the rest of the library can take.

Refuse = Callable[[str, str, str], HolokinError]
"""(key, fact, cure) -> the error of the sort of file that is read; the key is empty for the file as a whole."""

LONGEST_TOML = 1_000_000
"""Bytes of a TOML file: a polyline of 10,000 points with every digit has 600,000."""

DEEPEST = 16
"""Levels of tables and lists in a TOML file. Jobs need four; the parser itself fails some hundreds deeper."""

LONGEST_KEY = 10
"""Parts of a dotted key, a.b.c. The parser's time grows with the square of them: a second at 10,000."""

WINDOWS = r"write paths in single quotes, 'C:\Users\me', or with /, C:/Users/me"
"""The cure of strings in which a backslash begins what TOML takes for another character, or for none."""

_ESCAPE = re.compile(r"Unescaped '\\'|Invalid hex value|not a Unicode scalar")
"""What Python's parser says of them."""

_DOTTED = re.compile(r"""[\w"'-]+(?:[ \t]*\.[ \t]*[\w"'-]+)*""")


def _read_whole(path: Path, most: int, refuse: Refuse) -> bytes:
    """The bytes of a regular file. Raises: what `refuse` makes of a missing, unreadable or longer one."""
    try:
        if path.is_dir():
            raise refuse("", "cannot be read: there is no such file, but a folder", "give a file")
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise refuse("", "cannot be read: it is no regular file", "give a file on disk")
        with path.open("rb") as stream:
            data = stream.read(most + 1)
    except (FileNotFoundError, ValueError):  # the latter for a NUL in the name
        fact = "there is no such file"
        if not str(path).isprintable():  # the \\r of a TOML string "C:\\robots"
            raise refuse("", f"{fact}, and its name has control characters", WINDOWS) from None
        raise refuse("", fact, "check the path") from None
    except OSError as problem:
        raise refuse("", f"cannot be read ({problem.strerror})", "give a file that can be read") from None
    if len(data) > most:
        raise refuse("", f"has more than {most:,} bytes", f"give a file of at most {most:,}")
    return data


def read_toml(path: Path, refuse: Refuse) -> dict[str, Any]:
    """The table of a TOML file. Raises: what `refuse` makes of a file that is none, or holds what nothing can take."""
    try:
        text = _read_whole(path, LONGEST_TOML, refuse).decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        fact = f"cannot be read: byte {problem.start + 1} is not UTF-8"
        raise refuse("", fact, "give a TOML text file, saved as UTF-8") from None
    return parse_toml(text, refuse)


def parse_toml(text: str, refuse: Refuse) -> dict[str, Any]:
    """The same of a text. TOML's whole numbers have 64 bits; Python's parser takes longer ones, which are refused."""
    for word in _DOTTED.finditer(text):
        if word.group().count(".") >= LONGEST_KEY:
            fact = f"has a dotted key of more than {LONGEST_KEY} parts"
            raise refuse(word.group(), fact, "write tables, [robot], and plain keys")
    deep = f"nests tables or lists deeper than {DEEPEST} levels"
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        cure = WINDOWS if _ESCAPE.match(str(problem)) else "correct the line it names"
        raise refuse("", f"is not TOML: {problem}", cure) from None
    except RecursionError:
        raise refuse("", deep, "take the inner ones out") from None
    except ValueError as problem:  # a whole number of more digits than Python converts, or a date that is none
        raise refuse("", f"is not TOML: {problem}", "write long numbers as 1e300") from None
    waiting: list[tuple[str, Any, int]] = [("", table, 0)]
    while waiting:
        key, value, depth = waiting.pop()
        if depth > DEEPEST:
            raise refuse(key, deep, "take the inner ones out")
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            fact = f"is {shown(value, 60)}: a whole number of more than 64 bits"
            raise refuse(key, fact, "write it like 1e30, or give a smaller one")
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        waiting += [(f"{key}.{name}" if key else str(name), inner, depth + 1) for name, inner in items]
    return table


# --- The elements of a URDF, read from its XML as frozen values.

LONGEST_URDF = 50_000_000
"""Bytes of a URDF: a hundred times those of a humanoid."""

MOST_LINKS = 20_000
"""Links, and joints, of a URDF: some seconds. A humanoid with hands has a hundred."""

_GEOMETRIES = ("box", "cylinder", "sphere", "mesh")
_SINGLE = "link joint joint/safety_controller material material/color link/visual/material link/visual/material/color"
SRDF_TAGS = ("disable_collisions", "disable_default_collisions", "enable_collisions")
"""Elements of an SRDF that say which pairs of links are looked at."""

_WANTED = {
    *_SINGLE.split(),
    *SRDF_TAGS,
    *(f"link/inertial{part}" for part in ("", "/origin", "/mass", "/inertia")),
    *(f"joint/{part}" for part in ("parent", "child", "origin", "axis", "limit", "mimic")),
    *(f"link/{shape}{part}" for shape in ("collision", "visual") for part in ("", "/origin", "/geometry")),
    *(f"link/{shape}/geometry/{kind}" for shape in ("collision", "visual") for kind in _GEOMETRIES),
}
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

    return _read_whole(Path(path), LONGEST_URDF, refuse)


def essentials(data: bytes, path: str | Path) -> ElementTree.Element:
    """The XML of a URDF's links, masses, shapes, looks and joints alone; all else is skipped.

    Blank lines and comments before <?xml ...?>, where XML has none, do no harm. Raises: RobotFileError.
    """
    # What stands before <?xml ...?> goes behind it, where it does no harm.
    before, mark, rest = data.partition(b"<?xml")
    strange = re.sub(rb"<!--.*?-->", b"", before, flags=re.DOTALL).strip(b" \t\r\n" + BOM_UTF8)
    if mark and not strange:
        declared, closed, rest = rest.partition(b"?>")
        data = mark + declared + closed + before.replace(BOM_UTF8, b"") + rest  # so that lines keep their numbers
    root: ElementTree.Element | None = None
    tags: list[str] = []
    elements: list[ElementTree.Element] = []
    counts = {"link": 0, "joint": 0}

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal root
        if tag in counts:
            counts[tag] += 1
            if counts[tag] > MOST_LINKS:
                raise RobotFileError(path, f"has more than {MOST_LINKS:,} {tag}s", "give the URDF of a robot")
        if not tags:
            root = ElementTree.Element(tag, attributes)
            elements.append(root)
        elif len(elements) == len(tags) and "/".join([*tags[1:], tag]) in _WANTED:
            elements.append(ElementTree.SubElement(elements[-1], tag, attributes))
        tags.append(tag)

    def end(_tag: str) -> None:
        if len(elements) == len(tags):
            elements.pop()
        tags.pop()

    # Read the elements that are wanted; say what is wrong with the file where it is no XML.
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
        root_tag = root.tag if root is not None else "missing"
        raise RobotFileError(path, f"is not a URDF, its root is <{brief(root_tag, 60)}>", "give a URDF of a robot")
    return root


class Part(SimpleNamespace):
    """An element of a URDF; its parts have the names that those of `yourdfpy.URDF.robot` have, missing ones are None.

    Places are poses (4, 4), sizes and axes (3,), in m and rad; an element that cannot be read is None.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return None


def model_of(root: ElementTree.Element) -> Part:
    """The robot of the XML of a URDF: its name, links, joints, materials. Raises: Misread."""
    links, joints, materials = (
        tuple(map(read, root.findall(tag)))
        for tag, read in (("link", _link), ("joint", _joint), ("material", _material))
    )
    return Part(name=_name(root), links=links, joints=joints, materials=materials)


def _name(owner: ElementTree.Element) -> str:
    name = owner.get("name")
    if name is None:
        raise Misread(
            f"is not a URDF that can be read (a <{owner.tag}> lacks its 'name')", "check it with `check_urdf`"
        )
    return name


def _link(link: ElementTree.Element) -> Part:
    collisions, visuals = (tuple(_element(link, e) for e in link.findall(tag)) for tag in ("collision", "visual"))
    name, inertial = _name(link), link.find("inertial")
    if inertial is None:
        return Part(name=name, collisions=collisions, visuals=visuals)
    # What is not written of a mass is 0, of its moments about an axis 1.
    weight, moments, inertia = inertial.find("mass"), inertial.find("inertia"), None
    if moments is not None:
        xx, yy, zz = (_number(link, moments, axes, 1.0) for axes in ("ixx", "iyy", "izz"))
        xy, xz, yz = (_number(link, moments, axes, 0.0) for axes in ("ixy", "ixz", "iyz"))
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
    mass = None if weight is None else _number(link, weight, "value", 0.0)
    body = Part(origin=_origin(link, inertial), mass=mass, inertia=inertia)
    return Part(name=name, inertial=body, collisions=collisions, visuals=visuals)


def _element(link: ElementTree.Element, element: ElementTree.Element) -> Part | None:
    """None where it cannot be read, which must not hinder the kinematics."""
    geometry, material = element.find("geometry"), element.find("material")
    if geometry is None or not len(geometry):
        return None
    try:
        solid = Part(**{geometry[0].tag: _solid(link, geometry[0])})
        look = None if material is None else _material(material)
        return Part(origin=_origin(link, element), geometry=solid, material=look)
    except Misread:
        return None


def _solid(link: ElementTree.Element, solid: ElementTree.Element) -> Part:
    if solid.tag == "mesh":
        scale = solid.get("scale", "").replace(",", " ").split()
        values = _values(link, solid, "scale", " ".join(scale * 3 if len(scale) == 1 else scale), 3) if scale else None
        return Part(filename=solid.get("filename"), scale=values)
    if solid.tag == "box":
        return Part(size=_values(link, solid, "size", solid.get("size", ""), 3))
    radius = float(_values(link, solid, "radius", solid.get("radius", ""), 1)[0])
    if solid.tag == "sphere":
        return Part(radius=radius)
    return Part(radius=radius, length=float(_values(link, solid, "length", solid.get("length", ""), 1)[0]))


def _material(material: ElementTree.Element) -> Part:
    color, rgba = material.find("color"), None
    if color is not None:
        with suppress(ValueError):
            rgba = np.array([float(word) for word in color.get("rgba", "1 1 1 1").split()])
    return Part(name=material.get("name"), color=None if color is None else Part(rgba=rgba))


def _joint(joint: ElementTree.Element) -> Part:
    name, axis, mimic = _name(joint), joint.find("axis"), joint.find("mimic")
    along = None if axis is None else _values(joint, axis, "xyz", axis.get("xyz", "1 0 0"), 3)
    limit = _limit(joint, "limit", "lower", "upper", "velocity", "effort")
    soft = _limit(joint, "safety_controller", "soft_lower_limit", "soft_upper_limit")
    follows = None
    if mimic is not None:
        gain, shift = _number(joint, mimic, "multiplier", 1.0), _number(joint, mimic, "offset", 0.0)
        follows = Part(joint=mimic.get("joint"), multiplier=gain, offset=shift)
    ends = {"parent": _end(joint, "parent"), "child": _end(joint, "child"), "origin": _origin(joint, joint)}
    limits = {"limit": limit, "safety_controller": soft}
    return Part(name=name, type=joint.get("type"), **ends, axis=along, mimic=follows, **limits)


def _end(joint: ElementTree.Element, tag: str) -> str | None:
    if (end := joint.find(tag)) is not None:
        return end.get("link")
    fact = f"is not a URDF that can be read (joint {shown(joint.get('name', ''), 100)} lacks its <{tag}>)"
    raise Misread(fact, "check it with `check_urdf`")


def _limit(joint: ElementTree.Element, tag: str, *names: str) -> Part | None:
    element = joint.find(tag)
    return None if element is None else Part(**{name: _number(joint, element, name) for name in names})


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


def _turned_joints(root: ElementTree.Element) -> dict[str, list[float]]:
    """Joints of a URDF -> the roll, pitch and yaw of their origins, where these have some."""
    turned = {
        joint.get("name", ""): origin.get("rpy") for joint in root.iter("joint") for origin in joint.iter("origin")
    }
    return {name: [float(word) for word in rpy.split()] for name, rpy in turned.items() if rpy}


@typed
def from_urdf(
    path: str | Path,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from a URDF: the chain, or chains, from `base` to `tip`.

    Limits are those of <limit>, narrowed by the soft limits of <safety_controller>, and so that all joints that mimic
    a joint are within theirs.

    Args:
        path: the file; meshes are not needed.
        tip: link that carries the tool, or several for a robot with several arms (the first is the default
            tip). Without it the tree must end in one link only.
        base: link that stays put and whose frame is used; by default the root of the tree. It may be a hand: from
            one hand of a two-armed robot to the other, the task is their relative pose and all joints share it.
        locked: joint name -> value [m or rad] of joints to hold still.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        RobotFileError: missing or malformed file, a joint type that cannot be used, limits that exclude each other, a
        branching tree without `tip`; links of over 20 m on average, which look like millimetres, or limits of most
        hinges of more than two turns, which look like degrees.
        UnknownNameError: a link or joint that the file does not have.
        ArgumentError: a locked joint that cannot move, or a value that is no number or outside its limits.
    """
    return robot_of(urdf_tree(path), tip, base, locked, trust_units)


@typed
def from_yourdfpy(
    urdf: Any,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from a `yourdfpy.URDF`; the other arguments and errors as of `from_urdf`.

    Raises:
        ArgumentError: it is none. RobotFileError, UnknownNameError.
    """
    if not all(hasattr(getattr(urdf, "robot", None), part) for part in ("name", "links", "joints")):
        raise ArgumentError("urdf", urdf, "give a yourdfpy.URDF, as yourdfpy.URDF.load(file) makes it")
    handler = getattr(urdf, "_filename_handler", None)  # what it finds its own meshes with

    def find(name: str) -> Path:
        return Path(slashed(name) if handler is None else handler(slashed(name)))

    tree = _tree(f"yourdfpy.URDF {urdf.robot.name!r}", urdf.robot, "robot", find)
    return robot_of(tree, tip, base, locked, trust_units)


def urdf_tree(path: str | Path) -> Tree:
    """The tree of a URDF. Raises: RobotFileError."""
    return urdf_text_tree(read_model(path), path)


def urdf_text_tree(text: bytes, path: str | Path) -> Tree:
    """The same of the text of a file. Raises: RobotFileError."""
    root = essentials(text, path)
    try:
        model = model_of(root)
    except Misread as e:
        raise RobotFileError(path, e.fact, e.cure) from None
    return replace(_tree(str(path), model, Path(path).stem, mesh_finder(path)), turned=_turned_joints(root))


def _tree(source: str, model: Any, name: str, find: Finder) -> Tree:
    """The tree of a robot. Raises: RobotFileError."""
    if not model.joints:
        cure = "give a URDF of a robot; a xacro file is expanded when its name ends in .xacro"
        raise RobotFileError(source, "has no joints", cure)
    links: dict[str, Mass | None] = {}
    for link in model.links:
        if link.name in links:
            cure = "correct the file: links and joints must form a tree"
            raise RobotFileError(source, f"has two links named {link.name!r}", cure)
        links[link.name] = _mass(link.inertial)
    joints = tuple(_branch(joint) for joint in model.joints)
    shapes = collision_shapes(model.links, source, find)
    visuals = urdf_visuals(model, find)
    return checked(Tree(source, str(model.name or name), links, joints, shapes=shapes, visuals=visuals))


def _branch(joint: Any) -> Branch:
    (lower, upper), speed = _range(joint), _of(joint.limit, "velocity", np.inf)
    kind, mimic = joint.type, None
    if kind == "continuous":
        kind, lower, upper = "revolute", -np.inf, np.inf
    if joint.mimic is not None:
        gain = 1.0 if joint.mimic.multiplier is None else float(joint.mimic.multiplier)
        shift = 0.0 if joint.mimic.offset is None else float(joint.mimic.offset)
        mimic = Follow(joint.mimic.joint, gain, shift)
    axis = np.asarray([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
    return Branch(
        joint.name, kind, joint.parent, joint.child, _pose(joint.origin), axis, lower, upper, speed, follows=mimic
    )


def _range(joint: Any) -> tuple[float, float]:
    """The positions within its limits, and within its soft limits, where ROS controllers and MoveIt keep it."""
    soft = joint.safety_controller
    lower = max(_of(joint.limit, "lower", -np.inf), _of(soft, "soft_lower_limit", -np.inf))
    return lower, min(_of(joint.limit, "upper", np.inf), _of(soft, "soft_upper_limit", np.inf))


def _of(element: Any, name: str, missing: float) -> float:
    value = getattr(element, name, None)
    return missing if value is None else float(value)


def _pose(origin: Any) -> Matrix:
    return np.eye(4) if origin is None else np.asarray(origin, dtype=float)


def _mass(inertial: Any) -> Mass | None:
    if getattr(inertial, "mass", None) is None:
        return None
    T = _pose(inertial.origin)
    given = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, dtype=float)
    with np.errstate(all="ignore"):  # senseless masses are told by what needs them
        return Mass(float(inertial.mass), T[:3, 3], T[:3, :3] @ given @ T[:3, :3].T)
