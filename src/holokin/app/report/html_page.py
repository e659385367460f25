"""A self-contained HTML page of sections: its style, and what it leaves out of texts."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

from .section import Section

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #22262e; max-width: 68rem; margin: 2rem auto; padding: 0 1.2rem; }}
* {{ box-sizing: border-box; }}
h1 {{ font-size: 1.7rem; overflow-wrap: anywhere; margin-bottom: .2rem; }}
h2 {{ margin-top: 2.2rem; font-size: 1.25rem; }}
table {{ border-collapse: collapse; width: 100%; font-size: .92rem; font-variant-numeric: tabular-nums; }}
th, td {{ text-align: left; padding: .4rem .6rem; border-bottom: 1px solid #e5e7eb; vertical-align: top; }}
th {{ color: #4b5563; font-weight: 600; }} td.n, th.n {{ text-align: right; }} td.n {{ white-space: nowrap; }}
.yes {{ color: #00664a; font-weight: 600; }} .no {{ color: #a84a00; font-weight: 600; }}
figure {{ margin: 1.6rem 0; }} img, video {{ max-width: 100%; height: auto; }} li, p, dd {{ overflow-wrap: anywhere; }}
figcaption, .small {{ color: #4b5563; font-size: .9rem; }} .wide {{ overflow-x: auto; }}
dt {{ font-weight: 600; float: left; clear: left; margin-right: .4rem; }} dd {{ margin: 0 0 .3rem 0; }}
.fold {{ list-style: none; margin-left: -1.1rem; }} details > p {{ margin: .2rem 0 .4rem 1.1rem; }}
@media (max-width: 40rem) {{ body {{ margin: 1rem auto; padding: 0 .8rem; }} table {{ font-size: .8rem; }}
figure.many {{ overflow-x: auto; }} figure.many img {{ max-width: none; width: 46rem; }} }}
pre {{ background: #f6f7f9; padding: .8rem; overflow-x: auto; font-size: .85rem; }}
</style>{head}</head><body>
{body}
</body></html>
"""

CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""What HTML has no use for: control characters, halves of characters, and those that turn the direction of what comes
after them."""


def page(title: str, parts: Sequence[Section | str], head: str = "") -> str:
    """A page of sections, and of parts that are HTML already; what else its head is to have comes after the style."""
    body = "\n".join(part if isinstance(part, str) else part.html() for part in parts)
    return CONTROL.sub("\ufffd", _PAGE.format(title=escape(title), body=body, head=head))
