"""Structured Text as the fake PLC runs it: the very text that `plc-code` writes, bound to the memory once.

Only what that text uses is understood: `device := expression;`, IF with THEN, ELSIF, ELSE and END_IF, the comparisons,
`+`, AND, OR, NOT, TRUE, FALSE, numbers and 16#…, words of an array, comments. Words are unsigned and wrap at
65536. What it does not understand is refused when the text is read, not when it runs.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from ahgateway.codec.devices import parse_device
from ahgateway.errors import CodecError, StateError
from ahgateway.fake.memory import Memory, Words

Expression = Callable[[], int]
Statement = Callable[[], None]

_TOKEN = re.compile(
    r"\s+|\(\*.*?\*\)|(?P<token>16#[0-9A-Fa-f]+|\d+|[A-Za-z_][A-Za-z_0-9]*(?:\.\d+)?|:=|<>|<=|>=|[=<>+();\[\]])",
    re.DOTALL,
)
_COMPARE: dict[str, Callable[[int, int], bool]] = {
    "=": operator.eq, "<>": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_ENDS = frozenset({"ELSE", "ELSIF", "END_IF", ""})
WORD = 0xFFFF


def program(text: str, memory: Memory, arrays: Mapping[str, Words] | None = None) -> Statement:
    """Return what one call of the text does to the memory.

    Args:
        text: Structured Text.
        memory: The PLC's memory.
        arrays: Arrays of words that the text takes for declared, by name.

    Raises:
        StateError: The text uses what this subset has not, or a device that the map has not.
    """
    return _Reader(text, memory, arrays or {}).program()


class _Reader:
    """Recursive descent over the tokens; every rule returns what it does, bound to the memory."""

    def __init__(self, text: str, memory: Memory, arrays: Mapping[str, Words]) -> None:
        self._memory = memory
        self._arrays = arrays
        self._tokens = list(_tokens(text))
        self._at = 0

    def program(self) -> Statement:
        found = self._statements()
        if self._next:
            raise StateError(f"structured text: `{self._next}` stands where a statement belongs")
        return found

    @property
    def _next(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def _take(self, wanted: str = "") -> str:
        found = self._next
        if not found or (wanted and found != wanted):
            raise StateError(f"structured text: `{found}` stands where `{wanted or 'something'}` belongs")
        self._at += 1
        return found

    def _statements(self) -> Statement:
        found: list[Statement] = []
        while self._next not in _ENDS:
            found.append(self._branch("IF") if self._next == "IF" else self._assignment())
        steps = tuple(found)

        def run() -> None:
            for step in steps:
                step()

        return run

    def _branch(self, word: str) -> Statement:
        self._take(word)
        condition = self._expression()
        self._take("THEN")
        then, otherwise = self._statements(), _nothing
        if self._next == "ELSIF":
            otherwise = self._branch("ELSIF")
        else:
            if self._next == "ELSE":
                self._take("ELSE")
                otherwise = self._statements()
            self._take("END_IF")
            self._take(";")

        def run() -> None:
            (then if condition() else otherwise)()

        return run

    def _assignment(self) -> Statement:
        put = self._device(self._take())[1]
        self._take(":=")
        value = self._expression()
        self._take(";")
        return lambda: put(value())

    def _expression(self) -> Expression:
        return self._either("OR", partial(self._either, "AND", self._comparison))

    def _either(self, word: str, part: Callable[[], Expression]) -> Expression:
        found = [part()]
        while self._next == word:
            self._take(word)
            found.append(part())
        if len(found) == 1:
            return found[0]
        parts, decide = tuple(found), any if word == "OR" else all
        return lambda: decide(each() for each in parts)

    def _comparison(self) -> Expression:
        if self._next == "NOT":
            self._take("NOT")
            inner = self._comparison()
            return lambda: not inner()
        left = self._sum()
        if self._next not in _COMPARE:
            return left
        holds = _COMPARE[self._take()]
        right = self._sum()
        return lambda: holds(left(), right())

    def _sum(self) -> Expression:
        found = self._value()
        while self._next == "+":
            self._take("+")
            found = _added(found, self._value())
        return found

    def _value(self) -> Expression:
        token = self._take()
        if token == "(":
            inner = self._expression()
            self._take(")")
            return inner
        if token in ("TRUE", "FALSE"):
            return partial(int, token == "TRUE")
        if token[0].isdigit():
            return partial(int, int(token[3:], 16) if token.startswith("16#") else int(token))
        return self._device(token)[0]

    def _device(self, name: str) -> tuple[Expression, Callable[[int], None]]:
        """What reads a word or a flag, and what writes it."""
        if name in self._arrays:
            return self._element(self._arrays[name])
        try:
            device = parse_device(name)
            place = self._memory.devices.address(device)
        except CodecError as error:
            raise StateError(f"structured text: {error.message}") from error
        if place.is_bit:
            cell = self._memory.bit_at(place)
            return cell.get, lambda value: cell.put(bool(value))
        words = self._memory.words_at(place, 1)

        def put(value: int) -> None:
            words[0] = value & WORD

        return lambda: int(words[0]), put

    def _element(self, words: Words) -> tuple[Expression, Callable[[int], None]]:
        """What reads and writes the word of an array whose number follows in brackets."""
        self._take("[")
        index = self._sum()
        self._take("]")

        def put(value: int) -> None:
            words[index()] = value & WORD

        return lambda: int(words[index()]), put


def _tokens(text: str) -> Iterator[str]:
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise StateError(f"structured text: `{text[at : at + 20].splitlines()[0]}` is not understood")
        at = match.end()
        if match["token"] is not None:
            yield match["token"]


def _added(left: Expression, right: Expression) -> Expression:
    return lambda: left() + right()


def _nothing() -> None:
    pass


class Snippet:
    """A snippet in an interval task: called each time its period is over, while the PLC runs.

    Args:
        text: Structured Text.
        memory: The PLC's memory.
        period_ns: Period of the task.
    """

    def __init__(self, text: str, memory: Memory, period_ns: int) -> None:
        self._run = program(text, memory)
        self._memory = memory
        self._period_ns = period_ns
        self._gathered_ns = 0

    def scan(self, elapsed_ns: int) -> None:
        """Call it as often as its period fits into the time that has gone."""
        self._gathered_ns += elapsed_ns
        while self._gathered_ns >= self._period_ns:
            self._gathered_ns -= self._period_ns
            self._run()
            self._memory.generation += 1

    def power_up(self) -> None:
        """Begin a new period."""
        self._gathered_ns = 0
