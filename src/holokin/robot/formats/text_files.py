"""Reading the files that people write: whole, of a bounded size, and TOML that the rest of the library can take."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...base.errors import HolokinError, shown

Refuse = Callable[[str, str, str], HolokinError]
"""(key, fact, cure) -> the error of the sort of file that is read; the key is empty for the file as a whole."""

LONGEST_TOML = 1_000_000
"""Bytes of a TOML file: a polyline of 10,000 points with every digit has 600,000."""

DEEPEST = 16
"""Levels of tables and lists in a TOML file. Jobs need four; the parser itself fails some hundreds deeper."""

LONGEST_KEY = 10
"""Parts of a dotted key, a.b.c. The parser's time grows with the square of them: a second at 10,000."""

WINDOWS = r"write paths in single quotes, 'C:\Users\me', or with /, C:/Users/me"
"""The cure of strings in which a backslash begins what TOML takes for another character, or for none."""

_ESCAPE = re.compile(r"Unescaped '\\'|Invalid hex value|not a Unicode scalar")
"""What Python's parser says of them."""

_DOTTED = re.compile(r"""[\w"'-]+(?:[ \t]*\.[ \t]*[\w"'-]+)*""")


def read_whole(path: Path, most: int, refuse: Refuse) -> bytes:
    """The bytes of a regular file. Raises: what `refuse` makes of a missing, unreadable or longer one."""
    try:
        if path.is_dir():
            raise refuse("", "cannot be read: there is no such file, but a folder", "give a file")
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise refuse("", "cannot be read: it is no regular file", "give a file on disk")
        with path.open("rb") as stream:
            data = stream.read(most + 1)
    except (FileNotFoundError, ValueError):  # the latter for a NUL in the name
        fact = "there is no such file"
        if not str(path).isprintable():  # the \\r of a TOML string "C:\\robots"
            raise refuse("", f"{fact}, and its name has control characters", WINDOWS) from None
        raise refuse("", fact, "check the path") from None
    except OSError as problem:
        raise refuse("", f"cannot be read ({problem.strerror})", "give a file that can be read") from None
    if len(data) > most:
        raise refuse("", f"has more than {most:,} bytes", f"give a file of at most {most:,}")
    return data


def read_toml(path: Path, refuse: Refuse) -> dict[str, Any]:
    """The table of a TOML file. Raises: what `refuse` makes of a file that is none, or holds what nothing can take."""
    try:
        text = read_whole(path, LONGEST_TOML, refuse).decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        fact = f"cannot be read: byte {problem.start + 1} is not UTF-8"
        raise refuse("", fact, "give a TOML text file, saved as UTF-8") from None
    return parse_toml(text, refuse)


def parse_toml(text: str, refuse: Refuse) -> dict[str, Any]:
    """The same of a text. TOML's whole numbers have 64 bits; Python's parser takes longer ones, which are refused."""
    for word in _DOTTED.finditer(text):
        if word.group().count(".") >= LONGEST_KEY:
            fact = f"has a dotted key of more than {LONGEST_KEY} parts"
            raise refuse(word.group(), fact, "write tables, [robot], and plain keys")
    deep = f"nests tables or lists deeper than {DEEPEST} levels"
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        cure = WINDOWS if _ESCAPE.match(str(problem)) else "correct the line it names"
        raise refuse("", f"is not TOML: {problem}", cure) from None
    except RecursionError:
        raise refuse("", deep, "take the inner ones out") from None
    except ValueError as problem:  # a whole number of more digits than Python converts, or a date that is none
        raise refuse("", f"is not TOML: {problem}", "write long numbers as 1e300") from None
    waiting: list[tuple[str, Any, int]] = [("", table, 0)]
    while waiting:
        key, value, depth = waiting.pop()
        if depth > DEEPEST:
            raise refuse(key, deep, "take the inner ones out")
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            fact = f"is {shown(value, 60)}: a whole number of more than 64 bits"
            raise refuse(key, fact, "write it like 1e30, or give a smaller one")
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        waiting += [(f"{key}.{name}" if key else str(name), inner, depth + 1) for name, inner in items]
    return table
