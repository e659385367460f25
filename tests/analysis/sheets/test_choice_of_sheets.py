"""The integer programs behind a map of sheets, held against every choice there is."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from holokin.analysis.sheets.set_cover import fewest, labelled


@given(st.integers(1, 7), st.integers(1, 9), st.floats(0.1, 0.9), st.floats(0.3, 1.0), st.integers(0, 10**6))
def test_no_choice_of_fewer_sets_covers_as_much(c: int, k: int, fill: float, share: float, seed: int) -> None:
    """The number is the least of all choices, and the bound says so; of equally many none beats it in both respects."""
    rng = np.random.default_rng(seed)
    sets, costs = rng.random((c, k)) < fill, rng.random(c)
    wanted = int(np.ceil(share * k))
    cover = fewest(sets, wanted, costs, 10.0)
    goal = min(wanted, int(sets.any(axis=0).sum()))
    assert cover.covered == sets[cover.chosen].any(axis=0).sum() >= goal
    sizes = [
        size for size in range(c + 1) for some in combinations(range(c), size)
        if sets[list(some)].any(axis=0).sum() >= goal
    ]  # fmt: skip
    assert len(cover.chosen) == min(sizes) == cover.least
    for some in combinations(range(c), len(cover.chosen)):
        more = sets[list(some)].any(axis=0).sum() > cover.covered
        assert not (more and costs[list(some)].sum() < costs[cover.chosen].sum() - 1e-9)


@given(st.integers(2, 7), st.integers(1, 9), st.floats(0.1, 0.7), st.floats(0.3, 0.8), st.integers(0, 10**6))
def test_what_is_preferred_is_covered_where_no_more_sets_are_needed_for_it(
    c: int, k: int, fill: float, share: float, seed: int
) -> None:
    """However much dearer the sets are; and where it is out of reach, as much as so many sets can cover."""
    rng = np.random.default_rng(seed)
    sets, costs, weights = rng.random((c, k)) < fill, rng.random(c), rng.integers(1, 9, k).astype(float)
    wanted, preferred = share * weights.sum(), min(1.0, share + 0.2) * weights.sum()
    plain, cover = fewest(sets, wanted, costs, 10.0, weights), fewest(sets, wanted, costs, 10.0, weights, preferred)
    size = len(plain.chosen)
    assert len(cover.chosen) == size
    can = max(weights[sets[list(some)].any(axis=0)].sum() for some in combinations(range(c), size))
    assert cover.covered >= min(preferred, can) - 1e-5


@given(st.integers(1, 3), st.integers(2, 6), st.floats(0.2, 0.9), st.integers(0, 10**6))
def test_no_choice_of_sheets_has_fewer_cuts_than_is_said(S: int, k: int, fill: float, seed: int) -> None:
    """The cuts are those of the labels; of two sheets the choice is the best there is, of more the bound holds."""
    rng = np.random.default_rng(seed)
    served = rng.random((S, k)) < fill
    pairs = np.array([pair for pair in combinations(range(k), 2) if rng.random() < 0.7], dtype=int).reshape(-1, 2)
    on = served[:, pairs[:, 0]] & served[:, pairs[:, 1]] & (rng.random((S, len(pairs))) < 0.8)
    found = labelled(served, pairs, on)

    def cuts(of: np.ndarray) -> int:
        return sum(
            of[i] >= 0 and of[j] >= 0 and not (of[i] == of[j] and on[of[i], e]) for e, (i, j) in enumerate(pairs)
        )

    choices = [np.flatnonzero(served[:, p]).tolist() or [-1] for p in range(k)]
    assert all(found.of[p] in choices[p] for p in range(k))
    least = min(cuts(np.array(of)) for of in product(*choices))
    assert found.least <= least <= cuts(found.of) == len(found.cuts)
    if S < 3:
        assert len(found.cuts) == least == found.least
