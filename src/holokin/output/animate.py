"""GIFs: the two ways side by side, the paper's video; and the cycles, one panel a strategy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..files import writing
from ..trajectory import Status, Trajectory
from .figures import margins, tool_points
from .plots import CLOCKWISE, COUNTER, GREY, best_azimuth, frame_robot, robot_stick, style, tool_path
from .result import JobResult, StrategyResult
from .words import away, on_figure, stopped, ways_end

FRAMES = 60
"""Frames of a moving picture, before the last one is held."""

HOLD = 18
"""Times that the last frame is shown."""


def animate(result: JobResult, folder: FilePath, say: Callable[[str], None] = lambda _text: None) -> None:
    """Write `ways-NAME.gif` for every strategy with two ways, and `cycles.gif` when there are several cycles."""
    for strategy in result.drawn:
        if strategy.ways is not None:
            name = f"ways-{result.stems[strategy.name]}.gif"
            say(f"drawing {name}")
            ways_gif(result, strategy, folder / name)
    if result.cycles > 1:
        say("drawing cycles.gif")
        cycles_gif(result, list(result.drawn)[:3], folder / "cycles.gif")


def ways_gif(result: JobResult, strategy: StrategyResult, file: FilePath) -> None:
    """Left the clockwise way, right the counter-clockwise one; at the end each shows where the other stands.

    A way that stops says when, and nothing is compared.
    """
    if strategy.ways is None:
        return
    clockwise, counter = strategy.ways
    panels = [("clockwise", clockwise, CLOCKWISE), ("counter-clockwise", counter, COUNTER)]
    complete = clockwise.status is counter.status is Status.COMPLETE

    def caption(share: float, walk: Trajectory, title: str) -> str:
        if share < 1.0:
            return f"{on_figure(strategy.name)}, {title}\n"
        ending = ways_end((clockwise, counter)) if complete else stopped(walk) or "followed to the end"
        return f"{on_figure(strategy.name)}, {title}\n{ending}"

    ghosts = [counter.q[-1], clockwise.q[-1]] if complete else [None, None]
    _write(result, [(t, w, s["color"]) for t, w, s in panels], caption, ghosts, file, late_ghosts=True)


def cycles_gif(result: JobResult, strategies: list[StrategyResult], file: FilePath) -> None:
    """One panel a strategy, the start posture in grey."""
    colors = {True: CLOCKWISE["color"], False: COUNTER["color"]}
    panels = [(on_figure(s.name), s.cycles, colors[s.verdict.holonomic]) for s in strategies]

    def caption(share: float, walk: Trajectory, title: str) -> str:
        done = sum(mark <= share * (len(walk) - 1) for mark in walk.marks[1:])
        ended = stopped(walk) if share == 1.0 else ""
        return f"{title}\n{ended or (away(walk, done) if done else 'the start in grey')}"

    _write(result, panels, caption, [result.start] * len(panels), file, frames=FRAMES * 2)


def _write(
    result: JobResult, panels: list[tuple[str, Trajectory, Any]], caption: Callable[[float, Trajectory, str], str],
    ghosts: list[Any], file: FilePath, *, late_ghosts: bool = False, frames: int = FRAMES,
) -> None:  # fmt: skip
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    robot = result.robot
    images = []
    with rc_context(style()):
        figure = Figure(figsize=(4.2 * len(panels), 4.3), dpi=80, facecolor="white")
        side = 0.65 if robot.planar else 0.1
        margins(figure, left=side, right=0.25, bottom=0.55, top=0.6, width_gap=side, grid=(1, len(panels)))
        canvas = FigureCanvasAgg(figure)
        kind = {} if robot.planar else {"projection": "3d"}
        grid = figure.subplots(1, len(panels), squeeze=False, subplot_kw=kind)[0]
        clouds = [line for _, w, _ in panels for q in w.q[:: max(1, len(w) // 40)] for line in robot.skeleton(q)]
        paths = [tool_points(result, walk) for _, walk, _ in panels]
        shown = [walk.q[0] if ghost is None else ghost for (_, walk, _), ghost in zip(panels, ghosts, strict=True)]
        pairs = [(robot.skeleton(q), robot.skeleton(w.q[-1])) for q, (_, w, _) in zip(shown, panels, strict=True)]
        azimuth = best_azimuth([(np.vstack(one), np.vstack(other)) for one, other in pairs])
        for axes, points, (title, walk, _) in zip(grid, paths, panels, strict=True):
            frame_robot(axes, robot, clouds, azimuth=azimuth)
            tool_path(axes, robot, points, color=GREY, linewidth=1.2)
            axes.set_title(caption(0.0, walk, title), fontsize=11, loc="center")
        titles = [axes.title for axes in grid]
        for title in titles:
            title.set_animated(True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)  # everything that does not move is drawn once
        for frame in range(frames + 1):
            share = frame / frames
            canvas.restore_region(still)
            for axes, (title, walk, color), ghost in zip(grid, panels, ghosts, strict=True):
                moving = []
                if ghost is not None and (not late_ghosts or share == 1.0):
                    moving += robot_stick(axes, robot, ghost, GREY, width=6.0, alpha=0.6)
                q = walk.q[round(share * (len(walk) - 1))]
                moving += robot_stick(axes, robot, q, color, width=2.4)
                axes.title.set_text(caption(share, walk, title))
                for artist in [*moving, axes.title]:
                    axes.draw_artist(artist)
                for artist in moving:
                    artist.remove()
            images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
    palette = images[-1].quantize(64)
    quantised = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    quantised += [quantised[-1]] * HOLD
    with writing(file):
        quantised[0].save(file, save_all=True, append_images=quantised[1:], duration=60, loop=0, optimize=True)
