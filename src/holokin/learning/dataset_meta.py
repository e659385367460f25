"""The metadata of a dataset whose joints were written anew: info.json, the episodes and their statistics."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.audit.logs import Dataset, Episode
from ..analysis.audit.logs.dataset_folder import episode_files, read_json, read_lines, read_parquet
from ..base.errors import RecordingError
from ..base.given_files import shown
from .dataset_stats import Stats, as_arrays, as_lists, episode_stats, joined_stats, usual_names

EPISODES, STATS, SUMMARY = "meta/episodes.jsonl", "meta/episodes_stats.jsonl", "meta/stats.json"

Learnt = dict[int, dict[str, Stats]]


def write_meta(
    dataset: Dataset, features: dict[str, Any], kept: Sequence[Episode], firsts: dict[int, int], learnt: Learnt,
    out: Path,
) -> None:  # fmt: skip
    """Write the metadata that differs into a folder that has a copy of the old.

    Args:
        kept: the episodes that the new dataset has; firsts: the first row of each in it.
        learnt: statistics of the changed columns, by episode and column.

    Raises:
        RecordingError: metadata that cannot be read.
    """
    if len(kept) < len(dataset.episodes):
        _learn_numbers(dataset, kept, firsts, learnt)
    info = dataset.info | {"features": features} | _totals(dataset, kept)
    (out / "meta" / "info.json").write_text(json.dumps(info, indent=4, ensure_ascii=False), "utf-8")
    file = dataset.folder / SUMMARY
    with _of_its_form(dataset):
        whole = _write_v3(dataset, kept, firsts, learnt, out) if dataset.version == "v3.0" else _write_v2(
            dataset, kept, learnt, out
        )  # fmt: skip
        if file.exists():
            _write_summary(file, whole, learnt, len(kept) < len(dataset.episodes), out)


@contextmanager
def _of_its_form(dataset: Dataset) -> Iterator[None]:
    """What metadata with other types than LeRobot's raise, as a RecordingError."""
    import pyarrow

    try:
        yield
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, pyarrow.ArrowException) as problem:
        fact = f"holds statistics or numbers that are none ({shown(str(problem), 120)})"
        raise RecordingError(dataset.folder / "meta", fact, "download the dataset anew") from problem


def check_meta(dataset: Dataset) -> None:
    """Raises: RecordingError: metadata that cannot be written anew, which is so known before joints are computed."""
    with _of_its_form(dataset):
        if dataset.version == "v2.1":
            for row in _statistics(dataset):
                for one in row["stats"].values():
                    as_arrays(one)
        else:
            for file in episode_files(dataset.folder):
                table = read_parquet(file)
                for row in table.select([name for name in table.column_names if name.startswith("stats/")]).to_pylist():
                    _stats_of(row)
    if (dataset.folder / SUMMARY).exists() and not isinstance(read_json(dataset.folder / SUMMARY), dict):
        raise RecordingError(dataset.folder / SUMMARY, "has no statistics by column", "download the dataset anew")


def _statistics(dataset: Dataset) -> list[dict[str, Any]]:
    """The lines of episodes_stats.jsonl, of each episode one. Raises: RecordingError."""
    file = dataset.folder / STATS
    if not file.exists():
        cure = "download the dataset anew, or let LeRobot's convert_dataset_v20_to_v21.py write the file"
        raise RecordingError(file, "there is no such file, and a dataset of v2.1 has one", cure)
    found = read_lines(file)
    sound = all(isinstance(row, dict) and isinstance(row.get("stats"), dict) for row in found)
    if not sound or [row.get("episode_index") for row in found] != list(range(len(dataset.episodes))):
        raise RecordingError(file, "has not a line with the statistics of each episode", "download the dataset anew")
    return found


def _totals(dataset: Dataset, kept: Sequence[Episode]) -> dict[str, Any]:
    """What `info.json` counts, where episodes are left out."""
    if len(kept) == len(dataset.episodes):
        return {}
    count = len(kept)
    found: dict[str, Any] = {
        "total_episodes": count, "total_frames": sum(e.length for e in kept), "splits": {"train": f"0:{count}"},
    }  # fmt: skip
    if dataset.version == "v2.1":
        videos = sum(one["dtype"] == "video" for one in dataset.features.values())
        found |= {"total_videos": videos * count, "total_chunks": -(-count // dataset.info["chunks_size"])}
    return found


def _learn_numbers(dataset: Dataset, kept: Sequence[Episode], firsts: dict[int, int], learnt: Learnt) -> None:
    """The statistics of the columns that count episodes and rows."""
    names = usual_names(dataset.version)
    for number, e in enumerate(kept):
        index = firsts[e.index] + np.arange(e.length, dtype=float)
        learnt[e.index]["index"] = episode_stats(index[:, None], names)
        learnt[e.index]["episode_index"] = episode_stats(np.full((e.length, 1), float(number)), names)


def _write_v3(
    dataset: Dataset, kept: Sequence[Episode], firsts: dict[int, int], learnt: Learnt, out: Path
) -> list[dict[str, Stats]]:  # fmt: skip
    """The files of meta/episodes; returns the statistics of each episode that stays."""
    import pyarrow
    from pyarrow import parquet

    numbers, whole = {e.index: i for i, e in enumerate(kept)}, []
    for file in episode_files(dataset.folder):
        table = read_parquet(file)
        old = table.column("episode_index").to_pylist()
        table = table.filter(pyarrow.array([e in numbers for e in old]))
        old = [e for e in old if e in numbers]
        target = out / file.relative_to(dataset.folder)
        if not old:
            target.unlink()
            continue
        begins = [firsts[e] for e in old]
        ends = [firsts[e] + dataset.episodes[e].length for e in old]
        new = {"episode_index": [numbers[e] for e in old], "dataset_from_index": begins, "dataset_to_index": ends}
        for column in sorted({name for e in old for name in learnt[e]}):
            for what in learnt[old[0]][column]:
                new[f"stats/{column}/{what}"] = [learnt[e][column][what].tolist() for e in old]
        for name, values in new.items():
            place = table.schema.get_field_index(name)
            if place < 0:
                table = table.append_column(name, pyarrow.array(values))
            else:
                field = table.schema.field(place)
                table = table.set_column(place, field, pyarrow.array(values, field.type))
        parquet.write_table(table, target, compression="snappy")
        whole += [_stats_of(row) for row in table.to_pylist()]
    return whole


def _stats_of(row: dict[str, Any]) -> dict[str, Stats]:
    """The statistics in a row of meta/episodes."""
    found: dict[str, Stats] = {}
    for name, value in row.items():
        if name.startswith("stats/") and value is not None:
            _, column, what = name.split("/", 2)
            found.setdefault(column, {})[what] = np.asarray(value, dtype=float)
    return found


def _write_v2(dataset: Dataset, kept: Sequence[Episode], learnt: Learnt, out: Path) -> list[dict[str, Stats]]:
    """episodes.jsonl and episodes_stats.jsonl; returns the statistics of each episode that stays."""
    numbers = {e.index: i for i, e in enumerate(kept)}
    left_out = len(kept) < len(dataset.episodes)
    if left_out:
        rows = [row | {"episode_index": numbers[row["episode_index"]]}
                for row in read_lines(dataset.folder / EPISODES) if row["episode_index"] in numbers]  # fmt: skip
        _write_lines(out / EPISODES, rows)
    lines, whole = [], []
    for row in _statistics(dataset):
        if row["episode_index"] not in numbers:
            continue
        new = {column: as_lists(stats) for column, stats in learnt[row["episode_index"]].items()}
        stats = row["stats"] | new
        lines.append(row | {"episode_index": numbers[row["episode_index"]], "stats": stats})
        whole.append({column: as_arrays(one) for column, one in stats.items()})
    _write_lines(out / STATS, lines)
    return whole


def _write_lines(file: Path, rows: Sequence[Any]) -> None:
    file.write_text("".join(f"{json.dumps(row, ensure_ascii=False)}\n" for row in rows), "utf-8")


def _write_summary(file: Path, whole: Sequence[dict[str, Stats]], learnt: Learnt, all_of_them: bool, out: Path) -> None:
    """meta/stats.json: the columns that changed, or, where episodes are left out, all of them."""
    old = read_json(file)
    changed = {name for stats in learnt.values() for name in stats}
    for column in {name for stats in whole for name in stats} if all_of_them else changed:
        found = as_lists(joined_stats([stats[column] for stats in whole if column in stats]))
        names = list(old.get(column, found))
        old[column] = {name: found[name] for name in names if name in found}
    (out / SUMMARY).write_text(json.dumps(old, indent=4, ensure_ascii=False), "utf-8")
