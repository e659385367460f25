"""LeRobot datasets, formats v2.1 and v3.0: broken, missing or changed files; audited and retargeted."""

from __future__ import annotations

import io
import json
import random
from functools import cache
from pathlib import Path

import holokin as hk
from benchmarks.fuzz.jobs import NAMES, broken, mutated
from holokin.analysis.audit import audit_dataset
from holokin.analysis.audit.logs import STATE, joint_feature, read_dataset
from holokin.learning import retarget
from holokin.motion.ik import InverseKinematics

GOLDEN = Path(__file__).parents[2] / "tests" / "golden"
_NUMBERS = (0, -1, 1, 2, 3, 2**31, 2**62, 1e300, -1e-300, float("nan"), float("inf"), None)


@cache
def sound(version: str) -> dict[str, bytes]:
    """The files of a dataset of a Panda that LeRobot itself wrote: names and bytes."""
    folder = GOLDEN / f"lerobot-{version}"
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


@cache
def law() -> tuple[hk.Robot, InverseKinematics]:
    """The robot, and the leaf to which a dataset is retargeted."""
    robot = hk.load("panda")
    q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    return robot, hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), q0, limits=False)


def _json(data: bytes, chance: random.Random) -> bytes:
    """JSON, or a line of JSON lines, with other values."""
    lines = data.decode().split("\n") if data.count(b"\n{") else [data.decode()]
    i = chance.randrange(len(lines))
    try:
        lines[i] = json.dumps(mutated(json.loads(lines[i] or "{}"), chance))
    except (ValueError, RecursionError):  # what Python does not write, others do
        lines[i] = chance.choice(("9" * 5000, "[" * 5000, "NaN"))
    return "\n".join(lines).encode("utf-8", "replace")


def _parquet(data: bytes, chance: random.Random) -> bytes:
    """The table with other rows, columns, types or values."""
    import pyarrow as pa
    from pyarrow import parquet

    table = parquet.read_table(io.BytesIO(data))
    for _ in range(chance.choice((1, 1, 2))):
        i = chance.randrange(table.num_columns)
        name, column = table.column_names[i], table.column(i)
        match chance.randrange(7):
            case 0:
                table = table.drop_columns([name])
            case 1:
                table = table.slice(0, chance.randrange(len(table) + 1))
            case 2:
                table = pa.concat_tables([table, table])
            case 3:
                table = table.rename_columns([*table.column_names[:i], "x", *table.column_names[i + 1 :]])
            case 4:
                kinds = pa.string(), pa.float64(), pa.int8(), pa.list_(pa.float32()), pa.null(), pa.bool_()
                try:
                    table = table.set_column(i, name, column.cast(chance.choice(kinds), safe=False))
                except pa.ArrowException:
                    table = table.set_column(i, name, pa.array(["x"] * len(table)))
            case _:
                values, at = column.to_pylist(), chance.randrange(max(1, len(table)))
                if values:
                    odd = chance.choice(_NUMBERS)
                    if isinstance(values[at], list) and values[at] and chance.random() < 0.8:
                        values[at][chance.randrange(len(values[at]))] = odd
                    else:
                        values[at] = odd
                    try:
                        table = table.set_column(i, name, pa.array(values, column.type))
                    except (pa.ArrowException, OverflowError, TypeError):
                        table = table.set_column(i, name, pa.array([chance.choice(NAMES)[:99]] * len(table)))
    stream = io.BytesIO()
    parquet.write_table(table, stream, row_group_size=chance.choice((None, 1, 7)))
    return stream.getvalue()


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed: read, audited, and with its joints on a leaf written anew."""
    chance = random.Random(seed)
    files = dict(sound(chance.choice(("v2.1", "v3.0"))))
    for name in chance.sample(list(files), chance.choice((1, 1, 2))):
        kind = chance.random()
        if kind < 0.05:
            del files[name]
        elif kind < 0.3:
            files[name] = broken(files[name], chance)
        else:
            files[name] = (_parquet if name.endswith(".parquet") else _json)(files[name], chance)
    for name, data in files.items():
        (folder / "d" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "d" / name).write_bytes(data)
    robot, ik = law()
    dataset = read_dataset(folder / "d")
    joints = joint_feature(dataset, robot, STATE)
    str(audit_dataset(dataset, robot, joints))
    done = retarget(dataset, ik, [joints], folder / "new", bad=chance.choice(("refuse", "skip", "nearest")))
    str(done)
    if done.written is not None:
        again = read_dataset(done.written)
        audit_dataset(again, robot, joint_feature(again, robot, STATE))
