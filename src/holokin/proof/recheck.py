"""The checker, called from within holokin: its errors are holokin's."""

from __future__ import annotations

from collections.abc import Callable
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
        data = check(str(file), lambda done, of: report(1000 * done // of))
    except RejectedError as problem:
        return True, f"REJECTED: {problem}."
    except (OSError, ValueError) as problem:
        raise CertificateError(file, str(problem)) from None
    extent = "it covers all that was asked" if data["whole"] else "it is a part of what was asked"
    return False, f"VERIFIED: {data['title']}: {len(data['cells'])} cells; {extent}."
