"""The checker, called from within holokin: its errors are holokin's."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from itertools import count
from pathlib import Path as FilePath
from random import randrange
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, FileError, MissingExtraError, brief
from ..base.extra_module import extra_module
from ..base.types import Array, NoTruthValue, Value, not_negative
from ..robot import Robot
from ..robot.closed_form.arm_classes import SNAP, Link, frames_apart, links_of
from ..version import build
from .binding import described, unlike, unsaid
from .certificate import Certificate, digest
from .whole_arm import WholeArm

CURE = "give a certificate of `holokin certify`"


def recheck(
    file: str | FilePath,
    report: Callable[[int], None] = lambda _permille: None,
    seconds: float = 3600.0,
    robot: Robot | None = None,
    sample: float | None = None,
    seed: int | None = None,
) -> tuple[bool, str]:
    """(whether it is rejected, what is found, in sentences) of a certificate's file, by `proof.checker`.

    With a robot the rows of its task are written down anew and compared, see `binding`. With a sample, 0 to 1, this
    share of the cells is verified, by `proof.sample_checker`; the seed says which ones, by default any. The seconds are
    those that the checker may take.

    Raises:
        ArgumentError: a sample that is no share. FileError: a file that is no certificate.
        MissingExtraError: python-flint is not installed.
    """
    if sample is not None and not 0 < sample <= 1:
        raise ArgumentError("the sample", sample, "give the share of the cells that is verified, as 0.01")
    try:
        from .checker import RejectedError, check
        from .sample_checker import check_sample
        from .whole_checker import is_whole_arm
    except ImportError:
        raise MissingExtraError("python-flint", "proof") from None
    # The checker, which tells of each cell.
    done, partly = count(1), sample is not None and sample < 1

    def say(total: int) -> None:
        report(min(1000, 1000 * next(done) // max(total, 1)))

    try:
        if is_whole_arm(str(file)):
            if partly:
                raise ArgumentError("the sample", sample, "leave it out: a certificate of a whole arm has no cells")
            return _recheck_whole_arm(str(file), robot)
        if sample is not None and partly:
            drawn = randrange(10**6) if seed is None else seed
            verified = check_sample(str(file), say, seconds, sample, drawn)
        else:
            verified = check(str(file), say, seconds)
    except RejectedError as problem:
        return True, f"REJECTED: {problem}."
    except FileNotFoundError:
        raise FileError(file, "there is no such file", CURE) from None
    except TimeoutError:
        raise FileError(file, f"it is not verified within {seconds:.0f} s", "allow more with --seconds") from None
    except OSError as problem:
        raise FileError(file, f"it cannot be read ({problem.strerror or problem})", CURE) from None
    except ValueError as problem:
        raise FileError(file, str(problem), CURE) from None
    # The comparison with a robot.
    compared = "it is not compared with a robot: name one with --robot"
    if robot is not None:
        try:
            difference = unlike(verified.data, robot)
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RuntimeError) as problem:
            return True, f"REJECTED: its task cannot be read ({brief(repr(problem))})."
        if difference:
            return True, f"REJECTED: {difference}."
        compared = f"the rows of its task and its limits are those of {robot.name}{unsaid(verified.data, robot)}"
    extent = "it covers all that was asked" if verified.whole else "it is a part of what was asked"
    head = "NO FAULT FOUND in a sample, which does not verify the certificate" if partly else f"VERIFIED: {extent}"
    own = f"The file's own words, not verified: {verified.words}"
    return False, "\n  ".join([f"{head}.", *verified.lines, compared, own])


def _recheck_whole_arm(file: str, robot: Robot | None) -> tuple[bool, str]:
    """The same of the certificate of a whole arm."""
    from .whole_checker import RejectedError, check, text_of

    try:
        lines, data = check(file)
    except RejectedError as problem:
        return True, f"REJECTED: {problem}."
    compared = "it is not compared with a robot: name one with --robot"
    if robot is not None:
        rejected, compared = _unlike_arm(data, robot)
        if rejected:
            return True, f"REJECTED: {compared}."
    own = f"The file's own words, not verified: {text_of(data.get('title'))}, of {text_of(data.get('robot'))}"
    return False, "\n  ".join(["VERIFIED: it covers the whole arm.", *lines, compared, own])


def _unlike_arm(data: dict[str, Any], robot: Robot) -> tuple[bool, str]:
    """(whether the model of a whole arm is not that of a robot, to one of its tips; what is found)."""

    def array(values: Any) -> Array:
        return np.vectorize(lambda text: float(Fraction(text)), otypes=[float])(np.array(values, dtype=object))

    model = [
        Link(array(link["rotation"]), array(link["position"]), array(link["axis"]), link["slides"], i, 1.0, 0.0)
        for i, link in enumerate(data["links"])
    ]
    held, found = set(data["held"]), "it has other joints"
    for tip in robot.tips:
        links = links_of(robot, tip.name)[:-1]
        if [link.slides for link in links] != [link.slides for link in model]:
            continue
        # The held coordinates are others than the free ones, and each of these turns one joint by its own angle.
        kept = {link.coordinate for i, link in enumerate(links) if i in held}
        free = [link for i, link in enumerate(links) if i not in held]
        own = {link.coordinate for link in free if abs(link.multiplier) == 1}
        if len(own) != len(free) or own & kept:
            found = "one of its six joints follows another"
            continue
        angle, distance = frames_apart(links, model)
        found = f"its frames differ by up to {angle:.1e} rad and {distance:.1e} m"
        if max(angle, distance) < SNAP:
            names = " and ".join(robot.joint_names[k] for k in sorted(kept)) or "none"
            return False, f"it is {robot.name}, held: {names}; {found}, each seen from the frame before"
    return True, f"it is not {robot.name}: {found}"


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
def ask_checker(certificate: Certificate | WholeArm, seconds: float = 60.0, sample: float | None = None) -> CheckerWord:
    """What the checker says of the file of a certificate, by a copy of that file; with 0 seconds it is not run.

    With a sample, a share of the cells, it verifies these alone: `Outcome.SAMPLED`. Where the task is about one tool
    in the frame of the base, the file is compared with the robot, too.

    Raises:
        ArgumentError: the seconds are negative, or the sample is no share.
    """
    seconds = not_negative("the seconds of the checker", seconds)
    whole_arm = isinstance(certificate, WholeArm)
    if not whole_arm and not len(certificate):
        return unasked(certificate, "nothing is proven that it could verify")
    if seconds == 0:
        return unasked(certificate)
    sha256 = digest(certificate.data)
    if whole_arm:
        compared, sample = certificate.arm.robot, None
    else:
        clear = certificate.demands.clear
        robot = certificate.equation.strategy.task.robot if clear is None else clear.robot
        compared = robot if described(certificate.equation) is not None else None
    began, version = time.perf_counter(), ""
    try:
        flint = extra_module("flint", "proof", "python-flint")
        version = f"holokin {build()}, python-flint {flint.__version__}"
        with tempfile.TemporaryDirectory(prefix="holokin-") as folder:
            file = certificate.save(FilePath(folder) / "certificate.json")
            rejected, text = recheck(file, seconds=seconds, robot=compared, sample=sample)
        passed = Outcome.VERIFIED if sample is None or sample == 1 else Outcome.SAMPLED
        outcome = Outcome.REJECTED if rejected else passed
    except MissingExtraError:
        return unasked(certificate, "it was not run: python-flint is missing")
    except FileError as problem:
        outcome, text = Outcome.NONE, f"it gave no answer: {problem.fact}"
    known = compared is not None and outcome in (Outcome.VERIFIED, Outcome.SAMPLED)
    return CheckerWord(outcome, text, time.perf_counter() - began, sha256, version, known)


def unasked(certificate: Certificate | WholeArm, why: str = "it was not run") -> CheckerWord:
    """The word of a checker that was not run."""
    return CheckerWord(Outcome.NONE, why, 0.0, digest(certificate.data), "not run", False)
