"""`Moves`: the moves of a program as they are read, in order, collected to paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import dist
from pathlib import Path

import numpy as np

from ...base.errors import ArgumentError, FileError
from ...base.tables import FAR
from ...base.types import Vector
from ..curves import even_curve
from ..path import HALF_TURN, SAME, SURE, Segment, Waypoints, arc_segment, line_segment, rotations_along

INCH = {"m": 1.0, "mm": 1e-3, "in": 0.0254}
"""Units of length of files -> metres."""

OFF_CIRCLE = 5e-5, 1e-3
"""How far [m], and by which share of the radius, the end of an arc may lie off the circle about its center through its
start: postprocessors write three digits of a millimetre, or four of an inch, and controllers let about as much pass."""

ROUND_OFF = 1e-9
"""Distance [m] between the end of a move and the point of the file up to which it is that point."""

HELIX = 1e-5
"""Tolerance [m] of the spline of a helix."""


def line_error(file: Path, line: int, fact: str, cure: str) -> FileError:
    """The refusal of a line, counted from 1."""
    return FileError(file, f"line {line} {fact}", cure)


@dataclass
class Moves:
    """What is known while a program is read: where the tool is, and the moves of the path that goes on.

    A rapid move ends a path, and leads to the next one; with a rapid speed [m/s] it is a move like the others. What is
    read has metres and seconds; axes point along the tool's z axis.
    """

    file: Path
    rapid_speed: float | None
    paths: list[Waypoints] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    name: str = ""
    point: Vector | None = None
    axis: Vector | None = None
    approach: list[Vector] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    short: int = 0
    _points: list[Vector] = field(default_factory=list)
    _axes: list[Vector | None] = field(default_factory=list)
    _moves: list[Segment | None] = field(default_factory=list)
    _speeds: list[float] = field(default_factory=list)
    _lines: list[int] = field(default_factory=list)

    def rapid(self, line: int, point: Vector, axis: Vector | None) -> None:
        """A rapid move. Raises: FileError: it is too far."""
        self._near(line, point)
        if self.rapid_speed is not None and self.point is not None:
            self.feed(line, point, axis, self.rapid_speed)
            return
        self.end()
        self.point, self.axis = point, axis
        self.approach.append(point)

    def feed(
        self, line: int, point: Vector, axis: Vector | None, speed: float | None, curve: Sequence[Segment] = ()
    ) -> None:
        """A move to a point at a speed [m/s], straight, or along a curve. The first one of all may begin nowhere.

        Raises:
            FileError: it is too far.
        """
        self._near(line, point)
        if self.point is None:
            self.notes.append(f"line {line} is the first move, from an unknown point: the path begins where it ends")
            self.point, self.axis = point, axis
        if not self._points:
            self._put(self.point, self.axis, line)
        turned = 0.0 if axis is None or self.axis is None else dist(axis, self.axis)
        if not curve and dist(point, self.point) <= SAME and turned <= SAME:
            self.short += len(self._points) > 1 or len(self._moves) > 0
            return
        moves = list(curve) or [None]
        for i, move in enumerate(moves, 1):
            self._moves.append(move)
            self._speeds.append(np.nan if speed is None else speed)
            end, last = point if move is None else move.position(np.ones(1))[0], i == len(moves)
            close = last and dist(end, point) <= ROUND_OFF
            self._put(point if close else end, axis if last else self.axis, line)
        self.point, self.axis = self._points[-1], axis

    def _near(self, line: int, point: Vector) -> None:
        size = float(np.abs(point).max())
        if not size <= FAR:
            fact = f"has a coordinate of {size:g} m, which no robot reaches"
            raise line_error(self.file, line, fact, "look whether its unit is right")

    def _put(self, point: Vector, axis: Vector | None, line: int) -> None:
        self._points.append(point)
        self._axes.append(axis)
        self._lines.append(line)

    def named(self, name: str) -> None:
        """The paths after here have this name."""
        self.end()
        self.name = name

    def end(self) -> None:
        """The path ends; one of no move is none."""
        if self._moves:
            self.paths.append(self._path())
            self.approach, self.comments = [], []
        self._points, self._axes, self._moves, self._speeds, self._lines = [], [], [], [], []

    def done(self) -> None:
        """The program ends."""
        self.end()
        if self.approach:
            self.notes.append(f"{len(self.approach)} rapid moves behind the last path left out")

    def _path(self) -> Waypoints:
        axes = self._axes_of_all()
        curved = any(move is not None for move in self._moves)
        moves = zip(self._moves, pairwise(self._points), strict=True)
        whole = tuple(move or line_segment(*ends, np.zeros(3)) for move, ends in moves) if curved else None
        notes = (f"{self.short} moves of no length left out",) * (self.short > 0)
        if axes is not None and (missing := sum(axis is None for axis in self._axes)):
            notes += (f"{missing} points before the first tool axis: the tool is read as along z of the file, down",)
        self.short = 0
        return Waypoints(
            np.array(self._points),
            None if axes is None else rotations_along(axes),
            source=str(self.file),
            notes=notes,
            name=self.name,
            axes=axes,
            speeds=None if np.isnan(self._speeds).all() else np.array(self._speeds),
            moves=whole,
            approach=np.array(self.approach) if self.approach else None,
            comments=tuple(self.comments),
        )

    def _axes_of_all(self) -> np.ndarray | None:
        """The axes (k, 3), where the file gives any. Raises: FileError: half a turn, whose direction is by chance."""
        if all(axis is None for axis in self._axes):
            return None
        axes = np.array([np.array([0.0, 0.0, -1.0]) if axis is None else axis for axis in self._axes])
        turns = np.arccos(np.clip(np.sum(axes[1:] * axes[:-1], axis=1), -1.0, 1.0))
        if turns.max(initial=0.0) > SURE:
            line = self._lines[int(np.argmax(turns)) + 1]
            raise line_error(self.file, line, "turns the tool axis by 180 degrees", HALF_TURN)
        return axes


def arc_moves(
    file: Path, line: int, start: Vector, end: Vector, center: Vector, normal: Vector, turns: int = 0
) -> list[Segment]:
    """The arc about a center, counter-clockwise about a unit normal; with a rise along the normal it is a helix.

    Args:
        turns: whole turns besides; an arc that ends where it starts is one.

    Raises:
        FileError: it has no radius, or its end is not on its circle.
    """
    # Radii in the plane of the arc, and the rise along its normal.
    rise = float((end - start) @ normal)
    first = (start - center) - ((start - center) @ normal) * normal
    last = (end - center) - ((end - center) @ normal) * normal
    radius, other = float(np.linalg.norm(first)), float(np.linalg.norm(last))
    off, allowed = abs(other - radius), max(OFF_CIRCLE[0], OFF_CIRCLE[1] * radius)
    if not radius > SAME or not off <= allowed:
        fact = f"has an arc whose start is {1e3 * radius:.6g} mm from its center, and whose end {1e3 * other:.6g} mm"
        raise line_error(file, line, fact, "correct its center or its end")
    # A center as far from the end as from the start; where that is too far away, the arc ends beside its end.
    chord = last - first
    length = float(np.linalg.norm(chord))
    if length > SAME:
        shift = (first @ first - last @ last) / (2 * length**2) * chord
        if np.linalg.norm(shift) <= allowed:
            first, last = first + shift, last + shift
    x, y = first, np.cross(normal, first)
    angle = float(np.arctan2(last @ y, last @ x)) % (2 * np.pi) if length > SAME else 0.0
    angle += 2 * np.pi * (turns if angle > 1e-9 or turns else 1)
    origin = start - first
    if abs(rise) <= SAME:
        return [arc_segment(origin, x, y, angle, np.zeros(3))]

    def helix(s: Vector) -> np.ndarray:
        u = s[:, None] / pieces
        return origin + np.cos(angle * u) * x + np.sin(angle * u) * y + rise * u * normal

    pieces = max(1, int(np.ceil(angle / (np.pi / 2))))
    try:
        return even_curve(helix, pieces, False, 0.1, HELIX)
    except ArgumentError as problem:
        raise line_error(file, line, f"has a helix that no spline follows ({problem.what})", problem.cure) from None
