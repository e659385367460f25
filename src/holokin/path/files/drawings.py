"""Outlines of drawings as paths: their lines, arcs and curves; and those of an SVG drawing."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, FileError, HolokinError
from ...base.extra_module import extra_module
from ...base.files import shown
from ...base.types import Matrix, Vector, positive
from ..curves import even_curve
from ..path import CLOSED, SAME, Path, Segment, Waypoints, arc_segment, line_segment

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6, "q": 2.5e-4}
"""Units of length of a drawing's size -> metres."""

SMOOTH = np.deg2rad(1.0)
"""Angle [rad] below which two pieces of an outline meet without a corner: drawings hold three digits."""

EXACT = 1e-7
"""The same of lines and arcs that stay what they are."""

MOST_PIECES = 20_000

SPEED = 0.1
"""Speed [m/s] for which the splines are made; they have the same shape at any other."""

_SIZE = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([a-zA-Z]+)\s*")


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of an outline: u (k,) in [0, 1] -> points (k, 3) [m], and the line or arc that it is, if any."""

    points: Callable[[Vector], Matrix]
    exact: Segment | None = None

    @property
    def ends(self) -> Matrix:
        """Its start and its end (2, 3) [m]."""
        return self.points(np.array([0.0, 1.0]))

    def direction(self, end: bool) -> Vector:
        """Unit tangent (3,) at the start or the end."""
        if self.exact is not None:
            slope = self.exact.derivative(np.array([float(end)]))[0]
        else:
            near = self.points(np.array([1.0, 1 - 1e-5] if end else [1e-5, 0.0]))
            slope = near[0] - near[1]
        return slope / max(float(np.linalg.norm(slope)), 1e-300)

    def reversed(self) -> Piece:
        """The same piece, run through backwards."""
        exact = None if self.exact is None else self.exact.part(1.0, 0.0)
        return Piece(lambda u: self.points(1.0 - u), exact)


def exact_piece(segment: Segment) -> Piece:
    """A line or an arc."""
    return Piece(segment.position, segment)


def has_length(piece: Piece) -> bool:
    """Whether a piece is one, longer than `SAME`."""
    points = piece.points(np.linspace(0.0, 1.0, 9))
    return bool(np.isfinite(points).all() and np.linalg.norm(np.diff(points, axis=0), axis=1).sum() > SAME)


def read_svg(file: FilePath, text: str, pixel: float | None, tolerance: float) -> list[Waypoints]:
    """The outlines of an SVG drawing as paths in the plane z = 0, x to the right and y up from the page's lower left.

    Path elements with all their commands, rectangles, circles, ellipses, lines, polylines and polygons, with their
    transforms; other things (text, images) are left out. Lines and circular arcs stay what they are; Bezier curves and
    elliptical arcs, and what meets them without a corner, become splines. Pieces of 1e-7 m and less are left out, and
    the path's `notes` say so.

    Raises:
        FileError: no SVG, no size, no outlines. MissingExtraError: svgelements is not installed.
    """
    svgelements = extra_module("svgelements", "svg")
    drawing = _parsed(file, text, svgelements)
    if not isinstance(drawing, svgelements.SVG):
        raise FileError(file, "is no SVG drawing: its root is no <svg>", "save it as plain SVG")
    to_metres = _to_metres(file, drawing, pixel)
    out: list[Waypoints] = []
    for name, drawn in _outlines(file, drawing, to_metres, svgelements):
        pieces = [piece for piece in drawn if piece is not None]
        if pieces:
            short = len(drawn) - len(pieces)
            notes = (f"{short} of {len(drawn)} pieces left out, which are at most {SAME:g} m long",) * (short > 0)
            out.append(outline(file, name, pieces, tolerance, notes))
    if not out:
        raise FileError(file, "has no outlines", "convert text and images to paths in your drawing program")
    return out


def _outlines(
    file: FilePath, drawing: Any, to_metres: Matrix, svgelements: Any
) -> Iterator[tuple[str, list[Piece | None]]]:
    """(id of its element, pieces) of each outline, None for a piece that is too short.

    Raises:
        FileError: an element whose numbers the library cannot draw.
    """
    for element in drawing.elements():
        hidden = str(element.values.get("visibility", "")) == "hidden" or element.values.get("display") == "none"
        if not isinstance(element, svgelements.Shape) or hidden:
            continue
        try:
            outlines = [
                _pieces([s for s in outline if not isinstance(s, svgelements.Move)], to_metres, svgelements)
                for outline in svgelements.Path(element).as_subpaths()
            ]
        except Exception as problem:  # noqa: BLE001  of a shape without a start, or of numbers beyond all bounds
            message = str(problem) or type(problem).__name__
            tag = str(element.values.get("tag") or type(element).__name__.lower())
            fact = f"has a <{shown(tag)}> that cannot be drawn ({shown(message)})"
            raise FileError(file, fact, "correct its numbers") from None
        for pieces in outlines:
            yield str(element.values.get("id") or ""), pieces


def _parsed(file: FilePath, text: str, svgelements: Any) -> Any:
    import io

    if "<!ENTITY" in text:  # which may grow without end
        raise FileError(file, "defines entities", "save it as plain SVG")
    try:
        return svgelements.SVG.parse(io.StringIO(text), reify=True)
    except Exception as problem:  # noqa: BLE001  the parser throws whatever its parts do
        raise FileError(file, f"cannot be read as SVG ({shown(str(problem))})", "save it as plain SVG") from None


def _to_metres(file: FilePath, drawing: Any, pixel: float | None) -> Matrix:
    """The map (3, 3) from pixels x, y, 1, y down from the top, to metres x, y, 0."""
    stated = str((drawing.values.get("attributes") or {}).get("width", ""))
    match = _SIZE.fullmatch(stated)
    if pixel is None:
        unit = match[2].lower() if match else ""
        if match is None or unit not in LENGTHS:
            fact = f"gives its width as {shown(stated)!r}" if stated else "gives no width"
            raise FileError(file, f"{fact}, not in a unit of length", "say pixel=, the size of a pixel in metres")
        size, width = float(match[1]) * LENGTHS[unit], float(drawing.width or 0.0)
        if not (size > 0 and width > 0):
            raise FileError(file, f"gives its width as {shown(stated)!r}", "give it a width above 0")
        pixel = size / width
    scale = positive("pixel", pixel, "give the size of a pixel in metres")
    return np.array([[scale, 0.0, 0.0], [0.0, -scale, scale * float(drawing.height or 0.0)], [0.0, 0.0, 0.0]])


def _pieces(drawn: list[Any], to_metres: Matrix, svgelements: Any) -> list[Piece | None]:
    """The pieces, None where one is too short; an end of an outline where it began is no piece."""
    pieces = [_piece(outline, to_metres, svgelements) for outline in drawn]
    return pieces[:-1] if drawn and isinstance(drawn[-1], svgelements.Close) and pieces[-1] is None else pieces


def _piece(drawn: Any, to_metres: Matrix, svgelements: Any) -> Piece | None:
    """The piece, if it has a length."""

    def points(u: Vector) -> Matrix:
        return np.column_stack([np.asarray(drawn.npoint(u)), np.ones(len(u))]) @ to_metres.T

    piece = Piece(points)
    if not has_length(piece):
        return None
    (a, b), zero = piece.ends, np.zeros(3)
    if isinstance(drawn, svgelements.Line | svgelements.Close):
        return exact_piece(line_segment(a, b, zero))
    if isinstance(drawn, svgelements.Arc) and abs(drawn.rx - drawn.ry) <= 1e-9 * abs(drawn.rx):
        center = to_metres @ [drawn.center.x, drawn.center.y, 1.0]
        x = a - center
        return exact_piece(arc_segment(center, x, np.array([-x[1], x[0], 0.0]), -float(drawn.sweep), zero))
    return piece


def outline(file: FilePath, name: str, pieces: list[Piece], tolerance: float, notes: tuple[str, ...] = ()) -> Waypoints:
    """An outline of pieces that meet: its smooth stretches one after the other; a closed one begins at a corner of it.

    Raises:
        FileError: too many pieces; a curve that no spline follows to a tolerance [m].
    """
    if len(pieces) > MOST_PIECES:
        raise FileError(file, f"has an outline of {len(pieces)} pieces", f"simplify it to {MOST_PIECES} at most")
    # Where it turns a corner: a closed outline begins at one.
    ends = pieces[0].points(np.zeros(1))[0], pieces[-1].points(np.ones(1))[0]
    gap = float(np.linalg.norm(ends[0] - ends[1]))
    closed = gap <= SAME
    angles = [_angle(a, b) for a, b in pairwise([*pieces, pieces[0]])]  # after each piece
    smooth = [angle < SMOOTH for angle in angles]
    smooth[-1] = smooth[-1] and closed
    if closed and smooth[-1] and not all(smooth):
        first = smooth.index(False) + 1
        pieces, angles = pieces[first:] + pieces[:first], angles[first:] + angles[:first]
        smooth = smooth[first:] + smooth[:first]
    # Its smooth stretches: exact where their pieces are lines and arcs that meet evenly, else splines.
    stretches: list[tuple[list[Piece], list[float]]] = [([], [])]
    for piece, angle, goes_on in zip(pieces, angles, smooth, strict=True):
        stretches[-1][0].append(piece)
        if not goes_on:
            stretches.append(([], []))
        else:
            stretches[-1][1].append(angle)
    segments: list[Segment] = []
    for some, turns in stretches:
        exact = [piece.exact for piece in some if piece.exact is not None]
        if len(exact) == len(some) and max(turns, default=0.0) < EXACT:
            segments += exact
            continue
        try:
            segments += even_curve(_points(some), len(some), closed and len(turns) == len(some), SPEED, tolerance)
        except ArgumentError as problem:
            fact = (
                f"has an outline near {some[0].points(np.zeros(1))[0][:2].round(6).tolist()} m that no spline follows"
            )
            raise FileError(file, f"{fact} ({problem.what})", problem.cure) from None
    # The path, without the gaps that short pieces leave.
    try:
        path = _welded(Path(tuple(segments), SPEED), closed)
    except HolokinError as problem:
        raise FileError(file, f"has an outline that no tool can follow ({problem})", "simplify it") from None
    starts = path.on(np.arange(len(path.segments)), np.zeros(len(path.segments))).position
    end = path.start if closed else path.end
    points = np.vstack([starts, end])
    straight = all(segment.angle == 0.0 and not segment.along[1:].any() for segment in path.segments)
    return Waypoints(points, None, None, str(file), notes, name, moves=None if straight else path.segments)


def _welded(path: Path, closed: bool) -> Path:
    """The path without the gaps that short pieces leave: a line or cubic gives way to the next segment."""
    index, segments = np.arange(len(path.segments)), list(path.segments)
    starts, ends = (path.on(index, np.full(len(index), u)).position for u in (0.0, 1.0))
    gaps = np.roll(starts, -1, axis=0) - ends
    for i in np.flatnonzero(np.linalg.norm(gaps, axis=1) > CLOSED)[: None if closed else -1].tolist():
        j, along = (i + 1) % len(segments), [gaps[i], np.zeros(3), np.zeros(3)]
        if segments[i].angle == 0.0:
            segments[i] = replace(segments[i], along=segments[i].along + along)
        elif segments[j].angle == 0.0:
            segments[j] = replace(segments[j], center=segments[j].center - gaps[i], along=segments[j].along + along)
    return replace(path, segments=tuple(segments))


def _points(pieces: list[Piece]) -> Callable[[Vector], Matrix]:
    """s (k,) -> points (k, 3), s from 0 to the number of pieces."""

    def curve(s: Vector) -> Matrix:
        out = np.empty((len(s), 3))
        index = np.clip(np.floor(s).astype(int), 0, len(pieces) - 1)
        for i in np.unique(index):
            on_piece = index == i
            out[on_piece] = pieces[i].points(s[on_piece] - i)
        return out

    return curve


def _angle(a: Piece, b: Piece) -> float:
    u, v = a.direction(True), b.direction(False)
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))
