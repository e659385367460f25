"""Writing whole files or none, beside what killed processes left behind.

What is not finished lies in a hidden folder `.holokin-<16 hex digits>` beside its target. Its process holds a lock on
it (flock), which the system drops when the process ends, however it ends; so a folder of this name that can be locked
is left over from a process that is gone. Where there is no flock (Windows) nothing is cleared.
"""

from __future__ import annotations

import csv
import errno
import json
import os
import re
import secrets
import shutil
import signal
import stat
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .errors import FileError, WriteError

# --- Files that users give: whether one can be read, and its words in a message.


def is_folder(file: Path) -> bool:
    """True for a folder, False for a regular file. Raises: FileError for a pipe or device, and for no file."""
    try:
        mode = file.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise FileError(file, "there is no such file", "check the path") from None
    except OSError as problem:
        raise FileError(file, f"cannot be looked at ({problem.strerror})", "check the path") from None
    if not (stat.S_ISDIR(mode) or stat.S_ISREG(mode)):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a device or socket"
        raise FileError(file, f"it is {kind}, which may never end", "save it as a file first")
    return stat.S_ISDIR(mode)


def shown(text: str, most: int = 60) -> str:
    """Text from a file for a message: in one line, without control characters, and not longer than `most`."""
    plain = "".join(c if c.isprintable() else " " for c in text[: most + 1])
    return plain if len(plain) <= most else plain[: most - 3] + "..."


def listed(names: Sequence[str], most: int = 24) -> str:
    """Names for a message; of many only the first."""
    tail = f", ... ({len(names)} in all)" if len(names) > most else ""
    return ", ".join(shown(name) for name in names[:most]) + tail


try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_OURS = re.compile(r"\.holokin-[0-9a-f]{16}")
HELD = "old"
"""What was moved out of the way, in a hidden folder: while it is there the folder is not litter."""

PATIENCE = 10.0
"""Seconds to wait for another process that puts its results into the same folder: it takes milliseconds."""

_STREAMS = ("/dev/std", "/dev/fd/", "/proc/")
"""Where the names of open streams begin: these are written to, never replaced."""


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Errors of the system inside become a `WriteError` that names the file."""
    try:
        yield
    except OSError as problem:
        raise WriteError(file, problem) from problem


@contextmanager
def replacing(file: str | Path, *, new: bool = False) -> Iterator[Path]:
    """A path to write to, which becomes `file` when the block ends well: until then the old file stands, whole.

    A pipe or a device is given as it is. A link keeps pointing at its file, which keeps its permissions.

    Args:
        new: refuse a file that is there already.

    Raises:
        WriteError: it cannot be written; `__cause__` is the system's error.
    """
    file = Path(file)
    with writing(file):
        if file.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        there = file.exists()
        if not new and there and (not file.is_file() or str(file.absolute()).startswith(_STREAMS)):
            yield file
            return
        if there and (new or not os.access(file, os.W_OK)):
            code = errno.EEXIST if new else errno.EACCES
            raise OSError(code, os.strerror(code))
        target = file if new else Path(os.path.realpath(file))
        with aside(target.parent) as place:
            part = place / target.name
            yield part
            if there:
                shutil.copymode(target, part)
            (_appear if new else os.replace)(part, target)


def write_csv(file: str | Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a header and rows as CSV, complete or not at all; numbers of Python in full precision.

    Raises:
        WriteError: it cannot be written.
    """
    with replacing(file) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(header)
        writer.writerows(rows)


def write_text(file: str | Path, text: str, *, new: bool = False) -> None:
    """Write a text, complete or not at all; `new` as in `replacing`.

    Raises:
        WriteError: it cannot be written.
    """
    with replacing(file, new=new) as part:
        part.write_text(text, "utf-8")


def write_json(file: str | Path, facts: dict[str, Any]) -> None:
    """The same of facts, as JSON to be read by people, too."""
    write_text(file, json.dumps(facts, indent=2, allow_nan=False) + "\n")


def _appear(part: Path, target: Path) -> None:
    """Move to a name that nobody has. Raises: FileExistsError."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise
    except OSError as problem:  # a file system without hard links
        if os.path.lexists(target):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from problem
        os.rename(part, target)


@contextmanager
def aside(folder: Path, repair: Callable[[Path], None] | None = None) -> Iterator[Path]:
    """A hidden folder in a folder, for what is not finished; removed at the end, or by the next call in that folder.

    Args:
        repair: as in `clear`, of what is left over and, at the end, of this one.
    """
    clear(folder, repair)
    place, lock = _hidden_folder(folder)
    try:
        yield place
    finally:
        with uninterrupted():
            _remove(place, repair)
            if lock is not None:
                os.close(lock)


def clear(folder: Path, repair: Callable[[Path], None] | None = None) -> None:
    """Remove the hidden folders that killed processes of this user have left in a folder.

    Args:
        repair: gets the path of one that holds something moved out of the way (in `HELD`), to bring it back;
            without it, or where it leaves something, such a folder stays.
    """
    try:
        with os.scandir(folder) as entries:
            left = [Path(e.path) for e in entries if _OURS.fullmatch(e.name) and e.is_dir(follow_symlinks=False)]
    except OSError:
        return  # no folder, or none that may be read: nothing to see
    for place in left:
        lock = _locked(place)
        if lock is None:
            continue
        try:
            if os.fstat(lock).st_uid == os.geteuid():
                _remove(place, repair)
        finally:
            os.close(lock)


def _remove(place: Path, repair: Callable[[Path], None] | None) -> None:
    held = place / HELD
    if held.is_dir() and any(held.iterdir()):
        if repair is not None:
            with suppress(OSError):  # what cannot go back stays; the next call tries again
                repair(place)
        if held.is_dir() and any(held.iterdir()):
            return
    shutil.rmtree(place, ignore_errors=True)


def _hidden_folder(folder: Path) -> tuple[Path, int | None]:
    """A new hidden folder, and the lock on it; None where there are no locks."""
    while True:
        place = folder / f".holokin-{secrets.token_hex(8)}"
        place.mkdir()
        lock = _locked(place)
        if lock is not None or not _locks(folder) or not os.access(place, os.R_OK):
            return place, lock
        # another process took it for left over before it was locked: it is gone, or will be


def _locks(folder: Path) -> bool:
    """True where the file system of a folder has locks."""
    if fcntl is None:
        return False
    try:
        lock = os.open(folder, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as problem:
        return problem.errno in (errno.EWOULDBLOCK, errno.EACCES)
    finally:
        os.close(lock)
    return True


def _locked(folder: Path) -> int | None:
    """The lock on a folder, to be closed; None where another process has it, or there is no such folder or lock."""
    if fcntl is None:
        return None
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(lock), os.stat(folder)):
            return lock
    except OSError:
        pass
    os.close(lock)
    return None


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """One process at a time in the block, for a folder; where there are no locks it is entered at once.

    Raises:
        TimeoutError: another process stays in it for `PATIENCE` seconds.
    """
    until = time.monotonic() + PATIENCE
    while (lock := _locked(folder)) is None and _locks(folder):
        if time.monotonic() > until:
            raise TimeoutError(errno.ETIMEDOUT, "another process is putting its results there and does not end")
        time.sleep(0.01)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C, and SIGTERM where it is listened to, are heard at the end of the block. (Only the main thread hears.)"""
    heard: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    before = {number: handler for number, handler in before.items() if callable(handler)}
    if threading.current_thread() is not threading.main_thread():
        before = {}
    for number in before:
        signal.signal(number, lambda number, _frame: heard.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for number in heard[:1]:
        before[signal.Signals(number)](number, None)


def put(work: Path, target: Path, ours: set[str]) -> None:
    """Move a finished folder to its place, and from the folder that stood there all that is not ours.

    All of it or, where the system refuses, nothing; killed midway, `restore` goes on from there.

    Args:
        work: `PLACE/new/NAME`, in a hidden folder.
        ours: names in the folder that stands there which go with it; the rest moves to the new one, and gets ".kept"
            at its end where the name is taken.
    """
    held = work.parent.parent / HELD / target.name
    done: list[tuple[Path, Path]] = []

    def move(source: Path, place: Path) -> None:
        with writing(target if source in (work, target) else target / source.name):
            os.rename(source, place)
        done.append((source, place))

    held.parent.mkdir(exist_ok=True)
    try:
        if os.path.lexists(target):
            move(target, held)
        move(work, target)
        if held.is_dir():
            _keep(held, target, ours, move)
    except BaseException:
        for source, place in reversed(done):
            with suppress(OSError):  # what cannot go back stays in the hidden folder, which then is not removed
                os.rename(place, source)
        raise
    _let_go(held.parent)


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Write texts into a folder, made if need be, over files of the same names: all or, where the system refuses, none.

    Args:
        texts: by name, which may lead into a folder of the folder.

    Raises:
        WriteError: it cannot be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with writing(folder), aside(folder) as place:
        for name, text in texts.items():
            with writing(folder / name):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (place / "new" / name).parent.mkdir(parents=True, exist_ok=True)
                (place / "new" / name).write_text(text, "utf-8", newline="\n")
        with alone(folder), uninterrupted():
            _replace(place / "new", folder, list(texts))


def _replace(work: Path, folder: Path, names: list[str]) -> None:
    """Move finished files into a folder, over those of the same names: all or, where the system refuses, none."""
    copies = work.with_name("before")
    copies.mkdir()
    done: list[str] = []
    try:
        for name in names:
            with writing(folder / name):
                if (folder / name).exists():
                    (copies / name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(folder / name, copies / name)
        for name in names:
            with writing(folder / name):
                os.replace(work / name, folder / name)
            done.append(name)
    except BaseException:
        for name in done:
            with suppress(OSError):
                if (copies / name).exists():
                    os.replace(copies / name, folder / name)
                else:
                    os.unlink(folder / name)
        raise


def restore(place: Path, ours: Callable[[Path], set[str]]) -> None:
    """Bring back what a killed `put` left in a hidden folder: the whole folder, or what the new one still lacks.

    Args:
        ours: the names in an old folder that need not be kept.
    """
    for held in sorted((place / HELD).iterdir()):
        target = place.parent / held.name
        if not os.path.lexists(target):
            os.rename(held, target)
        elif target.is_dir() and not target.is_symlink():
            _keep(held, target, ours(held), os.rename)
        else:
            return
    _let_go(place / HELD)


def _keep(held: Path, target: Path, ours: set[str], move: Callable[[Path, Path], None]) -> None:
    for entry in sorted(held.iterdir()):
        if entry.name not in ours:
            free = target / entry.name
            while os.path.lexists(free):
                free = free.with_name(f"{free.name}.kept")
            move(entry, free)


def _let_go(held: Path) -> None:
    """From here on it is litter: one step, so that a half-removed folder is never taken for one to bring back."""
    os.rename(held, held.with_name("done"))
