"""The version, written here and nowhere else; and the commit, of a checkout that the package is used from."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

__version__ = "0.2.0"

SECONDS = 2.0
"""That git may take to answer."""


@cache
def build() -> str:
    """The version, with the commit where the package lies in a checkout of its own: "0.2.0 (commit 1a2b3c4d5e6f)".

    "+changes" behind the commit says that tracked files are not as it has them. A checkout that merely lies around an
    environment is another project's, and is not asked; nor is git where there is none.
    """
    top = Path(__file__).resolve().parents[2]
    if not ((top / ".git").exists() and (top / "pyproject.toml").is_file() and (top / "src" / "holokin").is_dir()):
        return __version__
    commit, changes = _git(top, "rev-parse", "--short=12", "HEAD"), _git(top, "status", "--porcelain", "-uno")
    if not commit:
        return __version__
    return f"{__version__} (commit {commit}{'+changes' if changes else ''})"


def _git(top: Path, *words: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(top), *words], capture_output=True, text=True, timeout=SECONDS, check=False
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
