"""A LeRobot dataset written anew with other joints: data files, metadata, statistics; videos are linked or copied."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..analysis.audit.logs import Dataset, Episode, JointFeature, PoseFeature, datasets
from ..base.errors import FileError
from ..base.files import shown
from ..base.types import Array, Matrix
from ..strategies.tasks.task import Task

# --- Statistics of a dataset's columns, episode by episode and together, by the definitions of LeRobot.

QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)  # those that format v3.0 keeps, as q01 to q99

_QUANTILE = re.compile(r"q(\d\d)")

Stats = dict[str, Array]


def _episode_stats(values: Matrix, names: Iterable[str]) -> Stats:
    """Statistics of a column (k, d) of one episode: min, max, mean, std, count, quantiles q01 to q99, as named."""
    stats: Stats = {name: getattr(values, name)(axis=0) for name in ("min", "max", "mean", "std")}
    stats["count"] = np.array([len(values)])
    for name in names:
        match = _QUANTILE.fullmatch(name)
        if match:
            stats[name] = np.quantile(values, int(match[1]) / 100, axis=0, method="inverted_cdf")
    return {name: stats[name] for name in names if name in stats}


def _joined_stats(episodes: Sequence[Stats]) -> Stats:
    r"""Statistics of a column over all episodes.

    The mean is $\sum n_e m_e / n$, the variance $\sum n_e (s_e^2 + (m_e - m)^2) / n$; quantiles are the averages
    $\sum n_e q_e / n$, as LeRobot takes them.
    """
    names = set.intersection(*(set(stats) for stats in episodes))
    count = np.array([float(np.ravel(stats["count"])[0]) for stats in episodes])
    share = count / count.sum()

    def mean(name: str) -> Array:
        return (np.stack([stats[name] for stats in episodes]).T @ share).T

    joined: Stats = {"count": np.array([int(count.sum())])}
    if {"min", "max"} <= names:
        joined["min"] = np.min([stats["min"] for stats in episodes], axis=0)
        joined["max"] = np.max([stats["max"] for stats in episodes], axis=0)
    if {"mean", "std"} <= names:
        joined["mean"] = mean("mean")
        square = np.stack([stats["std"] ** 2 + (stats["mean"] - joined["mean"]) ** 2 for stats in episodes])
        joined["std"] = np.sqrt(np.tensordot(share, square, axes=1))
    return joined | {name: mean(name) for name in sorted(names) if _QUANTILE.fullmatch(name)}


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


# --- The metadata of a dataset whose joints were written anew: info.json, the episodes and their statistics.

EPISODES, STATS, SUMMARY = "meta/episodes.jsonl", "meta/episodes_stats.jsonl", "meta/stats.json"

Learnt = dict[int, dict[str, Stats]]


def _write_meta(
    dataset: Dataset,
    features: dict[str, Any],
    episodes: Sequence[Episode],
    firsts: dict[int, int],
    learnt: Learnt,
    out: Path,
) -> None:
    """Write the metadata that differs into a folder that has a copy of the old.

    Args:
        episodes: those that the new dataset has; firsts: the first row of each in it.
        learnt: statistics of the changed columns, by episode and column.

    Raises:
        FileError: metadata that cannot be read.
    """
    if len(episodes) < len(dataset.episodes):
        # The statistics of the columns that count episodes and rows.
        names = _usual_names(dataset.version)
        for number, e in enumerate(episodes):
            index = firsts[e.index] + np.arange(e.length, dtype=float)
            learnt[e.index]["index"] = _episode_stats(index[:, None], names)
            learnt[e.index]["episode_index"] = _episode_stats(np.full((e.length, 1), float(number)), names)
    info = dataset.info | {"features": features} | _totals(dataset, episodes)
    (out / "meta" / "info.json").write_text(json.dumps(info, indent=4, ensure_ascii=False), "utf-8")
    file = dataset.folder / SUMMARY
    with _of_its_form(dataset):
        if dataset.version == "v3.0":
            whole = _write_v3(dataset, episodes, firsts, learnt, out)
        else:
            whole = _write_v2(dataset, episodes, learnt, out)
        if file.exists():
            # meta/stats.json: the columns that changed, or, where episodes are left out, all of them.
            all_of_them = len(episodes) < len(dataset.episodes)
            old = datasets.read_json(file)
            changed = {name for stats in learnt.values() for name in stats}
            for column in {name for stats in whole for name in stats} if all_of_them else changed:
                joined = _as_lists(_joined_stats([stats[column] for stats in whole if column in stats]))
                names = list(old.get(column, joined))
                old[column] = {name: joined[name] for name in names if name in joined}
            (out / SUMMARY).write_text(json.dumps(old, indent=4, ensure_ascii=False), "utf-8")


@contextmanager
def _of_its_form(dataset: Dataset) -> Iterator[None]:
    """What metadata with other types than LeRobot's raise, as a FileError."""
    import pyarrow

    try:
        yield
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, pyarrow.ArrowException) as problem:
        fact = f"holds statistics or numbers that are none ({shown(str(problem), 120)})"
        raise FileError(dataset.folder / "meta", fact, "download the dataset anew") from problem


def check_meta(dataset: Dataset) -> None:
    """Raises: FileError: metadata that cannot be written anew, which is so known before joints are computed."""
    with _of_its_form(dataset):
        if dataset.version == "v2.1":
            for row in _statistics(dataset):
                for values in row["stats"].values():
                    _as_arrays(values)
        else:
            for file in datasets.episode_files(dataset.folder):
                table = datasets.read_parquet(file)
                for row in table.select([name for name in table.column_names if name.startswith("stats/")]).to_pylist():
                    _stats_of(row)
    if (dataset.folder / SUMMARY).exists() and not isinstance(datasets.read_json(dataset.folder / SUMMARY), dict):
        raise FileError(dataset.folder / SUMMARY, "has no statistics by column", "download the dataset anew")


def _statistics(dataset: Dataset) -> list[dict[str, Any]]:
    """The lines of episodes_stats.jsonl, of each episode one. Raises: FileError."""
    file = dataset.folder / STATS
    if not file.exists():
        cure = "download the dataset anew, or let LeRobot's convert_dataset_v20_to_v21.py write the file"
        raise FileError(file, "there is no such file, and a dataset of v2.1 has one", cure)
    lines = datasets.read_lines(file)
    sound = all(isinstance(row, dict) and isinstance(row.get("stats"), dict) for row in lines)
    if not sound or [row.get("episode_index") for row in lines] != list(range(len(dataset.episodes))):
        raise FileError(file, "has not a line with the statistics of each episode", "download the dataset anew")
    return lines


def _totals(dataset: Dataset, episodes: Sequence[Episode]) -> dict[str, Any]:
    """What `info.json` counts, where episodes are left out."""
    if len(episodes) == len(dataset.episodes):
        return {}
    count = len(episodes)
    totals: dict[str, Any] = {
        "total_episodes": count,
        "total_frames": sum(e.length for e in episodes),
        "splits": {"train": f"0:{count}"},
    }
    if dataset.version == "v2.1":
        videos = sum(feature["dtype"] == "video" for feature in dataset.features.values())
        totals |= {"total_videos": videos * count, "total_chunks": -(-count // dataset.info["chunks_size"])}
    return totals


def _write_v3(
    dataset: Dataset, episodes: Sequence[Episode], firsts: dict[int, int], learnt: Learnt, out: Path
) -> list[dict[str, Stats]]:
    """The files of meta/episodes; returns the statistics of each episode that stays."""
    import pyarrow
    from pyarrow import parquet

    numbers, whole = {e.index: i for i, e in enumerate(episodes)}, []
    for file in datasets.episode_files(dataset.folder):
        table = datasets.read_parquet(file)
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
        table = _with_columns(table, new)
        parquet.write_table(table, target, compression="snappy")
        whole += [_stats_of(row) for row in table.to_pylist()]
    return whole


def _with_columns(table: Any, columns: Mapping[str, Any]) -> Any:
    """A table with columns in place of those of their names, of whose types they become, or behind the others."""
    import pyarrow

    for name, values in columns.items():
        place = table.schema.get_field_index(name)
        if place < 0:
            table = table.append_column(name, pyarrow.array(values))
        else:
            old = table.schema.field(place)
            table = table.set_column(place, old, pyarrow.array(values, old.type))
    return table


def _stats_of(row: dict[str, Any]) -> dict[str, Stats]:
    """The statistics in a row of meta/episodes."""
    stats: dict[str, Stats] = {}
    for name, value in row.items():
        if name.startswith("stats/") and value is not None:
            _, column, what = name.split("/", 2)
            stats.setdefault(column, {})[what] = np.asarray(value, dtype=float)
    return stats


def _write_v2(dataset: Dataset, episodes: Sequence[Episode], learnt: Learnt, out: Path) -> list[dict[str, Stats]]:
    """episodes.jsonl and episodes_stats.jsonl; returns the statistics of each episode that stays."""
    numbers = {e.index: i for i, e in enumerate(episodes)}
    left_out = len(episodes) < len(dataset.episodes)
    if left_out:
        rows = [row for row in datasets.read_lines(dataset.folder / EPISODES) if row["episode_index"] in numbers]
        _write_lines(out / EPISODES, [row | {"episode_index": numbers[row["episode_index"]]} for row in rows])
    lines, whole = [], []
    for row in _statistics(dataset):
        if row["episode_index"] not in numbers:
            continue
        new = {column: _as_lists(stats) for column, stats in learnt[row["episode_index"]].items()}
        stats = row["stats"] | new
        lines.append(row | {"episode_index": numbers[row["episode_index"]], "stats": stats})
        whole.append({column: _as_arrays(values) for column, values in stats.items()})
    _write_lines(out / STATS, lines)
    return whole


def _write_lines(file: Path, rows: Sequence[Any]) -> None:
    file.write_text("".join(f"{json.dumps(row, ensure_ascii=False)}\n" for row in rows), "utf-8")


@dataclass(frozen=True)
class Change:
    """A column that gets joints: those in `file`, (k, n) in rad and m, written as the column `name`."""

    source: JointFeature | PoseFeature
    file: Path
    name: str
    double: bool

    @property
    def kind(self) -> Any:
        """The type of its numbers."""
        return np.float64 if self.double else np.float32


def write_changed(
    dataset: Dataset, task: Task, changes: Sequence[Change], left_out: Sequence[int], out: Path, about: dict[str, Any]
) -> float:
    """Write the dataset into a new folder; returns how far rounding moves the tool at most [m or rad].

    Args:
        left_out: episodes that the new dataset does not have; those after them move up.
        about: what meta/holokin.json says of it.

    Raises:
        FileError: a file that cannot be read. OSError: one that cannot be written.
    """
    _copy_texts(dataset, out)
    episodes = [e for e in dataset.episodes if e.index not in set(left_out)]
    numbers = {e.index: i for i, e in enumerate(episodes)}
    firsts = dict(zip(numbers, np.cumsum([0, *(e.length for e in episodes)]).tolist(), strict=False))
    writer = _Writer(dataset, task, changes, numbers, firsts, out)
    streams = [change.file.open("rb") for change in changes]
    try:
        for file in dataset.files():
            writer.file(file, streams)
    finally:
        for stream in streams:
            stream.close()
    _videos(dataset, episodes, numbers, out)
    _write_meta(dataset, writer.features(), episodes, firsts, writer.stats, out)
    text = json.dumps(about | {"from": dataset.folder.resolve().name, "left out": list(left_out)}, indent=2)
    (out / "meta" / "holokin.json").write_text(text + "\n", "utf-8")
    return writer.rounded


def _copy_texts(dataset: Dataset, out: Path) -> None:
    """The metadata, of which some is written anew later, and the dataset's card. Raises: FileError."""
    for file in [*(dataset.folder / "meta").rglob("*"), *map(dataset.folder.joinpath, ("README.md", "LICENSE"))]:
        if file.is_file():
            datasets.check_inside(dataset.folder, "meta", file)
            target = out / file.relative_to(dataset.folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)


@dataclass(eq=False)
class _Writer:
    """Data files with changed columns, one after the other, and what is learnt of these columns on the way.

    numbers, firsts: of each episode that stays its number and its first row in the new dataset.
    """

    dataset: Dataset
    task: Task
    changes: Sequence[Change]
    numbers: dict[int, int]
    firsts: dict[int, int]
    out: Path
    stats: Learnt = field(default_factory=dict)
    rounded: float = 0.0

    def __post_init__(self) -> None:
        self.renumbered = len(self.numbers) < len(self.dataset.episodes)
        self.stats = {i: {} for i in self.numbers}

    def features(self) -> dict[str, Any]:
        """The features of the new dataset."""
        features = dict(self.dataset.features)
        robot = self.task.robot
        for change in self.changes:
            kind = np.dtype(change.kind).name
            if isinstance(change.source, JointFeature):
                features[change.name] = features[change.name] | ({"dtype": kind} if change.double else {})
            else:
                names = [f"{joint}.pos" for joint in robot.joint_names]
                features[change.name] = {"dtype": kind, "shape": [robot.n], "names": names}
        return features

    def file(self, file: Path, streams: Sequence[IO[bytes]]) -> None:
        """Write one data file anew, or, in format v2.1, leave out the one of an episode that is left out."""
        from pyarrow import parquet

        in_file = [e for e in self.dataset.episodes if e.file == file]
        count, n = sum(e.length for e in in_file), self.task.n
        joints = [np.fromfile(stream, count=count * n).reshape(count, n) for stream in streams]
        episodes = [e for e in in_file if e.index in self.numbers]
        if not episodes:
            return
        # The rows, a batch after the other, with the new columns.
        target = self.out / self._target(episodes[0])
        target.parent.mkdir(parents=True, exist_ok=True)
        writer, done = None, 0
        written: list[list[Matrix]] = [[] for _ in self.changes]
        try:
            for batch in datasets.batches(file, count):
                for change, q, values in zip(self.changes, joints, written, strict=True):
                    values.append(self._values(file, change, batch, q[done : done + len(batch)]))
                table = self._changed(batch, [values[-1] for values in written], in_file)
                done += len(batch)
                if writer is None:
                    writer = parquet.ParquetWriter(target, table.schema, compression="snappy", use_dictionary=True)
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()
        # The statistics of the new columns, and how far rounding moves the tool.
        names, columns = _usual_names(self.dataset.version), [np.vstack(values) for values in written]
        ends = np.cumsum([e.length for e in in_file])
        for e, end in zip(in_file, ends, strict=True):
            for change, q, values in zip(self.changes, joints, columns, strict=True):
                if e.index in self.numbers:
                    part = slice(end - e.length, end)
                    self.stats[e.index][change.name] = _episode_stats(values[part].astype(float), names)
                    self._measure(change, q[part])

    def _target(self, episode: Episode) -> Path:
        """Where the file of an episode is in the new dataset, from its folder."""
        if self.dataset.version == "v3.0":
            return episode.file.relative_to(self.dataset.folder)
        number = self.numbers[episode.index]
        fields = {"episode_chunk": number // self.dataset.info["chunks_size"], "episode_index": number}
        there = self.dataset.place("data_path", self.dataset.info["data_path"], **fields)
        return there.relative_to(self.dataset.folder)

    def _changed(self, batch: Any, columns: Sequence[Matrix], in_file: Sequence[Episode]) -> Any:
        """A batch with its new columns, without the episodes that are left out."""
        import pyarrow

        table = pyarrow.Table.from_batches([batch])
        for change, values in zip(self.changes, columns, strict=True):
            column = _column_of(values, change, table)
            there = table.schema.get_field_index(change.name)
            table = table.append_column(*column) if there < 0 else table.set_column(there, *column)
        if any(change.double or isinstance(change.source, PoseFeature) for change in self.changes):
            metadata = {k: v for k, v in (table.schema.metadata or {}).items() if k != b"huggingface"}
            table = table.replace_schema_metadata(metadata)
        return self._renumbered(table, in_file) if self.renumbered else table

    def _values(self, file: Path, change: Change, batch: Any, q: Matrix) -> Any:
        """The numbers of a column's rows, rounded as they are written."""
        source = change.source
        if isinstance(source, PoseFeature):
            return q.astype(change.kind)
        with datasets.reading(file):
            old = datasets.numeric(self.dataset, file, source.name, batch.column(source.name))
        old[:, source.places] = source.values(self.task.robot, q)
        return old.astype(change.kind if change.double else np.dtype(self.dataset.features[source.name]["dtype"]))

    def _measure(self, change: Change, q: Matrix) -> None:
        """How far rounding the joints (k, n) moves the tool."""
        source, robot, written = change.source, self.task.robot, q.astype(change.kind).astype(float)
        if isinstance(source, JointFeature):
            written = source.joints(robot, source.values(robot, q).astype(change.kind).astype(float))
        self.rounded = max(self.rounded, float(np.abs(self.task.error(written, *self.task._poses(q))).max()))

    def _renumbered(self, table: Any, in_file: Sequence[Episode]) -> Any:
        """Rows of the episodes that stay, with their new numbers."""
        import pyarrow

        episode = table.column("episode_index").to_numpy()
        keep = np.isin(episode, list(self.numbers))
        table = table.filter(pyarrow.array(keep))
        first = {e.index: e.first for e in in_file}
        old = episode[keep]
        moved = np.array([self.firsts[e] - first[e] for e in old], dtype=np.int64)
        numbers = np.array([self.numbers[e] for e in old], dtype=np.int64)
        columns = {"episode_index": numbers, "index": table.column("index").to_numpy() + moved}
        return _with_columns(table, columns)


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


def _videos(dataset: Dataset, episodes: Sequence[Episode], numbers: dict[int, int], out: Path) -> None:
    """The videos of the episodes that stay: hard links where the disk has them, else copies."""
    template = dataset.info.get("video_path")
    for key, feature in dataset.features.items():
        if feature["dtype"] != "video" or not isinstance(template, str):
            continue
        for e in episodes:
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
        # Whole numbers, which pandas may write as floats.
        whole = [int(index) for index in numbers if isinstance(index, int | float) and float(index).is_integer()]
        if len(whole) < 2:
            fact = f"does not say which file has the video {key} of episode {episode.index}"
            raise FileError(dataset.folder / "meta" / "episodes", fact, "download the dataset anew")
        chunk, file = whole
        return dataset.place("video_path", template, video_key=key, chunk_index=chunk, file_index=file)
    chunk = number // dataset.info["chunks_size"]
    return dataset.place("video_path", template, video_key=key, episode_chunk=chunk, episode_index=number)
