"""Figures of runs on physics: rests over the cycles, a push, and the arms."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.types import Matrix, Vector
from ..errors import HolokinError
from ..physics import PhysicalRun, make_plant
from ..physics.plant import mujoco_module
from ..robot import servo
from ..strategies import HolonomicStrategy
from .palette import BLUE, GREY, INK, LOOP, PALE, color_of, law_colors, rgb
from .plots import NAMED, write_figure
from .robot_panels import Actor, Curve, draw_panel, stage_of
from .words import joint_unit, on_figure

ELEVATION = 20.0
"""Height of the eye over the floor in rendered pictures [degrees]."""

AROUND = (0.3, 1.0)
"""Seconds before a push and after it that its figure shows."""

SIZE = (1100, 1100)
"""Width and height of a rendered arm [pixels]."""

AZIMUTH = 172.0
"""From where arms are looked at [degrees]: nearly from the front, since elbows swing to the side."""

SLIM = 0.55
"""Share of the thickness of capsules that is drawn, for two arms to be told apart."""

MOST_GEOMS = 2000
"""Shapes of a scene: those of an arm, and a few hundred of the path of its tool."""

MARGIN = 12
"""Round the arms [pixels]."""

VISIBLE = 5e-3
"""Distance of two rests [rad, m] from which both are drawn."""

PATH = (*(c / 255 for c in rgb(LOOP)), 1.0)
"""Of the tool's path [rgba]."""

GHOST = (*(c / 255 for c in rgb(BLUE)), 0.55)
"""Of the arm as it rested first [rgba]."""


def apart_figure(runs: Mapping[str, PhysicalRun], predicted: Mapping[str, Matrix | None]) -> Any:
    """How far the joints rest from their first rest, after each cycle: physics as points, kinematics as lines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.4, 4.2), layout="constrained")
    axes: Any = figure.add_subplot()
    colors = law_colors([isinstance(run.strategy, HolonomicStrategy) for run in runs.values()])
    for color, (label, run) in zip(colors, runs.items(), strict=True):
        cycles = np.arange(1, run.cycles + 1)
        axes.semilogy(cycles, np.maximum(run.apart, 1e-9), "o", color=color, markersize=5, label=on_figure(label))
        known = predicted.get(label)
        if known is not None and (sizes := np.abs(known).max(axis=1)).max() > 1e-9:
            axes.semilogy(np.arange(1, len(sizes) + 1), sizes, "-", color=color, linewidth=1.2, alpha=0.7)
    axes.plot([], [], "-", color=GREY, label="by kinematics alone")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("cycles done")
    unit = joint_unit(next(iter(runs.values())).strategy.task.robot)
    axes.set_ylabel(f"largest joint, from its first rest [{unit}]")
    axes.set_title("Where the joints rest after each cycle, on physics", loc="left", color=INK, fontsize=11)
    axes.legend(fontsize=9)
    return figure


def push_figure(runs: Mapping[str, PhysicalRun]) -> Any:
    """How far each joint is deflected by the push: against the cycle before."""
    from matplotlib.figure import Figure

    shown = {label: run for label, run in runs.items() if run.push is not None and run.t[-1] > run.push[0]}
    figure = Figure(figsize=(3.9 * max(len(shown), 1) + 0.9, 3.6), layout="constrained")
    grid = figure.subplots(1, max(len(shown), 1), squeeze=False, sharey=True)
    for axes, (label, run) in zip(grid.flat, shown.items(), strict=False):
        first, last = run.push or (0.0, 0.0)
        t, off = run.pushed(*AROUND)
        for joint, name in enumerate(run.strategy.task.robot.joint_names):
            dash = "-" if joint < NAMED else "--"
            axes.plot(t, 1e3 * off[:, joint], color=color_of(joint % NAMED), linestyle=dash, label=on_figure(name, 30))
        axes.axvspan(0, last - first, color=PALE, zorder=0)
        axes.set_title(on_figure(label), loc="left", color=INK, fontsize=10)
        axes.set_xlabel("seconds since the push began")
    grid[0, 0].set_ylabel(f"deflection [m{joint_unit(next(iter(runs.values())).strategy.task.robot)}]")
    if shown:
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    return figure


def write_frames(runs: Mapping[str, PhysicalRun], file: FilePath) -> None:
    """The arms at their first rest, pale, and at their last: rendered by MuJoCo, or where no GL is there, as solids."""
    try:
        pictures = rendered(runs)
    except HolokinError:
        raise
    except Exception:  # noqa: BLE001  a missing GL shows itself as any error at all
        write_figure(lambda: bodies_figure(runs), file)
        return
    write_figure(lambda: pictures_figure(runs, pictures), file)


def bodies_figure(runs: Mapping[str, PhysicalRun]) -> Any:
    """The arms as solids: the first rest pale, the last in colour, and the path of the tool; all on one scale."""
    from matplotlib.figure import Figure

    casts, first = {}, next(iter(runs.values())).strategy.task.robot
    colors = law_colors([isinstance(run.strategy, HolonomicStrategy) for run in runs.values()])
    for color, (label, run) in zip(colors, runs.items(), strict=True):
        casts[label] = ([Actor(run.rests[0], GREY, "ghost"), Actor(run.rests[-1], color)], [Curve(run.position, color)])
    postures = np.array([actor.q for actors, _ in casts.values() for actor in actors])
    curves = [curve for _, found in casts.values() for curve in found]
    stage = stage_of(first, postures, curves, pairs=[(run.rests[0], run.rests[-1]) for run in runs.values()])
    wide, tall = stage.scene.shape
    figure = Figure(figsize=(4.6 * len(runs), 4.4 * tall / wide + 0.6), layout="constrained")
    for i, (label, run) in enumerate(runs.items()):
        axes = figure.add_subplot(1, len(runs), i + 1)
        draw_panel(axes, stage, *casts[label], title=_caption(label, run))
    return figure


def pictures_figure(runs: Mapping[str, PhysicalRun], pictures: Mapping[str, Any]) -> Any:
    """Rendered arms side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(runs), 5.2), layout="constrained")
    for i, (label, run) in enumerate(runs.items()):
        axes = figure.add_subplot(1, len(runs), i + 1)
        axes.imshow(pictures[label])
        axes.set_axis_off()
        axes.set_title(_caption(label, run), loc="left", color=INK, fontsize=11)
    said = "orange: the arm after the last cycle; blue: at the start, where that is elsewhere; green: the tool's path"
    figure.supxlabel(said, fontsize=10)
    return figure


def _caption(label: str, run: PhysicalRun) -> str:
    unit = joint_unit(run.strategy.task.robot)
    said = f"after {run.cycles} cycles {run.apart[-1]:.2g} {unit} away" if run.cycles else "no cycle done"
    return f"{on_figure(label)}: {said}"


def rendered(runs: Mapping[str, PhysicalRun]) -> dict[str, Any]:
    """Pictures (height, width, 3) by MuJoCo, all seen alike: each arm at its last rest, and pale at its first.

    Raises: whatever a machine without GL raises.
    """
    mujoco = mujoco_module()
    points = np.vstack([
        line for run in runs.values() for q in run.rests[[0, -1]] for line in run.strategy.task.robot.skeleton(q)
    ])  # fmt: skip
    low, high = points.min(axis=0), points.max(axis=0)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (low + high) / 2
    camera.distance = 1.7 * float(np.linalg.norm(high - low)) + 0.1
    camera.azimuth, camera.elevation = AZIMUTH, -ELEVATION
    found = {label: _rendered(mujoco, run, camera) for label, run in runs.items()}
    full = np.any([(picture > 0).any(axis=2) for picture in found.values()], axis=0)
    rows, columns = (np.flatnonzero(full.any(axis=k)) for k in (1, 0))
    top, left = max(rows[0] - MARGIN, 0), max(columns[0] - MARGIN, 0)
    cut = {label: picture[top : rows[-1] + MARGIN, left : columns[-1] + MARGIN] for label, picture in found.items()}
    return {label: np.where((p > 0).any(axis=2, keepdims=True), p, 255) for label, p in cut.items()}


def _rendered(mujoco: Any, run: PhysicalRun, camera: Any) -> Any:
    """One arm on black."""
    robot = run.strategy.task.robot
    plant = make_plant(robot, servo(robot, run.servo, run.rests[0]))
    model, data = plant.model, mujoco.MjData(plant.model)
    model.vis.global_.offwidth, model.vis.global_.offheight = SIZE
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.55
    scene, option, nothing = mujoco.MjvScene(model, maxgeom=MOST_GEOMS), mujoco.MjvOption(), mujoco.MjvPerturb()
    kinds = mujoco.mjtCatBit.mjCAT_ALL.value
    _placed(mujoco, plant, data, run.rests[-1])
    mujoco.mjv_updateScene(model, data, option, nothing, camera, kinds, scene)
    first = scene.ngeom
    if np.abs(run.rests[-1] - run.rests[0]).max() > VISIBLE:
        _placed(mujoco, plant, data, run.rests[0])
        mujoco.mjv_addGeoms(model, data, option, nothing, kinds, scene)
    for k, geom in enumerate(scene.geoms[: scene.ngeom]):
        geom.size[:2] *= SLIM * (1.0 if k < first else 0.93)
        if k >= first:
            geom.rgba[:], geom.transparent = GHOST, 1
    _draw_path(mujoco, scene, run.position[:: max(1, len(run.position) // 400)])
    return _pixels(mujoco, model, scene)


def _pixels(mujoco: Any, model: Any, scene: Any) -> Any:
    """A scene off-screen. On Linux without a display by EGL: the window library would end the process there."""
    place: Any = mujoco
    shown = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"))
    if sys.platform == "linux" and not shown:
        import mujoco.egl as place
    width, height = SIZE
    gl = place.GLContext(width, height)
    gl.make_current()
    try:
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
        rectangle, pixels = mujoco.MjrRect(0, 0, width, height), np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_render(rectangle, scene, context)
        mujoco.mjr_readPixels(pixels, None, rectangle, context)
        context.free()
    finally:
        gl.free()
    return pixels[::-1]


def _placed(mujoco: Any, plant: Any, data: Any, q: Vector) -> None:
    data.qpos[plant.places] = q
    mujoco.mj_forward(plant.model, data)


def _draw_path(mujoco: Any, scene: Any, points: Matrix) -> None:
    """The tool's path as a string of thin capsules."""
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE
    for a, b in pairwise(points):
        if scene.ngeom >= scene.maxgeom or np.allclose(a, b):
            continue
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), np.array(PATH, "f"))
        mujoco.mjv_connector(geom, kind, 0.004, a, b)
        scene.ngeom += 1
