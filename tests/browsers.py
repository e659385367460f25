"""Debian's chromium without a window, for the tests of pages."""

from __future__ import annotations

import shutil

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
if BROWSER is None:
    pytest.skip("there is no chromium here: install one, as with `apt-get install chromium`", allow_module_level=True)

SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--disable-dev-shm-usage"]
"""WebGL without a graphics card."""

PATIENCE = 60_000
"""Milliseconds: a machine without a graphics card, whose cores are shared."""
