"""DXF drawings: lines, arcs, circles, ellipses, polylines and splines, joined to paths where they meet."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import FileError
from ...base.extra_module import extra_module
from ...base.files import shown
from ...base.types import Matrix, Vector
from ..path import SAME, Waypoints, arc_segment, line_segment
from .drawings import Piece, exact_piece, has_length, outline
from .moves import INCH, line_error

UNITS = {1: "in", 4: "mm", 5: "cm", 6: "m", 2: "ft"}
"""$INSUNITS of a drawing -> its unit."""
SCALES = {**INCH, "cm": 1e-2, "ft": 0.3048}

_REMARKS = re.compile(
    "M?TEXT|(?:ARC_|LARGE_RADIAL_)?DIMENSION|HATCH|LEADER|MULTILEADER|MLEADER|POINT|ATTDEF|ATTRIB|VIEWPORT|XLINE|RAY|IMAGE"
    "|WIPEOUT|SOLID|TRACE|ACAD_TABLE|TOLERANCE|OLE2FRAME|ACAD_PROXY_ENTITY"
)
"""Things in a drawing that are no paths."""

FRAME = 16
"""Flag of a corner that is no point of a polyline, but of the frame of its spline."""

NEAR = 1e-4
"""Gaps [m] between two paths that look as if they should meet."""


@dataclass
class _Chain:
    """Pieces that follow each other, on a layer."""

    layer: str
    pieces: list[Piece]

    @property
    def ends(self) -> Matrix:
        """Start and end (2, 3) [m]."""
        return np.array([self.pieces[0].ends[0], self.pieces[-1].ends[1]])

    def reversed(self) -> _Chain:
        """The same chain, run through backwards."""
        return _Chain(self.layer, [piece.reversed() for piece in reversed(self.pieces)])


def read_dxf(file: Path, text: str, units: str | None, tolerance: float) -> tuple[list[Waypoints], list[str]]:
    """(paths, notes) of a drawing: those of the model, by layer. Lines and arcs stay what they are, others are splines.

    Raises:
        FileError: no units; a thing that is not read; a curve that no spline follows. MissingExtraError: ezdxf is not
            installed.
    """
    ezdxf = extra_module("ezdxf", "dxf")
    try:
        document = ezdxf.readfile(file)
    except Exception as problem:  # noqa: BLE001  the parser throws whatever its parts do
        raise FileError(file, f"cannot be read as DXF ({shown(str(problem), 200)})", "save it again as DXF") from None
    notes: list[str] = []
    scale = _scale(file, text, document, units)
    left_out: Counter[str] = Counter()
    chains: list[_Chain] = []
    for thing in document.modelspace():
        try:
            chains += _chains(file, text, document, thing, scale, left_out)
        except FileError:
            raise
        except Exception as problem:  # noqa: BLE001  of numbers that make no curve, or of a block that is not there
            fact = f"has a {thing.dxftype()} that cannot be drawn ({shown(str(problem) or type(problem).__name__)})"
            raise line_error(file, _line_of(text, thing), fact, "draw it again") from None
    if through := sum(1 for thing in document.modelspace().query("SPLINE") if not thing.control_point_count()):
        notes.append(
            f"splines that are given by points alone, {through}, are read as the cubics through them that CAD draws"
        )
    if left_out:
        notes.append(f"left out: {', '.join(f'{count} {kind}' for kind, count in sorted(left_out.items()))}")
    joined = _joined(chains, notes)
    names = [chain.layer if chain.layer != "0" else "" for chain in joined]
    return [outline(file, name, c.pieces, tolerance) for name, c in zip(names, joined, strict=True)], notes


def _scale(file: Path, text: str, document: Any, units: str | None) -> float:
    """Metres of a unit of the drawing. Raises: FileError: it says none, or another one than the caller."""
    stated = re.search(r"\$INSUNITS\s*\n\s*70\s*\n\s*(\d+)", text)
    code = 0 if stated is None else int(document.header.get("$INSUNITS", 0))
    if code and code not in UNITS:
        line = text[: stated.start() if stated else 0].count("\n") + 1
        raise line_error(file, line, f"has the unit {code}", "save it in mm or inches")
    if code and units is not None and UNITS[code] != units:
        raise FileError(file, f"is in {UNITS[code]}, and you say units={units!r}", "leave out units=")
    if not code and units is None:
        raise FileError(file, "does not say its unit, by $INSUNITS", "say units='mm' or units='in'")
    return SCALES[UNITS[code] if code else str(units)]


def _chains(file: Path, text: str, document: Any, thing: Any, scale: float, left_out: Counter[str]) -> Iterator[_Chain]:
    """The pieces of a thing in a drawing. Raises: FileError: it is not read."""
    kind, layer = thing.dxftype(), str(thing.dxf.get("layer", "0"))
    known = document.layers.get(layer) if layer in document.layers else None
    if known is not None and (known.is_off() or known.is_frozen()):
        left_out[f"on the hidden layer {shown(layer)!r}"] += 1
    elif _REMARKS.fullmatch(kind):
        left_out[kind] += 1
    elif kind == "INSERT":
        for part in thing.virtual_entities():
            yield from _chains(file, text, document, part, scale, left_out)
    else:
        pieces = _pieces(thing, kind, scale)
        if pieces is None:
            fact = f"has a {kind}, which is no line, arc, circle, ellipse, polyline or spline"
            raise line_error(file, _line_of(text, thing), fact, "explode or delete it")
        sound = [piece for piece in pieces if has_length(piece)]
        if len(sound) < len(pieces):
            left_out[f"pieces of at most {SAME:g} m"] += len(pieces) - len(sound)
        if sound:
            yield _Chain(layer, sound)


def _line_of(text: str, thing: Any) -> int:
    """The line with the kind of a thing, which its handle follows; without handles the first one of this kind."""
    handle = rf"\n\s*5\s*\n\s*{re.escape(str(thing.dxf.handle))}\s*\n"
    match = re.search(handle, text) or re.search(rf"(?<=\n)\s*{thing.dxftype()}\s*\n", text)
    return text[: match.start()].count("\n") + 1 if match else 1


def _pieces(thing: Any, kind: str, scale: float) -> list[Piece] | None:
    """The pieces of a thing in metres, in the frame of the drawing; None for a kind that is not read."""
    if kind == "LINE":
        a, b = (scale * np.array(v.xyz) for v in (thing.dxf.start, thing.dxf.end))
        return [exact_piece(line_segment(a, b, np.zeros(3)))]
    if kind in ("ARC", "CIRCLE"):
        first, last = (thing.dxf.start_angle, thing.dxf.end_angle) if kind == "ARC" else (0.0, 360.0)
        center, (x, y, _) = np.array(thing.ocs().to_wcs(thing.dxf.center).xyz), _axes(thing)
        angle = np.deg2rad((last - first) % 360.0 or 360.0)
        return [_arc(scale * center, scale * thing.dxf.radius, x, y, np.deg2rad(first), angle)]
    if kind == "ELLIPSE":
        return [_ellipse(thing.construction_tool(), scale)]
    if kind in ("SPLINE", "HELIX"):
        return _spline(thing.construction_tool(), scale)
    if kind == "LWPOLYLINE":
        corners = [(x, y, thing.dxf.elevation, bulge) for x, y, bulge in thing.get_points("xyb")]
        return _polyline(corners, thing.closed, _axes(thing), scale)
    if kind == "POLYLINE" and (thing.is_2d_polyline or thing.is_3d_polyline):
        drawn = [vertex for vertex in thing.vertices if not vertex.dxf.flags & FRAME]
        height = thing.dxf.elevation.z if thing.is_2d_polyline else None
        corners = [
            (*v.dxf.location.xyz[:2], v.dxf.location.z if height is None else height, v.dxf.bulge) for v in drawn
        ]
        return _polyline(corners, thing.is_closed, np.eye(3) if height is None else _axes(thing), scale)
    return None


def _axes(thing: Any) -> Matrix:
    """The axes x, y, z (3, 3) of the frame in which a thing is drawn, a row each."""
    return np.array([thing.ocs().to_wcs(tuple(axis)).xyz for axis in np.eye(3)])


def _polyline(corners: Sequence[tuple[float, ...]], closed: bool, frame: Matrix, scale: float) -> list[Piece]:
    """Lines and arcs through corners x, y, z, bulge, in a frame with rows x, y, z: an arc turns by 4 atan(bulge)."""
    pieces = []
    points = scale * np.array([corner[:3] for corner in corners])
    follow = [*range(1, len(corners)), *([0] if closed else [])]
    for i, j in enumerate(follow):
        a, b, bulge = points[i], points[j], corners[i][3]
        if bulge == 0.0 or np.linalg.norm(b - a) <= SAME:
            pieces.append(line_segment(a, b, np.zeros(3)))
            continue
        left = np.array([a[1] - b[1], b[0] - a[0], 0.0])
        center = (a + b) / 2 + left * (1 / bulge - bulge) / 4
        x = a - center
        y = np.array([-x[1], x[0], 0.0])
        pieces.append(arc_segment(center, x, y, 4 * float(np.arctan(bulge)), np.zeros(3)))
    return [exact_piece(piece.mapped(frame.T, np.zeros(3))) for piece in pieces]


def _arc(center: Vector, radius: float, x: Vector, y: Vector, first: float, angle: float) -> Piece:
    c, s = np.cos(first), np.sin(first)
    return exact_piece(arc_segment(center, radius * (c * x + s * y), radius * (c * y - s * x), angle, np.zeros(3)))


def _ellipse(tool: Any, scale: float) -> Piece:
    center, x, y = (scale * np.array(v.xyz) for v in (tool.center, tool.major_axis, tool.minor_axis))
    first = tool.start_param
    angle = (tool.end_param - first) % (2 * np.pi) or 2 * np.pi
    if abs(np.linalg.norm(x) - np.linalg.norm(y)) <= 1e-9 * np.linalg.norm(x):
        radius = float(np.linalg.norm(x))
        return _arc(center, radius, x / radius, y / np.linalg.norm(y), first, angle)

    def points(u: Vector) -> Matrix:
        t = (first + angle * u)[:, None]
        return center + np.cos(t) * x + np.sin(t) * y

    return Piece(points)


def _spline(tool: Any, scale: float) -> list[Piece]:
    """A piece for each interval of knots, of a B-spline that may be rational."""
    from scipy.interpolate import BSpline

    control = np.array([scale * np.array(v.xyz) for v in tool.control_points])
    weights = np.array(tool.weights() or np.ones(len(control)))
    degree, knots = tool.degree, np.array(tool.knots())
    curve = BSpline(knots, np.column_stack([weights[:, None] * control, weights]), degree)
    breaks = np.unique(knots[degree : len(control) + 1])

    def piece(a: float, b: float) -> Piece:
        def points(u: Vector) -> Matrix:
            values = curve(a + u * (b - a))
            return values[:, :3] / values[:, 3:]

        return Piece(points)

    return [piece(a, b) for a, b in pairwise(breaks.tolist())]


def _joined(chains: list[_Chain], notes: list[str]) -> list[_Chain]:
    """The chains of each layer, one path where two of them meet and no third one: in the order of the file.

    Of a joined path the first chain of the file keeps its direction.
    """
    from scipy.spatial import KDTree

    if not chains:
        return []
    # The other ends at each end: that of chain i at its start is 2 i, at its end 2 i + 1.
    ends = np.concatenate([chain.ends for chain in chains])
    near: list[list[int]] = [[] for _ in ends]
    gaps = 0
    for a, b in KDTree(ends).query_pairs(NEAR):
        if chains[a // 2].layer != chains[b // 2].layer:
            continue
        meet = np.linalg.norm(ends[a] - ends[b]) <= SAME
        if meet:
            near[a].append(b)
            near[b].append(a)
        elif a // 2 != b // 2:
            gaps += 1
    # From each chain forward from its end, and then backward from its start.
    used, out, turned = set(), [], 0
    for first, chain in enumerate(chains):
        if first in used:
            continue
        used.add(first)
        whole = _Chain(chain.layer, [*chain.pieces])
        for side in (1, 0):
            place = 2 * first + side
            while len(near[place]) == 1 and len(near[near[place][0]]) == 1 and near[place][0] // 2 not in used:
                other = near[place][0]
                used.add(other // 2)
                forward = other % 2 != side  # it goes on where it starts, or led here where it ends
                turned += not forward
                part = chains[other // 2] if forward else chains[other // 2].reversed()
                whole.pieces = whole.pieces + part.pieces if side else part.pieces + whole.pieces
                place = other ^ 1
        out.append(whole)
    if len(out) < len(chains):
        reverse = f", {turned} of them turned round" if turned else ""
        notes.append(f"{len(chains)} lines and curves joined to {len(out)} paths where their ends meet{reverse}")
    if gaps:
        notes.append(f"{gaps} pairs of ends are less than {1e3 * NEAR:g} mm apart and do not meet: they are not joined")
    return out
