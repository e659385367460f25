"""One word for one idea: what the project once said in a language of its own, and the words of text books for it."""

from __future__ import annotations

import inspect
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

import holokin

ROOT = Path(__file__).parents[2]
PLAIN = {
    r"\b(comes?|came|coming|brings?|brought|back) (\w+ ){0,3}home\b": "repeat, return, end where they began",
    r"\bhomecoming\b": "repeatability",
    r"\btwins?\b": "radial strategy",
    r"\bsettl(e|es|ed|ing)\b": "move to a leaf; converge",
    r"\bmend(s|ed|ing)?\b": "correct, remove",
    r"\bstrays?\b": "drifts",
    r"\bforetell\w*|\bforetold\b|\bforecast\w*": "predict",
    r"\bconditioning\b": "rcond",
    r"\bholonomy\b": "integrability; drift",
    r"\bleaf.gains?\b": "constraint gain",
    r"\bwalkers?\b": "follower",
    r"\bblurred\b": "undecided, hidden by round-off",
    r"\bservo (law|step|loop)s?\b": "controller; a servo is the drive of a joint",
    r"\bprice(s|d)?\b": "distance to a repeatable law; cost",
}
"""What is not said -> what is said instead."""

ALLOWED = {
    "holonomy": re.compile(r"holonomic|anholonomy|Holonomy (group|of)|\[[A-Z][A-Za-z]*\d\d\]", re.IGNORECASE),
}
"""Words of text books that look alike."""

FOLDERS = ("src", "docs", "examples", "README.md", "CONTRIBUTING.md", "mkdocs.yml")


@cache
def texts() -> list[tuple[str, int, str]]:
    """(file, line number, line) of what users and readers of the code see."""
    done = subprocess.run(["git", "ls-files", *FOLDERS], cwd=ROOT, capture_output=True, text=True, check=False)
    names = done.stdout.split() or [
        str(f.relative_to(ROOT))
        for folder in FOLDERS
        for f in [ROOT / folder, *(ROOT / folder).rglob("*")]
        if f.is_file()
    ]
    kinds = (".py", ".md", ".toml", ".yml", ".c", ".h", ".txt")
    return [
        (name, number, line)
        for name in names
        if name.endswith(kinds) and name != "docs/references.md"
        for number, line in enumerate((ROOT / name).read_text("utf-8").splitlines(), 1)
    ]


@cache
def suspects() -> list[tuple[str, int, str]]:
    """The lines in which any of the idioms stands, sought once for all of them."""
    any_of = re.compile("|".join(f"(?:{idiom})" for idiom in PLAIN), re.IGNORECASE)
    return [line for line in texts() if any_of.search(line[2])]


def _exists(name: str) -> bool:
    """Whether hk.NAME, with its folders, can be had, and stands where it is public."""
    thing = holokin
    for part in name.split("."):
        names, inner = getattr(thing, "__all__", [part]), getattr(thing, part, None)
        if inner is None or (part not in names and not inspect.ismodule(inner)):
            return False
        thing = inner
    return True


def test_what_is_called_hk_something_can_be_had_of_it() -> None:
    """In the code's own sentences, above all in the cures of its errors, and on the pages."""
    named = {word for _, _, line in texts() for word in re.findall(r"\bhk((?:\.[A-Za-z]\w*)+)", line)}
    assert len(named) > 100
    assert sorted(word for word in named if not _exists(word[1:])) == []


@pytest.mark.parametrize("idiom", PLAIN)
def test_the_words_are_those_of_text_books(idiom: str) -> None:
    found = [f"{name}:{number}: {line.strip()[:120]}" for name, number, line in suspects() if _says(idiom, line)]
    assert found == [], f"say: {PLAIN[idiom]}"


def _says(idiom: str, line: str) -> bool:
    if not re.search(idiom, line, re.IGNORECASE):
        return False
    allowed = next((pattern for word, pattern in ALLOWED.items() if word in idiom), None)
    return allowed is None or not allowed.search(line)


def test_the_idiom_is_seen_where_it_stands() -> None:
    assert _says(next(iter(PLAIN)), "so the arm came safely back home")
    assert not _says(next(iter(PLAIN)), "the user's home folder")
