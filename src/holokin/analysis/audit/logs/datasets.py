"""LeRobot datasets: their folder, and which entries of their columns are which joints, or a tool pose."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np

from ....base.arguments import AxisCounts, typed
from ....base.errors import ArgumentError, FileError, UnknownNameError
from ....base.extra_module import extra_module
from ....base.files import listed, shown
from ....base.poses import QuaternionOrder
from ....base.tables import PoseColumns, Units, columns_of_poses, poses_of
from ....base.types import Array, Indices, Matrix, Shown, Value, Vector
from ....robot import Robot
from .bag import record_batches
from .joint_columns import Columns, columns_named
from .log_formats import outside

# --- A LeRobot dataset on disk, formats v2.1 and v3.0: its description, its episodes, and its rows, a batch at a time.

INFO = "meta/info.json"
VERSIONS = ("v2.1", "v3.0")
ROWS = 20_000  # rows of a data file that are in memory at one time: a megabyte and a half of fourteen columns

# How parquet files are opened: bytes of a column that are read at one time; else all of a row group are in memory.
_SMALL = {"memory_map": False, "pre_buffer": False, "buffer_size": 2**16}

# Frames of one dataset: five weeks at 30 Hz. A file that says more is broken, or made to fill the memory.
MOST_FRAMES = 100_000_000

LARGEST_TEXT = 200_000_000  # bytes of a JSON file that is read, and of what a parquet file of metadata unpacks to

# How the columns of meta/episodes begin that are read: others, as texts of tasks and statistics, may be large.
_FACTS = ("episode_index", "dataset_from_index", "length", "data/", "videos/")

_FIELD = re.compile(r"\{(\w+)(?::0?(\d{1,2})d)?\}")


@dataclass(frozen=True)
class Episode(Shown):
    """One episode: its index, its rows in the whole dataset, the data file that holds it, and its row of metadata."""

    index: int
    first: int
    length: int
    file: Path
    facts: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Dataset(Value):
    """A LeRobot dataset: its folder, what `meta/info.json` says, and its episodes. Rows are read by `rows`."""

    folder: Path
    info: dict[str, Any]
    episodes: tuple[Episode, ...]

    @property
    def version(self) -> str:
        """Its format, "v2.1" or "v3.0"."""
        return self.info["codebase_version"]

    @property
    def features(self) -> dict[str, dict[str, Any]]:
        """Each column, its dtype, shape and the names of its entries."""
        return self.info["features"]

    @property
    def frames(self) -> int:
        """Rows of all its episodes."""
        return sum(e.length for e in self.episodes)

    @property
    def period(self) -> float:
        """Time from a frame to the next [s]; LeRobot's usual one where `info.json` says none."""
        fps = self.info.get("fps")
        return 1 / fps if isinstance(fps, int | float) and 0 < fps < 1e6 else 1 / 30

    def files(self) -> list[Path]:
        """Its data files, in the order of the episodes."""
        return list(dict.fromkeys(e.file for e in self.episodes))

    def place(self, what: str, template: str, **fields: int | str) -> Path:
        """A file inside the folder, of a template in `info.json`. Raises: FileError."""
        return _place(self.folder, what, template, fields)


@typed
def is_dataset(path: Path) -> bool:
    """Whether a folder is a LeRobot dataset: it has meta/info.json."""
    return (path / INFO).is_file()


@typed
def read_dataset(folder: Path) -> Dataset:
    """The description and the episodes of a LeRobot dataset, format v2.1 or v3.0. No row is read.

    Args:
        folder: it has `meta/info.json`.

    Raises:
        FileError: files that are missing, broken or of another format; paths that lead out of the folder; episodes
            that do not follow each other. MissingExtraError: pyarrow is not installed.
    """
    info = read_json(folder / INFO)
    _check_info(folder / INFO, info)
    episodes = [_episode(folder, info, row) for row in _episode_rows(folder, info["codebase_version"])]
    where, first = folder / "meta", 0
    if not episodes:
        raise FileError(where, "has no episodes", "record one")
    for number, episode in enumerate(episodes):
        if episode.index != number or episode.first != first or episode.length < 1:
            fact = f"its episode {number} has the index {episode.index}, {episode.length} frames, and begins at frame "
            raise FileError(where, f"{fact}{episode.first}, where {first} was due", "download the dataset anew")
        first += episode.length
    if first > MOST_FRAMES:
        raise FileError(where, f"says that there are {first} frames", "no dataset is so long: download it anew")
    return Dataset(folder, info, tuple(episodes))


def rows(
    dataset: Dataset, columns: Sequence[str], episodes: Sequence[int] | None = None, size: int = ROWS
) -> Iterator[Rows]:
    """Numeric columns of a dataset, a batch at a time, in the order of the files.

    Args:
        columns: names of features, each (k, d) of numbers.
        episodes: those that are wanted; by default all.
        size: rows of a batch.

    Raises:
        FileError: a data file that is missing, broken, or holds something else than `meta/` says.
    """
    chosen = None if episodes is None else set(episodes)
    for file in dataset.files():
        in_file = [e for e in dataset.episodes if e.file == file]
        if chosen is not None and not chosen & {e.index for e in in_file}:
            continue
        read = 0
        for batch in batches(file, sum(e.length for e in in_file), ["episode_index", "frame_index", *columns], size):
            batch_rows = _rows_of(dataset, file, batch, columns, in_file, read)
            read += len(batch_rows.episode)
            keep = np.isin(batch_rows.episode, list(chosen)) if chosen is not None else slice(None)
            part = {name: values[keep] for name, values in batch_rows.values.items()}
            yield Rows(batch_rows.episode[keep], batch_rows.frame[keep], part)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows that follow each other: their episode (k,), their number in it (k,), and values (k, d) by column."""

    episode: Indices
    frame: Indices
    values: dict[str, Matrix]


def batches(file: Path, count: int, columns: Sequence[str] | None = None, size: int = ROWS) -> Iterator[Any]:
    """Record batches of a data file that holds so many rows. Raises: FileError."""
    parquet = _parquet()
    with reading(file), parquet.ParquetFile(file, **_SMALL) as table:
        there = table.schema_arrow.names
        missing = [name for name in columns or () if name not in there]
        if missing:
            cure = f"download it anew, or write it with LeRobot; its columns are {listed(there)}"
            raise FileError(file, f"has no column {listed(missing)}", cure)
        if table.metadata.num_rows != count:
            fact = f"has {table.metadata.num_rows} rows, but meta/ says {count} frames of the episodes in it"
            raise FileError(file, fact, "download it anew: some of its files are of another version")
        yield from record_batches(file, table, columns, size)
    release()


def release() -> None:
    """Give back to the system what pyarrow needs no more."""
    import pyarrow

    pyarrow.default_memory_pool().release_unused()


@contextmanager
def reading(file: Path) -> Iterator[None]:
    """What a file that cannot be read raises, as a FileError."""
    import pyarrow

    try:
        if not file.is_file():  # a pipe might never end
            raise FileNotFoundError
        yield
    except FileNotFoundError:
        raise FileError(file, "there is no such file, but meta/ names it", "download the dataset anew") from None
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as problem:
        words = " ".join(str(problem).split())
        raise FileError(file, f"cannot be read ({shown(words, 120)})", "download it anew") from problem


def read_json(file: Path) -> Any:
    """What a JSON file holds. Raises: FileError."""
    return _value_of(file, _text(file), "is")


def read_lines(file: Path) -> list[Any]:
    """What a file holds that has a JSON value a line. Raises: FileError."""
    lines = enumerate(_text(file).split("\n"), 1)
    return [_value_of(file, line, f"line {number} is") for number, line in lines if line.strip()]


def _value_of(file: Path, text: str, what: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as problem:
        fact = f"{what} no JSON ({shown(str(problem), 120)})"
        raise FileError(file, fact, "download it anew") from problem


def read_parquet(file: Path, begins: tuple[str, ...] = ("",)) -> Any:
    """A small table, of the columns whose names begin so. Raises: FileError."""
    parquet = _parquet()
    with reading(file), parquet.ParquetFile(file, **_SMALL) as table:
        if table.metadata.num_rows > MOST_FRAMES:
            raise FileError(file, f"has {table.metadata.num_rows} rows", "no dataset is so long: download it anew")
        names = [name for name in table.schema_arrow.names if name.startswith(begins)]
        groups = (table.metadata.row_group(i) for i in range(table.metadata.num_row_groups))
        parts = (group.column(j) for group in groups for j in range(group.num_columns))
        size = sum(part.total_uncompressed_size for part in parts if part.path_in_schema.startswith(tuple(names)))
        if size > LARGEST_TEXT:
            fact = f"unpacks to {size} bytes, by its own footer"
            raise FileError(file, fact, "no dataset's metadata is so large: download it anew")
        return table.read(columns=names, use_threads=False)


def episode_files(folder: Path) -> list[Path]:
    """The files of a dataset v3.0 that describe its episodes. Raises: FileError."""
    files = sorted((folder / "meta" / "episodes").glob("*/*.parquet"))
    if not files:
        raise FileError(folder / "meta" / "episodes", "has no parquet file", "download the dataset anew")
    for file in files:
        check_inside(folder, "meta/episodes", file)
    return files


def _parquet() -> Any:
    return extra_module("pyarrow.parquet", "lerobot", "pyarrow, to read LeRobot datasets")


def _text(file: Path) -> str:
    try:
        if not file.is_file():
            raise FileNotFoundError
        if file.stat().st_size > LARGEST_TEXT:
            raise FileError(file, f"has {file.stat().st_size} bytes", "no dataset's is so long: download it anew")
        return file.read_text("utf-8")
    except FileNotFoundError:
        cure = "give the whole folder of a LeRobot dataset: it has meta/info.json, and what that names"
        raise FileError(file, "there is no such file", cure) from None
    except (OSError, UnicodeDecodeError) as problem:
        raise FileError(file, f"cannot be read ({shown(str(problem), 120)})", "download it anew") from problem


def _check_info(file: Path, info: Any) -> None:
    """Raises: FileError: what is no description of a dataset that is read here."""
    if not isinstance(info, dict) or not isinstance(info.get("codebase_version"), str):
        raise FileError(file, "has no codebase_version", "give the folder of a LeRobot dataset")
    version = info["codebase_version"]
    if version not in VERSIONS:
        cure = f"convert it by LeRobot's own scripts to {' or '.join(VERSIONS)}"
        raise FileError(file, f"says format {shown(version)}", cure)
    features = info.get("features")
    sound = isinstance(features, dict) and all(_is_feature(feature) for feature in features.values())
    if not sound or not isinstance(info.get("data_path"), str):
        raise FileError(file, "has no data_path, or features without dtype and shape", "download it anew")
    if version == "v2.1" and not (isinstance(info.get("chunks_size"), int) and info["chunks_size"] > 0):
        raise FileError(file, "has no chunks_size", "download it anew")


def _is_feature(feature: Any) -> bool:
    return (
        isinstance(feature, dict)
        and isinstance(feature.get("dtype"), str)
        and isinstance(feature.get("shape"), list)
        and all(isinstance(side, int) and side >= 0 for side in feature["shape"])
    )


def _episode_rows(folder: Path, version: str) -> list[dict[str, Any]]:
    """What meta/ says of each episode. Raises: FileError."""
    if version == "v3.0":
        return [row for file in episode_files(folder) for row in read_parquet(file, _FACTS).to_pylist()]
    first, episodes, file = 0, [], folder / "meta" / "episodes.jsonl"
    for row in read_lines(file):
        if not isinstance(row, dict) or not isinstance(row.get("length"), int):
            raise FileError(file, "has a line without a length", "download the dataset anew")
        episodes.append(row | {"dataset_from_index": first})
        first += row["length"]
    return episodes


def _episode(folder: Path, info: dict[str, Any], row: dict[str, Any]) -> Episode:
    """Raises: FileError."""
    try:
        index, first, length = (int(row[key]) for key in ("episode_index", "dataset_from_index", "length"))
        if info["codebase_version"] == "v3.0":
            fields = {"chunk_index": int(row["data/chunk_index"]), "file_index": int(row["data/file_index"])}
        else:
            fields = {"episode_chunk": index // info["chunks_size"], "episode_index": index}
    except (KeyError, TypeError, ValueError, OverflowError) as problem:
        fact = f"has an episode without a number {shown(str(problem), 60)}"
        raise FileError(folder / "meta", fact, "download the dataset anew") from problem
    return Episode(index, first, length, _place(folder, "data_path", info["data_path"], fields), row)


def _place(folder: Path, what: str, template: str, fields: dict[str, Any]) -> Path:
    """The file of a template with fields like {chunk_index:03d}, inside the folder. Raises: FileError."""

    def written(match: re.Match[str]) -> str:
        name, width = match[1], match[2]
        if name not in fields:
            cure = f"it may name {', '.join(fields)}: download the dataset anew"
            raise FileError(folder / INFO, f"{what} has the field {shown(name)!r}", cure)
        return f"{fields[name]:0{width}d}" if width and isinstance(fields[name], int) else str(fields[name])

    name = _FIELD.sub(written, template)
    file = PurePosixPath(name)
    if "{" in name or "}" in name or "\\" in name or "\0" in name or file.is_absolute() or ".." in file.parts:
        fact = f"its {what} {shown(template)!r} leads out of the dataset, or is no template of LeRobot"
        raise FileError(folder / INFO, fact, "do not use this dataset before you know who wrote it")
    return check_inside(folder, what, folder / file)


def check_inside(folder: Path, what: str, file: Path) -> Path:
    """Raises: FileError: a link that leads out of the folder."""
    if not file.resolve().is_relative_to(folder.resolve()):
        cure = "copy the dataset with its links resolved (cp -rL), if you trust it"
        raise FileError(file, f"is a link out of the dataset, of {what}", cure)
    return file


def _rows_of(
    dataset: Dataset, file: Path, batch: Any, columns: Sequence[str], in_file: Sequence[Episode], read: int
) -> Rows:
    """A record batch as arrays, whose episodes are those that are due. Raises: FileError."""
    with reading(file):
        episode, frame = (_numbers(batch.column(name)) for name in ("episode_index", "frame_index"))
        values = {name: numeric(dataset, file, name, batch.column(name)) for name in columns}
    begins = np.cumsum([0, *(e.length for e in in_file)])
    place = np.arange(read, read + len(episode))
    which = np.searchsorted(begins, place, side="right") - 1
    due, frame_due = np.array([e.index for e in in_file])[which], place - begins[which]
    wrong = np.flatnonzero((episode != due) | (frame != frame_due))
    if len(wrong):
        i = int(wrong[0])
        fact = f"row {read + i} is frame {frame[i]} of episode {episode[i]}, where frame {frame_due[i]} of "
        raise FileError(file, f"{fact}episode {due[i]} was due", "download the dataset anew")
    return Rows(due, frame.astype(np.intp), values)


def numeric(dataset: Dataset, file: Path, name: str, column: Any) -> Matrix:
    """A column as numbers (k, d), of the width that `info.json` says. Raises: FileError."""
    import pyarrow

    width = int(np.prod(dataset.features[name]["shape"]))
    kind = column.type
    if pyarrow.types.is_list(kind) or pyarrow.types.is_large_list(kind) or pyarrow.types.is_fixed_size_list(kind):
        flat = column.flatten()
    else:
        flat = column
    if not (pyarrow.types.is_floating(flat.type) or pyarrow.types.is_integer(flat.type)):
        raise FileError(file, f"its column {name} holds {shown(str(kind))}", "give a feature of numbers")
    if len(flat) != len(column) * width:
        fact = f"its column {name} has {len(flat)} numbers in {len(column)} rows"
        raise FileError(file, fact, f"meta/info.json says {width} a row: download it anew")
    numbers = _numbers(flat).astype(np.float64).reshape(len(column), width)
    bad = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if len(bad):
        cure = "correct or delete the episode; LeRobot's own delete_episodes does"
        raise FileError(file, f"{len(bad)} rows of its column {name} hold no finite number", cure)
    return numbers


def _numbers(column: Any) -> Any:
    """A column as an array, NaN where it has no number. `to_numpy` loads pandas where it is installed: 40 MB."""
    from pyarrow import types

    plain = types.is_floating(column.type) or types.is_integer(column.type)
    if not plain or column.null_count or not len(column):
        return column.to_numpy(zero_copy_only=False)
    numbers = np.frombuffer(column.buffers()[1], column.type.to_pandas_dtype())
    return numbers[column.offset : column.offset + len(column)]


STATE = "observation.state"
"""The name that LeRobot gives to what the robot measures."""

ACTION = "action"
"""The name that LeRobot gives to what the robot is told."""

NORMALIZED = 100.0  # the ends of the range to which LeRobot maps a motor that has no unit

# How `robot_type` begins of arms of hobby servos: LeRobot records these in degrees, or from -100 to 100.
MOTORS = ("so100", "so101", "so_", "koch", "omx", "lekiwi", "bi_so", "hope_jr")

_TURNS = {"wx": "rx", "wy": "ry", "wz": "rz"}  # rotation vectors: as LeRobot names their entries, and as they are read

_POSE = re.compile(r"(?:^|.*[._/: ])(x|y|z|q[xyzw0-4]|roll|pitch|yaw|[rw][xyz])(?:[._](?:pos|position))?$")


@dataclass(frozen=True, eq=False)
class JointFeature(Value):
    """The joints of a robot in a column of a dataset: `places` (n,) among its entries, in the robot's order.

    degrees: True or False as the caller says; None where the values must show it. counts_turns: the values count whole
    turns of hinges, so none is taken to be modulo a turn. counts: sign, offset and scale of each joint.
    """

    name: str
    places: Indices
    degrees: bool | None
    counts_turns: bool = False
    counts: AxisCounts = field(default_factory=AxisCounts)

    def joints(self, robot: Robot, values: Matrix, degrees: bool | None = None) -> Matrix:
        """Joints (k, n) in rad and m of values in the robot's order."""
        units = np.where(robot.hinges & bool(self.degrees if degrees is None else degrees), np.pi / 180, 1.0)
        return self.counts.joints(robot.joint_names, values, units)

    def values(self, robot: Robot, joints: Matrix) -> Matrix:
        """What the dataset has for joints (k, n)."""
        units = np.where(robot.hinges & bool(self.degrees), np.pi / 180, 1.0)
        return self.counts.values(robot.joint_names, joints, units)


@dataclass(frozen=True, eq=False)
class PoseFeature(Value):
    """A tool pose in a column of a dataset: which of its entries, and in which units."""

    name: str
    columns: PoseColumns
    said: Units


def _names_of(dataset: Dataset, feature: str) -> list[str]:
    """The names of a column's entries, or their numbers where it has none. Raises: UnknownNameError, FileError."""
    if feature not in dataset.features:
        raise UnknownNameError("column", feature, dataset.features)
    known = dataset.features[feature]
    width = int(np.prod(known["shape"]))
    names = _flat(known.get("names"))
    if names and len(names) != width:
        fact = f"names {len(names)} entries of {feature}, which has {width}"
        raise FileError(dataset.folder / INFO, fact, "correct meta/info.json")
    return names or [str(i) for i in range(width)]


@typed
def joint_feature(
    dataset: Dataset,
    robot: Robot,
    feature: str,
    *,
    columns: Columns | None = None,
    degrees: bool | None = None,
    counts_turns: bool = False,
    signs: Mapping[str, int] | None = None,
    offsets: Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
) -> JointFeature:
    """The joints of a robot in a column, by their names, in whatever order.

    Args:
        columns: names of the entries, as for the columns of a log; entries without names have their numbers from 0.
        degrees: unit of the hinges; None where the values shall show it.
        counts_turns: the values of hinges count whole turns.
        signs, offsets, scales: how the column counts joints, as of `read_recording`.

    Raises:
        FileError: joints that are missing; a unit that must be said. ArgumentError, UnknownNameError.
    """
    names, file = _names_of(dataset, feature), dataset.folder / INFO
    counts = AxisCounts(signs or {}, offsets or {}, scales or {}).known(robot.joint_names)
    places = columns_named(file, names, robot, columns)
    kind = str(dataset.info.get("robot_type") or "")
    if degrees is None and kind.startswith(MOTORS) and not counts.scaled(robot.joint_names)[robot.hinges].all():
        fact = f"was recorded with {shown(kind)}, whose joints LeRobot writes in degrees or from -100 to 100"
        cure = "say --degrees (degrees=True) if it was recorded with use_degrees; other values are no angles"
        raise FileError(file, fact, cure)
    return JointFeature(feature, np.array(places, dtype=np.intp), degrees, counts_turns, counts)


@typed
def has_joints(dataset: Dataset, robot: Robot, feature: str) -> bool:
    """Whether a column names every joint of a robot."""
    try:
        joint_feature(dataset, robot, feature, degrees=False)
    except (FileError, UnknownNameError):
        return False
    return True


@typed
def pose_feature(
    dataset: Dataset,
    feature: str,
    *,
    angles: Literal["rad", "deg"] | None = None,
    order: QuaternionOrder | None = None,
) -> PoseFeature:
    """The tool pose in a column, with entries x, y, z [m] and qx, qy, qz, qw, or roll, pitch, yaw, or rx, ry, rz, also
    as ee.x or ee.wx; other entries are left aside.

    Args:
        angles: "rad" or "deg", of roll, pitch, yaw and rotation vectors; by default rad.
        order: "xyzw" or "wxyz" of quaternions whose entries are numbered.

    Raises:
        FileError: no such entries. UnknownNameError: no such column. ArgumentError.
    """
    names = _names_of(dataset, feature)
    plain = [_plain(name) for name in names]
    units = Units(None, angles, order, assumed=True, place="frame")
    numbered = [name for name in plain if re.fullmatch(r"q[0-4]", name)]
    entries = [(i, name) for i, name in enumerate(plain) if name and (order is not None or name not in numbered)]
    columns = columns_of_poses(dataset.folder / INFO, [name for _, name in entries], units)
    if not columns.kind:
        fact = f"{feature} has a position, but no orientation: its entries are {listed(names)}"
        cure = "name qx, qy, qz, qw, or roll, pitch, yaw, or rx, ry, rz"
        if numbered:
            cure = "say --order xyzw or wxyz (order=...), if these numbers are a quaternion"
        raise FileError(dataset.folder / INFO, fact, cure)
    places_of_entries = [i for i, _ in entries]
    places = [[places_of_entries[i] for i in part] for part in (columns.position, columns.orientation)]
    return PoseFeature(feature, PoseColumns(places[0], places[1], columns.kind, None, columns.scales), units)


def postures_of(dataset: Dataset, robot: Robot, joints: JointFeature, values: Matrix) -> Matrix:
    """Postures (k, n) in rad and m of the values (k, d) of a column. Raises: FileError: values that look like
    degrees, or like LeRobot's -100 to 100, where nothing was said."""
    raw = values[:, joints.places]
    if not len(raw):
        return raw
    low, high = raw.min(axis=0), raw.max(axis=0)
    file = dataset.folder / INFO
    ends = (np.maximum(-low, high) == NORMALIZED) & robot.hinges & ~joints.counts.scaled(robot.joint_names)
    if ends.sum() > 1 and np.abs(raw[:, robot.hinges]).max() == NORMALIZED and joints.degrees is not False:
        fact = f"{int(ends.sum())} joints of {joints.name} reach 100 exactly, the end of LeRobot's range -100 to 100"
        raise FileError(file, fact, "convert them to degrees by the calibration of the arm, or record degrees")
    if joints.degrees is None:
        _check_unit(file, robot, joints, np.stack([low, high]))
    return joints.joints(robot, raw)


def check_normalized(dataset: Dataset, robot: Robot, joints: JointFeature, low: Vector, high: Vector) -> None:
    """Raises: FileError: all joints (n,) of hobby servos that are said to be in degrees lie within LeRobot's -100
    to 100, between `low` and `high` [rad or m]; these look alike, and are no angles."""
    asked = robot.hinges & ~joints.counts.scaled(robot.joint_names)
    if not (joints.degrees and str(dataset.info.get("robot_type") or "").startswith(MOTORS) and asked.any()):
        return
    if np.abs(joints.values(robot, np.stack([low, high])))[:, asked].max() <= NORMALIZED * (1 + 1e-6):
        fact = f"no joint of {joints.name} is beyond 100: these may be degrees, or LeRobot's -100 to 100, no angles"
        cure = "give the rad of a unit for each joint by --scales, and --offsets, from the calibration of the arm"
        raise FileError(dataset.folder / INFO, fact, f"{cure}; a degree has 0.0174533")


def tool_poses_of(dataset: Dataset, poses: PoseFeature, values: Matrix, frames: Indices) -> tuple[Matrix, Array]:
    """Points [m] (k, 3) and rotations (k, 3, 3) of the values (k, d) of a column. Raises: FileError."""
    wanted = [*poses.columns.position, *poses.columns.orientation]
    poses_read = poses_of(dataset.folder, poses.columns, values[:, wanted], frames, poses.said)
    return poses_read.points, np.asarray(poses_read.rotations)


def _flat(names: Any) -> list[str]:
    """Names as LeRobot's versions write them: a list, or lists by group, as {"motors": [...]}."""
    if isinstance(names, dict):
        inner = [_flat(part) for part in names.values()]
        return [name for part in inner for name in part] if any(inner) else [str(name) for name in names]
    return [str(name) for name in names] if isinstance(names, Sequence) and not isinstance(names, str) else []


def _plain(name: str) -> str:
    """The name of a pose's entry without the tool's name before it; empty for another one."""
    match = _POSE.match(name.lower())
    return _TURNS.get(match[1], match[1]) if match else ""


def _check_unit(file: Any, robot: Robot, joints: JointFeature, ends: Matrix) -> None:
    """Raises: FileError: values that are no radians, by their extremes (2, n)."""
    low, high = (end(joints.joints(robot, ends, False), axis=0) for end in (np.min, np.max))
    over = np.where(robot.hinges & ~joints.counts.scaled(robot.joint_names), outside(robot, low, high), -np.inf)
    worst = int(np.argmax(over))
    if over[worst] <= 0:
        return
    name = robot.joint_names[worst]
    value = float(low[worst] if -low[worst] > high[worst] else high[worst])
    fact = f"joint {name} of {joints.name} reaches {value:.4g}, far outside its limits in rad"
    turned = joints.joints(robot, ends, True)
    if (outside(robot, turned.min(axis=0), turned.max(axis=0)) <= 0)[robot.hinges].all():
        cure = "say --degrees (degrees=True), or --radians if it is radians after all"
        raise FileError(file, f"{fact}, but every joint fits in degrees", cure)
    cure = "check robot and joints; of LeRobot's -100 to 100, and of encoder ticks, give --scales and --offsets"
    cure += " from the calibration of the arm"
    raise FileError(file, f"{fact} and in degrees", cure)


@typed
def chosen_episodes(dataset: Dataset, text: str | None) -> list[int]:
    """The episodes of a text as "0:10,12": 0 to 9, and 12; all where there is none. Raises: ArgumentError."""
    count = len(dataset.episodes)
    if text is None:
        return list(range(count))
    chosen: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,9})\s*(?:(:)\s*(\d{0,9})\s*)?", part)
        first, last = (int(match[1]), int(match[3] or count) if match[2] else int(match[1]) + 1) if match else (0, 0)
        if not match or not first < last <= count:
            cure = f"give numbers and ranges such as 0:10,12 of the episodes 0 to {count - 1}"
            raise ArgumentError("--episodes", text, cure)
        chosen |= set(range(first, last))
    return sorted(chosen)
