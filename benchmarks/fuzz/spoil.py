"""How a good file is spoilt: single bytes, values in nested tables, elements of XML."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any
from xml.etree import ElementTree

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
WORDS = [0, 1, 2, 255, 2**15, 2**16 - 1, 2**20, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]
"""What sizes and offsets in binary files are replaced by."""


def hostile(chance: random.Random) -> Any:
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


def among(values: Sequence[Any]) -> Callable[[random.Random], Any]:
    """One of some values, or now and then a hostile one."""
    return lambda chance: copy.deepcopy(chance.choice(values)) if chance.random() < 0.8 else hostile(chance)


def mutated(table: Any, chance: random.Random, value: Callable[[random.Random], Any] = hostile) -> Any:
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


def written(table: Any, chance: random.Random) -> bytes:
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


def broken(data: bytes, chance: random.Random) -> bytes:
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
                word = chance.choice(WORDS) % 2 ** (8 * size)
                out[at : at + size] = word.to_bytes(size, "little" if chance.random() < 0.7 else "big")
            case _:
                del out[at:]
    return bytes(out)


def mutated_xml(
    text: str, chance: random.Random, tags: Sequence[str], keys: Sequence[str], values: Sequence[str]
) -> bytes:
    """Elements removed, doubled, moved and renamed, attributes removed and replaced."""
    ElementTree.register_namespace("", "http://www.w3.org/2000/svg")
    root = ElementTree.fromstring(text)
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
                child.tag = "".join(child.tag.rpartition("}")[:2]) + chance.choice(tags)
            case 4 if child.attrib:
                del child.attrib[chance.choice(list(child.attrib))]
            case 5 if chance.random() < 0.3:
                child.text = "x" * chance.choice((1, 10_000))
            case _:
                child.set(chance.choice([*child.attrib, *child.attrib, *keys]), chance.choice(values))
    return ElementTree.tostring(root)


def wrapped_xml(text: str, before: str, chance: random.Random) -> bytes:
    """Deep or huge elements put before a place, entities that grow or name a file."""
    depth = chance.choice((10, 300, 3000))
    within = chance.choice(("<x>" * depth + "</x>" * depth, "<!--" + "x" * depth + "-->", "<x>" + "y" * depth + "</x>"))
    entities = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c SYSTEM "/etc/passwd">]>'
    text = text.replace(before, within + chance.choice(("", "<x>&b;</x>", "<x>&c;</x>", "<a:b/>")) + before, 1)
    return (text.replace("?>\n", f"?>\n{entities}", 1) if "?>\n" in text else entities + text).encode()
