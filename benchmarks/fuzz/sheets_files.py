"""Maps of sheets: broken bytes, arrays of another kind or shape, odd numbers and words; read again and asked."""

from __future__ import annotations

import io
import json
import random
import struct
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.fuzz.jobs import broken, hostile, mutated

_NUMBERS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-320, 0.0, -1.0, 7.0)
_WHOLE = (-(2**63), 2**63 - 1, -1, 0, 5, 10**6)
_KINDS = ("<f4", ">f8", "<c16", "<i8", "<u1", "|b1", "<U3", "|O", "<M8[s]", "<f8,<i4")
_SHAPES = ("(10000000000000,)", "(-1,)", "()", "(0,)", "(1000000, 4, 4)", "(2, 2)", "(True,)", "1", "(9**9,)")


@cache
def sound() -> tuple[hk.Task, dict[str, np.ndarray], bytes]:
    """The task of a map, its arrays, its file."""
    task = hk.position(hk.load("planar-3r"))
    found = hk.sheets(task, hk.workspace(box=([1.0, 0.6], [0.5, 0.5])), samples=16)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "s.npz"
        hk.analysis.sheets.write_sheets(found, file)
        with np.load(file) as arrays:
            return task, dict(arrays), file.read_bytes()


def _array(values: np.ndarray, chance: random.Random) -> Any:
    """The array of another kind or length, or with odd numbers."""
    kind = chance.random()
    if kind < 0.2:
        return values[: chance.randrange(len(values) + 1)]
    if kind < 0.3:
        return np.concatenate([values, values[: chance.choice((1, 2))]])
    if kind < 0.45:
        return values.astype(chance.choice(("f4", "f8", "i4", "i8", "u1", "?", "c16")))
    if kind < 0.5:
        return np.moveaxis(values, 0, -1)
    if kind < 0.55:
        return values.ravel()
    out = values.copy().ravel()
    for i in chance.sample(range(out.size), min(out.size, chance.choice((1, 1, 3, 1000)))):
        if out.dtype.kind == "f":
            out[i] = chance.choice(_NUMBERS) if chance.random() < 0.5 else out[i] + chance.choice((1e-9, 1e-3, 6.3))
        else:
            out[i] = chance.choice(_WHOLE if out.dtype.kind == "i" else range(256))
    return out.reshape(values.shape)


def _zipped(members: dict[str, bytes], chance: random.Random) -> bytes:
    """A ZIP file, sometimes packed in another way, or with a member twice."""
    stream = io.BytesIO()
    how = chance.choice((zipfile.ZIP_DEFLATED,) * 6 + (zipfile.ZIP_STORED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2))
    with zipfile.ZipFile(stream, "w", how) as packed:
        for name, data in members.items():
            packed.writestr(name, data)
    data = bytearray(stream.getvalue())
    if chance.random() < 0.15:  # sizes, flags, versions and offsets in its list of members
        at = data.find(b"PK\x01\x02") + chance.randrange(4, 46)
        data[at] = chance.choice((0, 1, 8, 99, 255))
    return bytes(data)


def mutant(chance: random.Random) -> bytes:
    """The bytes of a spoilt map."""
    _, arrays, whole = sound()
    if chance.random() < 0.3:
        return broken(whole, chance)
    arrays = dict(arrays)
    if chance.random() < 0.5:
        table = json.loads(arrays["about"].tobytes())
        try:
            text = json.dumps(mutated(table, chance) if chance.random() < 0.9 else hostile(chance))
        except (ValueError, RecursionError):  # what Python does not write, others do
            text = chance.choice(("9" * 5000, "[" * 5000 + "]" * 5000, '{"a":' * 400 + "1" + "}" * 400))
        text = chance.choice(("[" * 100_000, text[:-1], f"{text}x")) if chance.random() < 0.1 else text
        arrays["about"] = np.frombuffer(text.encode("utf-8", "replace"), np.uint8)
    else:
        for name in chance.sample(list(arrays), chance.choice((1, 1, 2))):
            arrays[name] = _array(arrays[name], chance)
    members = {}
    for name, values in arrays.items():
        stream = io.BytesIO()
        np.save(stream, np.asfortranarray(values) if chance.random() < 0.1 else values)
        members[f"{name}.npy"] = stream.getvalue()
    if chance.random() < 0.25:  # a header that says something else than the numbers below it
        name = chance.choice(list(members))
        kind, shape = chance.choice(_KINDS), chance.choice(_SHAPES)
        head = chance.choice((f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}", "{" * 90, "x"))
        head = head.ljust(117) + "\n"
        members[name] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + members[name][128:]
    for name in chance.sample(list(members), chance.choice((0, 0, 0, 0, 1))):
        members[chance.choice((f"{name}.npy", "../x", "q.npy"))] = members.pop(name)
    return _zipped(members, chance)


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed: what is read of it is a map, which answers, is told and is written."""
    task, _, _ = sound()
    file = folder / "s.npz"
    file.write_bytes(mutant(random.Random(seed)))
    found = hk.read_sheets(file, task)
    str(found)
    answers = found.batch(found.poses)
    T, q = found.poses[answers.served], answers.q[answers.served]
    if len(q) and not np.abs(task.error(q, T[:, :3, 3], T[:, :3, :3])).max() < 1e-6:
        raise ValueError("the tool is not at the pose")
    hk.analysis.sheets.write_sheets(found, file)
