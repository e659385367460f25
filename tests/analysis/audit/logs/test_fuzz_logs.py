"""Mutants of CSV logs and of bags: read and audited, or refused in one sentence, soon and in little memory."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from conftest import campaign

sys.path.insert(0, str(Path(__file__).parents[4]))
from benchmarks.fuzz.harness import run


@pytest.mark.parametrize("kind", ["csv_logs", "bags"])
@pytest.mark.parametrize("count", [20, campaign("count", 150)])
def test_no_mutant_of_a_log_ends_in_a_traceback(kind: str, count: int) -> None:
    if kind == "bags":
        pytest.importorskip("rosbags")
    tally = run(kind, count, workers=1)
    assert tally.done == count
    assert count / 10 < tally.refused < count
    assert [fault for fault in tally.faults if fault[0] >= 0] == []  # the process holds other tests' memory, too
    assert tally.slowest < 20
