"""Films: frames to a file, MP4 where imageio-ffmpeg is installed, else GIF; never larger than `MOST_BYTES`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.files import writing

MOST_BYTES = 3_000_000
"""Size of a film."""

RATE = 20
"""Frames a second."""

HOLD = 20
"""Times that the last frame is shown."""

QUALITY = (25, 30, 36, 42)
"""Constant rate factors of H.264 to try, the best first, until a film is small enough."""

SCALES = (1.0, 0.75, 0.5, 0.35)
"""Sizes of a GIF to try, until it is small enough."""


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
    for quality in QUALITY:
        options = ["-crf", str(quality), "-preset", "veryfast", "-movflags", "+faststart"]
        writer = imageio_ffmpeg.write_frames(
            str(file), (columns, rows), fps=rate, codec="libx264", pix_fmt_out="yuv420p", macro_block_size=2,
            output_params=options, ffmpeg_log_level="error",
        )  # fmt: skip
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

    for scale in SCALES:
        size = (round(scale * frames[0].shape[1]), round(scale * frames[0].shape[0]))
        images = [Image.fromarray(frame) for frame in frames[: len(frames) - HOLD + 1]]
        images = [image if scale == 1.0 else image.resize(size) for image in images]
        palette = images[len(images) // 2].quantize(96)
        flat = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
        flat += [flat[-1]] * (HOLD - 1)
        flat[0].save(file, save_all=True, append_images=flat[1:], duration=1000 // rate, loop=0, optimize=False)
        if file.stat().st_size <= MOST_BYTES:
            return
