"""Work in a child of this process, which has imported everything that it takes."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from conftest import Outcome
from holokin.app.cli import main as cli

PATIENCE = 280
"""Seconds after which a child is ended that hangs."""


@dataclass(frozen=True)
class Child:
    """What runs there."""

    process: int
    streams: tuple[int, int]

    def wait(self) -> Outcome:
        """What it leaves behind when it has ended; -9 is the code of one that was killed."""
        said = []
        for stream in self.streams:
            with open(stream, encoding="utf-8") as pipe:
                said.append(pipe.read())
        return Outcome(os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1]), *said)


def child(*words: object, work: Callable[[], object], folder: Path | None = None) -> Child:
    """Begin work in a folder that reads sys.argv; what it changes, it changes there alone. Its code: what it gives."""
    out, err = os.pipe(), os.pipe()
    process = os.fork()
    if process:
        os.close(out[1])
        os.close(err[1])
        return Child(process, (out[0], err[0]))
    code: object = 70
    try:
        os.dup2(out[1], 1)
        os.dup2(err[1], 2)
        for read_end in (out[0], err[0]):
            os.close(read_end)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8") for number in (1, 2))
        signal.alarm(PATIENCE)
        signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background ignore it
        if folder is not None:
            os.chdir(folder)
        sys.argv = [*map(str, words)]
        code = work() or 0
    except SystemExit as end:
        code = 0 if end.code is None else end.code
    finally:
        if code == 70:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 71)


def start(*arguments: object, before: Callable[[], object], folder: Path | None = None) -> Child:
    """Begin a command, after a function."""

    def work() -> None:
        before()
        cli.main()

    return child("holokin", *arguments, work=work, folder=folder)


def forked(*arguments: object, before: Callable[[], object], folder: Path | None = None) -> Outcome:
    """What a command leaves behind that runs so."""
    return start(*arguments, before=before, folder=folder).wait()
