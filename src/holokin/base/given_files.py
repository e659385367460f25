"""Files that users give: whether one can be read, and its words in a message."""

from __future__ import annotations

import stat
from collections.abc import Sequence
from pathlib import Path

from .errors import RecordingError


def is_folder(file: Path) -> bool:
    """True for a folder, False for a regular file. Raises: RecordingError for a pipe or device, and for no file."""
    try:
        mode = file.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise RecordingError(file, "there is no such file", "check the path") from None
    except OSError as problem:
        raise RecordingError(file, f"cannot be looked at ({problem.strerror})", "check the path") from None
    if not (stat.S_ISDIR(mode) or stat.S_ISREG(mode)):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a device or socket"
        raise RecordingError(file, f"it is {kind}, which may never end", "save it as a file first")
    return stat.S_ISDIR(mode)


def shown(text: str, most: int = 60) -> str:
    """Text from a file for a message: in one line, without control characters, and not longer than `most`."""
    plain = "".join(c if c.isprintable() else " " for c in text[: most + 1])
    return plain if len(plain) <= most else plain[: most - 3] + "..."


def listed(names: Sequence[str], most: int = 24) -> str:
    """Names for a message; of many only the first."""
    tail = f", ... ({len(names)} in all)" if len(names) > most else ""
    return ", ".join(shown(name) for name in names[:most]) + tail
