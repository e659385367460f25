"""Panels with robots in them: postures as solids, as pale ghosts or as outlines, with paths and obstacles, in Axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, final

import numpy as np

from ...base.types import Matrix, Vector
from ...robot import LinkShape, Robot
from ...robot.tree import Frames
from .plots import GREY, thin
from .robot_view import (
    ABOVE,
    DETAIL,
    Layer,
    Piece,
    Pixels,
    Scene,
    Solid,
    Window,
    best_view,
    empty,
    floor_scale,
    laid,
    layer_of,
    named_axes,
    outlined,
    over,
    pieces_of,
    posed,
    scene_of,
    shadowed,
    show,
    solids_at,
    standing,
    thickness,
    tool_frames,
    triad,
    wire,
)

MOST_POINTS = 120
"""Points of a path in a picture."""

GHOST = 0.38
"""How much a ghost covers."""


@final
@dataclass(frozen=True, eq=False)
class Actor:
    """A posture in a colour: solid, pale, or as an outline over what is there."""

    q: Vector
    color: str
    look: Literal["solid", "ghost", "outline"] = "solid"


@final
@dataclass(frozen=True, eq=False)
class Curve:
    """Points (k, 3) of a path in a colour; with a dash, so many points are shown, then as many not."""

    points: Matrix
    color: str
    dash: int = 0


@final
@dataclass(frozen=True, eq=False)
class Stage:
    """A robot's pieces and the scene for all that is shown of it, so that panels beside each other have one scale."""

    robot: Robot
    pieces: tuple[Piece, ...]
    scene: Scene
    unit: float
    obstacles: tuple[LinkShape, ...] = ()

    @property
    def axis(self) -> float:
        """Length of the rods of the tool's axes [m]; those of the base are longer."""
        return 2.6 * self.unit

    def frames(self, q: Vector) -> Frames:
        """The joints' frames at a posture."""
        return posed(self.robot, q)

    def layer(self, q: Vector, color: str, window: Window, *, axes: bool = True, still: bool = True) -> Layer:
        """A posture as it is seen, with the axes of its tools, and the parts that stand still."""
        frames = self.frames(q)
        solids = solids_at(self.pieces, frames, 0, color, still=still)
        return layer_of(self.scene, solids + (tool_frames(self.robot, frames, 0, self.axis) if axes else []), window)

    def wires(self, curves: Sequence[Curve]) -> list[Solid]:
        """Paths as thin rods."""
        radius = 0.005 * float(np.hypot(*self.scene.shape)) / 1.4
        return [rod for c in curves for rod in wire(_thinned(c.points), radius, c.color, c.dash)]


def stage_of(
    robot: Robot,
    postures: Matrix,
    curves: Sequence[Curve] = (),
    *,
    pairs: Sequence[tuple[Vector, Vector]] = (),
    obstacles: Sequence[LinkShape] = (),
    extra: Matrix | None = None,
    ratio: tuple[float, float] = (0.62, 1.35),
) -> Stage:
    """The stage for postures (k, n), paths and obstacles; from above for a robot that moves in a plane.

    Args:
        pairs: postures whose difference is to be seen.
        extra: points (k, 3) that shall be in the picture, too.
        ratio: least and greatest height over width.
    """
    # The view that shows most.
    Q = np.atleast_2d(postures)
    pieces, frames, unit = pieces_of(robot, Q), posed(robot, Q), thickness(robot, Q)
    view = ABOVE
    if not robot.planar:
        bodies = [np.vstack(robot.skeleton(q)) for q in Q[:: max(1, len(Q) // 12)]]
        apart = [(np.vstack(robot.skeleton(a)), np.vstack(robot.skeleton(b))) for a, b in pairs]
        view = best_view(bodies, [_thinned(c.points) for c in curves], apart)
    # The scene that holds all that is shown.
    solids = [solid for k in range(len(Q)) for solid in solids_at(pieces, frames, k, GREY)]
    solids += [solid for k in range(len(Q)) for solid in tool_frames(robot, frames, k, 2.6 * unit)]
    solids += [*triad(np.zeros(3), np.eye(3), 4.5 * unit)]
    solids += [rod for c in curves for rod in wire(_thinned(c.points), 0.1 * unit, GREY)]
    if extra is not None and len(extra):
        solids += wire(np.vstack([extra.min(axis=0), extra.max(axis=0)]), 1e-6, GREY)
    scene = scene_of(view, solids, flat=robot.planar, ratio=ratio, around=standing(obstacles))
    return Stage(robot, pieces, scene, unit, tuple(obstacles))


def picture(stage: Stage, actors: Sequence[Actor], curves: Sequence[Curve], window: Window) -> Pixels:
    """The picture (rows, columns, 4), 0 to 1: shadow, obstacles, ghosts, the robot, outlines, paths."""
    base = [] if stage.robot.planar else triad(np.zeros(3), np.eye(3), 4.5 * stage.unit)
    things = layer_of(stage.scene, standing(stage.obstacles), window)
    layers = [
        (actor, stage.layer(actor.q, actor.color, window, axes=actor.look != "ghost", still=actor.look != "outline"))
        for actor in actors
    ]
    # The shadow of the first solid posture and of the obstacles, and the obstacles.
    solid = [actor for actor in actors if actor.look == "solid"] or list(actors)
    shadow = [s for actor in solid[:1] for s in solids_at(stage.pieces, stage.frames(actor.q), 0, GREY)]
    pixels = shadowed(empty(window), stage.scene, window, [*shadow, *standing(stage.obstacles)])
    pixels = over(pixels, things)
    beneath = Layer(things.color, np.zeros_like(things.cover), np.full_like(things.depth, -np.inf))
    # The postures, one over the other; outlines are laid over the solids beneath them.
    for actor, layer in layers:
        if actor.look == "outline":
            pixels = outlined(pixels, layer, actor.color, beneath)
            continue
        pixels = over(pixels, layer, GHOST if actor.look == "ghost" else 1.0)
        if actor.look == "solid":
            cover, depth = np.maximum(beneath.cover, layer.cover), np.maximum(beneath.depth, layer.depth)
            beneath = Layer(layer.color, cover, depth)
    # Obstacles before the robot, the base frame, the paths.
    if stage.obstacles:
        # How much an obstacle covers of the robot behind it.
        pixels = over(pixels, things, 0.45, (things.depth > beneath.depth) & (beneath.cover > 0))
    depth = np.maximum(beneath.depth, things.depth)
    pixels = laid(pixels, layer_of(stage.scene, base, window), depth, 0.0)
    return laid(pixels, layer_of(stage.scene, stage.wires(curves), window), depth, 1.0 if stage.robot.planar else 0.25)


def draw_panel(axes: Any, stage: Stage, actors: Sequence[Actor], curves: Sequence[Curve] = (), title: str = "") -> Any:
    """A panel: the picture in Axes, as large as they are, with the floor, or axes x and y for a planar robot."""
    figure = axes.figure
    width = axes.get_position().width * figure.get_figwidth()
    window = stage.scene.window(max(120, round(DETAIL * width)))
    drawn = picture(stage, actors, curves, window)
    show(axes, stage.scene, drawn, window)
    if not stage.robot.planar:
        named = named_axes(axes, stage.scene, 4.5 * stage.unit, drawn[..., 3], window)
        floor_scale(axes, stage.scene, left=named)
    axes.set_title(title, loc="left", fontsize=10)
    return axes


def _thinned(points: Matrix) -> Matrix:
    """At most `MOST_POINTS` of the points of a path, ends included."""
    return points[thin(len(points), MOST_POINTS)]
