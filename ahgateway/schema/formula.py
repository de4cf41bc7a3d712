"""Comparisons that a person writes over operands, `abs(PV - SV) < 0.5 and MV <= MV_MAX`: read, checked, evaluated.

The grammar is the whole of it: numbers, names, + - * /, comparisons, and, or, not, abs, min, max. Nothing else is ever
carried out, whatever the text says. It is a subset of Python's, so Python's own parser reads it.
"""

from __future__ import annotations

import ast
import operator
import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache
from math import isfinite, isnan
from typing import Any

LENGTH_MAX = 500
"""Longest text in characters; what people write has one line."""

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_COMPARED: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
}
_CALLS: dict[str, tuple[Callable[..., Any], int, int]] = {"abs": (abs, 1, 1), "min": (min, 2, 9), "max": (max, 2, 9)}


def names_of(text: str) -> frozenset[str]:
    """Return the names that a comparison uses.

    Raises:
        ValueError: It is no comparison of this grammar; the message says what is in the way.
    """
    tree = _tree(text)
    _check(tree, text.strip())
    if not isinstance(tree, ast.Compare | ast.BoolOp) and not _is_negation(tree):
        raise ValueError("a comparison is wanted, `abs(PV - SV) < 0.5`")
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    return frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called)


def holds(text: str, values: Mapping[str, float | bool]) -> bool:
    """Tell whether a comparison holds for these values; where it meets a division by 0 or a NaN it does not."""
    try:
        return bool(_value(_tree(text), values))
    except (ZeroDivisionError, _NoNumberError):
        return False


class _NoNumberError(Exception):
    """A NaN is compared: neither that nor its negation says anything."""


@lru_cache
def _tree(text: str) -> ast.expr:
    if len(text) > LENGTH_MAX:
        raise ValueError(f"it has {len(text)} characters, at most {LENGTH_MAX} are read")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what Python thinks of `MV<50and PV>3` is no news for a technician
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError("it cannot be read") from error


def _is_negation(tree: ast.expr) -> bool:
    return isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.Not)


def _check(node: ast.expr, text: str) -> None:
    if isinstance(node, ast.BoolOp):
        parts = node.values
    elif isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        parts = [node.left, node.right]
    elif isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        parts = [node.operand]
    elif isinstance(node, ast.Compare) and all(type(each) in _COMPARED for each in node.ops):
        parts = [node.left, *node.comparators]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _CALLS:
        _, least, most = _CALLS[node.func.id]
        if node.keywords or not least <= len(node.args) <= most:
            raise ValueError(f"`{node.func.id}` takes {least if least == most else f'{least}…{most}'} values")
        parts = node.args
    elif isinstance(node, ast.Name) or (isinstance(node, ast.Constant) and _is_number(node.value)):
        return
    else:
        raise ValueError(
            f"`{ast.get_source_segment(text, node)}` is not allowed, allowed are numbers, operands, + - * /, "
            "< <= > >= == !=, and, or, not, abs, min, max"
        )
    for part in parts:
        _check(part, text)


def _is_number(value: object) -> bool:
    try:
        return isinstance(value, int | float) and isfinite(value)
    except OverflowError:  # a whole number beyond binary64
        return False


def _value(node: ast.expr, values: Mapping[str, float | bool]) -> Any:
    if isinstance(node, ast.Constant):
        assert isinstance(node.value, int | float)
        return float(node.value)  # whole numbers would grow without end
    if isinstance(node, ast.Name):
        return values[node.id]
    if isinstance(node, ast.BoolOp):
        wanted = isinstance(node.op, ast.Or)
        return wanted if any(bool(_value(each, values)) is wanted for each in node.values) else not wanted
    if isinstance(node, ast.UnaryOp):
        return _UNARY[type(node.op)](_value(node.operand, values))
    if isinstance(node, ast.BinOp):
        return _BINARY[type(node.op)](_value(node.left, values), _value(node.right, values))
    if isinstance(node, ast.Compare):
        left = _value(node.left, values)
        for each, comparator in zip(node.ops, node.comparators, strict=True):
            right = _value(comparator, values)
            if isnan(left) or isnan(right):
                raise _NoNumberError
            if not _COMPARED[type(each)](left, right):
                return False
            left = right
        return True
    assert isinstance(node, ast.Call), "`names_of` lets nothing else through"
    assert isinstance(node.func, ast.Name)
    return _CALLS[node.func.id][0](*[_value(each, values) for each in node.args])
