"""The page of the site, the script that makes it, and what a page computes, for tests of pages."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "play" / "index.html"
SCRIPT = SimpleNamespace(**runpy.run_path(str(DOCS / "play_page.py")))

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)> {{data}} <!--"
"""A name of a stranger's."""


def data_of(html: str) -> dict[str, Any]:
    """What a page has as JSON."""
    return json.loads(html.partition('id="data">')[2].partition("</script>")[0])


def joints(page: Any, rounds: int) -> list[np.ndarray]:
    """Joints (steps, n) of each strategy on a page in a browser, for so many rounds of its loop."""
    code = (
        "rounds => holokin.strategies.map(strategy => {"
        " strategy.advance(rounds, 1e9); return [strategy.n, strategy.done, Array.from(strategy.rows)]; })"
    )
    return [np.reshape(rows[: n * (done + 1)], (-1, n)) for n, done, rows in page.evaluate(code, rounds)]
