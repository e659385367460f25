"""The C compiler: which one, and calls of it that end and that cannot fill the memory, whatever it does."""

from __future__ import annotations

import importlib.util
import logging
import os
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from functools import cache

ASKING = 10.0
"""Seconds that a compiler may take to say its version."""

HEARD = 65_536
"""Bytes of what a compiler says that are kept: enough for the first error. The rest is read and dropped."""


_calls: set[subprocess.Popen[bytes]] = set()
_stopped = threading.Event()


@dataclass(frozen=True)
class Compiler:
    """A C compiler: the words that call it, and what it says it is."""

    command: tuple[str, ...]
    version: str

    def __str__(self) -> str:
        return self.version


@cache
def compiler() -> Compiler | None:
    """The C compiler: CC of the environment, else cc, gcc, clang, else ziglang of Python; None without any."""
    given = os.environ.get("CC", "").strip()
    if given:
        found, why = _chosen(given)
        if found is not None:
            return found
        logging.getLogger("holokin").warning("CC is %r, which is left out (%s)", given, why)
    commands: list[tuple[str, ...]] = [(name,) for name in ("cc", "gcc", "clang")]
    if importlib.util.find_spec("ziglang") is not None:
        commands.append((sys.executable, "-m", "ziglang", "cc"))
    return next((found for found in map(_asked, commands) if found is not None), None)


def call(command: tuple[str, ...], patience: float, stream: str) -> tuple[int, str]:
    """Run a command: (exit status, the beginning of what it says on `stream`, "stdout" or "stderr").

    Raises:
        OSError: it cannot be started. subprocess.TimeoutExpired: it took longer than `patience` [s] and was killed,
        with all that it had started.
    """
    if _stopped.is_set():
        raise OSError("the interpreter is ending")
    out, err = (subprocess.PIPE if stream == name else subprocess.DEVNULL for name in ("stdout", "stderr"))
    child = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, bufsize=0, start_new_session=os.name == "posix"
    )
    _calls.add(child)
    pipe, heard = getattr(child, stream), bytearray()

    def listen() -> None:
        with pipe, suppress(OSError):
            while piece := pipe.read(HEARD):
                heard.extend(piece[: HEARD - len(heard)])

    listener = threading.Thread(target=listen, daemon=True)
    try:
        listener.start()
        status = child.wait(patience)
    except BaseException:  # Ctrl-C included: a session of its own does not hear the terminal
        _kill(child)
        raise
    finally:
        _calls.discard(child)
    listener.join(1.0)  # not for ever: something that the compiler left running may hold the pipe
    return status, bytes(heard).decode("utf-8", "replace")


def stop_all() -> None:
    """End the calls that run, and refuse others: for the end of the interpreter."""
    _stopped.set()
    for child in _calls.copy():
        _signal(child)


def stopped() -> bool:
    """True after `stop_all`."""
    return _stopped.is_set()


def forget_calls() -> None:
    """In a child of this process, for which the calls of its parent are not its own."""
    _calls.clear()


def plain(text: str, most: int = 200) -> str:
    """Text that every terminal and log takes: printable ASCII on one line, no more than `most` characters."""
    line = "".join(letter if letter.isprintable() else " " for letter in text)
    return " ".join(line.split()).encode("ascii", "backslashreplace").decode()[:most]


def _chosen(given: str) -> tuple[Compiler | None, str]:
    """The compiler that CC names, or why there is none."""
    try:
        words = tuple(shlex.split(given))
    except ValueError as problem:
        return None, str(problem).lower()
    found = _asked(words) if words else None
    return found, "it is no program that says its version"


def _asked(command: tuple[str, ...]) -> Compiler | None:
    """The compiler of a command, if it is there and says its version."""
    if shutil.which(command[0]) is None:
        return None
    try:
        status, said = call((*command, "--version"), ASKING, "stdout")
    except (OSError, subprocess.TimeoutExpired):
        return None
    version = plain(said.strip().partition("\n")[0])
    return Compiler(command, version) if status == 0 and version else None


def _kill(child: subprocess.Popen[bytes]) -> None:
    """End a process and, where there are process groups, what it started."""
    _signal(child)
    with suppress(subprocess.TimeoutExpired):
        child.wait(5.0)


def _signal(child: subprocess.Popen[bytes]) -> None:
    with suppress(OSError):
        if os.name == "posix":
            os.killpg(child.pid, signal.SIGKILL)
        child.kill()
