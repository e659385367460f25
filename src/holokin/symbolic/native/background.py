"""Work in the background: one thread does one piece after another, and no exit of the interpreter waits for it.

The thread ends when nothing is left to do. At exit, compilers that still run are stopped, and their files removed.
A process that forks leaves the thread behind: its child begins again what was not done.
"""

from __future__ import annotations

import atexit
import os
import threading
import time
import weakref
from collections import deque
from typing import Protocol

from . import toolchain

ENDING = 2.0
"""Seconds at exit that the thread may take to remove its files: it takes milliseconds."""


class Worker(Protocol):
    """Who has work to do in the background: `work` does it, `again` sees to it that it is asked for again."""

    def work(self) -> None:
        """Do it; it raises nothing."""
        ...

    def again(self) -> None:
        """It was not done."""
        ...


class _Queue:
    """What is left to do; workers that nobody else keeps are dropped."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.waiting: deque[weakref.ref[Worker]] = deque()
        self.thread: threading.Thread | None = None

    def put(self, worker: Worker) -> None:
        """One more; the thread is started if none runs."""
        with self.lock:
            self.waiting.append(weakref.ref(worker))
            if self.thread is None:
                self.thread = threading.Thread(target=self.run, name="holokin-later", daemon=True)
                try:
                    self.thread.start()
                except RuntimeError:  # the interpreter is ending, or there are too many threads
                    self.thread = None

    def run(self) -> None:
        """The thread."""
        try:
            while (worker := self.first()) is not None:
                try:
                    worker.work()
                finally:
                    del worker
                    self.waiting.popleft()
        except BaseException as problem:
            self.thread = None
            if not (isinstance(problem, RuntimeError) and toolchain.stopped()):  # Python that ends starts no threads
                raise

    def first(self) -> Worker | None:
        """Whose turn it is; it stays the first until it is done. None, and no thread, where nothing is left."""
        with self.lock:
            while self.waiting and not toolchain.stopped():
                worker = self.waiting[0]()
                if worker is not None:
                    return worker
                self.waiting.popleft()
            self.thread = None  # under the lock, so that whoever puts more starts another
            return None

    def end(self) -> None:
        """Stop the compilers, and see the thread end."""
        thread, until = self.thread, time.monotonic() + ENDING
        toolchain.stop_all()
        while thread is not None and thread.is_alive() and time.monotonic() < until:
            thread.join(0.02)
            toolchain.stop_all()  # also a call that was about to start


_queue = _Queue()


def later(worker: Worker) -> None:
    """Have `worker.work()` done in the background, unless nobody else keeps it until then."""
    _queue.put(worker)


def idle(patience: float) -> bool:
    """Wait until nothing is left to do, at most some seconds; True when that is so."""
    until = time.monotonic() + patience
    while _queue.waiting and time.monotonic() < until:
        time.sleep(0.002)
    return not _queue.waiting


def _begin_again() -> None:
    """In a child: the thread and its locks were the parent's."""
    global _queue
    undone, _queue = [worker() for worker in _queue.waiting], _Queue()
    toolchain.forget_calls()
    for worker in undone:
        if worker is not None:
            worker.again()


atexit.register(lambda: _queue.end())
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_again)
