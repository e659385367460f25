"""Words for what the audit of a dataset found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .equal_poses import LogVerdict

if TYPE_CHECKING:
    from .dataset_audit import DatasetAudit

MOST_ROWS = 8
"""Episodes that are named, the worst first; `summary` has all."""


def dataset_sentence(audit: DatasetAudit) -> str:
    """The verdict, what it rests on, and what the dataset does not test."""
    pairs, worst = audit.pairs, audit.worst()
    if worst is None:
        return (
            f"cannot tell: in {len(audit.q)} frames no tool pose comes again within {1e3 * audit.near:g} mm; "
            "a greater --near compares poses that are farther apart"
        )
    tests = f"{len(pairs.first)} pairs of equal tool poses"
    if audit.verdict is LogVerdict.DIFFERS:
        count = int(pairs.beyond.sum())
        return f"differs: at {count} of {tests} the joints are not equal. Worst: {place_words(audit, worst)}"
    if audit.verdict is LogVerdict.REPEATS:
        return (
            f"repeats: the joints are equal at all {int(audit.decided.sum())} equal tool poses that are near enough to "
            f"tell (of {tests}); poses that come only once say nothing"
        )
    least = float(pairs.allowed.min())
    return (
        f"cannot tell: of {tests} none is so near that a difference of {2 * audit.tolerance:g} rad or m shows; the "
        f"nearest shows {least:.2g}. Give a greater --tolerance, or record poses that come again"
    )


def place_words(audit: DatasetAudit, pair: int) -> str:
    """A pair of frames, where the tool is, and how far which joint is apart."""
    p = audit.place(pair)
    (e, i), (f, j) = [(p[which]["episode"], p[which]["frame"]) for which in ("first", "second")]
    x, y, z = p["tool"]
    return (
        f"{p['distance']:.3g} ({p['joint']}) between frame {i} of episode {e} and frame {j} of episode {f}, tool at "
        f"({x:.3f}, {y:.3f}, {z:.3f}) m"
    )


def dataset_rows(audit: DatasetAudit) -> list[tuple[str, str]]:
    """(what, finding) of every question, for people."""
    pairs = audit.pairs
    found = [
        ("equal poses, equal joints", audit.verdict.value.partition(":")[0]),
        ("dataset", f"{audit.dataset.folder}, format {audit.dataset.version}"),
        ("looked at", f"{len(audit.q)} frames of {len(audit.episodes)} episodes, column {audit.feature}"),
        ("task", audit.task.name),
        ("equal", f"tool poses within {1e3 * audit.near:g} mm, joints within {audit.tolerance:g} rad or m"),
        ("pairs of equal poses", f"{len(pairs.first)}, {int(audit.decided.sum())} of them near enough to decide"),
        ("of them the joints differ", str(int(pairs.beyond.sum()))),
    ]
    if len(pairs.first):
        median, most = (_size(float(v)) for v in (np.median(pairs.distance), pairs.distance.max()))
        found.append(("distance of the joints", f"median {median}, largest {most} rad or m"))
    episodes = sorted(audit.by_episode(), key=lambda e: e["worst"]["allowed"] - e["worst"]["distance"])
    differ = [e for e in episodes if e["differ"]]
    if differ:
        found.append(("episodes that differ", f"{len(differ)} of {len(audit.episodes)}"))
    for e in differ[:MOST_ROWS]:
        w = e["worst"]
        other = next(w[k] for k in ("second", "first") if w[k]["episode"] != e["episode"] or k == "first")
        at = f"{w['distance']:.3g} ({w['joint']}) from frame {other['frame']} of episode {other['episode']}"
        said = f"{e['differ']} of {e['equal poses']} equal poses differ, by up to {at}"
        found.append((f"episode {e['episode']}", said))
    return found + [("note", note) for note in audit.notes]


def _size(distance: float) -> str:
    """A distance of joints; what single precision rounds is not shown."""
    return f"{distance:.3g}" if distance > 1e-6 else "under 1e-6"
