"""A LeRobot dataset written anew with other joints: data files, metadata, statistics; videos are linked or copied."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..analysis.audit.logs import Dataset, Episode, JointFeature, PoseFeature
from ..analysis.audit.logs.dataset_folder import batches, check_inside, numeric, reading
from ..base.errors import RecordingError
from ..base.types import Matrix
from ..strategies.tasks.task import Task
from .dataset_meta import write_meta
from .dataset_stats import Stats, episode_stats, usual_names


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
    write_meta(dataset, writer.features(), kept, firsts, writer.stats, out)
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
                self.stats[e.index][change.name] = episode_stats(mine, usual_names(self.dataset.version))

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
                self.rounded = max(self.rounded, float(np.abs(self.task.error(written, *self.task.poses(mine))).max()))

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
