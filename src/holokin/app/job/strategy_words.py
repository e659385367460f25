"""A strategy as one types it: the kind of a job and its keys, or one of a job file."""

from __future__ import annotations

from typing import Any

from ...base.errors import ArgumentError, UnknownNameError
from ...base.types import Vector
from ...robot.formats.text_files import parse_toml
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task
from .strategy_tables import KINDS, Fitted, keys_of
from .table_values import filled

FIRST = {"lock": "joints", "height": "joints", "linear": "matrix", "stationary": "cost", "radial": "steps"}
"""The key that words without one are for."""

EXAMPLE = (
    'write a kind and its keys as in a job, such as "lock joint3", "linear 1 0 -1 0 0 0 0", "arm-angle", '
    '"stationary manipulability" or "height joints=[4]"'
)
"""What may be typed."""


def _strategy_of_words(text: str, task: Task, q0: Vector) -> Strategy:
    """The strategy of a text like "lock joint3": its kind, and behind it values, or keys with values as TOML has them.

    Args:
        text: words of `lock` and `height` are joints, by name or number; of `linear` one row of numbers; of
            `stationary` the cost. Other keys: `height joints=[4]`, `arm-angle definition="conventional"`.

    Raises:
        UnknownNameError: no such kind. ArgumentError: words that are not understood; as the strategy raises.
    """
    kind, _, rest = text.strip().partition(" ")
    known = {name: model for name, model in KINDS.items() if model is not Fitted}
    if kind not in known:
        raise UnknownNameError("kind of strategy", kind, known)
    values = _keys(text, kind, rest.strip())
    table = filled(known[kind], "strategy", {"kind": kind, **values})
    return table.build(task, q0, text.strip())


def leaf_of_words(text: str, task: Task, q0: Vector) -> Strategy:
    """The same, of a strategy with leaves; where nothing is redundant any serves. Raises: ArgumentError besides."""
    strategy = _strategy_of_words(text, task, q0)
    if task.n > task.m and not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("--strategy", text, "it has no leaves, so a pose has many joints: name one such as lock")
    return strategy


def _keys(text: str, kind: str, rest: str) -> dict[str, Any]:
    """The keys of a kind, of the words behind it. Raises: ArgumentError."""
    if "=" in rest:
        return parse_toml(
            "\n".join(_assignments(rest)),
            lambda _, fact, _cure: ArgumentError("--strategy", text, f"{EXAMPLE}; it {fact}"),
        )
    words = rest.replace(",", " ").split()
    if not words:
        return {}
    needed, _ = keys_of(KINDS[kind])
    key = FIRST.get(kind)
    if key is None:
        have = f"; {kind} needs {', '.join(needed)}" if needed else ""
        raise ArgumentError("--strategy", text, EXAMPLE + have)
    if key == "joints":
        return {key: [int(word) if word.isdigit() else word for word in words]}
    if key in ("cost", "steps"):
        if len(words) > 1:
            raise ArgumentError("--strategy", text, f"{EXAMPLE}; give one {key}")
        return {key: int(words[0]) if words[0].isdigit() else words[0]}
    try:
        return {key: [[float(word) for word in words]]}
    except ValueError:
        raise ArgumentError("--strategy", text, f"{EXAMPLE}; {kind} takes numbers") from None


def _assignments(text: str) -> list[str]:
    """The pieces key=value of a text, cut before each key that is outside of brackets and quotes."""
    pieces, depth, quoted, start = [], 0, "", 0
    for i, c in enumerate(text):
        if quoted:
            quoted = "" if c == quoted else quoted
        elif c in "\"'":
            quoted = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        elif c == " " and not depth and "=" in text[i:] and text[i + 1 :].split("=")[0].strip().isidentifier():
            pieces.append(text[start:i])
            start = i + 1
    return [*pieces, text[start:]]
