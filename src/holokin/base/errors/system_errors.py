"""Errors of what lies outside: compilers, packages, files."""

from __future__ import annotations

import errno
from typing import ClassVar

from .holokin_error import HolokinError, brief


class NativeError(HolokinError):
    """Native code that could not be made or loaded. `cause`: a word for what lies behind it, by default the fact."""

    def __init__(self, fact: str, cause: str = "") -> None:
        self.fact, self.cause = fact, cause or fact
        super().__init__(f"{fact}; everything works without native code too: set HOLOKIN_NATIVE=0")


class ExportError(HolokinError):
    """A strategy that cannot be written as C, or whose C failed its self-test."""

    def __init__(self, fact: str, cure: str) -> None:
        super().__init__(f"{fact}; {cure}")


class MissingExtraError(HolokinError):
    """An optional dependency that is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"this needs {package}; install it with: pip install 'holokin[{extra}]'")


class SchedulerError(HolokinError):
    """A scheduler of a cluster that cannot be reached, or was lost; rows that were kept stay."""

    def __init__(self, scheduler: str, fact: str, cure: str = "check its address") -> None:
        self.scheduler, self.fact, self.cure = scheduler, fact, cure
        super().__init__(f"the scheduler {brief(scheduler)} {brief(fact)}; {brief(cure)}, and go on with --resume")


class WriteError(HolokinError):
    """A file that the system does not let us write; what stood there before is as it was."""

    _cures: ClassVar[dict[int, str]] = {
        errno.ENOSPC: "make room on that disk, or choose another place",
        errno.EDQUOT: "make room within your quota, or choose another place",
        errno.EFBIG: "raise the limit on the size of files (ulimit -f), or choose another place",
        errno.ENOENT: "make the folder first, or choose another place",
        errno.EEXIST: "choose another name",
        errno.ENAMETOOLONG: "choose a shorter name",
    }

    def __init__(self, file: object, problem: OSError) -> None:
        self.file, self.problem = file, problem
        cure = self._cures.get(problem.errno or 0, "choose another place")
        super().__init__(f"{file} cannot be written: {problem.strerror or problem}; {cure}")


class PickleError(HolokinError):
    """A value that holds functions which cannot be pickled."""

    def __init__(self, what: str, fact: str) -> None:
        super().__init__(f"{what} cannot be pickled: {brief(fact)}; pickle what you made it from, and make it again")
