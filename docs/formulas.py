"""For the site: brackets of formulas stay brackets. In Markdown `[J; g] [1; 0]` and `[G, e](q)` would be links."""

from __future__ import annotations

import re
from typing import Any

CODE = re.compile(r"(^```.*?^```|^(?: {4}|\t).*?$|`[^`\n]+`)", re.DOTALL | re.MULTILINE)
NO_LINK = re.compile(r"\](?=\s?\[|\((?![^)\s]*[.#/]))")
"""The end of a bracket that another bracket follows, or a parenthesis in which there is no address."""


def escaped(text: str) -> str:
    """Markdown without links that are none, outside of code."""
    parts = CODE.split(text)
    return "".join(part if i % 2 else NO_LINK.sub(r"\\]", part) for i, part in enumerate(parts))


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """MkDocs calls this for each page. The API pages link names by `[name][path]`, and have no formulas."""
    return markdown if page.file.src_uri.startswith("api/") else escaped(markdown)
