"""How large a model an MJCF text makes, counted before MuJoCo builds it: a few words can ask for millions of bodies."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from ...base.errors import RobotFileError, brief
from .urdf_xml import LONGEST_URDF

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

    def found(self, name: str) -> Path | None:
        """The first file of that name; MuJoCo says of one that is missing."""
        for folder in self.folders:
            for inner in sorted(self.inside):
                for word in (name, Path(name).name):
                    path = folder / inner / word
                    if word and "\0" not in str(path) and path.is_file():
                        return path
        return None


def check_sizes(text: bytes, source: str, folder: Path) -> None:
    """Raises: RobotFileError: MJCF of more bodies, elements, pixels, bytes than a robot has, or text that is no XML.

    Args:
        folder: where the files that it names are looked for.
    """
    counted = sizes_of(text, source, folder)
    for found, most, what in (
        (counted.bodies, MOST_BODIES, "bodies, with the replicas and the points of flexible bodies"),
        (counted.elements, MOST_ELEMENTS, "elements, with the replicas"),
        (counted.cells, MOST_CELLS, "pixels of textures and cells of height fields"),
        (counted.bytes, MOST_FILES, "bytes of meshes, textures and height fields"),
    ):
        if found > most:
            raise RobotFileError(source, f"has {found:.4g} {what}", f"give a model of a robot: at most {most:,}")


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
            part = self._part(scope.found(scope.models.get(name, "")), folders, depth)
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
            n = stack[-1]
            stack.append(n * _product(has.get("count", "1")) if tag == "replicate" else n)
            sizes.elements += n
            sizes.bodies += n * (tag == "body")
            if tag == "flexcomp":
                points = n * _product(has.get("count", _GRID))
                sizes.bodies, sizes.elements = sizes.bodies + points, sizes.elements + points
            elif tag == "include":
                path = scope.found(has.get("file", ""))
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
            parser.Parse(_PIECE.sub(_without_comments, text).lstrip(BOM_UTF8 + b" \t\r\n"), True)
        except expat.ExpatError as problem:
            raise RobotFileError(
                self.source, f"is no MJCF that MuJoCo reads: it is not XML ({problem})", "correct it there"
            ) from None

    def _weigh(self, name: str, scope: _Scope) -> None:
        path = scope.found(name)
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


def _without_comments(piece: re.Match[bytes]) -> bytes:
    return b"" if piece.group().startswith(b"<!--") else piece.group()


def _product(words: str) -> float:
    """The product of the numbers of a text; what is no number, or less than 1, MuJoCo tells."""
    product = 1.0
    for word in words.split():
        with suppress(ValueError):
            product *= float(word) if float(word) >= 1 else 1.0
    return product
