"""Another executable of a function of the core from its one source: compiled by numba, asking its dialect, or both.

This file alone knows how. A function is copied with every function of the core that it names. Compiled, enums become
plain integers and the compiler keeps IEEE: no reordering, no contraction. Asking, each `dialect.axis` becomes a look
into a row of numbers that notes which open axis was read first, so that a search knows on what an execution depends.
"""

from __future__ import annotations
import __future__ as future

import ast
import dis
import inspect
import textwrap
import types
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping
from enum import EnumMeta
from functools import lru_cache
from typing import Any

from ahgateway.core.dialect import AXES, Dialect

AXIS_COUNT = len(AXES)
FIRST_ASKED = 2 * AXIS_COUNT
"""Where an asked dialect notes the first open axis that was read, -1 for none; it is the row's last place."""

_PACKAGE = "ahgateway.core"
_PLACES = {name: place for place, name in enumerate(Dialect._fields)}


def ask(dialect: Any, place: int) -> Any:
    """Return the value of an axis, and note the axis when it is open and the first one asked."""
    if dialect[AXIS_COUNT + place] and dialect[FIRST_ASKED] < 0:
        dialect[FIRST_ASKED] = place
    return dialect[place]


def asked_row(fixed: Mapping[str, int]) -> list[int]:
    """Return a dialect to ask: each axis's value, then whether it is open, then the first open one that was read."""
    row = [*[0] * AXIS_COUNT, *[1] * AXIS_COUNT, -1]
    for name, value in fixed.items():
        place = _PLACES[name]
        row[place], row[AXIS_COUNT + place] = int(value), 0
    return row


def njit(*, is_inner: bool = False) -> Any:
    """The compiler, told to keep IEEE: no reordering, no contraction, division as numpy does it.

    What only compiled code calls gets no door from Python: those doors take most of the time to compile.
    """
    from numba import njit as numba_njit

    # numba's own stubs do not know the last two options.
    options: dict[str, Any] = {"no_cpython_wrapper": is_inner, "no_cfunc_wrapper": is_inner}
    return numba_njit(error_model="numpy", fastmath=False, **options)


Keeper = Callable[[Any, Iterable[Any]], None]
"""Keeps what numba's `njit` gave, before it is compiled; the functions compiled with it say which law it is."""

_KEEPERS: list[Keeper] = []


def keep_with(keeper: Keeper | None) -> None:
    """From now on the compiled forms of searches are kept in this way between runs; None keeps none."""
    _KEEPERS[:] = [] if keeper is None else [keeper]


def keep(dispatcher: Any, functions: Iterable[Any]) -> None:
    """Hand a function that will be compiled to whoever keeps them."""
    for keeper in _KEEPERS:
        keeper(dispatcher, functions)


@lru_cache(maxsize=16)
def plain_type(name: str, fields: tuple[str, ...]) -> Any:
    """A NamedTuple of plain numbers, in which enums and dialects pass into compiled code."""
    return namedtuple(name, fields)


class Maker:
    """Makes such copies, each function once.

    Args:
        compiled: Compile them.
        asking: Let them ask their dialect.
        label: Joins the name of every copy. What is kept between runs is linked by these names, and a copy of the same
            name and types would be taken for this one: they must differ where what is copied does.
    """

    def __init__(self, *, compiled: bool, asking: bool = False, label: str = "") -> None:
        self._compiled = compiled
        self._asking = asking
        self._label = label
        self._names: dict[str, Any] = {}
        self._made: dict[Any, Any] = {}

    def give(self, name: str, value: Any) -> None:
        """From now on this stands for a global name."""
        self._names[name] = value

    def give_made(self, name: str, function: Any) -> None:
        """From now on this function, which names nothing of the core, stands for a global name."""
        function.__qualname__ = name + self._label
        self._names[name] = njit(is_inner=True)(function) if self._compiled else function

    @property
    def made(self) -> tuple[Any, ...]:
        """Every function that was copied so far, as it was before."""
        return tuple(self._made)

    def function(self, function: Any, *, is_inner: bool = True) -> Any:
        """Return the copy of a function, and of all that it calls."""
        if function not in self._made:
            scope = {**function.__globals__, "ask": ask}
            code = _asking(function) if self._asking else function.__code__
            for name in _globals(code):
                if name in self._names:
                    scope[name] = self._names[name]
                elif name in scope:
                    scope[name] = self._stand_in(scope[name])
            # Laws hand every argument on; a default dialect would be of another type.
            defaults = None if self._compiled else function.__defaults__
            copy = types.FunctionType(code, scope, function.__name__, defaults, function.__closure__)
            copy.__qualname__ = function.__qualname__ + self._label
            self._made[function] = njit(is_inner=is_inner)(copy) if self._compiled else copy
        return self._made[function]

    def _stand_in(self, value: Any) -> Any:
        """What stands for a global: functions copied, enums as integers, modules name by name."""
        if isinstance(value, types.FunctionType) and value.__module__.startswith(_PACKAGE):
            return self.function(value)
        if isinstance(value, EnumMeta) and self._compiled:
            members: Mapping[str, Any] = value.__members__
            return plain_type(value.__name__, tuple(members))(*[int(member) for member in members.values()])
        if isinstance(value, types.ModuleType) and value.__name__.startswith(_PACKAGE):
            return _Names(value, self)
        return value

    def named(self, module: types.ModuleType, name: str) -> Any:
        """What stands for a name of a module of the core."""
        return self._stand_in(getattr(module, name))


class _Names(types.ModuleType):
    """A module of the core with its functions copied when they are named."""

    def __init__(self, module: types.ModuleType, maker: Maker) -> None:
        super().__init__(module.__name__)
        self._module = module
        self._maker = maker

    def __getattr__(self, name: str) -> Any:
        value = self._maker.named(self._module, name)
        setattr(self, name, value)
        return value


class _Asks(ast.NodeTransformer):
    """Turn each `dialect.axis` into a question."""

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.value, ast.Name) and node.value.id == "dialect" and node.attr in _PLACES:
            place = ast.Constant(_PLACES[node.attr])
            return ast.copy_location(ast.Call(ast.Name("ask", ast.Load()), [node.value, place], []), node)
        return node


def _asking(function: Any) -> types.CodeType:
    """The code of a function in which its dialect is asked."""
    tree = _Asks().visit(ast.parse(textwrap.dedent(inspect.getsource(function))))
    ast.fix_missing_locations(tree)
    module = compile(tree, function.__code__.co_filename, "exec", future.annotations.compiler_flag)
    return next(each for each in module.co_consts if isinstance(each, types.CodeType))


def _globals(code: types.CodeType) -> set[str]:
    """Every global that a function names."""
    found = {str(each.argval) for each in dis.get_instructions(code) if each.opname == "LOAD_GLOBAL"}
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            found |= _globals(each)
    return found
