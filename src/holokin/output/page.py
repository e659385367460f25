"""A self-contained HTML page: its style, tables, and figures inside it."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

from .plots import style

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #22262e; max-width: 68rem; margin: 2rem auto; padding: 0 1.2rem; }}
h1 {{ font-size: 1.7rem; margin-bottom: .2rem; }} h2 {{ margin-top: 2.2rem; font-size: 1.25rem; }}
table {{ border-collapse: collapse; width: 100%; font-size: .92rem; font-variant-numeric: tabular-nums; }}
th, td {{ text-align: left; padding: .4rem .6rem; border-bottom: 1px solid #e5e7eb; vertical-align: top; }}
th {{ color: #4b5563; font-weight: 600; }} figure {{ margin: 1.2rem 0; }} img {{ max-width: 100%; }}
figcaption, .small {{ color: #4b5563; font-size: .9rem; }} .wide {{ overflow-x: auto; }}
pre {{ background: #f6f7f9; padding: .8rem; overflow-x: auto; font-size: .85rem; }}
</style></head><body>
{body}
</body></html>
"""

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
"""Control characters, which HTML has no use for."""


def page(title: str, parts: Sequence[str]) -> str:
    """A page of parts in HTML."""
    return _CONTROL.sub("\ufffd", _PAGE.format(title=escape(title), body="\n".join(parts)))


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of cells in HTML."""
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<div class='wide'><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"


def drawn(draw: Callable[[], Any], caption: str) -> str:
    """A figure inside the page, as SVG, with what to see in it."""
    from matplotlib import rc_context

    stream = io.BytesIO()
    with rc_context(style()):
        draw().savefig(stream, format="svg", facecolor="white")
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    image = f"<img alt='{escape(caption, quote=True)}' src='data:image/svg+xml;base64,{data}'>"
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"
