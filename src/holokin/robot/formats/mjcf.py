"""Robots from MJCF, MuJoCo's format: files, texts, and models that are there already. Extra `mujoco`."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError, brief
from ...base.extra_module import extra_module
from ..chains import JointValues, robot_of, with_limits
from ..model import Robot
from ..shapes.link_shapes import LinkShape, Unread
from ..shapes.visuals import geom_shapes, mjcf_visuals, slashed, transform
from ..tree import MOVING, Branch, Follow, Loop, Mass, Tree, checked, motion
from .urdf import LONGEST_URDF, read_model

# --- How large a model an MJCF text makes, counted before MuJoCo builds it: a few words can ask for millions of bodies.

MOST_BODIES = 3_000
"""Bodies of a model, replicas and points of flexible bodies included: some seconds. MuJoCo's time grows fast."""

MOST_ELEMENTS = 50_000
"""Elements of a model, replicas included; a humanoid with its meshes has a thousand."""

MOST_CELLS = 400_000_000
"""Pixels of all textures, and cells of all height fields, together: twenty textures of 4,096 x 4,096."""

MOST_OF_SIZE = 10_000
"""The largest number in <size>: of keyframes, of user data of each element."""

MOST_OF_SHAPE = 300
"""The largest number in the parameters of a mesh that MuJoCo makes: a sphere of 300 x 300 patches takes a second."""

MOST_FILES = 500_000_000
"""Bytes of all meshes, textures and height fields of a model."""

DEEPEST = 50
"""Files that include or attach files that include or attach files: real ones do so once or twice."""

_PIECE = re.compile(rb"""<!--.*?-->|<!\[CDATA\[.*?\]\]>|<(?:"[^"]*"|'[^']*'|[^<>"'])*>|[^<]+""", re.S)
"""A piece of XML as MuJoCo reads it, which allows two hyphens in a comment; expat does not."""

_NOT_COUNTED = ("memory", "nconmax", "njmax", "nstack")
"""Numbers in <size> that say what a simulation may take, which holokin does not run."""

_SIDES = 6
"""Pictures of a texture that is not flat."""

_GRID = "10 10 10"
"""Points of a <flexcomp> that does not say how many."""


@dataclass
class Sizes:
    """What is counted of a model."""

    bodies: float = 0
    elements: float = 0
    cells: float = 0
    bytes: float = 0


@dataclass
class _Scope:
    """A model while it is read: what it names, and where its files are looked for."""

    folders: list[Path]
    sizes: Sizes = field(default_factory=Sizes)
    inside: set[str] = field(default_factory=lambda: {""})
    models: dict[str, str] = field(default_factory=dict)
    attachments: list[tuple[str, float]] = field(default_factory=list)
    files: set[str] = field(default_factory=set)
    included: set[Path] = field(default_factory=set)

    def file_named(self, name: str) -> Path | None:
        """The first file of that name; MuJoCo says of one that is missing."""
        for folder in self.folders:
            for inner in sorted(self.inside):
                for word in (name, Path(name).name):
                    path = folder / inner / word
                    if word and "\0" not in str(path) and path.is_file():
                        return path
        return None


def _check_sizes(text: bytes, source: str, folder: Path) -> None:
    """Raises: RobotFileError: MJCF of more bodies, elements, pixels, bytes than a robot has, or text that is no XML.

    Args:
        folder: where the files that it names are looked for.
    """
    counted = sizes_of(text, source, folder)
    for count, most, what in (
        (counted.bodies, MOST_BODIES, "bodies, with the replicas and the points of flexible bodies"),
        (counted.elements, MOST_ELEMENTS, "elements, with the replicas"),
        (counted.cells, MOST_CELLS, "pixels of textures and cells of height fields"),
        (counted.bytes, MOST_FILES, "bytes of meshes, textures and height fields"),
    ):
        if count > most:
            raise RobotFileError(source, f"has {count:.4g} {what}", f"give a model of a robot: at most {most:,}")


def sizes_of(text: bytes, source: str, folder: Path) -> Sizes:
    """What MuJoCo would make of a text, at the most. Raises: RobotFileError: one number alone is too large; no XML."""
    return _Counter(source).model(text, [folder], 0)


class _Counter:
    """Counts a text and what it includes and attaches."""

    def __init__(self, source: str):
        self.source = source
        self.attached: dict[Path, Sizes | None] = {}
        self.weighed: set[Path] = set()

    def model(self, text: bytes, folders: list[Path], depth: int) -> Sizes:
        """The sizes of a model. Raises: RobotFileError."""
        scope = _Scope(folders)
        self._scan(text, scope, 1.0, depth)
        for name in sorted(scope.files):
            self._weigh(name, scope)
        for name, times in scope.attachments:
            part = self._part(scope.file_named(scope.models.get(name, "")), folders, depth)
            scope.sizes.bodies += times * part.bodies
            scope.sizes.elements += times * part.elements
            scope.sizes.cells += part.cells  # its files are read once
            scope.sizes.bytes += part.bytes
        return scope.sizes

    def _part(self, path: Path | None, folders: list[Path], depth: int) -> Sizes:
        if path is None:
            return Sizes()
        if path not in self.attached:
            self.attached[path] = None  # as long as it is not known
            self.attached[path] = self.model(_read(path), [path.parent, *folders], depth + 1)
        part = self.attached[path]
        if part is None:
            raise RobotFileError(self.source, f"attaches {path.name} to itself", "attach each model once")
        return part

    def _scan(self, text: bytes, scope: _Scope, times: float, depth: int) -> None:
        """Add what stands in a text, so many times."""
        if depth > DEEPEST:
            raise RobotFileError(self.source, f"has files in files, {DEEPEST} deep", "put them into one")
        sizes, stack = scope.sizes, [times]

        def start(tag: str, has: dict[str, str]) -> None:
            # How many times the element counts, with all that replicates it.
            n = stack[-1]
            stack.append(n * _product(has.get("count", "1")) if tag == "replicate" else n)
            sizes.elements += n
            sizes.bodies += n * (tag == "body")
            # Elements that make many, or lead to other files.
            if tag == "flexcomp":
                points = n * _product(has.get("count", _GRID))
                sizes.bodies, sizes.elements = sizes.bodies + points, sizes.elements + points
            elif tag == "include":
                path = scope.file_named(has.get("file", ""))
                if path is not None and path not in scope.included:  # MuJoCo refuses a second time
                    scope.included.add(path)
                    self._scan(_read(path), scope, n, depth + 1)
            elif tag == "compiler":
                scope.inside.update(has[key] for key in ("meshdir", "texturedir", "assetdir") if key in has)
            elif tag == "model":
                scope.models[has.get("name", Path(has.get("file", "")).stem)] = has.get("file", "")
            elif tag == "attach":
                scope.attachments.append((has.get("model", ""), n))
            elif tag == "size":
                self._within(tag, {key: v for key, v in has.items() if key not in _NOT_COUNTED}, MOST_OF_SIZE)
            elif tag == "mesh" and "builtin" in has:
                self._within(tag, {"params": has.get("params", "")}, MOST_OF_SHAPE)
            if tag in ("texture", "hfield"):
                pixels = _product(f"{has.get('width', '1')} {has.get('height', '1')}")
                sizes.cells += pixels * (1 if has.get("type") == "2d" else _SIDES)
                sizes.cells += _product(f"{has.get('nrow', '1')} {has.get('ncol', '1')}")
            if tag in ("mesh", "texture", "hfield", "skin", "flexcomp"):
                scope.files.update(has[key] for key in has if key.startswith("file"))

        parser = expat.ParserCreate("UTF-8")  # as MuJoCo reads it, whatever it declares
        parser.StartElementHandler, parser.EndElementHandler = start, lambda _tag: stack.pop()
        try:
            plain = _PIECE.sub(lambda piece: b"" if piece[0].startswith(b"<!--") else piece[0], text)
            parser.Parse(plain.lstrip(BOM_UTF8 + b" \t\r\n"), True)
        except expat.ExpatError as problem:
            raise RobotFileError(
                self.source, f"is no MJCF that MuJoCo reads: it is not XML ({problem})", "correct it there"
            ) from None

    def _weigh(self, name: str, scope: _Scope) -> None:
        path = scope.file_named(name)
        if path is None or path in self.weighed:
            return
        self.weighed.add(path)
        scope.sizes.bytes += path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(24)
        if head.startswith(b"\x89PNG") and len(head) == 24:
            scope.sizes.cells += float(int.from_bytes(head[16:20]) * int.from_bytes(head[20:24]))

    def _within(self, tag: str, has: dict[str, str], most: int) -> None:
        for key, words in has.items():
            if any(_product(word) > most for word in words.split()):
                fact = f"has <{tag} {brief(key, 40)}={brief(words, 40)!r}>"
                raise RobotFileError(self.source, fact, f"give at most {most:,}")


def _read(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(LONGEST_URDF)


def _product(words: str) -> float:
    """The product of the numbers of a text; what is no number, or less than 1, MuJoCo tells."""
    product = 1.0
    for word in words.split():
        with suppress(ValueError):
            product *= float(word) if float(word) >= 1 else 1.0
    return product


_FAULTS = (ValueError, RuntimeError, MemoryError)
"""What MuJoCo raises of a text that is no model: RuntimeError where memory is short, or of what it did not foresee."""

_UNKNOWN = (1.0, 0.01)
"""Mass [kg] and inertia [kg m^2] that MuJoCo gets for a body that has none without its meshes; thrown away again."""

_LONGEST_NAME = 100
"""Characters of a text that is shown as the source of a robot."""


@typed
def from_mjcf(
    model: Any,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    max_velocity: JointValues | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot from MJCF: the chain, or chains, from `base` to `tip`, read by MuJoCo.

    Joints are hinges and slides, with their `ref`; a joint equality whose polynomial is linear makes one joint follow
    another, whose range is narrowed to what the range of the first allows. MuJoCo has no speed limits: give them as
    `max_velocity`, else the robot has none. Missing meshes do no harm: then masses are those that the file gives in
    numbers, and none if a body has no such numbers.

    Args:
        model: a file, a text that begins with "<", or a `mujoco.MjModel`.
        tip: site or body that carries the tool, or several; a site that has the name of a body is "name (site)".
            Without it the tree must end in one of them only.
        base: body that stays put and whose frame is used; by default the world.
        locked: joint name -> value [m or rad] of joints to hold still.
        max_velocity: speed limits [rad/s or m/s], as of `with_limits`: one for all joints, one for each, or by name.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        MissingExtraError: mujoco is not installed.
        RobotFileError: a missing or malformed file; on the chain a free or ball joint, a joint of a closed loop
        (connect, weld, tendon), or one that follows another by a polynomial that is not linear; units as of
        `from_urdf`.
        UnknownNameError: a body, site or joint that there is not. ArgumentError.
    """
    mujoco = _mujoco_module()
    if isinstance(model, mujoco.MjModel):
        name = _text(model.names, 0) or "model"
        tree = _Reader(model, f"mujoco.MjModel {name!r}", name).tree()
    elif isinstance(model, str | Path):
        tree = mjcf_text_tree(str(model)) if str(model).lstrip().startswith("<") else mjcf_tree(model)
    else:
        raise ArgumentError("model", model, "give an MJCF file, a text of one, or a mujoco.MjModel")
    robot = robot_of(tree, tip, base, locked, trust_units)
    return robot if max_velocity is None else with_limits(robot, max_velocity=max_velocity, trust_units=trust_units)


def mjcf_tree(path: str | Path) -> Tree:
    """The tree of an MJCF file. Raises: MissingExtraError, RobotFileError."""
    _check_sizes(read_model(path), str(path), Path(path).parent)  # says what is wrong with the file itself, too
    return _compiled_tree(lambda: _mujoco_module().MjSpec.from_file(str(path)), str(path), Path(path).stem)


def mjcf_text_tree(text: str, source: str = "") -> Tree:
    """The same of a text. Raises: MissingExtraError, RobotFileError."""
    head = source or f"MJCF text {' '.join(text[:_LONGEST_NAME].split())!r}"
    _check_sizes(text.encode("utf-8", "replace"), head, Path())
    return _compiled_tree(lambda: _mujoco_module().MjSpec.from_string(text), head, "model")


def _mujoco_module() -> Any:
    """MuJoCo's Python package. Raises: MissingExtraError."""
    return extra_module("mujoco", "mujoco")


def _compiled_tree(parse: Any, source: str, name: str) -> Tree:
    """The tree of what `parse` gives, with its meshes, or where MuJoCo cannot have these, without."""
    problem: Exception | None = None
    for choice in (_no_files, _missing_files, _all_files):
        spec = _parsed(parse, source)
        lost = choice(spec)
        geoms = [
            [geom for geom in body.geoms if choice is _all_files or lost & ({geom.meshname, geom.hfieldname} - {""})]
            for body in spec.bodies
        ]
        bodies = [body.name or f"body {i}" for i, body in enumerate(spec.bodies)]
        bare = [name for name, of in zip(bodies, geoms, strict=True) if any(g.contype or g.conaffinity for g in of)]
        try:
            weighed = choice is _no_files or _without_shapes(spec, geoms, lost)
            model = spec.compile()
            break
        except _FAULTS as fault:
            problem = fault
    else:
        raise RobotFileError(source, f"is no MJCF that MuJoCo takes ({problem})", "correct it there")
    named = spec.modelname not in ("", "MuJoCo Model")
    tree = _Reader(model, source, spec.modelname if named else name).tree()
    why = "its meshes are not there" if choice is _missing_files else f"MuJoCo does not take its shapes ({problem})"
    shapes, unread = dict(tree.shapes), Unread(source, why)
    for link in bare:
        shape = LinkShape(link, -1, np.eye(4), unread, obstacle=link == bodies[0])
        shapes[link] = (*shapes.get(link, ()), shape)
    tree = replace(tree, shapes=shapes)
    return tree if weighed else replace(tree, links=dict.fromkeys(tree.links))


def _no_files(spec: Any) -> set[str]:
    """The names of no meshes."""
    return set()


def _all_files(spec: Any) -> set[str]:
    """The names of all meshes and height fields."""
    return {_name(asset) for asset in (*spec.meshes, *spec.hfields)}


def _missing_files(spec: Any) -> set[str]:
    """The names of the meshes and height fields whose files are not there."""
    folder = Path(spec.modelfiledir) / slashed(spec.meshdir)
    files = [(asset, Path(slashed(asset.file))) for asset in (*spec.meshes, *spec.hfields) if asset.file]
    return {_name(asset) for asset, file in files if not (folder / (file.name if spec.strippath else file)).is_file()}


def _name(asset: Any) -> str:
    """Of a mesh or a height field: by default that of its file."""
    return asset.name or Path(slashed(asset.file)).stem


def _parsed(parse: Any, source: str) -> Any:
    try:
        return parse()
    except _FAULTS as problem:
        raise RobotFileError(source, f"is no MJCF that MuJoCo reads ({problem})", "correct it there") from None


def _without_shapes(spec: Any, geoms: Sequence[Sequence[Any]], lost: set[str]) -> bool:
    """Take some geoms of each body and meshes out of a spec, and whatever could need a file or them.

    Returns:
        True if masses are known all the same: every body that moves and loses a shape has its mass in numbers.
    """
    losing = [body for body, of in zip(spec.bodies, geoms, strict=True) if of]
    weighed = all(body.explicitinertial or body not in losing for body in _moving(spec.worldbody))
    for kind in ("sensors", "actuators", "keys", "pairs", "skins", "flexes"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    gone = [asset for asset in (*spec.meshes, *spec.hfields) if _name(asset) in lost]
    for element in [*(geom for of in geoms for geom in of), *gone]:
        spec.delete(element)
    for element in [*spec.sites, *spec.tendons, *spec.geoms]:
        element.material = ""
    for kind in ("materials", "textures"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    if not weighed or not list(spec.geoms):
        spec.compiler.inertiafromgeom = 0
    for body in spec.bodies[1:]:
        if not body.explicitinertial and list(body.joints) and (not weighed or not list(body.geoms)):
            body.mass, body.inertia = _UNKNOWN[0], [_UNKNOWN[1]] * 3
            body.ipos, body.explicitinertial = [0, 0, 0], True
    return weighed


def _moving(body: Any, carried: bool = False) -> Iterator[Any]:
    """The bodies below one that have a joint, or are carried by one that has."""
    for child in body.bodies:
        moves = carried or bool(list(child.joints))
        if moves:
            yield child
        yield from _moving(child, moves)


class _Reader:
    """The tree of an MjModel: bodies are links, sites hang on them, each joint moves a frame of its body."""

    def __init__(self, model: Any, source: str, name: str):
        self.model, self.source, self.name, self.enums = model, source, name, _mujoco_module()
        self.bodies = self._names("body", model.nbody)
        self.joints = self._names("jnt", model.njnt)
        self.links: dict[str, Mass | None] = {}
        self.branches: list[Branch] = []

    def tree(self) -> Tree:
        """All bodies, joints and sites as a tree of links. Raises: RobotFileError."""
        m = self.model
        follows, fixed, bent = self._couplings()
        for body, name in enumerate(self.bodies):
            self.links[name] = _mass(m, body)
        for body, name in enumerate(self.bodies):
            if body:
                self._body(body, name, follows, fixed, bent)
        sites = self._names("site", m.nsite)
        for site, name in enumerate(sites):
            label = f"{name} (site)" if name in self.links else name
            self.links[label] = None
            parent, origin = self.bodies[m.site_bodyid[site]], transform(m.site_pos[site], m.site_quat[site])
            self.branches.append(Branch(f"to {label}", "fixed", parent, label, origin))
        loops = tuple(Loop(text, joints) for text, joints in self._loops() if joints)
        shapes = geom_shapes(m, self.enums, self.source, self.bodies, self._names("geom", m.ngeom))
        branches, visuals = tuple(self.branches), mjcf_visuals(m, self.enums, self.bodies)
        return checked(Tree(self.source, self.name, self.links, branches, loops, "body or site", shapes, visuals))

    def _body(self, body: int, name: str, follows: Mapping, fixed: Mapping, bent: Mapping) -> None:
        """T_parent_child = T(pos, quat), then for each joint T(anchor) M(q - ref) T(-anchor), as MuJoCo does."""
        m = self.model
        parent, origin = self.bodies[m.body_parentid[body]], transform(m.body_pos[body], m.body_quat[body])
        first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
        for k in range(first, first + count):
            # The frame that the joint moves, with its kind and its limits.
            label = self.joints[k]
            child = f"{name} moved by {label}"
            anchor, back = np.eye(4), np.eye(4)
            kind = self.enums.mjtJoint(m.jnt_type[k]).name.removeprefix("mjJNT_").lower()
            if kind == "hinge":
                anchor[:3, 3], back[:3, 3] = m.jnt_pos[k], -m.jnt_pos[k]
            kind = {"hinge": "revolute", "slide": "prismatic"}.get(kind, kind)
            lower, upper = map(float, m.jnt_range[k]) if m.jnt_limited[k] else (-np.inf, np.inf)
            kind += bent.get(k, "")
            branch = Branch(
                label,
                kind,
                parent,
                child,
                origin @ anchor,
                m.jnt_axis[k],
                lower,
                upper,
                zero=float(m.qpos0[m.jnt_qposadr[k]]),
                follows=follows.get(k),
            )
            # A joint that an equality holds at a constant stands still.
            if k in fixed and kind in MOVING:
                held = branch.origin @ motion(kind, branch.axis, fixed[k])
                branch = replace(branch, kind="fixed", origin=held)
            self.branches.append(branch)
            self.links[child] = None
            parent, origin = child, back
        self.branches.append(Branch(f"to {name}", "fixed", parent, name, origin))

    def _couplings(self) -> tuple[dict[int, Follow], dict[int, float], dict[int, str]]:
        """Joints that follow others, that are held by a constant, and that follow by what is not linear."""
        m, follows, fixed, bent = self.model, {}, {}, {}
        for e in self._equalities("JOINT"):
            joint, master, law = int(m.eq_obj1id[e]), int(m.eq_obj2id[e]), m.eq_data[e][:5]
            if np.any(law[2:]) and master >= 0:
                bent[joint] = (
                    f" that follows {self.joints[master]!r} by a polynomial of degree {np.max(np.nonzero(law))}"
                )
            elif master < 0:
                fixed[joint] = float(law[0])
            else:
                follows[joint] = Follow(self.joints[master], float(law[1]), float(law[0]))
        return follows, fixed, bent

    def _loops(self) -> Iterator[tuple[str, frozenset[str]]]:
        """What closes a loop, and the joints round it. What is tied to a mocap body is dragged, not part of a loop."""
        m = self.model
        for word in ("CONNECT", "WELD"):
            for e in self._equalities(word):
                ends = [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
                if m.eq_objtype[e] == self.enums.mjtObj.mjOBJ_SITE:
                    ends = [int(m.site_bodyid[end]) for end in ends]
                if all(m.body_mocapid[end] < 0 for end in ends):
                    text = f"{word.lower()} of {self.bodies[ends[0]]!r} and {self.bodies[ends[1]]!r}"
                    yield text, self._between(*ends)
        for e in self._equalities("TENDON"):
            tendon = int(m.eq_obj1id[e])
            first, count = int(m.tendon_adr[tendon]), int(m.tendon_num[tendon])
            of_joints, of_sites = self.enums.mjtWrap.mjWRAP_JOINT, self.enums.mjtWrap.mjWRAP_SITE
            wraps = [(m.wrap_type[k], int(m.wrap_objid[k])) for k in range(first, first + count)]
            names = {self.joints[thing] for kind, thing in wraps if kind == of_joints}
            sites = [int(m.site_bodyid[thing]) for kind, thing in wraps if kind == of_sites]
            for site, next_site in pairwise(sites):
                names |= self._between(site, next_site)
            yield f"equality of tendon {self._names('tendon', m.ntendon)[tendon]!r}", frozenset(names)

    def _equalities(self, word: str) -> list[int]:
        """Indices of the active equalities of a kind."""
        m, kind = self.model, getattr(self.enums.mjtEq, f"mjEQ_{word}")
        return [e for e in range(m.neq) if m.eq_type[e] == kind and m.eq_active0[e]]

    def _between(self, first: int, last: int) -> frozenset[str]:
        """The joints on the way from one body to another, through the tree."""
        return frozenset(self._up(first) ^ self._up(last))

    def _up(self, body: int) -> set[str]:
        m, ancestors = self.model, set()
        while body:
            first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
            ancestors |= set(self.joints[first : first + count]) if count else set()
            body = int(m.body_parentid[body])
        return ancestors

    def _names(self, kind: str, count: int) -> list[str]:
        """The names of all bodies, joints, ... ; one without a name is called by its number."""
        word = {"jnt": "joint"}.get(kind, kind)
        addresses = getattr(self.model, f"name_{kind}adr")
        return [_text(self.model.names, int(addresses[i])) or f"{word} {i}" for i in range(count)]


def _text(names: bytes, start: int) -> str:
    return names[start : names.index(b"\0", start)].decode("utf-8", "replace")


def _mass(model: Any, body: int) -> Mass | None:
    if not body or not model.body_mass[body] > 0:
        return None
    T = transform(model.body_ipos[body], model.body_iquat[body])
    R = T[:3, :3]
    return Mass(float(model.body_mass[body]), T[:3, 3], R @ np.diag(model.body_inertia[body]) @ R.T)
