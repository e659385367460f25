"""Expands a xacro file in a process of its own, and takes its expressions for data: nothing of the file is run.

`xacro.py` runs this file as a program, with limits on time and memory. The package xacro hands expressions to Python's
`eval`, and keeps a few names from them; there are ways round that. Here an interpreter of its own walks their syntax
tree: what it does not know it refuses, and it takes no attribute of an object, but an entry of a namespace or a
dictionary, or one of the methods named below. It imports nothing of holokin, so that the process starts quickly.
"""

from __future__ import annotations

import ast
import json
import operator
import os
import re
import string
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

PATIENCE = 30
"""Seconds of processor time that an expansion may take. Those of robots with four arms take less than two."""

MEMORY = 4_000_000_000
"""Bytes of memory that it may take, where the system can limit them (Linux)."""

LONGEST_TEXT = 50_000_000
"""Bytes of the expanded text: as of a URDF."""

BITS = 100_000
"""Bits of the largest whole number that a power or a shift may give; 9**9**9 has 1.2 thousand million."""

LENGTH = 1_000_000
"""Items of the longest list or text that an expression may give, and of the longest range."""

Operators = dict[type, Callable[..., Any]]


def _operators(names: str, functions: str) -> Operators:
    """The nodes of some names in Python's syntax -> the functions of module `operator` that do the same."""
    return {getattr(ast, n): getattr(operator, f) for n, f in zip(names.split(), functions.split(), strict=True)}


_BINARY = _operators(
    "Add Sub Mult Div FloorDiv Mod Pow LShift RShift BitOr BitXor BitAnd",
    "add sub mul truediv floordiv mod pow lshift rshift or_ xor and_",
)
_UNARY = _operators("UAdd USub Not Invert", "pos neg not_ invert")
_COMPARISONS = {
    **_operators("Eq NotEq Lt LtE Gt GtE Is IsNot", "eq ne lt le gt ge is_ is_not"),
    ast.In: lambda part, whole: part in whole,
    ast.NotIn: lambda part, whole: part not in whole,
}
_CONVERSIONS: dict[int, Callable[[Any], Any]] = {-1: lambda v: v, ord("s"): str, ord("r"): repr, ord("a"): ascii}

_OF_TEXT = (
    "capitalize count endswith find format index isalpha isdigit join lower lstrip partition replace rfind rsplit "
    "rstrip split startswith strip title upper zfill"
)
_METHODS: dict[type, set[str]] = {
    str: set(_OF_TEXT.split()),
    dict: {"get", "items", "keys", "values"},
    list: {"append", "count", "extend", "index"},
    tuple: {"count", "index"},
}
"""The methods that an expression may call, of values of the built-in types and what is derived from them."""

_UNSAFE = ("type", "vars")
"""Functions that xacro offers which lead from values to Python's own machinery."""


class Refused(Exception):
    """An expression asks for what is not evaluated. The sentence says what."""


class _Format(string.Formatter):
    """As `str.format`, whose fields can name attributes ('{0.__class__}') and have any width; here they cannot."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        """As of `string.Formatter`. Raises: Refused: of a field with a part."""
        if set(field_name) & set(".["):
            raise Refused(f"the field {{{field_name}}} of a format names a part of a value")
        return super().get_field(field_name, args, kwargs)

    def format_field(self, value: Any, format_spec: str) -> Any:
        """As of `string.Formatter`. Raises: Refused: of a wide field."""
        _refuse_wide(format_spec)
        return super().format_field(value, format_spec)


class Method:
    """A method of a value, to be called only."""

    def __init__(self, value: Any, name: str):
        self._call = getattr(value, name)
        self._value, self._name = value, name
        if isinstance(value, str) and name == "format":
            self._call = lambda *args, **kwargs: _Format().vformat(value, args, kwargs)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """What the method gives. Raises: Refused: a text that would be too long."""
        if self._name == "zfill":
            _refuse_long(args[0] if args and isinstance(args[0], int) else 0)
        elif self._name == "replace" and len(args) > 1 and isinstance(args[1], str):
            _refuse_long(self._value.count(args[0]) * len(args[1]))
        elif self._name == "join" and args:
            args = (list(args[0]),)
            _refuse_long(sum(len(self._value) + len(item) for item in args[0] if isinstance(item, str)))
        return self._call(*args, **kwargs)


class Interpreter:
    """Evaluates expressions over names, with the functions that may be called, and the classes of its namespaces."""

    def __init__(self, functions: Iterable[Any], namespaces: tuple[type, ...] = ()):
        self._functions = {id(function): function for function in functions}  # an id holds as long as its owner lives
        self._namespaces = namespaces

    def also(self, functions: Iterable[Any]) -> Interpreter:
        """The same with more functions."""
        return Interpreter([*self._functions.values(), *functions], self._namespaces)

    def evaluate(self, text: str, names: Any) -> Any:
        """The value of an expression. Raises: Refused, SyntaxError, and what Python raises of such operations."""
        return self._value(ast.parse(text.strip(), mode="eval").body, names)

    def _value(self, node: ast.expr, names: Any) -> Any:
        handler = getattr(self, f"_of_{type(node).__name__}", None)
        if handler is None:
            raise Refused(f"it holds {_WORDS.get(type(node), f'what Python calls {type(node).__name__}')}")
        value = handler(node, names)
        if isinstance(value, str | bytes | list | tuple):
            _refuse_long(len(value))
        return value

    def _of_Constant(self, node: ast.Constant, _names: Any) -> Any:
        return node.value

    def _of_Name(self, node: ast.Name, names: Any) -> Any:
        _refuse_hidden(node.id)
        try:
            return names[node.id]
        except KeyError:
            raise NameError(f"name {node.id!r} is not defined") from None

    def _of_Attribute(self, node: ast.Attribute, names: Any) -> Any:
        _refuse_hidden(node.attr)
        value = self._value(node.value, names)
        if isinstance(value, self._namespaces):
            try:
                return value[node.attr]
            except KeyError:
                raise NameError(f"name {node.attr!r} is not defined") from None
        for kind, known in _METHODS.items():
            if isinstance(value, kind) and node.attr in known:
                return Method(value, node.attr)
        if isinstance(value, dict):
            try:
                return value[node.attr]
            except KeyError:
                raise AttributeError(f"the dictionary has no key {node.attr!r}") from None
        raise Refused(f"it asks a {type(value).__name__} for its {node.attr!r}")

    def _of_Subscript(self, node: ast.Subscript, names: Any) -> Any:
        value = self._value(node.value, names)
        if isinstance(node.slice, ast.Slice):
            parts = (node.slice.lower, node.slice.upper, node.slice.step)
            return value[slice(*(None if part is None else self._value(part, names) for part in parts))]
        return value[self._value(node.slice, names)]

    def _of_Call(self, node: ast.Call, names: Any) -> Any:
        function = self._value(node.func, names)
        if not isinstance(function, Method) and id(function) not in self._functions:
            raise Refused(f"it calls what is no function of xacro, {type(function).__name__}")
        args = list(self._items(node.args, names))
        kwargs: dict[str, Any] = {}
        for keyword in node.keywords:
            value = self._value(keyword.value, names)
            kwargs |= value if keyword.arg is None else {keyword.arg: value}
        return function(*args, **kwargs)

    def _of_BinOp(self, node: ast.BinOp, names: Any) -> Any:
        if type(node.op) not in _BINARY:
            raise Refused("it holds the operator @")
        left, right = self._value(node.left, names), self._value(node.right, names)
        _refuse_large(node.op, left, right)
        return _BINARY[type(node.op)](left, right)

    def _of_UnaryOp(self, node: ast.UnaryOp, names: Any) -> Any:
        return _UNARY[type(node.op)](self._value(node.operand, names))

    def _of_BoolOp(self, node: ast.BoolOp, names: Any) -> Any:
        value: Any = None
        for part in node.values:
            value = self._value(part, names)
            if bool(value) == isinstance(node.op, ast.Or):
                break
        return value

    def _of_Compare(self, node: ast.Compare, names: Any) -> Any:
        left, result = self._value(node.left, names), True
        for op, part in zip(node.ops, node.comparators, strict=True):
            other = self._value(part, names)
            result = _COMPARISONS[type(op)](left, other)
            if not result:
                break
            left = other
        return result

    def _of_IfExp(self, node: ast.IfExp, names: Any) -> Any:
        return self._value(node.body if self._value(node.test, names) else node.orelse, names)

    def _of_Tuple(self, node: ast.Tuple | ast.List | ast.Set, names: Any) -> Any:
        return {ast.Tuple: tuple, ast.List: list, ast.Set: set}[type(node)](self._items(node.elts, names))

    _of_List = _of_Set = _of_Tuple

    def _of_Dict(self, node: ast.Dict, names: Any) -> Any:
        table: dict[Any, Any] = {}
        for key, part in zip(node.keys, node.values, strict=True):
            value = self._value(part, names)
            table |= value if key is None else {self._value(key, names): value}
        return table

    def _of_JoinedStr(self, node: ast.JoinedStr, names: Any) -> Any:
        return "".join(self._value(part, names) for part in node.values)

    def _of_FormattedValue(self, node: ast.FormattedValue, names: Any) -> Any:
        value = _CONVERSIONS[node.conversion](self._value(node.value, names))
        return _Format().format_field(value, "" if node.format_spec is None else self._value(node.format_spec, names))

    def _items(self, nodes: list[ast.expr], names: Any) -> Iterator[Any]:
        for node in nodes:
            if isinstance(node, ast.Starred):
                yield from self._value(node.value, names)
            else:
                yield self._value(node, names)


_WORDS: dict[type, str] = {
    **dict.fromkeys((ast.ListComp, ast.SetComp, ast.DictComp), "a comprehension"),
    ast.Lambda: "a lambda",
    ast.GeneratorExp: "a generator",
    ast.NamedExpr: "an assignment",
}


def _refuse_hidden(name: str) -> None:
    if name.startswith("__"):
        raise Refused(f"it names {name}")


def _refuse_large(op: ast.operator, left: Any, right: Any) -> None:
    """Whole numbers and lists that fill the memory before any limit is met."""
    if isinstance(left, int) and isinstance(right, int):
        bits = right * left.bit_length() if isinstance(op, ast.Pow) and abs(left) > 1 else 0
        bits = left.bit_length() + right if isinstance(op, ast.LShift) else bits
        if bits > BITS:
            raise Refused(f"it gives a whole number of {bits} bits" if bits < 2**64 else "it gives too long a number")
    if isinstance(op, ast.Mult):
        for items, count in ((left, right), (right, left)):
            if isinstance(items, str | bytes | list | tuple) and isinstance(count, int):
                _refuse_long(len(items) * count)
    if isinstance(op, ast.Mod) and isinstance(left, str | bytes):
        form = re.sub(r"\(\w*\)", "", str(left))  # plain names of a dictionary may hold digits; of others they count
        sizes = form if isinstance(right, dict) else " ".join(re.findall(r"%%|%([-#0 +\d.*]*)", form))
        values = right if isinstance(right, tuple) else (right,)
        _refuse_wide(sizes, [v for v in values if isinstance(v, int)] if "*" in sizes else [])


def _refuse_wide(sizes: str, more: Iterable[int] = ()) -> None:
    """Formats whose widths and precisions, in digits or given beside them, add up to a long text."""
    _refuse_long(sum(min(float(digits), 1e300) for digits in re.findall(r"\d+", sizes)) + sum(map(abs, more)))


def _refuse_long(length: float) -> None:
    if length > LENGTH:
        raise Refused(f"it gives a list or a text of {length:.6g} items")


def _short_range(*args: int) -> range:
    values = range(*args)
    if values.start != values.stop and abs((values.stop - values.start) // values.step) > LENGTH:
        raise Refused(f"it gives a range of more than {LENGTH} numbers")
    return values


def xacro_interpreter(xacro: Any) -> Interpreter:
    """The interpreter of the expressions of the package xacro, whose table of names loses what is not safe."""
    table = xacro._global_symbols
    for name in _UNSAFE:
        dict.pop(table["python"], name, None)
    for names in (table, table["python"]):
        dict.__setitem__(names, "range", _short_range)
    spaces = [table, *(value for value in dict.values(table) if isinstance(value, xacro.NameSpace))]
    functions = [value for space in spaces for value in dict.values(space) if callable(value)]
    return Interpreter(functions, (xacro.NameSpace,))


def _substitutions(interpreter: Interpreter, given: Any, xacro: Any) -> Callable[[str, Mapping[str, Any]], str]:
    """What $(eval ...) becomes: of the arguments, `arg`, `env`, `find` and the functions that ${...} has."""
    python = dict(dict.items(xacro._global_symbols["python"]))

    def evaluate(text: str, context: Mapping[str, Any]) -> str:
        values = context.get("arg", {})
        arguments = {name: given.convert_value(value, "auto") for name, value in values.items()}
        values.asked.update(name for name in arguments if name in text)
        own = {"env": given._eval_env, "optenv": given._eval_optenv, "find": given._eval_find}
        own["arg"] = arguments.__getitem__
        math = dict(dict.items(xacro._global_symbols["math"]))
        names = {**arguments, **math, **python, "true": True, "false": False, **own}
        return str(interpreter.also(own.values()).evaluate(text, names))

    return evaluate


_TOO_MUCH: dict[type, str] = {
    RecursionError: "it is nested too deep, or contains itself",
    MemoryError: f"it needs more than {MEMORY:,} bytes of memory",
}


class _Given(dict):
    """Values of arguments, which remembers all names that a file declares or asks for."""

    def __init__(self, args: Mapping[str, str]):
        super().__init__(args)
        self.asked: set[str] = set()

    def __contains__(self, name: Any) -> bool:
        self.asked.add(name)
        return super().__contains__(name)

    def __getitem__(self, name: Any) -> Any:
        self.asked.add(name)
        return super().__getitem__(name)


def answer(path: Path, args: Mapping[str, str]) -> dict[str, Any]:
    """The expanded text of a file, {"text"}, with its "macros", and the arguments that it has, "known"; else why not.

    That is {"fault"}, with "file" and "expression" where one is refused, or with the "package" that is not found. It
    changes the package xacro for good, and the folder it runs in: for a process of its own.
    """
    import xacro
    from xacro import substitution_args
    from xacrodoc import XacroDoc
    from xacrodoc.packages import PackageNotFoundError

    # Its expressions go to the interpreter, which notes what it refuses, and where.
    interpreter = xacro_interpreter(xacro)
    refused: dict[str, str] = {}

    def noting_refusals(evaluate: Callable[[str], Any], text: str) -> Any:
        try:
            return evaluate(text)
        except (Refused, MemoryError, RecursionError) as problem:
            fact = str(problem) if isinstance(problem, Refused) else _TOO_MUCH[type(problem)]
            if not refused:  # one of a YAML file is met again in the expression that reads it
                where = next((name for name in reversed(xacro.filestack or []) if name), path.name)
                refused.update(fault=fact, expression=text.strip(), file=str(where))
            raise

    substitute = _substitutions(interpreter, substitution_args, xacro)
    xacro.safe_eval = lambda text, names, _locals=None: noting_refusals(lambda t: interpreter.evaluate(t, names), text)
    substitution_args._eval = lambda text, context: noting_refusals(lambda t: substitute(t, context), text)
    # The package notes the macros and arguments that it meets, and expands.
    given, macros, grab = _Given(args), [], xacro.grab_macro
    xacro.grab_macro = lambda element, table: (macros.append(element.getAttribute("name")), grab(element, table))
    os.chdir(path.parent)  # from where xacro looks for files that are named without a package
    try:
        text = XacroDoc.from_file(path.name, subargs=given, resolve_packages=False).dom.toxml()
    except (RecursionError, MemoryError) as problem:
        return {"fault": _TOO_MUCH[type(problem)]}
    except Exception as problem:  # noqa: BLE001  xacro, and what it calls, raise anything
        cause = problem
        while isinstance(inner := getattr(cause, "exc", None), Exception):  # xacro wraps what it meets
            cause = inner
        if isinstance(cause, PackageNotFoundError):
            return {"fault": str(cause), "package": " ".join(map(str, cause.args))}
        message = re.sub(r"<class '[\w.]+'>: ", "", str(problem)).strip()
        return refused or {"fault": message or type(problem).__name__}
    if len(text) > LONGEST_TEXT:
        return {"fault": f"it gives more than {LONGEST_TEXT:,} characters"}
    return {"text": text, "macros": macros, "known": sorted(given.asked)}


def main() -> None:
    """Read {"path", "args"} from the standard input, write the answer to the standard output."""
    sys.path[:] = [os.path.abspath(entry) for entry in sys.path]  # no module out of the folder of the file
    reply, sys.stdout = sys.stdout.buffer, sys.stderr  # xacro prints
    with suppress(ImportError, ValueError, OSError):  # where the system can limit a process
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    asked = json.loads(sys.stdin.buffer.read())
    reply.write(json.dumps(answer(Path(asked["path"]), asked["args"])).encode())
    reply.flush()


if __name__ == "__main__":
    main()
