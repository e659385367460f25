"""ROS 2: a timed trajectory as trajectory_msgs/JointTrajectory in JSON and YAML, and as a rosbag2 in MCAP."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, MissingExtraError
from ...base.files import writing
from ...base.types import positive
from ...motion import TimedTrajectory
from .robot_program import Program, header
from .targets import chosen, deviation

NANO = 10**9


@typed
def to_ros(
    timed: TimedTrajectory,
    *,
    about: str = "",
    tolerance: float | None = None,
    frame: str = "",
    format: Literal["yaml", "json"] = "yaml",
) -> Program:
    """A trajectory_msgs/msg/JointTrajectory of positions, velocities and accelerations, as YAML or JSON.

    The YAML is what `ros2 topic pub` takes, its header comments included; in JSON the same lines stand in "comments".

    Args:
        about: a line of the header: the strategy.
        tolerance: [rad or m] leave out samples between which even motion is right to this; None for all samples.
            Controllers put cubic or quintic polynomials between points with rates, which are nearer.
        frame: the frame_id.
        format: "yaml" or "json".

    Raises:
        ArgumentError: another format.
    """
    if format not in ("yaml", "json"):
        raise ArgumentError("format", format, "use 'yaml' or 'json'")
    picked = np.arange(len(timed)) if tolerance is None else chosen(timed, positive("tolerance", tolerance))
    head = header(timed, about, None, ["units: rad, m, s"])
    comments = list(head.lines)
    points = []
    for i in picked:
        rates = {"velocities": timed.dq[i].tolist(), "accelerations": timed.ddq[i].tolist(), "effort": []}
        points.append({"positions": timed.q[i].tolist(), **rates, "time_from_start": _stamp(float(timed.t[i]))})
    stamp = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}
    message = {"header": stamp, "joint_names": list(timed.joint_names), "points": points}
    if format == "json":
        text = json.dumps({"comments": comments, **message}, indent=1, allow_nan=False) + "\n"
    else:
        text = "\n".join([*(f"# {line}" for line in comments), *_yaml(message), ""])
    files = {f"joint_trajectory.{format}": text}
    return Program(files, len(picked), deviation(timed, picked), notes=head.notes, facts=head.facts)


@typed
def write_mcap(timed: TimedTrajectory, folder: str | Path, *, topic: str = "/joint_states") -> Path:
    """Write a rosbag2 folder in MCAP, which Foxglove opens: each sample as sensor_msgs/JointState, and one
    trajectory_msgs/JointTrajectory on /joint_trajectory. Needs the extra `log`.

    Args:
        folder: a new one.
        topic: of the joint states.

    Returns:
        The .mcap file.

    Raises:
        MissingExtraError: rosbags is not installed. ArgumentError: the folder exists. WriteError.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("rosbags, to write MCAP files", "log") from None
    folder = Path(folder)
    if folder.exists():
        raise ArgumentError("the folder of a bag", str(folder), "it exists: choose a new one")
    store = get_typestore(Stores.ROS2_HUMBLE)
    of: dict[str, Any] = {name.split("/")[-1]: kind for name, kind in store.types.items() if "/msg/" in name}
    names, none = list(timed.joint_names), np.zeros(0)

    def stamped(t: float) -> Any:
        return of["Header"](of["Time"](**_stamp(t)), "")

    # The whole trajectory as one message, and each sample as a state.
    points = [
        of["JointTrajectoryPoint"](q, dq, ddq, none, of["Duration"](**_stamp(t)))
        for t, q, dq, ddq in zip(timed.t, timed.q, timed.dq, timed.ddq, strict=True)
    ]
    whole = of["JointTrajectory"](stamped(0.0), names, points)
    with writing(folder), Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        states, plan = (
            writer.add_connection(name, kind.__msgtype__, typestore=store)
            for name, kind in ((topic, of["JointState"]), ("/joint_trajectory", of["JointTrajectory"]))
        )
        writer.write(plan, 0, store.serialize_cdr(whole, plan.msgtype))
        for t, q, dq in zip(timed.t, timed.q, timed.dq, strict=True):
            state = of["JointState"](stamped(t), names, q, dq, none)
            writer.write(states, round(t * NANO), store.serialize_cdr(state, states.msgtype))
    return next(folder.glob("*.mcap"))


def _stamp(t: float) -> dict[str, int]:
    sec, nanosec = divmod(round(float(t) * NANO), NANO)
    return {"sec": sec, "nanosec": nanosec}


def _yaml(message: dict[str, Any]) -> list[str]:
    """Block style down to the points, JSON in a point; with 1.0e-9 for 1e-9, which to YAML 1.1 is text."""
    lines = [f"{key}: {json.dumps(message[key])}" for key in ("header", "joint_names")] + ["points:"]
    return lines + ["- " + re.sub(r"(?<![.0-9])([0-9]+)e", r"\1.0e", json.dumps(point)) for point in message["points"]]
