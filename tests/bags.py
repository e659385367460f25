"""A log of a Panda and the rosbag2 that holds it, for the tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from conftest import PANDA_START

JOINTS = tuple(f"panda_joint{i}" for i in range(1, 8))
Q = PANDA_START + 0.1 * np.sin(np.linspace(0, 6, 40))[:, None] * np.arange(1, 8)
T = 0.01 * np.arange(40)


def write_bag(
    folder: Path, kind: str, topic: str = "/joint_states", names: Sequence[str] = JOINTS, stamped: bool = True,
    positions: np.ndarray = Q,
) -> Path:  # fmt: skip
    """A real rosbag2 with the arm's states, a gripper's on the same topic, and a topic of another type."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header, time, text = (
        store.types[f"{package}/msg/{name}"]
        for package, name in (
            ("sensor_msgs", "JointState"), ("std_msgs", "Header"), ("builtin_interfaces", "Time"),
            ("std_msgs", "String"),
        )
    )  # fmt: skip
    order = list(range(len(names)))[::-1]  # ROS promises no order
    none = np.zeros(0)
    plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(folder, version=9, storage_plugin=plugin) as writer:
        states = writer.add_connection(topic, state.__msgtype__, typestore=store)
        other = writer.add_connection("/rosout", text.__msgtype__, typestore=store)
        writer.write(other, 0, store.serialize_cdr(text("hello"), text.__msgtype__))
        for k, q in enumerate(positions):
            at = 7_000_000_000 + 10_000_000 * k
            stamp = time(at // 10**9, at % 10**9) if stamped else time(0, 0)
            arm = state(header(stamp, ""), [names[i] for i in order], q[order].copy(), none, none)
            writer.write(states, at + 123, store.serialize_cdr(arm, state.__msgtype__))
            if k % 4 == 0:
                hand = state(header(stamp, ""), ["panda_finger_joint1"], np.array([0.04]), none, none)
                writer.write(states, at + 456, store.serialize_cdr(hand, state.__msgtype__))
    return folder
