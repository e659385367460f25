"""Boxes that touch: what `overlapping` finds by cuts is what comparing all with all finds."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from holokin.proof import cell_search
from holokin.proof.cell_search import overlapping


@given(st.integers(0, 2**32 - 1), st.integers(0, 120), st.integers(0, 4), st.booleans())
def test_cuts_find_the_pairs_that_comparing_all_with_all_finds(seed: int, k: int, d: int, halved: bool) -> None:
    """Boxes of halved sides, as the search makes them, share faces exactly; others lie anywhere."""
    rng = np.random.default_rng(seed)
    parts = 2.0 ** rng.integers(0, 4, (k, d)) if halved else rng.uniform(1, 9, (k, d))
    low = np.floor(rng.uniform(0, 1, (k, d)) * parts) / parts if halved else rng.uniform(0, 1, (k, d))
    high = low + 1 / parts
    ones, others = np.flatnonzero(rng.random(k) < 0.5), np.flatnonzero(rng.random(k) < 0.5)
    at_once, cell_search.COMPARED = cell_search.COMPARED, 4
    try:
        i, j = overlapping(low, high, ones, others)
    finally:
        cell_search.COMPARED = at_once
    expected = [
        (a, b) for a in ones for b in others if (np.maximum(low[a], low[b]) < np.minimum(high[a], high[b])).all()
    ]
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == sorted(expected)
