"""Solids seen without perspective: rods with round ends and convex blocks, shaded, the nearer before the farther."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ...base.types import Matrix, Vector
from .palette import rgb

Pixels = NDArray[Any]
"""What is known of each pixel: 32 bits are enough."""

LIGHT = np.array([-0.45, 0.62, 0.64]) / np.linalg.norm([-0.45, 0.62, 0.64])
"""Where the light comes from, in the axes of the eye: from the left, above and behind it."""

AMBIENT, DIFFUSE, GLOSS = 0.50, 0.50, 0.22
"""Shares of the light from everywhere, from the lamp, and of what shines."""

_SHADES = 512
"""Steps of brightness."""

_TILT = np.linspace(-1, 1, _SHADES)[:, None]
_LIGHT = AMBIENT + DIFFUSE * _TILT.clip(0) + 0.12 * _TILT.clip(-1, 0)
_SHINE = GLOSS * _TILT.clip(0) ** 12

_END_ON = 1e-6
"""Share of a rod's length that is seen, below which it is seen as a ball."""


@final
@dataclass(frozen=True, eq=False)
class Rod:
    """All points within `radius` of the segment from a (3,) to b (3,) [m]; a ball where they are one."""

    a: Vector
    b: Vector
    radius: float
    color: Vector

    def moved(self, p: Vector, R: Matrix) -> Rod:
        """The same in another frame."""
        return Rod(p + R @ self.a, p + R @ self.b, self.radius, self.color)

    def box(self) -> Matrix:
        """The least and the greatest (2, 3) of its points along each axis."""
        ends = np.array([self.a, self.b])
        return np.array([ends.min(axis=0) - self.radius, ends.max(axis=0) + self.radius])

    def depth(self, x: Pixels, y: Pixels) -> tuple[Pixels, Pixels, Pixels]:
        """(depth, brightness, cover 0 to 1) at pixels x, y; see `Block.depth`.

        The nearest point of all balls along the segment: that of the ball at s, where the surface is highest.
        """
        step = self.b - self.a
        length = float(np.linalg.norm(step))
        r = np.float32(self.radius)
        wx, wy = x - np.float32(self.a[0]), y - np.float32(self.a[1])
        seen = float(np.hypot(step[0], step[1])) / length if length > 0 else 0.0
        if seen < _END_ON:
            s = np.zeros_like(wx) if step[2] <= 0 else np.full_like(wx, length)
            ux, uy, k, near = 0.0, 0.0, np.sign(step[2]) if length > 0 else 0.0, wx * wx + wy * wy
        else:
            ux, uy, k = (float(v) for v in step / length)
            ex, ey = ux / seen, uy / seen
            along, across = wx * np.float32(ex) + wy * np.float32(ey), wy * np.float32(ex) - wx * np.float32(ey)
            h = np.sqrt(np.maximum(r * r - across * across, 0))
            s = np.clip((along + np.float32(k) * h) / np.float32(seen), 0, np.float32(length))
            off = along - np.clip(along, 0, np.float32(length * seen))
            near = across * across + off * off
        dx, dy = wx - s * np.float32(ux), wy - s * np.float32(uy)
        dz = np.sqrt(np.maximum(r * r - dx * dx - dy * dy, 0))
        depth = np.float32(self.a[2]) + s * np.float32(k) + dz
        tilt = (dx * np.float32(LIGHT[0]) + dy * np.float32(LIGHT[1]) + dz * np.float32(LIGHT[2])) / r
        return depth, tilt, r - np.sqrt(near)


@final
@dataclass(frozen=True, eq=False)
class Block:
    """A convex solid: all points x with normals (f, 3) @ x <= offsets (f,) [m], within a ball."""

    normals: Matrix
    offsets: Vector
    center: Vector
    reach: float
    color: Vector
    corners: Matrix = field(default_factory=lambda: np.zeros((0, 3)))

    def moved(self, p: Vector, R: Matrix) -> Block:
        """The same in another frame."""
        normals = self.normals @ R.T
        corners = p + self.corners @ R.T if len(self.corners) else self.corners
        return Block(normals, self.offsets + normals @ p, p + R @ self.center, self.reach, self.color, corners)

    def box(self) -> Matrix:
        """The least and the greatest (2, 3) of its points along each axis."""
        if len(self.corners):
            return np.array([self.corners.min(axis=0), self.corners.max(axis=0)])
        return np.array([self.center - self.reach, self.center + self.reach])

    def depth(self, x: Pixels, y: Pixels) -> tuple[Pixels, Pixels, Pixels]:
        """(depth, brightness, cover): towards the eye [m], cosine to the light, and how far inside the outline [m]."""
        n, h = self.normals.astype(np.float32), self.offsets.astype(np.float32)
        side = np.abs(n[:, 2]) <= 1e-5
        front, back = (n[:, 2] > 0) & ~side, (n[:, 2] < 0) & ~side
        flat = np.stack([x.ravel(), y.ravel(), np.ones(x.size, np.float32)])
        planes = np.column_stack([-n[:, :2], h])
        tops = (planes[front] / n[front, 2:]) @ flat
        which = tops.argmin(axis=0)
        top = np.take_along_axis(tops, which[None], axis=0)[0]
        bottom = ((planes[back] / n[back, 2:]) @ flat).max(axis=0)
        cover = top - bottom
        if side.any():
            cover = np.minimum(cover, (planes[side] @ flat).min(axis=0))
        tilt = (n[front] @ LIGHT.astype(np.float32))[which]
        return top.reshape(x.shape), tilt.reshape(x.shape), cover.reshape(x.shape)


Solid = Rod | Block


def tint(color: str, white: float = 0.0, ink: float = 0.0) -> Vector:
    """A colour (3,), 0 to 1, mixed with shares of white and of black."""
    mixed = np.array(rgb(color)) / 255
    return mixed * (1 - white - ink) + white


@dataclass(frozen=True, eq=False)
class Window:
    """What is seen: from left, right, bottom, top [m] in the axes of the eye, in pixels (rows, columns)."""

    left: float
    right: float
    bottom: float
    top: float
    rows: int
    columns: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """As matplotlib takes it."""
        return self.left, self.right, self.bottom, self.top

    @property
    def pixel(self) -> float:
        """Size of a pixel [m]."""
        return (self.right - self.left) / self.columns


@dataclass(frozen=True, eq=False)
class Layer:
    """Solids drawn: colours (rows, columns, 3), cover (rows, columns), both 0 to 1, and depth [m], -inf for none.

    `here`: the rows and columns beyond which nothing is covered.
    """

    color: Pixels
    cover: Pixels
    depth: Pixels
    here: Any = np.s_[:, :]


def drawn(solids: Sequence[Solid], window: Window) -> Layer:
    """Solids in the axes of the eye, right, up, towards it; row 0 of the layer is at the top."""
    shape, pixel = (window.rows, window.columns), window.pixel
    color = np.zeros((*shape, 3), np.float32)
    cover, depth = np.zeros(shape, np.float32), np.full(shape, -np.inf, np.float32)
    xs = (window.left + pixel * (np.arange(window.columns) + 0.5)).astype(np.float32)
    ys = (window.top - pixel * (np.arange(window.rows) + 0.5)).astype(np.float32)
    for solid in sorted(solids, key=lambda one: one.box()[1, 2]):
        for low, high in _pieces(solid):
            i0 = max(int((window.top - high[1]) / pixel) - 1, 0)
            i1 = min(int((window.top - low[1]) / pixel) + 2, window.rows)
            j0 = max(int((low[0] - window.left) / pixel) - 1, 0)
            j1 = min(int((high[0] - window.left) / pixel) + 2, window.columns)
            if i0 >= i1 or j0 >= j1:
                continue
            here = np.s_[i0:i1, j0:j1]
            x, y = np.broadcast_arrays(xs[None, j0:j1], ys[i0:i1, None])
            z, tilt, inside = solid.depth(x, y)
            share = np.clip(inside * np.float32(1 / pixel) + np.float32(0.5), 0, 1)
            share *= z >= depth[here]
            known = cover[here]
            total = share + known * (1 - share)
            weight = share / np.maximum(total, np.float32(1e-6))
            paint = _shaded(solid.color, tilt)
            paint -= color[here]
            paint *= weight[..., None]
            color[here] += paint
            cover[here] = np.maximum(known, total)
            np.copyto(depth[here], z, where=share > 0.5)
    return Layer(color, cover, depth, _part(solids, window))


def _part(solids: Sequence[Solid], window: Window) -> Any:
    """The rows and columns of a picture that solids can be in."""
    if not len(solids):
        return np.s_[0:0, 0:0]
    boxes = np.array([solid.box()[:, :2] for solid in solids])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    top, bottom = (int((window.top - y) / window.pixel) for y in (high[1], low[1]))
    left, right = (int((x - window.left) / window.pixel) for x in (low[0], high[0]))
    return np.s_[max(top - 2, 0) : max(bottom + 3, 0), max(left - 2, 0) : max(right + 3, 0)]


def _pieces(solid: Solid) -> list[tuple[Vector, Vector]]:
    """Boxes (low, high) that hold a solid: several for a long slanted rod, whose one box is mostly empty.

    They do not overlap: each is cut off where the next begins.
    """
    low, high = solid.box()
    if isinstance(solid, Block):
        return [(low, high)]
    step = np.abs(solid.b - solid.a)[:2]
    count = int(min(8, step.min() // (1.5 * solid.radius) + 1))
    if count < 2:
        return [(low, high)]
    axis = int(np.argmax(step))
    cuts = np.linspace(low[axis], high[axis], count + 1)
    direction = (solid.b - solid.a)[:2]
    slope = direction[1 - axis] / direction[axis]
    reach = solid.radius * float(np.hypot(1, slope))
    pieces = []
    for start, stop in pairwise(cuts):
        beside = solid.a[1 - axis] + slope * (np.array([start, stop]) - solid.a[axis])
        piece = np.array([low, high])
        piece[:, axis] = start, stop
        piece[0, 1 - axis] = max(low[1 - axis], beside.min() - reach)
        piece[1, 1 - axis] = min(high[1 - axis], beside.max() + reach)
        pieces.append((piece[0], piece[1]))
    return pieces


def _shaded(color: Vector, tilt: Pixels) -> Pixels:
    """Colours (..., 3) of a surface by the cosine of its normal to the light."""
    at = ((tilt + np.float32(1)) * np.float32(_SHADES / 2)).astype(np.intp)
    return (_LIGHT * color * (1 - _SHINE) + _SHINE).astype(np.float32).take(at, axis=0, mode="clip")


def over(below: Any, layer: Layer, alpha: float = 1.0, where: Any = None) -> Pixels:
    """Pictures (rows, columns, 4), 0 to 1, with a layer laid over them; `where`: the pixels that take it, and how."""
    found, here = below.copy(), layer.here
    share = layer.cover[here] * np.float32(alpha)
    if where is not None:
        share = share * where[here]
    part = found[here]
    total = share + part[..., 3] * (1 - share)
    weight = share / np.maximum(total, np.float32(1e-6))
    part[..., :3] += weight[..., None] * (layer.color[here] - part[..., :3])
    part[..., 3] = total
    return found


def onto(ground: Pixels, layer: Layer, alpha: float = 1.0, where: Any = None) -> None:
    """The same on a picture (rows, columns, 3) without holes, in its place."""
    share = layer.cover[layer.here] * np.float32(alpha)
    if where is not None:
        share *= where[layer.here]
    part = ground[layer.here]
    part += share[..., None] * (layer.color[layer.here] - part)
