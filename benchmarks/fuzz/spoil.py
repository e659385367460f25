"""How something good is spoilt: bytes, values in nested tables, files of every format, arguments of calls."""

from __future__ import annotations

import copy
import datetime
import decimal
import fractions
import io
import json
import random
import sqlite3
import struct
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from holokin.symbolic import SX

Chance = random.Random

NAMES = (
    "", ".", "..", "../..", "/", "x" * 300, "[/red]", "[tool A] of [b]", "\x00\x1b[31m\n", "\u202e", "日本語",
    "a.b", "$\\frac$", "x" * 300 + ".urdf", "nothing.toml", "\x00.toml", "_", "é" * 120, "q1", "path", "mp",
)  # fmt: skip
FORMULAS = (
    "(-8)**0.5", "1/0", "q1/0", "log(q1 - 50)", "sqrt(-q1)", "9**9**9", "q1**q1**q1", "tan(q1*1e9)", "1e400",
    "(" * 500 + "1" + ")" * 500, "-" * 5000 + "1", "+".join(["q1"] * 900), "sin(" * 90 + "q1" + ")" * 90,
    "9" * 5000, "lambda: 1", "__import__('os')", "q1.q2", "q1 if q2 else 1", "q1 q2", "\x00", "x" * 20_000,
    "atan2(q1)", "True", "q9", "0*q1", "q1", "exp(exp(exp(q1*9)))", "q1**-300", "1e-320*q1",
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 2, 7, 1e-300, -1e200, 1e200, 1e308, float("nan"), float("inf"), 10**30, 10**400, 10**5000, 0.1,
    -0.5, 3, 1e6, 1e12, 100_000, 2**63, 1e-12,
)  # fmt: skip
OTHERS = (True, False, [], {}, [[]], [1] * 200, [[0.1]], {"a": 1}, [None], "1")
SIZES = [0, 1, 2, 255, 2**15, 2**16 - 1, 2**20, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]
"""What sizes and offsets in binary files are replaced by."""


CODES = ("utf-8-sig", "utf-16", "utf-16-le", "utf-32", "utf-7", "latin-1", "cp1252", "cp037", "gb18030", "shift_jis")
"""Encodings other than UTF-8."""

MORE = {
    ".xml": """0 0 0|1 2|1 2 3 4|j1|b3|planar|ball|free|hinge|3000000|0x10|1_0|&#10;|rotate(inf)|scale(0)|#g|50%
        matrix(1 1 1 1 0 0)|skewX(90)|translate(nan)|scale(1e200)|rotate(30|m5,5 h 20 v 10 h -20 z|M0 0 L0 0|M 1 1
        M 0 0 A 0 0 0 0 0 1 1|M 0 0 L nan 1 L 1e300 5 Z""",
    ".xacro": """$(find nowhere)|$(env NOTHING)|$(eval 1 + 1)|$(|${|$${x}|xacro:call|**block|z:=${z}|z:=^
        $(arg nothing)|${1/0}|${L.x}|${props.up[5]}|${9**9**9}|${().__class__}|${'a' * 10**9}|${xacro.fatal('x')}|${(1,}
        ${xacro.load_yaml('/etc/passwd')}|${nan}""",
    ".yaml": """~|[]|[[[]]]|"|&a [1]|*a|.nan|zstd|message|FILE|mcap|sqlite3|json|!!|!!python/object:os.system|- a
        %|2020-01-01|10|-1"""
    + f"|{'[' * 3000}|{'{a: ' * 500}",
    ".csv": """t|time|stamp|secs|nsecs|header.stamp|ppr_1|q|\ufeff|position.| |1,5|1.5.2|٣|１|6.5|400|#|1e|\u2028
        1000000000000000000|1700000000123456789|"|\x85""",
}
"""Words that matter in one format alone, between bars and at the ends of lines."""


def hostile(chance: Chance) -> Any:
    """A value that somebody may write by mistake, or on purpose."""
    kind = chance.random()
    if kind < 0.4:
        return chance.choice(NUMBERS)
    if kind < 0.6:
        return chance.choice(NAMES)
    if kind < 0.8:
        return chance.choice(FORMULAS)
    if kind < 0.84:
        value: Any = 1
        for _ in range(chance.choice((3, 40, 400, 3000))):
            value = [value] if chance.random() < 0.8 else {"a": value}
        return value
    return copy.deepcopy(chance.choice(OTHERS))


def mutated(table: Any, chance: Chance, value: Callable[[Chance], Any] = hostile) -> Any:
    """A copy with a few values deleted, doubled, moved, replaced or renamed."""
    out = copy.deepcopy(table)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        spots = _places(out)
        if not spots:
            break
        holder, key = chance.choice(spots)
        match chance.randrange(9):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, list):
                holder.extend([_copied(holder[key])] * chance.choice((1, 5, 200)))
            case 1 | 2 if isinstance(holder, dict):
                word = chance.choice((*NAMES, *holder, f"{key}s"))
                holder[word] = holder.pop(key)
            case 3:
                other, place = chance.choice(spots)
                holder[key] = _copied(other[place]) if isinstance(other, dict) and place in other else 0
            case 4 | 5:
                holder[key] = value(chance)
            case _ if isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
                with suppress(OverflowError):  # a whole number beyond all floats stays
                    holder[key] *= chance.choice((2, 3, -1, -0.5, 0.1, 1.5, 10))
            case _:
                holder[key] = value(chance)
    return out


def _places(table: Any) -> list[tuple[Any, Any]]:
    """(container, key) of every value in nested tables and lists."""
    places, waiting = [], [table]
    while waiting:
        holder = waiting.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        places += [(holder, key) for key in keys]
        waiting += [holder[key] for key in keys if isinstance(holder[key], dict | list)]
    return places


def _copied(value: Any) -> Any:
    """A copy; 0 of what is nested too deep for one."""
    try:
        return copy.deepcopy(value)
    except RecursionError:
        return 0


def written(table: Any, chance: Chance) -> bytes:
    """JSON of a table; what Python does not write, others do."""
    try:
        return json.dumps(table).encode("utf-8", "replace")
    except (ValueError, RecursionError):
        return chance.choice(("9" * 5000, "[" * 5000 + "]" * 5000, '{"a":' * 400 + "1" + "}" * 400, "NaN")).encode()


def toml(value: Any, top: bool = True) -> str:
    """TOML of nested tables, without recursion: some are nested deep."""
    parts, waiting = [], [(value, top)]
    while waiting:
        item, outermost = waiting.pop()
        if outermost is None:
            parts.append(item)
        elif isinstance(item, dict):
            inner: list[tuple[Any, bool | None]] = []
            for key, part in item.items():
                inner += [(f"{json.dumps(str(key))} = ", None), (part, False), ("\n" if outermost else ", ", None)]
            inner = inner if outermost else [("{", None), *inner[:-1], ("}", None)]
            waiting += reversed(inner)
        elif isinstance(item, list):
            inner = [("[", None)]
            for part in item:
                inner += [(part, False), (", ", None)]
            waiting += reversed([*inner, ("]", None)])
        elif isinstance(item, str):
            parts.append(json.dumps(item, ensure_ascii=False).replace("\x7f", "\\u007f"))
        elif isinstance(item, bool):
            parts.append(str(item).lower())
        elif isinstance(item, int) and abs(item) > 10**4000:
            parts.append("9" * 5000)
        elif isinstance(item, int | float):
            parts.append(repr(item))
        else:
            parts.append("1979-05-27T07:32:00Z")
    return "".join(parts)


def broken(data: bytes, chance: Chance) -> bytes:
    """Some bytes changed, cut out, doubled, or put in; of binary files a size or an offset, too."""
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 5))):
        at = chance.randrange(len(out) + 1)
        match chance.randrange(7):
            case 0:
                out[at : at + 1] = bytes([chance.randrange(256)])
            case 1:
                del out[at : at + chance.choice((1, 3, 30))]
            case 2:
                out[at:at] = out[at : at + chance.choice((5, 50, 500))]
            case 3:
                out[at:at] = chance.choice((b"\xff\xfe", b"\xc3", b"\xed\xa0\x80", b"\x00", b"\xef\xbb\xbf", b"\r"))
            case 4:
                out[at:at] = bytes(chance.choice(b'"[]{}=.,\n#<>/&-0123456789e') for _ in range(chance.choice((1, 4))))
            case 5 if b"\x00" in data:
                size = chance.choice((2, 4, 8))
                word = chance.choice(SIZES) % 2 ** (8 * size)
                out[at : at + size] = word.to_bytes(size, "little" if chance.random() < 0.7 else "big")
            case _:
                del out[at:]
    return bytes(out)


# --- Files, by their formats.


def _text(chance: Chance, suffix: str) -> str:
    """A word that is odd in a format."""
    if chance.random() < 0.5:
        return chance.choice([word for line in MORE[suffix].split("\n        ") for word in line.split("|")])
    with suppress(ValueError, RecursionError):
        return str(hostile(chance))
    return "9" * 5000


def _toml(data: bytes, chance: Chance) -> bytes:
    return toml(mutated(tomllib.loads(data.decode()), chance)).encode("utf-8", "replace")


def _json(data: bytes, chance: Chance) -> bytes:
    """JSON, or one of some lines of JSON."""
    lines = data.decode().split("\n") if data.count(b"\n{") else [data.decode()]
    i = chance.randrange(len(lines))
    lines[i] = written(mutated(json.loads(lines[i] or "{}"), chance), chance).decode()
    return "\n".join(lines).encode("utf-8", "replace")


def _xml(data: bytes, chance: Chance) -> bytes:
    """Elements removed, doubled, moved and renamed, attributes replaced; very deep or huge elements, entities."""
    if chance.random() < 0.12:
        depth = chance.choice((10, 300, 3000))
        deep = chance.choice(
            ("<x>" * depth + "</x>" * depth, "<!--" + "x" * depth + "-->", "<x>" + "y" * depth + "</x>")
        )
        entities = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c SYSTEM "/etc/passwd">]>'
        head, _, rest = data.decode().rpartition("</")
        begin, end, body = head.rpartition("?>")
        deep += chance.choice(("", "<x>&b;</x>", "<x>&c;</x>", "<a:b/>"))
        return f"{begin}{end}{entities}{body}{deep}</{rest}".encode()
    ElementTree.register_namespace("", "http://www.w3.org/2000/svg")
    ElementTree.register_namespace("xacro", "http://www.ros.org/wiki/xacro")
    root = ElementTree.fromstring(data)
    tags, keys = ["x", *(e.tag for e in root.iter())], ["name", *(key for e in root.iter() for key in e.attrib)]
    values = [value for element in root.iter() for value in element.attrib.values()]
    for _ in range(chance.choice((1, 1, 2, 3))):
        elements = [(parent, child) for parent in root.iter() for child in parent]
        if not elements:
            break
        parent, child = chance.choice(elements)
        match chance.randrange(7):
            case 0:
                parent.remove(child)
            case 1:
                parent.append(copy.deepcopy(child))
            case 2:
                chance.choice(elements)[0].append(copy.deepcopy(child))
            case 3:
                child.tag = chance.choice(tags)
            case 4 if child.attrib:
                del child.attrib[chance.choice(list(child.attrib))]
            case 5 if chance.random() < 0.3:
                child.text = "x" * chance.choice((1, 10_000))
            case _:
                value = chance.choice(values) if chance.random() < 0.2 else _text(chance, ".xml")
                child.set(chance.choice([*child.attrib, *child.attrib, *keys]), value)
    return ElementTree.tostring(root)


def _words(suffix: str) -> Callable[[bytes, Chance], bytes]:
    """Single words of a text replaced."""

    def spoil(data: bytes, chance: Chance) -> bytes:
        text = data.decode()
        for _ in range(chance.choice((1, 1, 2, 3))):
            word = chance.choice(text.replace('"', " ").replace("<", " ").split() or [""])
            text = text.replace(word, _text(chance, suffix), chance.choice((1, -1)))
        return text.encode("utf-8", "replace")

    return spoil


def _xacro(data: bytes, chance: Chance) -> bytes:
    return (_words(".xacro") if chance.random() < 0.7 else _xml)(data, chance)


def _csv(data: bytes, chance: Chance) -> bytes:
    """Headers, separators, numbers, times, the order of rows."""
    rows: list[Any] = [line.split(",") for line in data.decode().split("\n")]
    for _ in range(chance.randrange(4)):
        rows = mutated(rows, chance, lambda c: _text(c, ".csv"))
        rows = [[str(cell) for cell in row] if isinstance(row, list) else [str(row)] for row in rows] or [[]]
        if chance.random() < 0.2:
            column, factor = chance.randrange(4), 10.0 ** chance.randrange(-300, 300)
            for row in rows[1:]:
                with suppress(ValueError, IndexError):
                    row[column] = repr(float(row[column]) * factor)
        if chance.random() < 0.1:
            chance.shuffle(rows)
    end, delimiter = chance.choice(("\n", "\r\n", "\r")), chance.choice((",", ";", "\t"))
    text = end.join(delimiter.join(row) for row in rows) + chance.choice(("", end, end * 5))
    return text.encode("utf-8", "surrogatepass")


def _sqlite(data: bytes, chance: Chance) -> bytes:
    """One or two changes that SQLite takes: of a value, a column, rows, a table, JSON in it."""
    db = sqlite3.connect(":memory:")
    db.deserialize(data)
    tables = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    for _ in range(chance.choice((1, 1, 2))):
        table = chance.choice(tables)
        columns = [row[1] for row in db.execute(f"PRAGMA table_info({table})")]
        if not columns:
            continue
        column, where = chance.choice(columns), " WHERE rowid = 1" * (chance.random() < 0.5)
        old, value = db.execute(f"SELECT {column} FROM {table}").fetchone() or [None], hostile(chance)
        if isinstance(old[0], str) and chance.random() < 0.5:
            with suppress(ValueError):
                value = written(mutated(json.loads(old[0]), chance), chance).decode()
        value = (
            value if isinstance(value, str | bool | float) else chance.choice((None, 0, -1, 2**62, b"\xff\x00", "{}"))
        )
        change = chance.choice(
            (
                *[f"UPDATE {table} SET {column} = ?{where}"] * 7,
                f"ALTER TABLE {table} DROP COLUMN {column}",
                f"ALTER TABLE {table} ADD COLUMN extra",
                f"DELETE FROM {table}",
                f"DROP TABLE {table}",
            )
        )
        with suppress(sqlite3.DatabaseError):  # a key that may not be twice, a number that may not be missing
            db.execute(change, (value,) if "?" in change else ())
    db.commit()
    return db.serialize()


def _parquet(data: bytes, chance: Chance) -> bytes:
    """The table with other rows, columns, types or values."""
    import pyarrow as pa
    from pyarrow import parquet

    table = parquet.read_table(io.BytesIO(data))
    for _ in range(chance.choice((1, 1, 2))):
        i = chance.randrange(table.num_columns)
        name, column = table.column_names[i], table.column(i)
        other = pa.array([chance.choice(NAMES)[:99]] * len(table))
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
                with suppress(pa.ArrowException):
                    other = column.cast(chance.choice(kinds), safe=False)
                table = table.set_column(i, name, other)
            case _:
                with suppress(pa.ArrowException, OverflowError, TypeError, ValueError):
                    other = pa.array(
                        mutated(column.to_pylist(), chance, lambda c: c.choice((*NUMBERS, None))), column.type
                    )
                if len(other) == len(table):
                    table = table.set_column(i, name, other)
    stream = io.BytesIO()
    parquet.write_table(table, stream, row_group_size=chance.choice((None, 1, 7)))
    return stream.getvalue()


def _array(values: np.ndarray, chance: Chance) -> Any:
    """The array of another kind or length, or with odd numbers."""
    kind = chance.random()
    if kind < 0.2:
        return values[: chance.randrange(len(values) + 1)]
    if kind < 0.3:
        return np.concatenate([values, values[: chance.choice((1, 2))]])
    if kind < 0.45:
        return values.astype(chance.choice(("f4", "f8", "i4", "i8", "u1", "?", "c16")))
    if kind < 0.55:
        return np.moveaxis(values, 0, -1) if kind < 0.5 else values.ravel()
    out = values.copy().ravel()
    for i in chance.sample(range(out.size), min(out.size, chance.choice((1, 1, 3, 1000)))):
        if out.dtype.kind == "f":
            near = out[i] + chance.choice((1e-9, 1e-3, 6.3))
            out[i] = (
                chance.choice((np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 0.0, -1.0, 7.0))
                if chance.random() < 0.5
                else near
            )
        else:
            out[i] = chance.choice((-(2**63), 2**63 - 1, -1, 0, 5, 10**6) if out.dtype.kind == "i" else range(256))
    return out.reshape(values.shape)


def _npz(data: bytes, chance: Chance) -> bytes:
    """Arrays of another kind, shape or length, headers, odd numbers and words, another packing."""
    with np.load(io.BytesIO(data)) as loaded:
        arrays = dict(loaded)
    if chance.random() < 0.5:
        table = json.loads(arrays["about"].tobytes())
        text = written(mutated(table, chance) if chance.random() < 0.9 else hostile(chance), chance)
        text = chance.choice((b"[" * 100_000, text[:-1], text + b"x")) if chance.random() < 0.1 else text
        arrays["about"] = np.frombuffer(text, np.uint8)
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
        kind = chance.choice(("<f4", ">f8", "<c16", "<i8", "<u1", "|b1", "<U3", "|O", "<M8[s]", "<f8,<i4"))
        shape = chance.choice(("(10000000000000,)", "(-1,)", "()", "(0,)", "(1000000, 4, 4)", "(2, 2)", "1", "(9**9,)"))
        head = chance.choice((f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}", "{" * 90, "x"))
        head = head.ljust(117) + "\n"
        members[name] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + members[name][128:]
    for name in chance.sample(list(members), chance.choice((0, 0, 0, 0, 1))):
        members[chance.choice((f"{name}.npy", "../x", "q.npy"))] = members.pop(name)
    return _zipped(members, chance)


def _zipped(members: dict[str, bytes], chance: Chance) -> bytes:
    """A ZIP file, sometimes packed in another way."""
    stream = io.BytesIO()
    how = chance.choice((zipfile.ZIP_DEFLATED,) * 6 + (zipfile.ZIP_STORED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2))
    with zipfile.ZipFile(stream, "w", how) as packed:
        for name, data in members.items():
            packed.writestr(name, data)
    data = bytearray(stream.getvalue())
    if chance.random() < 0.15:  # sizes, flags, versions and offsets in its list of members
        data[data.find(b"PK\x01\x02") + chance.randrange(4, 46)] = chance.choice((0, 1, 8, 99, 255))
    return bytes(data)


FORMATS: dict[str, Callable[[bytes, Chance], bytes]] = {
    ".toml": _toml, ".json": _json, ".jsonl": _json, ".urdf": _xml, ".xml": _xml, ".svg": _xml, ".xacro": _xacro,
    ".yaml": _words(".yaml"), ".csv": _csv, ".sqlite": _sqlite, ".parquet": _parquet, ".npz": _npz,
}  # fmt: skip
"""Ending of a file's name -> what spoils its content; in other files only bytes are."""


def spoilt_files(files: dict[str, bytes], chance: Chance) -> dict[str, bytes]:
    """One or two files of a folder spoilt, by their format or by single bytes, or re-encoded, or missing."""
    found = dict(files)
    for name in chance.sample(list(files), min(len(files), chance.choice((1, 1, 2)))):
        data, way = files[name], chance.random()
        if way < 0.05 and len(files) > 1:
            del found[name]
        elif way < 0.12 and b"\x00" not in data:
            code = chance.choice(CODES)
            text = data.decode().replace('"1.0"?>', f'"1.0" encoding="{chance.choice((code, "no-such", "idna"))}"?>')
            found[name] = text.encode(code, "replace")
        elif way < 0.35:
            found[name] = broken(data, chance)
        else:
            found[name] = FORMATS.get(Path(name).suffix, broken)(data, chance)
    return found


# --- Something bad in place of something good, for calls.


def _looped() -> list[Any]:
    loop: list[Any] = []
    loop.append(loop)
    return loop


BAD: list[Callable[[], Any]] = [
    lambda: None, lambda: b"x", lambda: "a\0b", lambda: "q" * 10_000, lambda: ["a", "b", "c"], lambda: ["1", "2", "3"],
    lambda: [1, [2, 3]], lambda: [None] * 3, lambda: [float("nan")] * 3, lambda: [float("inf")] * 3, lambda: 1j,
    lambda: [1j, 0, 0], lambda: [10**400] * 3, lambda: 2**40, lambda: 2.0, lambda: [0, 0.5], lambda: [-1],
    lambda: [7], lambda: [0, 0], lambda: [1e308] * 3, list, lambda: (), dict, lambda: {1, 2}, lambda: np.zeros(0),
    lambda: np.zeros(1), lambda: np.zeros(3), lambda: np.full(3, np.nan), lambda: np.zeros((3, 3)),
    lambda: np.zeros((0, 3)), lambda: np.zeros((4, 4)), lambda: np.zeros((2, 2, 2)), lambda: np.full(3, None),
    lambda: np.array(1.0), lambda: np.array("x"), lambda: np.array([10**400] * 3, object), lambda: np.int8(-1),
    lambda: np.datetime64("2020-01-01"), lambda: np.zeros(3, "i4,f8"), lambda: (i for i in range(3)), lambda: range(3),
    lambda: slice(None), lambda: object(), lambda: Ellipsis, lambda: datetime.date(2020, 1, 1),
    lambda: fractions.Fraction(1, 3), lambda: decimal.Decimal("sNaN"), lambda: Path("no"), lambda: Path(),
    lambda: memoryview(b"abc"), lambda: np.ma.masked, _looped, lambda: (lambda *_: None), lambda: (lambda: 0),
    lambda: copy, lambda: Exception("x"), lambda: SX(1),
]  # fmt: skip
"""Makers of values that files do not hold, fresh each time."""


def spoilt(rng: random.Random, good: Any, nouns: Sequence[Any]) -> Any:
    """Something bad in place of a good value; of one that has parts, sometimes in place of one of them."""
    if rng.random() < 0.3 and isinstance(good, list | tuple | dict | np.ndarray) and np.size(good):
        if isinstance(good, dict):
            return {**good, rng.choice(list(good)): spoilt(rng, None, nouns)}
        parts = list(good)
        i = rng.randrange(len(parts))
        parts[i] = spoilt(rng, parts[i], nouns)
        return tuple(parts) if isinstance(good, tuple) else parts
    bad = rng.choice(nouns) if rng.random() < 0.12 else rng.choice(BAD)() if rng.random() < 0.7 else hostile(rng)
    return (lambda *_: bad) if rng.random() < (0.5 if callable(good) else 0.08) else bad
