"""The HTML of a page from its parts. What is the user's is escaped, and nothing but the page's own script may run."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html import escape
from importlib.resources import files
from typing import Any

from ...version import __version__

SCRIPTS = ("stage.js", "loops.js", "law.js", "charts.js", "play.js")

_HOLE = re.compile(r"\{\{(\w+)\}\}")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, halves of characters, and those that turn the direction of what is written after them."""


def page_text(title: str, text: str, data: dict[str, Any]) -> str:
    """The page: one file with style, script and data. Its policy names script and style by their hashes."""
    script, style = "\n".join(_file(name) for name in SCRIPTS), _file("page.css")
    parts = {
        "title": escape(title),
        "text": f"<p>{escape(text)}</p>" if text else "",
        "version": escape(__version__),
        "sources": sources(),
        "style": style,
        "style_hash": _hash(style),
        "script": script,
        "script_hash": _hash(script),
        "data": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
    }
    return _CONTROL.sub("\ufffd", _HOLE.sub(lambda hole: parts[hole[1]], _file("page.html")))


def sources() -> str:
    """A number of the files that every page is made of: it says whether a page is of this version of them."""
    names = ("page.html", "page.css", "law.c", *SCRIPTS)
    return digest("\0".join(_file(name) for name in names))


def digest(text: str) -> str:
    """A number of a text, to tell whether it is another one."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _file(name: str) -> str:
    return files("holokin.app.studio").joinpath("web", name).read_text("utf-8")


def _hash(text: str) -> str:
    """As a Content-Security-Policy names a script or a style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
