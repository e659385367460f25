"""`CheckerWord`: what the independent checker says of a certificate, or why it says nothing."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from enum import Enum
from pathlib import Path as FilePath

from ..base.arguments import typed
from ..base.errors import CertificateError, MissingExtraError
from ..base.extra_module import extra_module
from ..base.types import NoTruthValue, Value, not_negative
from ..version import build
from .binding import described
from .certificate import Certificate, digest
from .recheck import recheck


class Outcome(NoTruthValue, Enum, ask="`is Outcome.VERIFIED`"):
    """What the checker says of a certificate."""

    VERIFIED = "verified"
    REJECTED = "REJECTED"
    SAMPLED = "only sampled"
    NONE = "not verified"


@dataclass(frozen=True)
class CheckerWord(Value):
    """The outcome, in sentences, and the seconds it took; of which data (`sha256`), and by which version.

    `compared` says that the rows of the task and the limits in the file are those of the certificate's robot.
    """

    outcome: Outcome
    text: str
    seconds: float
    sha256: str
    version: str
    compared: bool


@typed
def ask_checker(certificate: Certificate, seconds: float = 60.0, sample: float | None = None) -> CheckerWord:
    """What the checker says of the file of a certificate, by a copy of that file; with 0 seconds it is not run.

    With a sample, a share of the cells, it verifies these alone: `Outcome.SAMPLED`. Where the task is about one tool
    in the frame of the base, the file is compared with the robot, too.

    Raises:
        ArgumentError: the seconds are negative, or the sample is no share.
    """
    seconds = not_negative("the seconds of the checker", seconds)
    if not len(certificate):
        return unasked(certificate, "nothing is proven that it could verify")
    if seconds == 0:
        return unasked(certificate)
    sha256, clear = digest(certificate.data), certificate.demands.clear
    robot = certificate.equation.strategy.task.robot if clear is None else clear.robot
    compared = robot if described(certificate.equation) is not None else None
    began, version = time.perf_counter(), ""
    try:
        version = _version()
        with tempfile.TemporaryDirectory(prefix="holokin-") as folder:
            file = certificate.save(FilePath(folder) / "certificate.json")
            rejected, text = recheck(file, seconds=seconds, robot=compared, sample=sample)
    except MissingExtraError:
        return unasked(certificate, "it was not run: python-flint is missing")
    except CertificateError as problem:
        taken = time.perf_counter() - began
        return CheckerWord(Outcome.NONE, f"it gave no answer: {problem.fact}", taken, sha256, version, False)
    passed = Outcome.VERIFIED if sample is None or sample == 1 else Outcome.SAMPLED
    outcome = Outcome.REJECTED if rejected else passed
    taken = time.perf_counter() - began
    return CheckerWord(outcome, text, taken, sha256, version, compared is not None and not rejected)


def unasked(certificate: Certificate, why: str = "it was not run") -> CheckerWord:
    """The word of a checker that was not run."""
    return CheckerWord(Outcome.NONE, why, 0.0, digest(certificate.data), "not run", False)


def _version() -> str:
    """Of the checker, and of the library of its arithmetic. Raises: MissingExtraError."""
    flint = extra_module("flint", "proof", "python-flint")
    return f"holokin {build()}, python-flint {flint.__version__}"
