"""150 mutants of each kind of file that people write: none ends in anything but a result or a refusal."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[3]))

from benchmarks.fuzz import harness

from conftest import sampled


def test_a_spoilt_map_of_sheets_is_refused_in_words_or_answers_at_its_poses() -> None:
    """Of its bytes, arrays, headers, numbers and words: no zlib.error, no IndexError, no memory by a header's word."""
    found = [harness.one("sheets_files", seed) for seed in range(16)]
    assert {seed: fault for seed, _, _, fault in found if fault} == {}
    assert 8 < sum(refusal for _, refusal, _, _ in found) < 16


@pytest.mark.campaign
@sampled(2, ("kind", "count"), [
    ("survey_files", 150), ("certificate_files", 60), ("mjcf_files", 60), ("drawings", 40), ("sheets_files", 3000),
    ("datasets", 1000),
])  # fmt: skip
def test_a_mutant_of_what_others_send_is_read_or_refused(kind: str, count: int) -> None:
    extras = {"datasets": "pyarrow", "mjcf_files": "mujoco", "drawings": "svgelements", "certificate_files": "flint"}
    if kind in extras:
        pytest.importorskip(extras[kind])
    found = [harness.one(kind, seed) for seed in range(count)]
    assert {seed: fault for seed, _, _, fault in found if fault} == {}
    assert count / 10 < sum(refusal for _, refusal, _, _ in found) < count


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["jobs", "urdfs", "dh"])
def test_a_mutant_is_done_or_refused(kind: str) -> None:
    found = [harness.one(kind, seed) for seed in range(150)]
    faults = {seed: fault for seed, _, _, fault in found if fault}
    refused = sum(refusal for _, refusal, _, _ in found)
    assert faults == {}
    assert 15 < refused < 147  # both ends of the code are reached
