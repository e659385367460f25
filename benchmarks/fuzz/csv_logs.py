"""Mutants of CSV logs: headers, separators, numbers, times, encodings and single bytes that are wrong."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

import holokin as hk

ROWS = 90
CELLS = [
    "", " ", "nan", "NaN", "inf", "-inf", "1e308", "-1e308", "1e400", "1e-320", "0", "-0", "9" * 400, "9" * 5000, "1_0",
    "0x10", "1,5", "1.5.2", "None", "null", '"', '""', '"a\nb"', "\x00", "\x1b[31m", "[/red]", "٣", "１", "1e6", "1e7",
    "6.5", "400", str(2**63), str(-(2**63)), str(10**18), "1700000000123456789", "a" * 3000, "\u202e1", "#", "+", "1e",
]  # fmt: skip
NAMES = [
    "", "t", "time", "stamp", "secs", "nsecs", "timestamp", "header.stamp", "ppr_1", "q", "\ufeff", "é", "時間",
    "[/red]",
    "\x1b[2J", "a" * 5000, '"', "'", "#", "velocity.", "position.", "x/y", "1", "nan", "\u2028", "\x85",
]  # fmt: skip


@cache
def base() -> tuple[hk.Robot, list[str], np.ndarray]:
    """A robot and three cycles of it, in which the third joint is a function of the tool's place."""
    robot = hk.load("ppr")
    phase = np.linspace(0, 6 * np.pi, ROWS)
    x, y = 0.3 * np.cos(phase), 0.3 * np.sin(phase)
    z = 0.5 + 0.4 * x * y
    table = np.column_stack([0.05 * np.arange(ROWS), x - np.cos(z), y - np.sin(z), z])
    return robot, ["t", *robot.joint_names], table


def mutant(rng: np.random.Generator) -> bytes:
    """The bytes of a broken log."""
    _, names, table = base()
    header, rows = list(names), [[repr(float(v)) for v in row] for row in table]
    delimiter = str(rng.choice([",", ";", "\t"]))
    for _ in range(int(rng.integers(0, 4))):
        _spoil(rng, header, rows)
    end = str(rng.choice(["\n", "\r\n", "\r"]))
    text = end.join(delimiter.join(row) for row in [header, *rows]) + str(rng.choice(["", end, end * 5]))
    kind = int(rng.integers(0, 14))
    if kind == 0:
        return text.encode(str(rng.choice(["utf-16", "utf-16-le", "utf-32", "utf-8-sig", "utf-7"])), "replace")
    if kind == 1:
        return text.encode(str(rng.choice(["shift_jis", "gb2312", "cp1252", "cp037"])), "replace")
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    if kind in (2, 3, 4):
        for _ in range(int(rng.integers(1, 30))):
            _bite(rng, data)
    if kind == 5:
        return bytes(rng.integers(0, 256, int(rng.integers(0, 5000)), dtype=np.uint8))
    if kind == 6:
        return bytes(data[: int(rng.integers(0, len(data) + 1))])
    return bytes(data)


def _bite(rng: np.random.Generator, data: bytearray) -> None:
    at = int(rng.integers(0, len(data) + 1))
    change = int(rng.integers(0, 4))
    if change == 0 and data:
        data[min(at, len(data) - 1)] = int(rng.integers(0, 256))
    elif change == 1:
        del data[at : at + int(rng.integers(1, 20))]
    elif change == 2:
        data[at:at] = bytes(rng.choice(list(b'",;\t\n\r\x00\xff.eE+-0 9#'), int(rng.integers(1, 6))).tolist())
    else:
        data[at:at] = data[max(0, at - int(rng.integers(1, 200))) : at]


def _spoil(rng: np.random.Generator, header: list[str], rows: list[list[str]]) -> None:
    column, row = int(rng.integers(0, 4)), int(rng.integers(0, len(rows))) if rows else 0
    kind = int(rng.integers(0, 18))
    if kind == 0 and header:
        header[column % len(header)] = str(rng.choice(NAMES))
    elif kind == 1:
        header.insert(column, str(rng.choice(header or ["t"])))
    elif kind == 2 and header:
        del header[column % len(header)]
    elif kind == 3 and header:
        header[:] = [str(rng.choice(NAMES)) + name for name in header]
    elif kind == 4:
        header.clear()
    elif kind == 5:
        rows.clear()
    elif kind == 6 and rows:
        rows.insert(row, rows[row][:])
    elif kind == 7 and rows:
        rows.insert(0, rows.pop(row))
    elif kind == 8 and rows:
        rows[row] = rows[row][:column]
    elif kind == 9 and rows:
        rows[row] += [str(rng.choice(CELLS))] * int(rng.integers(1, 200))
    elif kind == 10:
        del rows[row:]
    elif kind == 11:
        factor = 10.0 ** float(rng.integers(-300, 300))
        for line in rows:
            if len(line) > column:
                line[column] = repr(_number(line[column]) * factor)
    elif kind == 12:
        for i, line in enumerate(rows):
            line[:1] = [str(10 ** int(rng.integers(0, 20)) * i)]
    elif kind == 13:
        rng.shuffle(rows)
    elif kind == 14:
        header += [str(rng.choice(NAMES))] * int(rng.integers(1, 3000))
    elif rows:
        for _ in range(int(rng.integers(1, 4))):
            line = rows[int(rng.integers(0, len(rows)))]
            line[column : column + 1] = [str(rng.choice(CELLS))]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 1.0


def attempt(seed: int, folder: Path) -> None:
    """Read and audit the mutant of a seed."""
    rng = np.random.default_rng(seed)
    robot = base()[0]
    file = folder / "log.csv"
    file.write_bytes(mutant(rng))
    degrees = [None, None, True, False][int(rng.integers(0, 4))]
    log = hk.read_recording(file, robot, degrees=degrees)
    json.dumps([str(found := hk.audit_recording(log, robot)), found.to_dict()], allow_nan=False)
