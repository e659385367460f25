"""What the tests of broken compilers and poisoned caches share."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from conftest import Command
from holokin.symbolic import Function, symbol
from holokin.symbolic import function as function_module
from holokin.symbolic.native import engine, toolchain
from holokin.symbolic.native import toolchain as native

needs_compiler = pytest.mark.skipif(
    native.compiler() is None or os.name != "posix", reason="needs a C compiler and a POSIX shell"
)
MACHINE, NATIVE = "CasADi's virtual machine (", "native code ("
X = np.linspace(-3, 3, 64)


def forget() -> None:
    toolchain.compiler.cache_clear()
    native._troubles.clear()
    native._told.clear()


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """A process that has not looked for a compiler yet, a cache of its own, and an end to what hangs."""

    def late(*_: object) -> None:
        raise TimeoutError("it hangs")

    forget()
    monkeypatch.setenv("HOLOKIN_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("HOLOKIN_NATIVE", raising=False)
    monkeypatch.setattr(function_module, "NATIVE_FROM", 1)
    caplog.set_level(logging.WARNING, "holokin")
    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
    monkeypatch.undo()
    forget()


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache that holds the libraries of `sines` already: to copy."""
    folder = tmp_path_factory.mktemp("built") / "cache"
    with pytest.MonkeyPatch.context() as within:
        within.setenv("HOLOKIN_CACHE", str(folder))
        within.setattr(function_module, "NATIVE_FROM", 1)
        sines()
    return folder


def sines() -> None:
    """Two new functions give the right numbers, whatever runs."""
    x = symbol("x", 1)
    for k in (1.0, 2.0):
        assert np.abs(Function("sine", {"x": x}, {"y": ca.sin(k * x)}).batch(X[:, None]) - np.sin(k * X)).max() < 1e-15


def check(expected: str, warnings: int, logs: pytest.LogCaptureFixture, holokin: Command) -> list[str]:
    """Right numbers, so many warnings and no more, and a command that says what runs. Returns the warnings."""
    sines()
    assert engine().startswith(expected)
    said = holokin("--version")
    assert said.code == 0
    assert said.err == ""
    assert said.out.isascii() and said.out.count("\n") == 1 and engine() in said.out
    messages = [record.getMessage() for record in logs.records if record.name == "holokin"]
    assert len(messages) == warnings, messages
    assert all(message.isascii() and len(message) < 500 for message in messages)
    return messages
