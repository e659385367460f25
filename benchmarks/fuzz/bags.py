"""Mutants of bags: rosbag2 folders of either storage, .mcap, .db3 and ROS 1 .bag, broken in bytes and metadata."""

from __future__ import annotations

import atexit
import json
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk

from .csv_logs import base as csv_base

SAMPLES = 30
VALUES = [
    "0", "-1", "9", "10", "1e400", "9" * 400, "9" * 5000, "~", "[]", "{}", "[[[]]]", "'a'", '"', "&a [1]", "*a", ".nan",
    "zstd", "message", "file", "FILE", "mcap", "sqlite3", "cdr", "json", "sensor_msgs/msg/JointState", "2020-01-01",
    "!!",
    "!!python/object:os.system",
    "[" * 3000, "{a: " * 500, "\x00", "../../etc/passwd",
    "/dev/zero", ".", "true", "99999999999",
    str(2**63), str(2**64), "- a", "|", "%", "@",
]  # fmt: skip
WORDS = [0, 1, 2, 255, 2**15, 2**16 - 1, 2**20, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]


@cache
def bases() -> dict[str, dict[str, bytes]]:
    """Whole bags: name of the bag to names and bytes of its files."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    robot, _, table = csv_base()
    folder = Path(tempfile.mkdtemp(prefix="fuzz-bags-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    found = {}
    modes = rosbag2.CompressionMode
    for name, plugin, mode in (
        ("db3", "SQLITE3", modes.NONE), ("db3-message", "SQLITE3", modes.MESSAGE), ("db3-file", "SQLITE3", modes.FILE),
        ("mcap", "MCAP", modes.NONE), ("mcap-zstd", "MCAP", modes.STORAGE),
    ):  # fmt: skip
        bag = rosbag2.Writer(folder / name, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
        if mode is not modes.NONE:
            bag.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
        with bag:
            _fill(bag, get_typestore(Stores.ROS2_HUMBLE), robot, table, new=True)
        found[name] = {f.name: f.read_bytes() for f in (folder / name).iterdir()}
    for name in ("plain.bag", "bz2.bag", "lz4.bag"):
        old = rosbag1.Writer(folder / name)
        if name != "plain.bag":
            old.set_compression(rosbag1.Writer.CompressionFormat[name[:3].upper()])
        with old:
            _fill(old, get_typestore(Stores.ROS1_NOETIC), robot, table, new=False)
        found[name] = {name: (folder / name).read_bytes()}
    return found


def _fill(writer: Any, store: Any, robot: hk.Robot, table: np.ndarray, *, new: bool) -> None:
    names = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, time = (store.types[name] for name in names)
    link = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
    none = np.zeros(0)
    for k, row in enumerate(table[::3][:SAMPLES]):
        at = 10**9 + 50_000_000 * k
        head = header(time(at // 10**9, at % 10**9), "") if new else header(k, time(at // 10**9, at % 10**9), "")
        message, kind = state(head, list(robot.joint_names), row[1:].copy(), none, none), state.__msgtype__
        raw = store.serialize_cdr(message, kind) if new else store.serialize_ros1(message, kind)
        writer.write(link, at, raw)


def _bite(rng: np.random.Generator, data: bytearray) -> None:
    at, kind = int(rng.integers(0, max(len(data), 1))), int(rng.integers(0, 6))
    if kind == 0:
        data[at : at + 1] = bytes([int(rng.integers(0, 256))])
    elif kind == 1:
        size = int(rng.choice([2, 4, 8]))
        word = WORDS[int(rng.integers(0, len(WORDS)))] % 2 ** (8 * size)
        data[at : at + size] = word.to_bytes(size, "little" if rng.random() < 0.7 else "big")
    elif kind == 2:
        del data[at:]
    elif kind == 3:
        del data[at : at + int(rng.integers(1, 64))]
    elif kind == 4:
        data[at:at] = data[max(0, at - 100) : at]
    else:
        data[at : at + 16] = bytes(rng.integers(0, 256, 16, dtype=np.uint8))


def _metadata(rng: np.random.Generator, text: str) -> str:
    lines = text.split("\n")
    for _ in range(int(rng.integers(1, 4))):
        i, kind = int(rng.integers(0, len(lines))), int(rng.integers(0, 5))
        value = VALUES[int(rng.integers(0, len(VALUES)))]
        if kind == 0:
            del lines[i : i + 1]
        elif kind == 1:
            lines.insert(i, lines[int(rng.integers(0, len(lines)))] if lines else value)
        elif kind == 2:
            lines[i : i + 1] = [" " * int(rng.integers(0, 9)) + value]
        else:
            lines[i : i + 1] = [lines[i].partition(":")[0] + ": " + value if lines else value]
        lines = lines or [""]
    return "\n".join(lines)


def attempt(seed: int, folder: Path) -> None:
    """Read and audit the mutant of a seed."""
    rng = np.random.default_rng(seed)
    robot = csv_base()[0]
    every = bases()
    name = list(every)[int(rng.integers(0, len(every)))]
    files = dict(every[name])
    alone = len(files) == 1 or (rng.random() < 0.4 and "-" not in name)
    storage = next(file for file in files if file != "metadata.yaml")
    if not alone and rng.random() < 0.6:
        files["metadata.yaml"] = _metadata(rng, files["metadata.yaml"].decode()).encode()
    else:
        data = bytearray(files[storage])
        for _ in range(int(rng.integers(1, 6))):
            _bite(rng, data)
        files[storage] = bytes(data)
    bag = folder / "bag"
    bag.mkdir()
    for file, content in files.items():
        (bag / file).write_bytes(content)
    log = hk.read_recording(bag / storage if alone else bag, robot)
    json.dumps([str(found := hk.audit_recording(log, robot)), found.to_dict()], allow_nan=False)
