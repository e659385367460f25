"""Statistics of a dataset's columns, episode by episode and together, by the definitions of LeRobot."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..base.types import Array, Matrix

QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
"""Those that format v3.0 keeps, as q01 to q99."""

_QUANTILE = re.compile(r"q(\d\d)")

Stats = dict[str, Array]


def episode_stats(values: Matrix, names: Iterable[str]) -> Stats:
    """Statistics of a column (k, d) of one episode: min, max, mean, std, count, quantiles q01 to q99, as named."""
    found: Stats = {
        "min": values.min(axis=0), "max": values.max(axis=0), "mean": values.mean(axis=0), "std": values.std(axis=0),
        "count": np.array([len(values)]),
    }  # fmt: skip
    for name in names:
        match = _QUANTILE.fullmatch(name)
        if match:
            found[name] = np.quantile(values, int(match[1]) / 100, axis=0, method="inverted_cdf")
    return {name: found[name] for name in names if name in found}


def joined_stats(episodes: Sequence[Stats]) -> Stats:
    r"""Statistics of a column over all episodes.

    The mean is $\sum n_e m_e / n$, the variance $\sum n_e (s_e^2 + (m_e - m)^2) / n$; quantiles are the averages
    $\sum n_e q_e / n$, as LeRobot takes them.
    """
    names = set.intersection(*(set(one) for one in episodes))
    count = np.array([float(np.ravel(one["count"])[0]) for one in episodes])
    share = count / count.sum()

    def mean(name: str) -> Array:
        return (np.stack([one[name] for one in episodes]).T @ share).T

    found: Stats = {"count": np.array([int(count.sum())])}
    if {"min", "max"} <= names:
        found["min"] = np.min([one["min"] for one in episodes], axis=0)
        found["max"] = np.max([one["max"] for one in episodes], axis=0)
    if {"mean", "std"} <= names:
        found["mean"] = mean("mean")
        square = np.stack([one["std"] ** 2 + (one["mean"] - found["mean"]) ** 2 for one in episodes])
        found["std"] = np.sqrt(np.tensordot(share, square, axes=1))
    return found | {name: mean(name) for name in sorted(names) if _QUANTILE.fullmatch(name)}


def usual_names(version: str) -> list[str]:
    """The statistics that a format keeps of each column."""
    more = [f"q{round(100 * q):02d}" for q in QUANTILES] if version == "v3.0" else []
    return ["min", "max", "mean", "std", "count", *more]


def as_lists(stats: Stats) -> dict[str, Any]:
    """Plain data for JSON."""
    return {name: value.tolist() for name, value in stats.items()}


def as_arrays(stats: dict[str, Any]) -> Stats:
    """Statistics as they stand in a file."""
    return {name: np.asarray(value, dtype=float) for name, value in stats.items()}
