"""The checker, called from within holokin: its errors are holokin's."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path as FilePath

from ..errors import CertificateError, MissingExtraError


def recheck(file: str | FilePath, report: Callable[[int], None] = lambda _permille: None) -> tuple[bool, str]:
    """(whether it is rejected, what is found in one sentence) of a certificate's file, by `proof.checker`.

    Raises:
        CertificateError: a file that is no certificate. MissingExtraError: python-flint is not installed.
    """
    try:
        from .checker import RejectedError, check
    except ImportError:
        raise MissingExtraError("python-flint", "proof") from None
    try:
        cells = FilePath(file).read_text("utf-8").count('"q0": ')
        done = count(1)
        data = check(str(file), lambda: report(min(1000, 1000 * next(done) // max(cells, 1))))
    except RejectedError as problem:
        return True, f"REJECTED: {problem}."
    except FileNotFoundError:
        raise CertificateError(file, "there is no such file") from None
    except OSError as problem:
        raise CertificateError(file, f"it cannot be read ({problem.strerror or problem})") from None
    except ValueError as problem:
        raise CertificateError(file, str(problem)) from None
    extent = "it covers all that was asked" if data["claims"]["whole"] else "it is a part of what was asked"
    return False, f"VERIFIED: {data['title']}: {cells} cells; {extent}."
