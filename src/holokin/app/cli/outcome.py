"""How a command ends, and options that several share: exit codes, one sentence an error, Ctrl-C and SIGTERM."""

from __future__ import annotations

import atexit
import contextlib
import errno
import io
import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...base.errors import HolokinError, UnknownNameError, WriteError
from ...base.progress import as_printed, print_by

if TYPE_CHECKING:
    from ...robot import Robot
    from ..job import Job

BAD_INPUT, UNEXPECTED, SIGNAL = 2, 3, 128
"""Exit codes, besides 0 and 1: input or a file that cannot be used; a fault of holokin itself; stopped by Ctrl-C, which
is signal 2, or by SIGTERM, 15."""

_REFUSED = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
"""What the system says when it has nothing left to give: no fault of holokin."""

_LONGEST = 300
"""Characters of an unexpected error's own words in the sentence; `--traceback` has them all."""


class Ending:
    """What is known while a command runs: whether the whole traceback is wanted, which signal was heard, 0 for none.

    SIGTERM, by which batch systems, containers and `timeout` stop a command, ends it as Ctrl-C does. Libraries lose
    some of the KeyboardInterrupts that Python raises (CasADi while it converts arguments, modules while they are
    imported), or turn them into other errors; so a signal is noted when it comes, and `check` raises again.
    """

    def __init__(self, whole: bool = False) -> None:
        self.whole, self.heard = whole, 0
        self._hooks = sys.unraisablehook, sys.excepthook

    def listen(self) -> None:
        """Note both signals from now on, unless this process was started to ignore them (in the background)."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
            before = signal.getsignal(number)
            if getattr(before, "__func__", before) in (Ending._hear, usual):
                signal.signal(number, self._hear)
                sys.unraisablehook, sys.excepthook = self._unraisable, self._printed
        if signal.getsignal(signal.SIGINT) == self._hear:
            atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # nothing is left that it could stop

    def _unraisable(self, lost: Any) -> None:
        """A KeyboardInterrupt that came where nothing can be raised is noted already, and needs no traceback."""
        if not (self.heard and isinstance(lost.exc_value, KeyboardInterrupt)):
            self._hooks[0](lost)

    def _printed(self, kind: Any, problem: Any, trace: Any) -> None:
        """The same, as `sys.excepthook`, where compiled code prints it first, as Cython does."""
        if not (self.heard and isinstance(problem, KeyboardInterrupt)):
            self._hooks[1](kind, problem, trace)

    def _hear(self, number: int, _frame: object) -> None:
        if self.heard == number == signal.SIGTERM:
            return  # `timeout` sends it twice, to the process and to its group: what is kept now is kept whole
        self.heard = number
        warnings.simplefilter("ignore")  # of libraries that lost the signal and found something missing
        raise KeyboardInterrupt

    def leave(self) -> None:
        """Give back what `listen` took, but for Ctrl-C.

        A KeyboardInterrupt that left a text which was being run, as dataclasses have one, is noted in Python for good,
        and `python -m` then ends by SIGINT, whatever the exit code. Another text clears that.
        """
        exec("")
        sys.unraisablehook, sys.excepthook = self._hooks
        if signal.getsignal(signal.SIGTERM) == self._hear:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def check(self) -> None:
        """Raises: KeyboardInterrupt: Ctrl-C or SIGTERM was heard, whatever became of it."""
        if self.heard:
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def telling(self, name: str = "") -> Iterator[Telling]:
        """Tell on a terminal what goes on; what is said names the job, if it has a name."""
        from rich.console import Console
        from rich.text import Text

        progress = Console(stderr=True)
        if not progress.is_terminal:
            yield Telling(self, name, None)
            return
        with progress.status(Text(f"{name} ...".lstrip())) as status:
            yield Telling(self, name, status)

    def tell(self, problem: BaseException, job: str = "") -> int:
        """Say what happened in one sentence on stderr; returns the exit code."""
        if self.heard or isinstance(problem, KeyboardInterrupt):
            complain("stopped; what is named above is complete, and nothing else was changed")
            return SIGNAL + (self.heard or signal.SIGINT)
        if self.whole:
            complain("".join(traceback.format_exception(problem)).rstrip())
        sentence, code = _sentence(problem)
        complain(f"error: {f'{job}: ' if job else ''}{sentence}")
        return code


_running: ContextVar[Ending] = ContextVar("how the command that runs will end")
_running.set(Ending())


def set_ending(of_command: Ending) -> None:
    """Of the command that runs from now on, which prints in rad and m until a job is named."""
    _running.set(of_command)
    print_by(str)


def ending() -> Ending:
    """Of the command that runs."""
    return _running.get()


def _sentence(problem: BaseException) -> tuple[str, int]:
    """What a user reads of an error, and the exit code."""
    if isinstance(problem, HolokinError):
        listed = isinstance(problem, UnknownNameError) and problem.kind in ("job", "robot")
        return f"{problem}{' (`holokin jobs` and `holokin robots` list what there is)' if listed else ''}", BAD_INPUT
    if isinstance(problem, OSError) and problem.errno in _REFUSED:
        where = f" ({problem.filename})" if problem.filename else ""
        return f"the system refused to go on: {problem.strerror}{where}; make room and run it again", BAD_INPUT
    if isinstance(problem, MemoryError):
        return "there is not enough memory; ask for fewer samples or cycles", BAD_INPUT
    words = " ".join(f"{type(problem).__name__}: {problem}".split())
    words = words if len(words) <= _LONGEST else f"{words[:_LONGEST]}..."
    frames = traceback.extract_tb(problem.__traceback__)
    where = f" (in {frames[-1].name}, line {frames[-1].lineno} of {os.path.basename(frames[-1].filename)})"
    return (
        f"holokin failed where it should not: {words}{where if frames else ''}; the same command with --traceback "
        "shows the rest: please send that, with the files it reads, to the authors of holokin",
        UNEXPECTED,
    )


class Telling:
    """Hears what a command does, for a line of the terminal that the next one replaces."""

    def __init__(self, ending: Ending, name: str, status: Any) -> None:
        self._ending, self._name, self._status = ending, name, status

    def __call__(self, text: str) -> None:
        """Say what goes on now. Raises: KeyboardInterrupt: Ctrl-C was heard."""
        self._ending.check()
        self.tell(text)

    def tell(self, text: str) -> None:
        """The same of what Ctrl-C may end by itself, keeping what it has: nothing is raised."""
        if self._status is not None:
            from rich.text import Text

            text = as_printed(text)
            self._status.update(Text(f"{self._name}: {text}" if self._name else text))

    def announce(self, text: str) -> None:
        """Print a line that stays."""
        if self._status is not None:
            self._status.stop()
        show(text)
        if self._status is not None:
            self._status.start()


def complain(text: str) -> None:
    """Print to stderr, in the units of the job, if it can be written."""
    try:
        typer.echo(as_printed(text), err=True)
    except OSError:
        _mute(sys.stderr)


def each_minute(say: Callable[[str], None]) -> Callable[[str], None]:
    """Say what goes on; without a terminal, as in the log of a cluster, print some of it on stderr, a line a minute."""
    last = time.monotonic()

    def say_or_print(text: str) -> None:
        nonlocal last
        say(text)
        if not sys.stderr.isatty() and time.monotonic() - last > 60.0:
            last = time.monotonic()
            complain(text)

    return say_or_print


def show(text: str) -> None:
    """Print to stdout, in the units of the job; in silence once its reader has gone.

    Raises:
        WriteError: it cannot be written; what is printed later is dropped.
    """
    _print(as_printed(text), True)


def _print(text: str, newline: bool) -> None:
    try:
        typer.echo(text, nl=newline)
    except BrokenPipeError:
        _mute(sys.stdout)
    except OSError as problem:
        _mute(sys.stdout)
        raise WriteError("the standard output", problem) from problem


def show_rich(draw: Callable[[Any], None]) -> None:
    """Print what a function draws on a Rich console: in colour on a terminal, else as wide as COLUMNS says, or 120.

    Raises:
        WriteError: as `show`, which does the printing, since Rich itself ends the process when its reader goes.
    """
    from rich.console import Console

    screen, text = Console(), io.StringIO()
    width = screen.width if screen.is_terminal or os.environ.get("COLUMNS", "").isdigit() else 120
    draw(Console(file=text, force_terminal=screen.is_terminal, width=width))
    _print(text.getvalue(), False)  # a section is in the units of the job already


def _mute(stream: Any) -> None:
    """From now on a stream leads nowhere, and what it still holds is dropped when it closes."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def prepare_streams() -> None:
    """Let the streams show names that their encoding does not have, as escapes."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def finish(code: int) -> int:
    """Flush the streams at the end of a command; returns its exit code, 2 where the output was lost."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except BrokenPipeError:
            _mute(stream)
        except OSError as problem:
            _mute(stream)
            complain(f"error: {WriteError('the standard output', problem)}")
            code = max(code, BAD_INPUT)
    return code


Degrees = Annotated[bool | None, typer.Option("--degrees/--radians", help="Unit of revolute joints.")]
Columns = Annotated[
    str | None,
    typer.Option(
        help='Names of joints in it: "a, b, ..." in the order of the robot, "joint=a, ...", or "actual_q_%d".'
    ),
]
CountsTurns = Annotated[
    bool, typer.Option("--counts-turns", help="Joint values count whole turns: none is taken to be modulo a turn.")
]
Signs = Annotated[str | None, typer.Option(help='Joints that it counts the other way round: "joint_2=-1, ...".')]
Offsets = Annotated[
    str | None, typer.Option(help='Its values in rad or m where joints are at 0: "joint_2=-1.57, joint_3=90deg".')
]
Scales = Annotated[str | None, typer.Option(help='Rad or m of a unit of its own: "joint_1=0.00153398, ...".')]


def counts_of_words(signs: str | None, offsets: str | None, scales: str | None) -> dict[str, Any]:
    """Arguments signs, offsets and scales of the words of these options. Raises: ArgumentError."""
    options = {"--signs": signs, "--offsets": offsets, "--scales": scales}
    return {name[2:]: None if text is None else _pairs(name, text) for name, text in options.items()}


def _pairs(option: str, text: str) -> dict[str, float]:
    from math import pi

    from ...base.errors import ArgumentError

    pairs = {}
    for part in text.split(","):
        joint, _, value = (word.strip() for word in part.partition("="))
        turned = option != "--signs" and value.endswith("deg")
        try:
            pairs[joint] = float(value.removesuffix("deg") if turned else value) * (pi / 180 if turned else 1.0)
        except ValueError:
            raise ArgumentError(option, text, 'give pairs like "joint_2=-1, joint_3=-1"') from None
    return pairs


class TaskKind(StrEnum):
    """What the tool must hold."""

    POSE = "pose"
    AXIS = "axis"
    POSITION = "position"


# --- A robot or a job on the command line. A job says of which chain it is, and in which units one prints.


def print_as(job: Job, file: Path) -> None:
    """Print all that follows in the units of a job, the postures of its robot, too."""

    units = job.printed_units
    if units.plain:
        print_by(str)
        return

    @cache
    def joints() -> list[tuple[str, str]]:
        from ..job.job_parts import build_robot

        with contextlib.suppress(HolokinError):  # said where the robot is used
            return [(c.name, c.unit) for c in build_robot(job, file).coordinates]
        return []

    print_by(lambda text: units.reworded(text, joints()))


def _named(name: str | None) -> str | None:
    """What was typed for a robot or a job; of a job its units are those of what is printed from now on."""
    from ...robot import catalogue, is_model

    if name is None or is_model(name) or name in catalogue():
        return name
    from ..job import is_job, open_one_job  # the reader of job files takes 13 MB

    with contextlib.suppress(HolokinError):  # said where it is opened
        if is_job(name):
            print_as(*open_one_job(name)[1:])
    return name


def robot_of_option(name: str, tip: str | None = None, base: str | None = None, trust_units: bool = False) -> Robot:
    """The robot of --robot: of the catalogue, of a file, or of a job. A tip chooses a chain of a model alone.

    Raises:
        as `load` and `robot_of_file`.
    """
    from ...robot import catalogue, is_model, load

    if is_model(name) or name in catalogue():
        return load(name, tip=tip if is_model(name) else None, base=base, trust_units=trust_units)
    from ..job import robot_of_file

    return robot_of_file(name, tip, base, trust_units)


_KNOWN = "Catalogue name, model (.urdf, .xacro, .xml) or .toml file; or a job, whose robot it is."
OneJob = Annotated[
    str, typer.Argument(metavar="JOB", help="A packaged job (`holokin jobs`) or a .toml file.", callback=_named)
]
RobotOrJob = Annotated[str, typer.Argument(metavar="ROBOT|JOB", help=_KNOWN, callback=_named)]
MaybeRobotOrJob = Annotated[str | None, typer.Argument(metavar="[ROBOT|JOB]", help=_KNOWN, callback=_named)]
RobotName = Annotated[str, typer.Option("--robot", metavar="ROBOT|JOB", help=_KNOWN, callback=_named)]
MaybeRobot = Annotated[str | None, typer.Option("--robot", metavar="ROBOT|JOB", help=_KNOWN, callback=_named)]
Tip = Annotated[
    str | None, typer.Option(help="The link that is the tool; by default that of the arm, or of the robot's own table.")
]
Base = Annotated[str | None, typer.Option(help="Of a model: the link that stands still; by default the root.")]
TrustUnits = Annotated[
    bool, typer.Option("--trust-units", help="The robot's numbers are in rad and m, whatever they look like.")
]
Box = Annotated[
    str | None,
    typer.Option(help='Where the tool works: "X Y Z HX HY HZ", centre and half sides [m]; tool down.'),
]
Tilt = Annotated[
    float | None, typer.Option(min=0.0, max=180.0, help="With --box: how far the tool leans to all sides [degrees].")
]
Task = Annotated[
    TaskKind | None, typer.Option(help="What the tool must hold: axis is its point and the direction of an axis.")
]
