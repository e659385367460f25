"""The choice of sheets along a path, held against every choice there is."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holokin.analysis.sheets.seams import fewest_changes


def every_choice(steps: np.ndarray, served: np.ndarray, change: np.ndarray, first: int | None) -> tuple:
    """The least (divisions, changes, seconds) of all choices that take a sheet on each step that one serves."""
    choices = [np.flatnonzero(row).tolist() or [-1] for row in served.T]
    found = []
    for labels in product(*choices):
        divisions = changes = 0
        seconds = sum(steps[s, i] for i, s in enumerate(labels) if s >= 0)
        last = -1 if first is None else first
        away = False
        for i, s in enumerate(labels):
            if s < 0:
                away = True
                continue
            if last >= 0 and (away and i and any(x >= 0 for x in labels[:i])):
                divisions += 1
            elif last >= 0 and s != last and not away:
                if np.isfinite(change[i, last, s]):
                    changes += 1
                    seconds += change[i, last, s]
                else:
                    divisions += 1
            last, away = s, False
        found.append((divisions, changes, seconds))
    return min(found)


@given(
    st.integers(1, 3), st.integers(1, 6), st.floats(0.2, 1.0), st.floats(0.0, 1.0), st.booleans(), st.integers(0, 10**6)
)
def test_no_choice_has_fewer_divisions_or_changes_or_less_motion(
    S: int, k: int, fill: float, joined: float, begun: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    served, steps = rng.random((S, k)) < fill, rng.random((S, k))
    change = np.where(rng.random((k, S, S)) < joined, rng.random((k, S, S)), np.inf)
    first = int(rng.integers(S)) if begun else None
    found = fewest_changes(steps, served, change, first)
    divisions, changes, seconds = every_choice(steps, served, change, first)
    assert (found.divisions, found.changes) == (divisions, changes)
    assert found.seconds == pytest.approx(seconds, abs=1e-12)
    taken = found.sheets
    assert ((taken >= 0) == served.any(axis=0)).all()
    assert all(served[s, i] for i, s in enumerate(taken) if s >= 0)


def test_one_sheet_that_serves_all_is_kept_though_another_is_faster() -> None:
    """A change counts more than any motion. Where the slow sheet ends, the change is where it is cheapest."""
    steps = np.array([[9.0] * 6, [1.0] * 6])
    served = np.ones((2, 6), dtype=bool)
    change = np.full((6, 2, 2), 0.1)
    assert fewest_changes(steps, served, change, 0).sheets.tolist() == [0] * 6
    served[0, 4:], served[1, :2] = False, False
    change[:, 0, 1] = [5, 5, 5, 5, 20, 5]
    assert fewest_changes(steps, served, change).sheets.tolist() == [0, 0, 1, 1, 1, 1]
    change[:, 0, 1] = [5, 5, np.inf, 30, 50, 5]
    assert fewest_changes(steps, served, change).sheets.tolist() == [0, 0, 0, 1, 1, 1]


def test_a_change_that_cannot_be_made_divides_the_path_and_a_gap_counts_once() -> None:
    served = np.array([[1, 1, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0]], dtype=bool)
    found = fewest_changes(np.ones((2, 6)), served, np.full((6, 2, 2), np.inf))
    assert found.sheets.tolist() == [0, 0, 1, -1, -1, 0]
    assert (found.divisions, found.changes, found.turnings) == (2, 0, [(2, 0, 1)])
    none = fewest_changes(np.ones((2, 3)), np.zeros((2, 3), dtype=bool), np.full((3, 2, 2), np.inf))
    assert none.sheets.tolist() == [-1, -1, -1]
    assert none.divisions == 0
