"""150 mutants each of CSV logs and of bags: read and audited, or refused in one sentence, soon and in little memory."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from benchmarks.fuzz.harness import run


@pytest.mark.parametrize("kind", ["csv_logs", "bags"])
def test_no_mutant_of_a_log_ends_in_a_traceback(kind: str) -> None:
    if kind == "bags":
        pytest.importorskip("rosbags")
    tally = run(kind, 150, workers=1)
    assert tally.done == 150
    assert 15 < tally.refused < 150
    assert [fault for fault in tally.faults if fault[0] >= 0] == []  # the process holds other tests' memory, too
    assert tally.slowest < 20
