"""A LeRobot dataset written anew with other joints: data files, metadata, statistics; videos are linked or copied."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..analysis.audit.logs import Dataset, Episode, JointFeature, PoseFeature
from ..analysis.audit.logs.datasets import (
    batches,
    check_inside,
    episode_files,
    numeric,
    read_json,
    read_lines,
    read_parquet,
    reading,
)
from ..base.errors import RecordingError
from ..base.files import shown
from ..base.types import Array, Matrix
from ..strategies.tasks.task import Task

# --------------------------------------------------------------------------------------------------
# Statistics of a dataset's columns, episode by episode and together, by the definitions of LeRobot.
# --------------------------------------------------------------------------------------------------

QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
"""Those that format v3.0 keeps, as q01 to q99."""

_QUANTILE = re.compile(r"q(\d\d)")

Stats = dict[str, Array]


def _episode_stats(values: Matrix, names: Iterable[str]) -> Stats:
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


def _joined_stats(episodes: Sequence[Stats]) -> Stats:
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


def _usual_names(version: str) -> list[str]:
    """The statistics that a format keeps of each column."""
    more = [f"q{round(100 * q):02d}" for q in QUANTILES] if version == "v3.0" else []
    return ["min", "max", "mean", "std", "count", *more]


def _as_lists(stats: Stats) -> dict[str, Any]:
    """Plain data for JSON."""
    return {name: value.tolist() for name, value in stats.items()}


def _as_arrays(stats: dict[str, Any]) -> Stats:
    """Statistics as they stand in a file."""
    return {name: np.asarray(value, dtype=float) for name, value in stats.items()}


# --------------------------------------------------------------------------------------------------
# The metadata of a dataset whose joints were written anew: info.json, the episodes and their
# statistics.
# --------------------------------------------------------------------------------------------------

EPISODES, STATS, SUMMARY = "meta/episodes.jsonl", "meta/episodes_stats.jsonl", "meta/stats.json"

Learnt = dict[int, dict[str, Stats]]


def _write_meta(
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
                    _as_arrays(one)
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
    names = _usual_names(dataset.version)
    for number, e in enumerate(kept):
        index = firsts[e.index] + np.arange(e.length, dtype=float)
        learnt[e.index]["index"] = _episode_stats(index[:, None], names)
        learnt[e.index]["episode_index"] = _episode_stats(np.full((e.length, 1), float(number)), names)


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
        new = {column: _as_lists(stats) for column, stats in learnt[row["episode_index"]].items()}
        stats = row["stats"] | new
        lines.append(row | {"episode_index": numbers[row["episode_index"]], "stats": stats})
        whole.append({column: _as_arrays(one) for column, one in stats.items()})
    _write_lines(out / STATS, lines)
    return whole


def _write_lines(file: Path, rows: Sequence[Any]) -> None:
    file.write_text("".join(f"{json.dumps(row, ensure_ascii=False)}\n" for row in rows), "utf-8")


def _write_summary(file: Path, whole: Sequence[dict[str, Stats]], learnt: Learnt, all_of_them: bool, out: Path) -> None:
    """meta/stats.json: the columns that changed, or, where episodes are left out, all of them."""
    old = read_json(file)
    changed = {name for stats in learnt.values() for name in stats}
    for column in {name for stats in whole for name in stats} if all_of_them else changed:
        found = _as_lists(_joined_stats([stats[column] for stats in whole if column in stats]))
        names = list(old.get(column, found))
        old[column] = {name: found[name] for name in names if name in found}
    (out / SUMMARY).write_text(json.dumps(old, indent=4, ensure_ascii=False), "utf-8")


@dataclass(frozen=True)
class Change:
    """A column that gets joints: those in `file`, (k, n) in rad and m, written as the column `name`."""

    source: JointFeature | PoseFeature
    file: Path
    name: str
    double: bool


def write_changed(
    dataset: Dataset, task: Task, changes: Sequence[Change], left_out: Sequence[int], out: Path, about: dict[str, Any]
) -> float:  # fmt: skip
    """Write the dataset into a new folder; returns how far rounding moves the tool at most [m or rad].

    Args:
        left_out: episodes that the new dataset does not have; those after them move up.
        about: what meta/holokin.json says of it.

    Raises:
        RecordingError: a file that cannot be read. OSError: one that cannot be written.
    """
    _copy_texts(dataset, out)
    kept = [e for e in dataset.episodes if e.index not in set(left_out)]
    numbers = {e.index: i for i, e in enumerate(kept)}
    firsts = dict(zip(numbers, np.cumsum([0, *(e.length for e in kept)]).tolist(), strict=False))
    writer = _Writer(dataset, task, changes, numbers, firsts, out)
    streams = [change.file.open("rb") for change in changes]
    try:
        for file in dataset.files():
            writer.file(file, streams)
    finally:
        for stream in streams:
            stream.close()
    _videos(dataset, kept, numbers, out)
    _write_meta(dataset, writer.features(), kept, firsts, writer.stats, out)
    text = json.dumps(about | {"from": dataset.folder.resolve().name, "left out": list(left_out)}, indent=2)
    (out / "meta" / "holokin.json").write_text(text + "\n", "utf-8")
    return writer.rounded


def _copy_texts(dataset: Dataset, out: Path) -> None:
    """The metadata, of which some is written anew later, and the dataset's card. Raises: RecordingError."""
    for file in [*(dataset.folder / "meta").rglob("*"), *map(dataset.folder.joinpath, ("README.md", "LICENSE"))]:
        if file.is_file():
            check_inside(dataset.folder, "meta", file)
            target = out / file.relative_to(dataset.folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)


class _Writer:
    """Data files with changed columns, one after the other, and what is learnt of these columns on the way."""

    def __init__(
        self, dataset: Dataset, task: Task, changes: Sequence[Change], numbers: dict[int, int],
        firsts: dict[int, int], out: Path,
    ) -> None:  # fmt: skip
        self.dataset, self.task, self.changes, self.out = dataset, task, changes, out
        self.numbers, self.firsts = numbers, firsts
        self.renumbered = len(numbers) < len(dataset.episodes)
        self.stats: dict[int, dict[str, Stats]] = {i: {} for i in numbers}
        self.rounded = 0.0

    def features(self) -> dict[str, Any]:
        """The features of the new dataset."""
        found = dict(self.dataset.features)
        robot = self.task.robot
        for change in self.changes:
            kind = "float64" if change.double else "float32"
            if isinstance(change.source, JointFeature):
                found[change.name] = found[change.name] | ({"dtype": kind} if change.double else {})
            else:
                names = [f"{joint}.pos" for joint in robot.joint_names]
                found[change.name] = {"dtype": kind, "shape": [robot.n], "names": names}
        return found

    def file(self, file: Path, streams: Sequence[IO[bytes]]) -> None:
        """Write one data file anew, or, in format v2.1, leave out the one of an episode that is left out."""
        from pyarrow import parquet

        here = [e for e in self.dataset.episodes if e.file == file]
        count = sum(e.length for e in here)
        joints = [self._joints(stream, count) for stream in streams]
        kept = [e for e in here if e.index in self.numbers]
        for change, q in zip(self.changes, joints, strict=True):
            self._measure(change, q, here)
        if not kept:
            return
        target = self.out / self._target(kept[0])
        target.parent.mkdir(parents=True, exist_ok=True)
        writer, done = None, 0
        written: list[list[Matrix]] = [[] for _ in self.changes]
        try:
            for batch in batches(file, count):
                parts = [q[done : done + len(batch)] for q in joints]
                for change, q, values in zip(self.changes, parts, written, strict=True):
                    values.append(self._values(file, change, batch, q))
                table = self._changed(batch, [values[-1] for values in written], here)
                done += len(batch)
                if writer is None:
                    writer = parquet.ParquetWriter(target, table.schema, compression="snappy", use_dictionary=True)
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()
        for change, values in zip(self.changes, written, strict=True):
            self._learn(change, np.vstack(values), here)

    def _learn(self, change: Change, values: Matrix, here: Sequence[Episode]) -> None:
        """The statistics of a column in the episodes of a file."""
        first = 0
        for e in here:
            mine = values[first : first + e.length].astype(float)
            first += e.length
            if e.index in self.numbers:
                self.stats[e.index][change.name] = _episode_stats(mine, _usual_names(self.dataset.version))

    def _target(self, episode: Episode) -> Path:
        """Where the file of an episode is in the new dataset, from its folder."""
        if self.dataset.version == "v3.0":
            return episode.file.relative_to(self.dataset.folder)
        number = self.numbers[episode.index]
        fields = {"episode_chunk": number // self.dataset.info["chunks_size"], "episode_index": number}
        there = self.dataset.place("data_path", self.dataset.info["data_path"], **fields)
        return there.relative_to(self.dataset.folder)

    def _joints(self, stream: IO[bytes], count: int) -> Matrix:
        n = self.task.n
        return np.fromfile(stream, count=count * n).reshape(count, n)

    def _changed(self, batch: Any, columns: Sequence[Matrix], here: Sequence[Episode]) -> Any:
        """A batch with its new columns, without the episodes that are left out."""
        import pyarrow

        table = pyarrow.Table.from_batches([batch])
        for change, values in zip(self.changes, columns, strict=True):
            column = _column_of(values, change, table)
            there = table.schema.get_field_index(change.name)
            table = table.append_column(*column) if there < 0 else table.set_column(there, *column)
        if any(change.double or isinstance(change.source, PoseFeature) for change in self.changes):
            table = table.replace_schema_metadata(
                {k: v for k, v in (table.schema.metadata or {}).items() if k != b"huggingface"}
            )
        return self._renumbered(table, here) if self.renumbered else table

    def _values(self, file: Path, change: Change, batch: Any, q: Matrix) -> Any:
        """The numbers of a column's rows, rounded as they are written."""
        robot = self.task.robot
        kind = np.float64 if change.double else np.float32
        if isinstance(change.source, PoseFeature):
            return q.astype(kind)
        source = change.source
        with reading(file):
            old = numeric(self.dataset, file, source.name, batch.column(source.name))
        if not change.double:
            kind = np.dtype(self.dataset.features[source.name]["dtype"])
        old[:, source.places] = source.values(robot, q)
        return old.astype(kind)

    def _measure(self, change: Change, q: Matrix, here: Sequence[Episode]) -> None:
        """How far rounding moves the tool."""
        source, robot = change.source, self.task.robot
        kind = np.float64 if change.double else np.float32
        first = 0
        for e in here:
            mine = q[first : first + e.length]
            first += e.length
            if e.index in self.numbers:
                if isinstance(source, JointFeature):
                    written = source.joints(robot, source.values(robot, mine).astype(kind).astype(float))
                else:
                    written = mine.astype(kind).astype(float)
                self.rounded = max(self.rounded, float(np.abs(self.task.error(written, *self.task._poses(mine))).max()))

    def _renumbered(self, table: Any, here: Sequence[Episode]) -> Any:
        """Rows of the episodes that stay, with their new numbers."""
        import pyarrow

        episode = table.column("episode_index").to_numpy()
        keep = np.isin(episode, list(self.numbers))
        table = table.filter(pyarrow.array(keep))
        first = {e.index: e.first for e in here}
        old = episode[keep]
        moved = np.array([self.firsts[e] - first[e] for e in old], dtype=np.int64)
        for name, values in {
            "episode_index": np.array([self.numbers[e] for e in old], dtype=np.int64),
            "index": table.column("index").to_numpy() + moved,
        }.items():
            place = table.schema.get_field_index(name)
            column = pyarrow.array(values, table.schema.field(name).type)
            table = table.set_column(place, table.schema.field(name), column)
        return table


def _column_of(values: Matrix, change: Change, table: Any) -> tuple[Any, Any]:
    """(field, array) of a column of vectors, of the kind of list that it had before."""
    import pyarrow

    numbers = pyarrow.array(values.ravel())
    there = table.schema.get_field_index(change.name)
    old = None if there < 0 else table.schema.field(there)
    if old is not None and not pyarrow.types.is_nested(old.type):
        return pyarrow.field(change.name, numbers.type, metadata=old.metadata), numbers
    width = values.shape[1]
    fixed = pyarrow.FixedSizeListArray.from_arrays(numbers, width)
    if old is not None and not pyarrow.types.is_fixed_size_list(old.type):
        offsets = pyarrow.array(np.arange(0, len(numbers) + 1, width, dtype=np.int32))
        plain = pyarrow.ListArray.from_arrays(offsets, numbers)
        return pyarrow.field(change.name, plain.type, metadata=old.metadata), plain
    return pyarrow.field(change.name, fixed.type, metadata=None if old is None else old.metadata), fixed


def _videos(dataset: Dataset, kept: Sequence[Episode], numbers: dict[int, int], out: Path) -> None:
    """The videos of the episodes that stay: hard links where the disk has them, else copies."""
    template = dataset.info.get("video_path")
    for key, one in dataset.features.items():
        if one["dtype"] != "video" or not isinstance(template, str):
            continue
        for e in kept:
            source, target = (_video(dataset, template, key, e, i) for i in (e.index, numbers[e.index]))
            place = out / target.relative_to(dataset.folder)
            if source.is_file() and not place.exists():
                place.parent.mkdir(parents=True, exist_ok=True)
                try:
                    os.link(source.resolve(), place)
                except OSError:
                    shutil.copyfile(source, place)


def _video(dataset: Dataset, template: str, key: str, episode: Episode, number: int) -> Path:
    """The video file of an episode, where its number is `number`."""
    if dataset.version == "v3.0":
        numbers = [episode.facts.get(f"videos/{key}/{what}") for what in ("chunk_index", "file_index")]
        whole = [int(one) for one in numbers if isinstance(one, int | float) and float(one).is_integer()]  # of pandas
        if len(whole) < 2:
            fact = f"does not say which file has the video {key} of episode {episode.index}"
            raise RecordingError(dataset.folder / "meta" / "episodes", fact, "download the dataset anew")
        chunk, file = whole
        return dataset.place("video_path", template, video_key=key, chunk_index=chunk, file_index=file)
    chunk = number // dataset.info["chunks_size"]
    return dataset.place("video_path", template, video_key=key, episode_chunk=chunk, episode_index=number)
