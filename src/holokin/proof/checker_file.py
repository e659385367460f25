"""The part of the checker that reads a file, before anything is computed from it. It needs only Python.

A file may be a stranger's. Here each of its parts is shown to be of the one kind that the checker reads: a number is
finite and no truth value, a place in a list is one of that list, an operation takes what stands before it, lists that
belong together have one length, and no tree is deep.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

FORMAT = "holokin certificate 3"

BYTES, OPERATIONS, UNKNOWNS, MOST, JOINTS, POINTS = 500_000_000, 20_000, 64, 4096, 1000, 256
"""Of a file, of an equation, of shapes or pairs, of a tree of joints, and of a shape: those of holokin's have less."""

LARGEST, FAR, DEEPEST = 1e100, 1e6, 200
"""Of a number, of a place or turn of a joint, and of cuts within each other: halves of halves end after some 50."""


class RejectedError(Exception):
    """The certificate does not prove what it says; the message tells what fails."""


def need(true: bool, what: str) -> None:
    """Raises: RejectedError."""
    if not true:
        raise RejectedError(what)


def text_of(value: Any) -> str:
    """A word of the file, without what a terminal obeys."""
    return "".join(c if c.isprintable() else "?" for c in str(value)[:100])


def parsed(text: str) -> Any:
    """What a text of JSON says. Raises: ValueError: it says nothing, or too much."""
    # Those of holokin have 8 letters or more for each list, which takes 64 bytes of memory.
    if text.count("[") + text.count("{") > len(text) / 6 + 1000:
        raise ValueError("it has more lists than numbers, and would take more memory than its size tells")
    try:
        return json.loads(text)
    except (RecursionError, MemoryError):
        raise ValueError("it is nested too deep") from None


def read(file: str, arity: Any) -> tuple[Any, int]:
    """(the data of a certificate's file, how many cells they have).

    Args:
        arity: how many operands each operation takes.

    Raises:
        OSError, ValueError: it is no certificate. RejectedError: it is not as it was written, or not of its form.
    """
    path = Path(file)
    if path.exists() and (not path.is_file() or path.stat().st_size > BYTES):
        raise ValueError(f"not a file of at most {BYTES:,} bytes")
    text = path.read_text("utf-8")
    given = parsed(text)
    written = given.get("format") if isinstance(given, dict) else None
    if written != FORMAT:
        raise ValueError(f"its format is {text_of(written)!r}, not {FORMAT!r}; certify again")
    data = {key: value for key, value in given.items() if key != "sha256"}
    try:
        own = json.dumps(data, allow_nan=False)
        sealed = f'{own[:-1]}, "sha256": "{hashlib.sha256(own.encode()).hexdigest()}"}}\n'
        need(text == sealed, "the file is not as it was written: SHA-256")
        _check_form(data, arity)
    except (LookupError, TypeError, ValueError, RecursionError, MemoryError) as problem:
        raise RejectedError(f"it is not of its form ({text_of(repr(problem))})") from None
    return data, text.count('"q0": ')


def _check_form(data: Any, arity: Any) -> None:
    """That data have the form of a certificate. Raises: LookupError, TypeError: a part is missing, or no table."""
    pieces, operations, claims, clear = data["pieces"], data["operations"], data["claims"], data.get("clear")
    need(_list(pieces) and len(pieces) > 0, "it has no pieces")
    n, d, given = (len(pieces[0][key]) for key in ("q", "u", "numbers"))
    level, constants, outputs = data["level"], data["constants"], data["outputs"]
    small = max(len(operations), len(constants), len(outputs), given) <= OPERATIONS and len(level) <= n <= UNKNOWNS
    need(_list(operations) and small and 0 < d <= 6, "it is too large, or has no unknowns")
    need(numbers(level, -1) and numbers(constants, -1), "its level or a constant is no number")
    before = n + d + given + len(level) + len(constants)
    for k, of in enumerate(operations):
        known = _list(of) and len(of) > 0 and isinstance(of[0], str) and arity.get(of[0]) == len(of) - 1
        need(known and all(_place(i, before + k) for i in of[1:]), f"operation {k + 1} is unknown, or of other places")
    need(_list(outputs) and len(outputs) >= n, "its equation has fewer rows than unknowns")
    need(all(_place(i, before + len(operations)) for i in outputs), "its equation ends at a place that there is not")
    _check_claims(claims, n)
    _check_task(data.get("task"))
    units = data["units"]
    need(_list(units) and 0 < len(units) <= n, "it has other units than joints")
    need(all(unit in ("rad", "m") for unit in units), "a joint has another unit than rad and m")
    pairs = 0 if clear is None else _check_clear(clear, len(units))
    for piece in pieces:
        fits = numbers(piece["q"], n) and numbers(piece["u"], d) and numbers(piece["numbers"], given)
        need(fits, "a piece has other numbers than the first")
        _check_cells(piece["cells"], n, d, pairs)


def _check_claims(claims: Any, n: int) -> None:
    need(isinstance(claims["whole"], bool), "whole is neither true nor false")
    need(numbers(claims["determinant"]) and numbers(claims["gap"]), "its determinant or gap is no number")
    joints, turns = claims["joints"], claims["turns"]
    need(_list(joints) and len(joints) == 4, "it has other bounds of the joints than limits and hull")
    rows = all(_list(row) and len(row) == n for row in joints)
    need(rows and all(x is None or (numbers(x) and abs(x) <= FAR) for row in joints for x in row), "a bound is none")
    whole = turns is None or (_list(turns) and len(turns) == n and all(type(k) is int and abs(k) <= FAR for k in turns))
    need(whole, "its turns are no whole numbers, one a joint")


def _check_task(task: Any) -> None:
    """What is compared with a robot; None where it is not."""
    if task is None:
        return
    kinds, orientation = task["stretches"], task["orientation"]
    fits = (orientation is None or isinstance(orientation, str)) and isinstance(task["turning"], bool)
    fits = fits and _list(task["rows"]) and len(task["rows"]) <= 6 and all(_place(i, 6) for i in task["rows"])
    fits = fits and numbers(task["reference"], 3, 3) and numbers(task["axis"], 3)
    need(fits, "its task is none")
    flags = kinds is None or (_list(kinds) and 0 < len(kinds) <= UNKNOWNS and all(map(_list, kinds)))
    need(flags and all(list(map(type, of)) == [bool, bool] for of in kinds or ()), "its task has no such path")


def _check_clear(clear: Any, joints: int) -> int:
    """The number of pairs that are to keep apart."""
    tree, shapes, pairs = clear["joints"], clear["shapes"], clear["pairs"]
    need(all(map(_list, (tree, shapes, pairs))), "its shapes are no lists")
    need(max(len(shapes), len(pairs)) <= MOST and len(tree) <= JOINTS, "it has too many shapes or joints")
    for k, joint in enumerate(tree):
        need(_place(joint["parent"], k, -1) and _place(joint["coordinate"], joints), "its joints are no tree")
        need(joint["kind"] in ("revolute", "prismatic"), "a joint of its shapes is of an unknown kind")
        fits = numbers(joint["placement"], 3, 3) and numbers(joint["origin"], 3) and numbers(joint["axis"], 3)
        need(fits and numbers(joint["multiplier"]) and numbers(joint["offset"]), "a joint has other numbers")
    for shape in shapes:
        need(_place(shape["joint"], len(tree), -1), "a shape is on no joint")
        need(isinstance(shape["link"], str) and numbers(shape["radius"]) and shape["radius"] >= 0, "a shape is none")
        need(numbers(shape["points"], -1, 3) and 0 < len(shape["points"]) <= POINTS, "a shape has no points, or many")
        need(numbers(shape["holds"], -1, 3), "a corner of a mesh is no point")
        need(numbers(shape["normal"], 3) or shape["normal"] == [], "a half space has no normal")
    for pair in pairs:
        need(_list(pair["shapes"]) and len(pair["shapes"]) == 2, "a pair is of no shapes")
        need(all(_place(i, len(shapes)) for i in pair["shapes"]), "a pair is of no shapes")
        need(numbers(pair["apart"]) and pair["apart"] >= 0, "a pair is to be no distance apart")
    return len(pairs)


def _check_cells(tree: Any, n: int, d: int, pairs: int) -> None:
    """That a tree has cells at its ends, and cuts of one of d sides elsewhere."""
    waiting = [(tree, 0)]
    while waiting:
        part, depth = waiting.pop()
        if isinstance(part, dict):
            fits = numbers(part["q0"], n) and numbers(part["V"], n, d) and numbers(part["Q"], n, d, d)
            fits = fits and numbers(part["Y"], n, n) and numbers(part.get("planes", []), pairs, 3)
            need(fits, "a cell has other numbers than there are unknowns, sides and pairs")
        elif part is not None:
            need(_list(part) and len(part) == 4 and _place(part[0], d) and numbers(part[1]), "a cut of cells is none")
            need(depth < DEEPEST, "its cells are cut too often")
            waiting += [(half, depth + 1) for half in part[2:]]


def _list(value: Any) -> bool:
    return type(value) is list


def _place(value: Any, end: int, first: int = 0) -> bool:
    """Whether a value is a whole number from `first` to below `end`."""
    return type(value) is int and first <= value < end


def numbers(value: Any, *lengths: int) -> bool:
    """Whether a value is a number; or a list of a length, -1 for any, of lists of the next one, ... of numbers."""
    if not lengths:
        return type(value) in (float, int) and -LARGEST <= value <= LARGEST
    if type(value) is not list or lengths[0] not in (-1, len(value)):
        return False
    if len(lengths) > 1:
        return all(numbers(row, *lengths[1:]) for row in value)
    return all(type(x) in (float, int) and -LARGEST <= x <= LARGEST for x in value)
