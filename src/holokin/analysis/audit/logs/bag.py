"""Reads joints from rosbag2 folders, .mcap, .db3 and ROS 1 .bag files."""

from __future__ import annotations

import bz2
import re
import struct
import sys
from array import array
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import FileError, HolokinError, MissingExtraError
from ....base.files import listed, shown
from ....base.sqlite_file import sqlite_file
from ....robot import Robot
from .joint_columns import Columns, Samples, columns_named

# --- What a bag or a dataset unpacks to is measured before it is unpacked: a few bytes may stand for gigabytes.

MOST_CHUNK = 256 * 2**20  # bytes that one chunk may unpack to; recorders write chunks of 1 to 16 MB
MOST_MESSAGE = 2**20  # bytes of one JointState message; that of an arm has less than a thousand
MOST_FILE = 4 * 2**30  # bytes that a packed storage file of a folder may unpack to, on disk

# Bytes of metadata.yaml; that of an hour of bags in parts has a tenth, and parsing takes five seconds a megabyte.
MOST_METADATA = 2 * 2**20

MOST_ROWS = 64 * 2**20  # bytes that the rows of a dataset may unpack to that are in memory at one time

# Bytes up to which writers of parquet files keep the texts of a column in a dictionary; rows name its entries.
DICTIONARY = 2**20

# How many times its size in the file a column of over `MOST_ROWS` bytes may unpack to; texts come to some 100.
DENSEST = 1000

_WIDTHS = {"BOOLEAN": 1, "INT32": 4, "INT64": 8, "INT96": 12, "FLOAT": 4, "DOUBLE": 8}

_PIECE = 2**20
_DEEPEST = 50  # the parser's time grows with the square of it
_ALIAS = re.compile(r"(?:^|[\s\[{,:-])[&*][^\s&*]", re.MULTILINE)


def broken(file: Path, why: str) -> FileError:
    """The refusal of a bag whose bytes make no sense."""
    cure = "give a rosbag2 folder with metadata.yaml, or a whole .mcap, .db3 or .bag file"
    return FileError(file, f"cannot be read as a bag ({shown(why, 200)})", cure)


@contextmanager
def _refusals(file: Path) -> Iterator[None]:
    """Whatever the parsers of a bag raise at broken bytes becomes a refusal of the file.

    They and the libraries beneath (sqlite, zstd, lz4, yaml, struct) have no common error, and raise MemoryError or
    OverflowError at senseless sizes. So everything is caught, round calls of theirs alone.
    """
    try:
        yield
    except HolokinError:
        raise
    except Exception as problem:  # noqa: BLE001
        raise broken(file, f"{type(problem).__name__}: {problem}") from None


def _unpacker(kind: str) -> Any:
    if kind == "zstd":
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
        return zstd.ZstdDecompressor()
    if kind == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    return bz2.BZ2Decompressor()


def _unpacked_pieces(kind: str, pieces: Iterator[bytes]) -> Iterator[bytes]:
    """What zstd, lz4 or bz2 data unpack to, a megabyte at a time; several frames follow one another."""
    unpacker = _unpacker(kind)
    for piece in pieces:
        data = piece
        while True:
            if unpacker.eof:
                unpacker = _unpacker(kind)
            yield unpacker.decompress(data, max_length=_PIECE)
            data = (unpacker.unused_data or b"") if unpacker.eof else b""
            if not data and (unpacker.eof or unpacker.needs_input):
                break


def _bounded(file: Path, what: str, kind: str, pieces: Iterator[bytes], most: int) -> Iterator[bytes]:
    """What packed data unpack to, as long as it is at most `most` bytes. Raises: FileError."""
    size = 0
    for part in _unpacked_pieces(kind, pieces):
        size += len(part)
        if size > most:
            raise _too_large(file, what, most)
        yield part


def unpacked(file: Path, what: str, kind: str, data: bytes, most: int) -> bytes:
    """Unpacked bytes, at most `most`. Raises: FileError."""
    return b"".join(_bounded(file, what, kind, iter([data]), most))


def _check_size(file: Path, what: str, kind: str, pieces: Iterator[bytes], most: int) -> None:
    """Raises: FileError when packed data unpack to more than `most` bytes."""
    deque(_bounded(file, what, kind, pieces, most), maxlen=0)


def _too_large(file: Path, what: str, most: int) -> FileError:
    """The refusal of a bag that would unpack to too much."""
    fact = f"{what} unpacks to over {most} bytes, more than joint states need"
    return FileError(file, fact, "record joint states alone")


def check_folder(folder: Path) -> list[Path]:
    """The files of a rosbag2 folder. Raises: FileError when it cannot be read without harm."""
    with _refusals(folder):
        parts = sorted(folder.iterdir())
        for part in parts:
            if not (part.is_dir() or part.is_file()):
                raise FileError(folder, f"{shown(part.name)!r} in it is no regular file", "delete it")
        metadata = folder / "metadata.yaml"
        if not metadata.is_file():
            raise broken(folder, "there is no metadata.yaml in it")
        if metadata.stat().st_size > MOST_METADATA:
            fact = f"its metadata.yaml has over {MOST_METADATA} bytes"
            raise FileError(folder, fact, "audit its .mcap or .db3 files one by one")
        text = metadata.read_text("utf-8")
        depth = accumulate((c in "[{") - (c in "]}") for c in text)
        if _ALIAS.search(text) or max(depth, default=0) > _DEEPEST:
            fact = f"its metadata.yaml holds aliases (& and *), or brackets over {_DEEPEST} deep"
            fact += ", which no recorder writes"
            raise FileError(folder, fact, "write it out, or audit its .mcap or .db3 files one by one")
        files = [part for part in parts if part.is_file()]
        for part in files:
            if part.suffix == ".zstd":
                with part.open("rb") as stream:
                    pieces = iter(lambda: stream.read(_PIECE), b"")
                    _check_size(folder, shown(part.name), "zstd", pieces, MOST_FILE)
    return files


def _check_mcap(file: Path) -> None:
    """Raises: FileError when records are longer than the file, or chunks unpack to more than they say."""
    size = file.stat().st_size
    chunks: dict[int, int] = {}
    indexed: set[int] = set()
    with _refusals(file), file.open("rb") as stream:
        if stream.read(8) != b"\x89MCAP0\r\n":
            raise broken(file, "it does not begin like an MCAP file")
        place = 8
        while place + 9 <= size:
            stream.seek(place)
            kind, length = struct.unpack("<BQ", stream.read(9))
            if place + 9 + length > size:
                raise broken(file, f"the record at byte {place} is longer than the file")
            if kind == 0x06:
                chunks[place] = _check_chunk(file, stream, place, length)
            if kind == 0x08:
                where, says = _index(stream.read(min(length, 2**20)))
                if where in indexed or chunks.get(where) != says:
                    raise broken(file, f"its index names a chunk at byte {where} that is not there")
                indexed.add(where)
            if kind == 0x02:
                break
            place += 9 + length


def _check_chunk(file: Path, stream: Any, place: int, length: int) -> int:
    """The size that a chunk says it unpacks to, when it does."""
    head = stream.read(min(length, 64))
    says, letters = struct.unpack_from("<16xQ4xI", head)
    kind = head[32 : 32 + letters].decode()
    (packed,) = struct.unpack_from("<Q", head, 32 + letters)
    begin = 40 + letters
    if begin + packed > length or kind not in ("", "lz4", "zstd") or (not kind and says != packed):
        raise broken(file, f"the chunk at byte {place} makes no sense")
    if says > MOST_CHUNK:
        raise _too_large(file, f"the chunk at byte {place}", MOST_CHUNK)
    if kind:
        stream.seek(place + 9 + begin)
        pieces = (stream.read(min(_PIECE, packed - done)) for done in range(0, packed, _PIECE))
        _check_size(file, f"the chunk at byte {place}", kind, pieces, says)
    return says


def _index(record: bytes) -> tuple[int, int]:
    """(byte of the chunk, its unpacked size) of a chunk index."""
    (where,) = struct.unpack_from("<16xQ", record)
    (maps,) = struct.unpack_from("<I", record, 32)
    (letters,) = struct.unpack_from("<8xI", record, 36 + maps)
    (says,) = struct.unpack_from("<8xQ", record, 48 + maps + letters)
    return where, says


def _check_sqlite(file: Path) -> None:
    """Raises: FileError when a database is none, or computes its rows (views, generated columns): that may never
    end."""
    with _refusals(file):
        with file.open("rb") as stream:
            if stream.read(16) != b"SQLite format 3\0":
                raise broken(file, "it does not begin like an SQLite file")
        with sqlite_file(file, "frozen") as db:
            rows = db.execute("SELECT type, sql FROM sqlite_master").fetchmany(10_000)
    for kind, sql in rows:
        computed = re.search(r"\bas\s*\(|\bvirtual\s+table\b", str(sql or ""), re.IGNORECASE)
        if kind not in ("table", "index") or computed:
            raise broken(file, f"its tables are computed: {sql}")


def record_batches(file: Path, table: Any, columns: Sequence[str] | None, most: int) -> Iterator[Any]:
    """The rows of a parquet file, some `most` together, or fewer where these would take more than `MOST_ROWS` bytes.

    Raises: FileError: a column is a bomb.
    """
    import pyarrow

    def joined() -> Any:
        return waiting[0] if len(waiting) == 1 else pyarrow.Table.from_batches(waiting).combine_chunks().to_batches()[0]

    few, waiting, rows, size = _rows_at_once(file, table, columns, most), [], 0, 0
    for batch in table.iter_batches(few, columns=None if columns is None else list(columns), use_threads=False):
        waiting.append(batch)
        rows, size = rows + len(batch), size + batch.nbytes
        if rows >= most or size > MOST_ROWS:
            yield joined()
            waiting, rows, size = [], 0, 0
    if waiting:
        yield joined()


def _rows_at_once(file: Path, table: Any, columns: Sequence[str] | None, most: int) -> int:
    """How many rows of a parquet file, 1 to `most`, unpack to `MOST_ROWS` bytes by what its footer says of its parts.

    Raises: FileError: a column is a bomb.
    """
    largest = MOST_ROWS / most
    for group in map(table.metadata.row_group, range(table.metadata.num_row_groups)):
        size = 0
        for part in map(group.column, range(group.num_columns)):
            if columns is not None and not part.path_in_schema.startswith(tuple(columns)):
                continue
            values, width, whole = part.num_values, _WIDTHS.get(part.physical_type), part.total_uncompressed_size
            most_of_one = MOST_ROWS * group.num_rows if width else max(MOST_ROWS, DENSEST * part.total_compressed_size)
            if (values * width if width else whole) > most_of_one:
                fact = f"its column {shown(part.path_in_schema)} unpacks to far more than its size in the file"
                raise FileError(file, fact, "no recorder writes such a one: download it anew")
            size += values * width if width else whole
            if not width and part.has_dictionary_page:  # any of its texts may be that of every row
                size += values * min(whole, DICTIONARY)
        largest = max(largest, size / max(group.num_rows, 1))
    return max(1, int(MOST_ROWS / largest))


JOINT_STATE = "sensor_msgs/msg/JointState"


_State = tuple[int, int, tuple[str, ...], Any]  # of a message: its stamp, its reception [ns], names, positions


def read_bag(file: Path, robot: Robot, topic: str | None, columns: Columns | None = None) -> Samples:
    """The samples of a bag; columns: which names of its messages are which joints, as of a CSV file.

    Raises: FileError; MissingExtraError: rosbags is not installed. UnknownNameError, ArgumentError: as
    `columns_named`.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("rosbags, to read bags and .mcap files", "log") from None
    old = file.suffix.lower() == ".bag" and not file.is_dir()
    for part in check_folder(file) if file.is_dir() else [file]:
        {".mcap": _check_mcap, ".db3": _check_sqlite}.get(part.suffix.lower(), lambda _: None)(part)
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    notes: list[str] = []
    with _refusals(file):
        reader: Any = Reader1(file) if old else Reader2(file)
        reader.open()
    try:
        for c in reader.connections:
            if not (isinstance(c.topic, str) and isinstance(c.msgtype, str) and isinstance(c.msgcount, int)):
                raise broken(file, f"a topic is {c.topic!r} of type {c.msgtype!r} with {c.msgcount!r} messages")
        # The definition of a message that a bag brings along is not used: a JointState has been the same in all
        # releases, and another one could declare arrays of any size.
        parse = store.deserialize_ros1 if old else store.deserialize_cdr
        connections = [c for c in reader.connections if c.msgtype == JOINT_STATE]
        name = _topic(file, {c.topic for c in connections}, {c.topic for c in reader.connections}, topic, notes)
        wanted = [c for c in connections if c.topic == name]
        samples, read = _joint_states(file, robot, _states(file, reader, wanted, parse), columns, notes)
        counted = sum(c.msgcount for c in wanted)
        if read < counted:
            notes.append(f"{read} messages read of the {counted} that the bag counts")
        return samples
    finally:
        reader.close()


def _states(file: Path, reader: Any, wanted: list[Any], parse: Any) -> Iterator[_State]:
    """The JointState messages in the order of their reception."""
    storage: Any = getattr(reader, "storage", None)
    packed = False
    if storage is not None and storage.metadata.compression_mode == "message":
        packed = True  # unpacked here, with a limit
        storage.metadata = storage.metadata._replace(compression_mode=None)
    with _refusals(file):
        messages = reader.messages(wanted)
    while True:
        with _refusals(file):
            record = next(messages, None)
            if record is None:
                return
            connection, received, raw = record
            data = unpacked(file, "a message", "zstd", raw, MOST_MESSAGE) if packed else raw
            message = parse(data, connection.msgtype)
            stamp = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
            names, position = tuple(message.name), np.asarray(message.position, dtype=float)
            if not 0 <= int(received) < 2**63:
                raise OverflowError(f"a message was received at {received} ns")
        yield stamp, int(received), names, position


def _topic(file: Path, states: set[str], every: set[str], topic: str | None, notes: list[str]) -> str:
    name = topic or "/joint_states"
    if name in states:
        return name
    if topic is None and len(states) == 1:
        name = next(iter(states))
        notes.append(f"topic {shown(name)}")
        return name
    known = f"it has no JointState messages at all, its topics are {listed(sorted(every)) or 'none'}"
    known = f"topics of JointState messages: {listed(sorted(states))}" if states else known
    fact = f"there are no JointState messages on {shown(name)}"
    raise FileError(file, fact, f"name the topic with --topic; {known}")


def _joint_states(
    file: Path, robot: Robot, states: Iterator[_State], columns: Columns | None, notes: list[str]
) -> tuple[Samples, int]:
    """The robot's samples, and how many messages were read."""
    stamps, received, numbers, q = array("q"), array("q"), array("q"), array("d")
    seen: dict[str, None] = {}
    order: list[int] | None = None
    last: tuple[str, ...] | None = None
    count = 0
    # The robot's joints in each message that has them all; their places are looked for where the names change.
    for count, (stamp, reception, names, position) in enumerate(states, 1):
        if names != last:
            last = names
            seen.update(dict.fromkeys(last if len(seen) < 1000 else ()))
            try:
                order = columns_named(file, last, robot, columns, noun="name", what="joints")
            except FileError:  # a message of other joints
                order = None
        if order is None or len(position) < len(names):
            continue
        row = position[order]
        if not np.isfinite(row).all():
            joint = robot.joint_names[int(np.argmin(np.isfinite(row)))]
            fact = f"message {count}: the position of {joint} is not finite"
            raise FileError(file, fact, "record again, or cut the bag before it")
        stamps.append(stamp)
        received.append(reception)
        numbers.append(count)
        q.frombytes(row.tobytes())
    if not numbers:
        if not seen:
            raise FileError(file, "there are no JointState messages in it", "record at least two cycles")
        columns_named(file, list(seen), robot, columns, noun="name", what="joints")
        fact = f"no message holds the positions of all joints of {robot.name} together"
        raise FileError(file, fact, "record the topic of the joint_state_broadcaster")
    # Their times: the stamps, or where there are none the times of reception.
    if len(numbers) < count:
        notes.append(f"{count - len(numbers)} messages without all of the robot's joints left out")
    stamped = any(stamps)
    if not stamped:
        notes.append("messages without stamps: times of reception used")
    ticks = np.frombuffer(stamps if stamped else received, dtype=np.int64)
    t = (ticks - ticks[0]) * 1e-9  # stamps are below 2^62, times of reception not negative: nothing overflows
    samples = Samples(t, np.frombuffer(q).reshape(len(t), -1), "message", np.frombuffer(numbers, np.int64), notes)
    return samples, count
