"""Bad calls of the whole public surface end in a `HolokinError` or not at all."""

from __future__ import annotations

import contextlib
import signal
import time
from pathlib import Path

import pytest
from benchmarks.fuzz import calls, harness

import holokin as hk
from holokin.base.errors import ArgumentError, HolokinError


@pytest.mark.campaign
def test_every_public_function_is_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # one call of each takes less time than a compiler
    assert calls.uncalled() == set()
    answered = 0
    for function, arguments, named in calls.calls().values():
        try:
            function(*arguments, **named)
            answered += 1
        except HolokinError:  # no such file, no masses
            continue
    assert answered > 0.8 * len(calls.calls())


def test_of_100_bad_calls_none_ends_in_a_stranger_s_exception() -> None:
    found = [harness.one("calls", seed) for seed in range(100)]
    assert [(seed, calls.mutant(seed)[0], fault) for seed, _, _, fault in found if fault] == []
    assert sum(refused for _, refused, _, _ in found) > 60


@pytest.mark.parametrize("rows", [[0.5], 0.5, [True], ["0"], [0, 1.0]])
def test_a_half_is_no_row_of_a_task(planar_3r: hk.Robot, rows: object) -> None:
    with pytest.raises(ArgumentError, match="rows is"):
        hk.position(planar_3r, rows=rows)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError):
        hk.position(planar_3r)[rows]  # type: ignore[index]


def test_numbers_as_text_and_nothing_as_nan_are_no_numbers(planar_3r: hk.Robot) -> None:
    law = hk.moore_penrose(hk.position(planar_3r))
    for q in (["0.1", "0.2", "0.3"], [None, None, None], [1j, 0, 0], [10**400, 0, 0], [[0.1], [0.2, 0.3]]):
        with pytest.raises(ArgumentError, match="q is"):
            law(q)


def test_the_message_names_argument_and_kind(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    with pytest.raises(ArgumentError, match=r"strategy is Task\(.*; give a strategy with leaves"):
        hk.motion.ik.move_to_leaf(task, [0.1, 0.2, 0.3])  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="limits is 'no'; give True or False"):
        hk.follow(hk.moore_penrose(task), hk.line([0, 0], [1, 0]), [0.1, 0.2, 0.3], limits="no")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="joints is not given; give text or a whole number"):
        hk.lock(None)  # type: ignore[arg-type]


def test_a_call_that_takes_too_long_is_stopped_whatever_it_catches_and_ctrl_c_is_python_s_again() -> None:
    """By no signal that Windows lacks."""
    before, begin = signal.getsignal(signal.SIGINT), time.perf_counter()
    with pytest.raises(harness.TooLongError), harness.limited(0.05):
        while True:
            with contextlib.suppress(Exception):
                sum(range(100))
    assert time.perf_counter() - begin < 5
    with harness.limited(5.0):
        pass
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt), harness.limited(5.0):
        signal.raise_signal(signal.SIGINT)
