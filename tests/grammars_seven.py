"""Programs of arms of seven axes: their grammar is read, or their Python is run with the maker's calls recorded.

KUKA: "Sunrise.OS" (a class of RoboticsAPIApplication with ptp and SplineJP of targets). UFACTORY: xArm-Python-SDK 1.18,
doc/api/xarm_api.md. Franka: pylibfranka 0.21. Kinova: Kortex API.
"""

from __future__ import annotations

import ast
import re
import sys
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np

from grammars import REAL, GrammarError, Parsed
from holokin.export import Program


def sunrise(text: str, speeds: np.ndarray) -> Parsed:
    """A class of ptp and SplineJP; greatest speeds of the axes [degrees/s]. `java` compiles and runs it."""
    if not text.isascii() or max(map(len, text.splitlines())) > 120:
        raise GrammarError("a long line, or letters of another alphabet")
    frame = r"package application;\n\n(.*)public class (\w+) extends RoboticsAPIApplication (\{.*\})\n"
    head = re.fullmatch(frame, text, re.S)
    if head is None or head[3].count("{") != head[3].count("}"):
        raise GrammarError("frame of the class")
    table = re.search(r"double\[\]\[\] TARGETS = \{\n(.*?)\n    \};", head[3], re.S)
    run = re.search(r"public void run\(\) \{\n(.*?)\n    \}", head[3], re.S)
    if table is None or run is None:
        raise GrammarError("no targets, or no run")
    rows = [re.fullmatch(rf" +\{{((?:{REAL}, ){{7}}{REAL})\}},", line) for line in table[1].splitlines()]
    known = np.array([[float(x) for x in row[1].split(", ")] for row in rows])  # type: ignore[index]
    made = Parsed(head[2], known[:, :7], [], [], re.findall(r"^// (.*)$", head[1], re.M))
    made.stops = [False] * len(known)
    reached = 0
    for line in map(str.strip, run[1].splitlines()):
        if found := re.fullmatch(r"lbr\.move\(spline\((\d+), (\d+)\)\);", line):
            if int(found[1]) != reached or int(found[2]) < reached:
                raise GrammarError(line)
            reached = int(found[2]) + 1
            made.stops[reached - 1] = True
        elif line == "lbr.move(target(0));" and not reached:
            reached, made.stops[0] = 1, True
        elif re.fullmatch(r"ThreadUtil\.milliSleep\(\d+\);|\w+\.set\w+\(.*\);", line):
            made.lines.append((reached, line))
        else:
            raise GrammarError(line)
    if reached != len(known) or not ((known[:, 7] > 0) & (known[:, 7] <= 1)).all():
        raise GrammarError("targets that are not reached, or shares of no speed")
    made.kinds = ["joint"] * (len(known) - 1)
    made.speeds = [np.nan] * (len(known) - 1)
    shares = (np.abs(np.diff(made.axes, axis=0)) / speeds).max(axis=1)
    made.seconds = (shares / known[1:, 7]).tolist()
    return made


@contextmanager
def _modules(**given: ModuleType):
    modules = {name.replace("__", "."): module for name, module in given.items()}
    kept = {name: sys.modules[name] for name in modules if name in sys.modules}
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name in modules:
            del sys.modules[name]
        sys.modules.update(kept)


def xarm(program: Program, refuses: int | None = None) -> Parsed:
    """What a program asks of the arm, by the rules of the SDK; the call of number `refuses` answers with an error."""
    made = Parsed("", np.zeros(0), [], [], (ast.get_docstring(ast.parse(program.text)) or "").splitlines()[:5])
    axes: list[list[float]] = []
    asked: list[str] = []

    class XArmAPI:
        def __init__(self, ip: str) -> None:
            self.state, self.mode = 4, None

        def _answer(self, what: str) -> int:
            asked.append(what)
            return 9 if refuses is not None and len(asked) > refuses else 0

        def disconnect(self) -> None:
            asked.append("end")

        def motion_enable(self, enable: bool) -> int:
            return self._answer("enable")

        def set_mode(self, mode: int) -> int:
            self.mode = mode
            return self._answer("mode")

        def set_state(self, state: int) -> int:
            self.state = state
            return self._answer("state")

        def set_cgpio_digital(self, ionum: int, value: int) -> int:
            made.lines.append((len(axes), f"output {ionum} {value}"))
            return self._answer("output")

        def set_pause_time(self, sltime: float) -> int:
            made.lines.append((len(axes), f"pause {sltime:g}"))
            return self._answer("pause")

        def set_servo_angle(self, *, angle, speed, mvacc, is_radian, radius, wait) -> int:
            if (
                (self.mode, self.state) != (0, 0)
                or is_radian
                or not 0.0057 <= speed <= 180
                or not 0.573 <= mvacc <= 1146
            ):
                raise GrammarError(f"a move in mode {self.mode}, state {self.state}, at {speed} and {mvacc}")
            if (radius is None) != wait or len(angle) != 7:
                raise GrammarError(f"{radius} {wait} {angle}")
            if axes:
                made.seconds.append(float(np.abs(np.subtract(angle, axes[-1])).max()) / speed)
            axes.append(list(angle))
            made.stops.append(radius is None)
            return self._answer("move")

    module = ModuleType("xarm.wrapper")
    module.XArmAPI = XArmAPI  # type: ignore[attr-defined]
    argv, sys.argv = sys.argv, ["program.py", "192.168.1.200"]
    try:
        with _modules(xarm=ModuleType("xarm"), xarm__wrapper=module):
            exec(compile(program.text, "program.py", "exec"), {"__name__": "__main__"})
    except SystemExit as ended:
        made.lines.append((len(axes), str(ended)))
    finally:
        sys.argv = argv
    made.axes = np.array(axes)
    made.kinds = ["joint"] * len(made.seconds)
    made.speeds = [np.nan] * len(made.seconds)
    return made


def franka(program: Program, folder: Path, at: np.ndarray, lost: int | None = None) -> list[np.ndarray]:
    """The joints (k, 7) that a program commands, a row a millisecond, in each of its motions.

    Args:
        at: where the robot rests before. lost: the cycle of whose message nothing is heard.
    """
    played: list[list[np.ndarray]] = []

    class JointPositions:
        def __init__(self, q: list[float]) -> None:
            self.q, self.motion_finished = q, False
            if len(q) != 7 or not all(type(x) is float for x in q):
                raise GrammarError(f"{q}")

    class Control:
        def __init__(self) -> None:
            self.cycle, self.open = 0, False
            played.append([])

        def readOnce(self) -> tuple[SimpleNamespace, SimpleNamespace]:
            if self.open or self.cycle < 0:
                raise GrammarError("a cycle without an answer, or after the end")
            self.open = True
            late = 2e-3 if self.cycle == lost else 1e-3
            seconds = late if self.cycle else 0.0
            return SimpleNamespace(), SimpleNamespace(to_sec=lambda: seconds)

        def writeOnce(self, command: JointPositions) -> None:
            self.open, self.cycle = False, -1 if command.motion_finished else self.cycle + 1
            played[-1].append(np.array(command.q))

    class Robot:
        def __init__(self, ip: str) -> None:
            pass

        def read_once(self) -> SimpleNamespace:
            return SimpleNamespace(q_d=at.tolist())

        def start_joint_position_control(self, mode: str) -> Control:
            return Control()

    module = ModuleType("pylibfranka")
    module.JointPositions, module.Robot = JointPositions, Robot  # type: ignore[attr-defined]
    module.ControllerMode = SimpleNamespace(JointImpedance="joints")  # type: ignore[attr-defined]
    file = program.save(folder)[0]
    argv, sys.argv = sys.argv, [str(file), "172.16.0.2"]
    try:
        with _modules(pylibfranka=module):
            exec(compile(program.text, str(file), "exec"), {"__name__": "__main__", "__file__": str(file)})
    finally:
        sys.argv = argv
    for before, after in pairwise([[at], *played]):
        if np.abs(before[-1] - after[0]).max() > 1e-9:
            raise GrammarError("a motion that begins elsewhere")
    return [np.array(rows) for rows in played]


class Message(SimpleNamespace):
    """Of protobuf: fields that are made when they are asked for, and lists to which `add` adds."""

    def __getattr__(self, name: str) -> Message:
        if name.startswith("_"):
            raise AttributeError(name)
        made = Message(items=[])
        setattr(self, name, made)
        return made

    def add(self, **fields: object) -> None:
        self.items.append(SimpleNamespace(**fields))


def kinova(program: Program, folder: Path, aborts: bool = False) -> tuple[list[float], np.ndarray, np.ndarray]:
    """(the angles of the move to the start, times (k,), the rows (k, 3 n) of the trajectory), by the Kortex API."""
    asked: list[Message] = []
    heard: list = []

    class BaseClient:
        def __init__(self, router: object) -> None:
            pass

        def OnNotificationActionTopic(self, hear, options: object) -> int:
            heard.append(hear)
            return 1

        def Unsubscribe(self, handle: int) -> None:
            heard.pop()

        def ExecuteAction(self, action: Message) -> None:
            asked.append(action)
            heard[-1](SimpleNamespace(action_event="end"))

        def PlayPreComputedJointTrajectory(self, trajectory: Message) -> None:
            asked.append(trajectory)
            heard[-1](SimpleNamespace(action_event="abort" if aborts else "end"))

        def GetTrajectoryErrorReport(self) -> str:
            return "no trajectory for this arm"

    class Router:
        basicErrorCallback = None

        def __init__(self, transport: object, callback: object) -> None:
            pass

    def named(**members: object) -> ModuleType:
        module = ModuleType("of Kortex")
        module.__dict__.update(members)
        return module

    kinds = {"Action": Message, "PreComputedJointTrajectory": Message, "NotificationOptions": Message}
    words = {"ACTION_END": "end", "ACTION_ABORT": "abort", "JOINT_CONSTRAINT_SPEED": "speed"}
    base = named(**kinds, **words, TRAJECTORY_CONTINUITY_MODE_POSITION="position")
    messages = named(Base_pb2=base, Session_pb2=named(CreateSessionInfo=Message))
    manager = type(
        "Manager", (), {"__init__": lambda *_: None, "CreateSession": lambda *_: None, "CloseSession": lambda *_: None}
    )
    transport = type("Transport", (), {"connect": lambda *_: None, "disconnect": lambda *_: None})
    parts = {
        "kortex_api": named(), "kortex_api__autogen": named(), "kortex_api__autogen__client_stubs": named(),
        "kortex_api__autogen__client_stubs__BaseClientRpc": named(BaseClient=BaseClient),
        "kortex_api__autogen__messages": messages, "kortex_api__RouterClient": named(RouterClient=Router),
        "kortex_api__SessionManager": named(SessionManager=manager),
        "kortex_api__TCPTransport": named(TCPTransport=transport),
    }  # fmt: skip
    file = program.save(folder)[0]
    argv, sys.argv = sys.argv, [str(file), "192.168.1.10", "user", "word"]
    try:
        with _modules(**parts):
            exec(compile(program.text, str(file), "exec"), {"__name__": "__main__", "__file__": str(file)})
    finally:
        sys.argv = argv
    action, trajectory = asked
    start = [angle.value for angle in action.reach_joint_angles.joint_angles.joint_angles.items]
    if trajectory.mode != "position" or action.reach_joint_angles.constraint.value != 10.0:
        raise GrammarError("the mode of the trajectory, or the speed to its start")
    elements = trajectory.trajectory_elements.items
    rows = [[*e.joint_angles, *e.joint_speeds, *e.joint_accelerations] for e in elements]
    return start, np.array([e.time_from_start for e in elements]), np.array(rows)
