"""The checker, called from within holokin: its errors are holokin's."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path as FilePath
from random import randrange

from ..base.errors import ArgumentError, CertificateError, MissingExtraError, brief
from ..robot import Robot
from .binding import unlike
from .shape_binding import unsaid

LONGEST = 3600.0
"""Seconds that the checker may take."""


def recheck(
    file: str | FilePath,
    report: Callable[[int], None] = lambda _permille: None,
    seconds: float = LONGEST,
    robot: Robot | None = None,
    sample: float | None = None,
    seed: int | None = None,
) -> tuple[bool, str]:
    """(whether it is rejected, what is found, in sentences) of a certificate's file, by `proof.checker`.

    With a robot the rows of its task are written down anew and compared, see `binding`. With a sample, 0 to 1, this
    share of the cells is verified, by `proof.sample_checker`; the seed says which ones, by default any.

    Raises:
        ArgumentError: a sample that is no share. CertificateError: a file that is no certificate.
        MissingExtraError: python-flint is not installed.
    """
    if sample is not None and not 0 < sample <= 1:
        raise ArgumentError("the sample", sample, "give the share of the cells that is verified, as 0.01")
    try:
        from .checker import RejectedError, check
        from .sample_checker import check_sample
    except ImportError:
        raise MissingExtraError("python-flint", "proof") from None
    try:
        done, partly = count(1), sample is not None and sample < 1

        def say(total: int) -> None:
            report(min(1000, 1000 * next(done) // max(total, 1)))

        if sample is not None and partly:
            drawn = randrange(10**6) if seed is None else seed
            found = check_sample(str(file), say, seconds, sample, drawn)
        else:
            found = check(str(file), say, seconds)
    except RejectedError as problem:
        return True, f"REJECTED: {problem}."
    except FileNotFoundError:
        raise CertificateError(file, "there is no such file") from None
    except TimeoutError:
        raise CertificateError(file, f"it is not verified within {seconds:.0f} s; allow more with --seconds") from None
    except OSError as problem:
        raise CertificateError(file, f"it cannot be read ({problem.strerror or problem})") from None
    except ValueError as problem:
        raise CertificateError(file, str(problem)) from None
    bound = "\n  it is not compared with a robot: name one with --robot"
    if robot is not None:
        try:
            other = unlike(found.data, robot)
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RuntimeError) as problem:
            return True, f"REJECTED: its task cannot be read ({brief(repr(problem))})."
        if other:
            return True, f"REJECTED: {other}."
        bound = f"\n  the rows of its task and its limits are those of {robot.name}{unsaid(found.data, robot)}"
    extent = "it covers all that was asked" if found.whole else "it is a part of what was asked"
    lines = "".join(f"\n  {line}" for line in found.lines)
    head = "NO FAULT FOUND in a sample, which does not verify the certificate" if partly else f"VERIFIED: {extent}"
    return False, f"{head}.{lines}{bound}\n  The file's own words, not verified: {found.words}"
