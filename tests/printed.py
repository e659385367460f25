"""What a page shows beside what is printed today, for the tests."""

from __future__ import annotations

import re

import pytest

NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
ROUND_OFF = 1e-8
"""Printed numbers below this are not compared: they are another machine's."""


def said(text: str) -> tuple[list[str], list[float]]:
    """The words and the numbers of a print-out, without its line breaks."""
    words = " ".join(text.split())
    return NUMBER.sub("#", words).split(), [float(number) for number in NUMBER.findall(words)]


def assert_alike(printed: str, shown: str) -> None:
    (words, numbers), (wanted, values) = said(printed), said(shown)
    assert words == wanted
    assert [n for n, v in zip(numbers, values, strict=True) if max(abs(n), abs(v)) > ROUND_OFF] == pytest.approx(
        [v for n, v in zip(numbers, values, strict=True) if max(abs(n), abs(v)) > ROUND_OFF], rel=2e-2, abs=0
    )
