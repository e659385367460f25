"""Films of a job: the two paths of two strategies beside each other, their cycles with the drift, and their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.files import writing
from ...base.types import Vector
from ...motion.trajectory import Status, Trajectory
from . import plots
from .job_figures import strategy_colors, tool_points
from .job_result import JobResult, StrategyResult
from .robot_panels import GHOST, Curve, stage_of
from .robot_view import Layer, Pixels, floor_scale, layer_of, onto, show, solids_at, standing, triad

# --- Films: frames to a file, MP4 where imageio-ffmpeg is installed, else GIF; never larger than `MOST_BYTES`.

MOST_BYTES = 3_000_000
"""Size of a film."""

RATE = 20
"""Frames a second."""

HOLD = 20
"""Times that the last frame is shown."""


def ending() -> str:
    """ ".mp4" where it can be written, else ".gif"."""
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return ".gif"
    return ".mp4"


def write_film(frames: Sequence[Any], file: FilePath, rate: int = RATE) -> None:
    """Write pictures (rows, columns, 3) of bytes as a film of the file's kind, the last one held.

    Raises:
        WriteError: the system refuses the file.
    """
    with writing(file):
        (_write_mp4 if file.suffix == ".mp4" else _write_gif)([*frames, *[frames[-1]] * HOLD], file, rate)


def _write_mp4(frames: Sequence[Any], file: FilePath, rate: int) -> None:
    import imageio_ffmpeg

    rows, columns = (2 * (size // 2) for size in frames[0].shape[:2])  # H.264 wants even sizes
    # Constant rate factors of H.264 to try, the best first, until a film is small enough.
    for quality in (25, 30, 36, 42):
        options = ["-crf", str(quality), "-preset", "veryfast", "-movflags", "+faststart"]
        form = {"fps": rate, "codec": "libx264", "pix_fmt_out": "yuv420p", "macro_block_size": 2}
        form |= {"output_params": options, "ffmpeg_log_level": "error"}
        writer = imageio_ffmpeg.write_frames(str(file), (columns, rows), **form)
        writer.send(None)
        try:
            for frame in frames:
                writer.send(np.ascontiguousarray(frame[:rows, :columns]))
        finally:
            writer.close()
        if file.stat().st_size <= MOST_BYTES:
            return


def _write_gif(frames: Sequence[Any], file: FilePath, rate: int) -> None:
    from PIL import Image

    # Sizes of a GIF to try, until it is small enough.
    for scale in (1.0, 0.75, 0.5, 0.35):
        size = (round(scale * frames[0].shape[1]), round(scale * frames[0].shape[0]))
        images = [Image.fromarray(frame) for frame in frames[: len(frames) - HOLD + 1]]
        images = [image if scale == 1.0 else image.resize(size) for image in images]
        palette = images[len(images) // 2].quantize(96)
        flat = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
        flat += [flat[-1]] * (HOLD - 1)
        flat[0].save(file, save_all=True, append_images=flat[1:], duration=1000 // rate, loop=0, optimize=False)
        if file.stat().st_size <= MOST_BYTES:
            return


FRAMES = 45
"""Frames of the two paths; and the least number of those of the cycles."""

MOST_FRAMES = 140
"""Frames of the cycles."""

WIDTH = 420
"""Of a panel [pixels]."""

DPI = 100

TOP, STRIP, SIDE = 52, 120, 60
"""Room for the titles, for the drift below, and left of it [pixels]."""

CONTROLS = 44
"""Room below the drift [pixels]: browsers lay the buttons of a film over its lower edge."""


@dataclass(frozen=True, eq=False)
class Panel:
    """What a panel of a film shows: motions, each in a colour and solid or pale, and its title at a share of them."""

    walks: tuple[tuple[Trajectory, str, float], ...]
    title: Callable[[float], str]


def animate(
    result: JobResult, folder: FilePath, say: Callable[[str], None] = lambda _text: None
) -> list[tuple[str, str]]:
    """Write `paths` where there are two paths, and `cycles` where there are several, as .mp4 or .gif.

    Returns:
        The names of the files, each with its caption.

    Raises:
        WriteError: the system refuses a file.
    """
    if not result.robot.tips:
        return []
    # The films that the job has.
    films, written, shown = [], [], shown_strategies(result)
    apart = tuple(s for s in shown if s.two_paths is not None)
    if result.cycles > 1:
        caption = (
            "The cycles: the start is pale pink. At the end of each cycle the tool is back; below, how far the joints "
            "are from their start then. The joints of a strategy that repeats here are back too."
        )
        films.append(("cycles", caption, lambda: cycles_frames(result, shown)))
    if apart:
        caption = (
            "The two paths: clockwise (light blue) and counter-clockwise (orange), half a loop each, to one pose of "
            "the tool. By a strategy that repeats here the two robots meet there; by any other they end apart."
        )
        films.append(("paths", caption, lambda: two_path_frames(result, apart)))
    # Their files.
    for stem, caption, frames in films:
        name = f"{stem}{ending()}"
        say(f"drawing {name}")
        write_film(list(frames()), folder / name)
        written.append((name, caption))
    return written


def shown_strategies(result: JobResult) -> tuple[StrategyResult, ...]:
    """All of up to three strategies; of more the first that is not holonomic, such as the pseudo-inverse, and the first
    holonomic one.
    """
    # Panels of a film: all strategies of a job that has no more, else the two that differ.
    if len(result.drawn) <= 3:
        return result.drawn
    first = {s.verdict.holonomic: s for s in reversed(result.drawn)}
    pair = tuple(first[kind] for kind in (False, True) if kind in first)
    return pair if len(pair) == 2 else result.drawn[:2]


def two_path_frames(result: JobResult, strategies: tuple[StrategyResult, ...]) -> Iterator[Pixels]:
    """The two paths at once, in one panel a strategy; a way that stops says when, and nothing is compared."""
    panels = []
    for strategy in strategies:
        if strategy.two_paths is None:
            continue
        clockwise, counter = strategy.two_paths
        ends = [
            f"{name} {plots.stopped(walk) or 'followed to the end'}"
            for name, walk in zip(("clockwise", "counter-clockwise"), strategy.two_paths, strict=True)
        ]
        complete = clockwise.status is counter.status is Status.COMPLETE
        end = plots.paths_end(strategy.two_paths) if complete else "; ".join(ends)

        def title(share: float, name: str = plots.on_figure(strategy.name, 44), end: str = end) -> str:
            return f"{name}\n{end if share == 1.0 else 'half a loop, both paths'}"

        panels.append(Panel(((clockwise, plots.CLOCKWISE, 1.0), (counter, plots.COUNTER_CLOCKWISE, 0.62)), title))
    yield from _frames(result, panels, FRAMES)


def cycles_frames(result: JobResult, strategies: tuple[StrategyResult, ...]) -> Iterator[Pixels]:
    """The cycles, one panel a strategy, the start in pale pink, and below how far the joints are after each cycle."""
    panels = []
    for strategy in strategies:
        color = strategy_colors(result)[strategy.name]

        def title(
            share: float, walk: Trajectory = strategy.cycles, name: str = plots.on_figure(strategy.name, 44)
        ) -> str:
            done = _done(walk, share)
            ended = plots.stopped(walk) if share == 1.0 else ""
            return f"{name}\n{ended or (plots.away(walk, done) if done else 'the start in pale pink')}"

        panels.append(Panel(((strategy.cycles, color, 1.0),), title))
    frames = int(np.clip(28 * result.cycles, FRAMES, MOST_FRAMES))
    yield from _frames(result, panels, frames, drift=any(s.cycles.cycles for s in strategies))


def _done(walk: Trajectory, share: float) -> int:
    """Cycles that are done at a share of a motion."""
    return sum(mark <= share * (len(walk) - 1) for mark in walk.marks[1:])


def _frames(result: JobResult, panels: list[Panel], frames: int, *, drift: bool = False) -> Iterator[Pixels]:
    """Pictures (rows, columns, 3) of bytes: what stands still is drawn once."""
    from matplotlib import rc_context

    with rc_context(plots.style()):
        sheet = _Sheet(result, panels, drift)
        for frame in range(frames + 1):
            yield sheet.at(frame / frames)


class _Sheet:
    """The paper of a film: robots are laid onto what was drawn once, titles and dots of the drift onto that."""

    def __init__(self, result: JobResult, panels: list[Panel], drift: bool) -> None:
        self.panels, self.robot = panels, result.robot
        walks = [walk for panel in panels for walk, _, _ in panel.walks]
        postures = np.vstack([result.q0[None], *(walk.q[:: max(1, len(walk) // 24)] for walk in walks)])
        curves = [Curve(points, plots.LOOP) for walk in walks for points in tool_points(result, walk)]
        pairs = [(panel.walks[-1][0].q[-1], panel.walks[0][0].q[-1]) for panel in panels]
        if len(panels[0].walks) == 1:
            pairs = [(result.q0, panel.walks[0][0].q[-1]) for panel in panels]
        self.stage = stage_of(self.robot, postures, curves, pairs=pairs, obstacles=result.obstacles, ratio=(0.6, 1.1))
        self.window = self.stage.scene.window(WIDTH)
        self.start, self.drift = result.q0, drift
        self.unit, self.cycles = plots.joint_unit(self.robot), result.cycles
        self._draw()
        base = [] if self.robot.planar else triad(np.zeros(3), np.eye(3), 4.5 * self.stage.unit)
        still = [p for p in self.stage.pieces if p.joint < 0]
        base += solids_at(still, self.stage.frames(self.start), 0, plots.GREY)
        self.things = layer_of(self.stage.scene, [*base, *standing(self.stage.obstacles)], self.window)
        self.ghost = self.stage.layer(self.start, plots.START, self.window, axes=False, still=False)
        self.grounds = [self._ground(*place) for place in self.places]
        self.loops = [
            layer_of(self.stage.scene, self.stage.wires(self._paths(result, panel)), self.window) for panel in panels
        ]

    def _paths(self, result: JobResult, panel: Panel) -> list[Curve]:
        several = len(panel.walks) > 1
        return [
            Curve(points, color if several else plots.LOOP)
            for walk, color, _ in panel.walks
            for points in tool_points(result, walk)
        ]

    def _draw(self) -> None:
        """The background, once."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        # The size of the film, and where each panel is.
        side = SIDE if self.robot.planar or self.drift else 12
        below = (STRIP + 46 + CONTROLS if self.drift else 8) + (40 if self.robot.planar else 0)
        width = len(self.panels) * (WIDTH + side) + 16
        height = self.window.rows + TOP + below
        width, height = width + width % 2, height + height % 2
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(figure)
        self.places, self.titles, self.dots = [], [], []
        for i in range(len(self.panels)):
            left = side + i * (WIDTH + side)
            place = (left / width, below / height, WIDTH / width, self.window.rows / height)
            axes = figure.add_axes(place)
            show(axes, self.stage.scene, np.zeros((2, 2, 4)), self.window)
            if not self.robot.planar:
                floor_scale(axes, self.stage.scene)
            self.places.append((TOP + (height - TOP - below - self.window.rows), left))
            title = figure.text(left / width, 1 - 6 / height, "", va="top", ha="left", fontsize=10.5, color=plots.INK)
            self.titles.append(title)
            if self.drift:
                strip = figure.add_axes((left / width, (42 + CONTROLS) / height, WIDTH / width, (STRIP - 26) / height))
                self.dots.append(self._strip(strip, i))
        # All but titles and dots, drawn once.
        for artist in (*self.titles, *self.dots):
            artist.set_animated(True)
        self.canvas.draw()
        self.still = np.asarray(self.canvas.buffer_rgba()).copy()
        self.region = self.canvas.copy_from_bbox(figure.bbox)

    def _strip(self, axes: Any, i: int) -> Any:
        """The drift after each cycle, of which dots appear."""
        most = max(float(_sizes(panel.walks[0][0]).max()) for panel in self.panels)
        axes.set_xlim(-0.15, self.cycles + 0.15)
        axes.set_ylim(-0.06 * max(most, 1e-9), 1.15 * max(most, 1e-9))
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.locator_params(axis="y", nbins=3)
        axes.set_xlabel("cycles done", fontsize=9, labelpad=1)
        axes.set_ylabel(f"drift [{self.unit}]" if i == 0 else "", fontsize=9)
        axes.tick_params(labelsize=8)
        color = self.panels[i].walks[0][1]
        return axes.plot([], [], "o-", color=color, markersize=5, linewidth=2)[0]

    def at(self, share: float) -> Pixels:
        """The frame at a share of the motions."""
        self.canvas.restore_region(self.region)
        buffer = np.asarray(self.canvas.buffer_rgba())
        for panel, (row, column), ground, loop in zip(self.panels, self.places, self.grounds, self.loops, strict=True):
            panel_pixels = buffer[row : row + self.window.rows, column : column + self.window.columns]
            panel_pixels[..., :3] = self._picture(ground.copy(), panel, loop, share)
        for panel, title in zip(self.panels, self.titles, strict=True):
            title.set_text(panel.title(share))
            title.axes = None
            self.canvas.figure.draw_artist(title)
        for panel, dots in zip(self.panels, self.dots, strict=False):
            walk = panel.walks[0][0]
            done = _done(walk, share)
            dots.set_data(range(done + 1), _sizes(walk)[: done + 1])
            dots.axes.draw_artist(dots)
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()

    def _ground(self, row: int, column: int) -> Pixels:
        """What stands still in a panel: the floor, obstacles, base, and the start as a ghost."""
        panel_pixels = self.still[row : row + self.window.rows, column : column + self.window.columns, :3]
        picture = panel_pixels.astype(np.float32) / 255
        onto(picture, self.things)
        onto(picture, self.ghost, GHOST)
        return picture

    def _picture(self, pixels: Pixels, panel: Panel, loop: Layer, share: float) -> Pixels:
        depth = self.things.depth
        for walk, color, alpha in panel.walks:
            q = walk.q[round(share * (len(walk) - 1))]
            layer = self.stage.layer(q, color, self.window, still=False)
            onto(pixels, layer, alpha, np.where(layer.depth >= self.things.depth, np.float32(1.0), np.float32(0.3)))
            depth = np.maximum(depth, layer.depth) if alpha == 1.0 else depth
        hidden = np.float32(1.0 if self.robot.planar else 0.3)
        onto(pixels, loop, 1.0, np.where(loop.depth >= depth - 1e-4, np.float32(1.0), hidden))
        return (255 * np.clip(pixels, 0, 1) + 0.5).astype(np.uint8)


def _sizes(walk: Trajectory) -> Vector:
    """The largest joint's distance from the start, at the start and after each cycle."""
    return np.concatenate([[0.0], np.abs(walk.drift_since_start()).max(axis=1)]) if walk.cycles else np.zeros(1)
