"""The folder of a job's results: replaced whole or not at all, without the loss of what others have put there."""

from __future__ import annotations

import json
import os
from collections.abc import Container, Iterator
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path as FilePath
from typing import Any

from ...base.errors import ArgumentError, WriteError
from ...base.files import alone, aside, clear, put, restore, uninterrupted, write_json, writing

FACTS = "result.json"
"""The file by which a folder is known as holokin's; it names the files that holokin wrote."""


def check_folder(out: FilePath, name: str) -> FilePath:
    """`out/<name>`, where a job's results go, after what killed runs have left in `out` is repaired.

    Raises:
        ArgumentError: they cannot go there.
    """
    clear(out, _repair)
    return _checked(out, name)


def _checked(out: FilePath, name: str) -> FilePath:
    target = out / name
    if target.is_symlink() or (target.exists() and written(target) is None):
        raise ArgumentError("the output folder", str(target), "it is not one of holokin's; choose another --out")
    above = next(p for p in (out, *out.absolute().parents) if p.exists())
    fault = "" if above.is_dir() else f"{above} is not a folder"
    if above.is_dir() and not os.access(above, os.W_OK):
        fault = f"{above} may not be written"
    if fault:
        raise ArgumentError("the output folder", str(out), f"cannot be made: {fault}; choose another --out")
    return target


@contextmanager
def renewed(out: FilePath, name: str) -> Iterator[FilePath]:
    """A folder to fill, which becomes `out/<name>` when the block ends well.

    Until then the folder of an earlier run stands there, whole. It is replaced whole; what others have put into it
    moves to the new one, without being read. A file of theirs under a name that holokin needs gets ".kept" at its end.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made.
        WriteError: the system refuses a file; the old folder stands as it was.
    """
    target = check_folder(out, name)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise ArgumentError("the output folder", str(out), f"cannot be made: {problem.strerror}") from None
    with writing(target), aside(out, _repair) as place:
        work = place / "new" / name
        work.mkdir(parents=True)
        try:
            yield work
        except WriteError as problem:  # by the name that the user knows
            if FilePath(str(problem.file)).parent != work:
                raise
            raise WriteError(target / FilePath(str(problem.file)).name, problem.problem) from problem
        with alone(out), uninterrupted():
            _checked(out, name)
            put(work, target, written(target) or set())


def free_name(label: str, ending: str, taken: Container[str], *, prefix: str = "") -> str:
    """A file name for a strategy: the letters of its label, and a number where that name is taken."""
    word = "".join(c if c.isalnum() or c in "-_" else "-" for c in label).strip("-") or "strategy"
    stems = chain([word], (f"{word}-{i}" for i in count(2)))
    return next(name for stem in stems if (name := f"{prefix}{stem}{ending}") not in taken)


def write_facts(folder: FilePath, facts: dict[str, Any]) -> None:
    """result.json, with the names of all files of a folder, which a later run may replace: written last."""
    write_json(folder / FACTS, facts | {"files": sorted({FACTS, *(entry.name for entry in folder.iterdir())})})


def written(folder: FilePath) -> set[str] | None:
    """Names that holokin wrote into a folder, as its result.json says; None if the folder is not holokin's."""
    facts = folder / FACTS
    try:
        names = json.loads(facts.read_text("utf-8"))["files"] if facts.is_file() else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return {str(name) for name in names} if isinstance(names, list) else None


def _repair(place: FilePath) -> None:
    """After a run that was killed while it put its folder in place; only one process does it."""
    with alone(place.parent), uninterrupted():
        restore(place, lambda held: written(held) or set())
