"""150 mutants of each kind of file that people write: none ends in anything but a result or a refusal."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.fuzz import harness


@pytest.mark.parametrize("kind", ["jobs", "urdfs", "dh"])
def test_a_mutant_is_done_or_refused(kind: str) -> None:
    found = [harness.one(kind, seed) for seed in range(150)]
    faults = {seed: fault for seed, _, _, fault in found if fault}
    refused = sum(refusal for _, refusal, _, _ in found)
    assert faults == {}
    assert 15 < refused < 147  # both ends of the code are reached
