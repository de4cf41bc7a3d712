"""Faults of a wire on purpose: a seeded script says which exchange suffers what, and whole frames come out spoiled.

It knows frames and delays, no sockets and no clock: tests drive it in virtual time, the proxy between two real ends.
A request is only ever lost, delayed or answered in the unit's place: nothing that reaches a PLC has been changed.

Not every fault can be told from the truth by whoever receives it: Modbus TCP has no checksum, and on RTU and ASCII a
foreign frame of the very shape that is waited for, between request and reply, looks like the reply. `DETECTABLE` holds
those against which a client has a defence; the others are for looking at what a user would see.
"""

from __future__ import annotations

import random
from binascii import unhexlify
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from ahgateway.clock import MILLISECOND
from ahgateway.errors import ProfileError
from ahgateway.transports.ascii import AsciiRequests
from ahgateway.transports.framing import Adu, Framing, Mbap
from ahgateway.transports.pdu import encode_exception
from ahgateway.transports.rtu import RtuRequests, crc

NOISE_SIZE_MAX = 12
LATE_MS = (20, 400)
SPLIT_MS_MAX = 5
CODE_FAILURE, CODE_BUSY = 4, 6
FUNCTIONS = (1, 2, 3, 4, 5, 6, 15, 16)
WRAPPINGS: Mapping[str, type[Framing]] = {"tcp": Mbap, "rtu": RtuRequests, "ascii": AsciiRequests}


class Fault(Enum):
    """What can happen to one exchange."""

    REQUEST_LOST = "request lost"
    LATE = "late"
    LOST = "lost"
    DUPLICATED = "duplicated"
    STRAY = "stray"
    TRUNCATED = "truncated"
    CORRUPTED = "corrupted"
    NOISE_BEFORE = "noise before"
    NOISE_INSIDE = "noise inside"
    NOISE_AFTER = "noise after"
    WRONG_UNIT = "wrong unit"
    WRONG_FUNCTION = "wrong function"
    WRONG_COUNT = "wrong count"
    EXCEPTION = "exception"
    BUSY = "busy"
    SPLIT = "split"
    MERGED = "merged"


_NEEDS_CHECKSUM = {
    Fault.TRUNCATED,
    Fault.CORRUPTED,
    Fault.NOISE_BEFORE,
    Fault.NOISE_INSIDE,
    Fault.NOISE_AFTER,
}
DETECTABLE: Mapping[str, tuple[Fault, ...]] = {
    "tcp": tuple(fault for fault in Fault if fault not in _NEEDS_CHECKSUM),
    "rtu": tuple(Fault),
    "ascii": tuple(Fault),
}
"""Faults by wire (`tcp`, `rtu`, `ascii`) that no client needs to fall for."""

_NAMES = {fault.value.replace(" ", "-"): fault for fault in Fault}


class Piece(NamedTuple):
    """Bytes to be sent `delay_ns` after the piece before them."""

    delay_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Rule:
    """When a fault happens: from exchange `first` to `last` (from 1), at each `every`th, with probability `rate`."""

    faults: tuple[Fault, ...]
    first: int = 1
    last: int | None = None
    every: int = 1
    rate: float = 1.0
    late_ms: int | None = None


class Script:
    """Which exchange suffers what; equal seeds give equal faults. The first rule that applies counts."""

    def __init__(self, rules: tuple[Rule, ...], seed: int = 0) -> None:
        self.rules = rules
        self.random = random.Random(seed)
        self.exchange = 0

    def next(self) -> tuple[Fault | None, int | None]:
        """Return the fault of the next exchange, None for a sound one, and how late in ms when the script says so."""
        self.exchange += 1
        for rule in self.rules:
            number = self.exchange - rule.first
            if number < 0 or (rule.last is not None and self.exchange > rule.last) or number % rule.every:
                continue
            if rule.rate >= 1.0 or self.random.random() < rule.rate:
                return self.random.choice(rule.faults), rule.late_ms
        return None, None


def parse_script(text: str, file: str, seed: int = 0) -> Script:
    """Return the script in a text of lines: `5 lost`, `10-20 late 300`, `every 7 corrupted`, `rate 0.1 split,late`.

    Raises:
        ProfileError: Naming file, line and what is allowed.
    """
    rules = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if words:
            try:
                rules.append(_rule(words))
            except ValueError as error:
                raise ProfileError(
                    str(error),
                    file=file,
                    key=f"line {number}",
                    hint="`5 lost`, `10-20 late 300`, `every 7 corrupted`, `rate 0.1 split,late`",
                ) from error
    return Script(tuple(rules), seed)


def _rule(words: list[str]) -> Rule:
    when, first, last, every, rate = words[0], 1, None, 1, 1.0
    if when in ("every", "rate"):
        if len(words) < 3:
            raise ValueError(f"`{' '.join(words)}` is no fault")
        if when == "every":
            first = every = _whole(words[1])
        else:
            rate = float(words[1])
            if not 0.0 < rate <= 1.0:
                raise ValueError(f"rate {words[1]}, allowed above 0 up to 1")
        words = words[1:]
    else:
        start, dash, end = when.partition("-")
        first = _whole(start)
        last = _whole(end) if dash else first
    if len(words) not in (2, 3):
        raise ValueError(f"`{' '.join(words)}` is no fault")
    faults = []
    for name in words[1].split(","):
        if name not in _NAMES:
            raise ValueError(f"`{name}` is no fault, known are {', '.join(_NAMES)}")
        faults.append(_NAMES[name])
    return Rule(tuple(faults), first, last, every, rate, _whole(words[2]) if len(words) == 3 else None)


def _whole(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise ValueError(f"`{text}` is no whole number above 0")
    return int(text)


class FaultyWire:
    """Spoils the frames of one line or connection, one fault an exchange.

    Args:
        wire: `tcp`, `rtu` or `ascii`.
        script: What happens when.
    """

    def __init__(self, wire: str, script: Script) -> None:
        self.script = script
        self.fault: Fault | None = None
        self._wrap = WRAPPINGS[wire]().wrap
        self._wire = wire
        self._late_ms: int | None = None
        self._held = b""
        self._older = b""

    def request(self, frame: bytes) -> tuple[bytes, list[Piece]]:
        """Begin an exchange; return what goes on to the unit (the request or nothing) and what goes back at once."""
        self.fault, self._late_ms = self.script.next()
        if self.fault is Fault.REQUEST_LOST:
            return b"", []
        if self.fault in (Fault.EXCEPTION, Fault.BUSY):
            asked = opened(self._wire, frame)
            code = CODE_BUSY if self.fault is Fault.BUSY else CODE_FAILURE
            refusal = self._wrap(asked.tag, asked.unit, encode_exception(asked.pdu[0], code))
            return b"", [Piece(0, self._release() + refusal)]
        return frame, []

    def reply(self, frame: bytes) -> list[Piece]:
        """Return what comes of the unit's reply to the last request, in order; nothing when it is lost or kept back."""
        pieces = self._spoiled(frame)
        self._older = frame
        held = self._release() if pieces else b""
        if held:
            pieces[0] = Piece(pieces[0].delay_ns, held + pieces[0].data)
        if self.fault is Fault.MERGED:
            self._held = frame
        return pieces

    def _release(self) -> bytes:
        held, self._held = self._held, b""
        return held

    def _spoiled(self, frame: bytes) -> list[Piece]:
        fault, rng = self.fault, self.script.random
        if fault is None:
            return [Piece(0, frame)]
        place = rng.randrange(1, len(frame)) if len(frame) > 1 else 0
        noise = rng.randbytes(rng.randrange(1, NOISE_SIZE_MAX + 1))
        if fault in (Fault.LOST, Fault.MERGED):
            return []
        if fault is Fault.LATE:
            late_ms = rng.randint(*LATE_MS) if self._late_ms is None else self._late_ms
            return [Piece(late_ms * MILLISECOND, frame)]
        if fault is Fault.SPLIT:
            return [Piece(0, frame[:place]), Piece(rng.randint(0, SPLIT_MS_MAX) * MILLISECOND, frame[place:])]
        if fault is Fault.STRAY:
            return [Piece(0, frame + self._older)]
        data = {
            Fault.DUPLICATED: frame + frame,
            Fault.TRUNCATED: frame[:place],
            Fault.CORRUPTED: frame[:place] + bytes((frame[place] ^ 1 << rng.randrange(8),)) + frame[place + 1 :],
            Fault.NOISE_BEFORE: noise + frame,
            Fault.NOISE_AFTER: frame + noise,
        }.get(fault)
        if data is None:
            data = self._noise_inside(frame, place) if fault is Fault.NOISE_INSIDE else self._lie(frame)
        return [Piece(0, data)]

    def _noise_inside(self, frame: bytes, place: int) -> bytes:
        # Noise that satisfies a checksum by chance cannot be told from data by anybody: it is drawn again.
        rng, size = self.script.random, len(frame)
        while True:
            noisy = frame[:place] + rng.randbytes(rng.randrange(1, NOISE_SIZE_MAX + 1)) + frame[place:]
            if self._wire != "rtu" or crc(noisy[: size - 2]) != noisy[size - 2 : size]:
                return noisy

    def _lie(self, frame: bytes) -> bytes:
        """A frame with a sound checksum that is no answer to what was asked."""
        rng, said = self.script.random, opened(self._wire, frame)
        if self.fault is Fault.WRONG_UNIT:
            return self._wrap(said.tag, said.unit % 247 + 1, said.pdu)
        if self.fault is Fault.WRONG_FUNCTION:
            others = [function for function in FUNCTIONS if function != said.pdu[0] & 0x7F]
            return self._wrap(said.tag, said.unit, bytes((rng.choice(others),)) + said.pdu[1:])
        if said.pdu[0] <= 4 and said.pdu[1] > 2 and rng.random() < 0.5:  # a word less, or a word more
            return self._wrap(said.tag, said.unit, bytes((said.pdu[0], said.pdu[1] - 2)) + said.pdu[2:-2])
        if said.pdu[0] <= 4 and said.pdu[1] <= 248:
            return self._wrap(said.tag, said.unit, bytes((said.pdu[0], said.pdu[1] + 2)) + said.pdu[2:] + bytes(2))
        if len(said.pdu) == 5:  # the echo of a write says another value or count
            return self._wrap(said.tag, said.unit, said.pdu[:4] + bytes((said.pdu[4] ^ 1,)))
        return self._wrap(said.tag, said.unit, said.pdu + b"\x00")


def opened(wire: str, frame: bytes) -> Adu:
    """Return what a sound frame carries."""
    if wire == "tcp":
        return Adu(int.from_bytes(frame[:2], "big"), frame[6], frame[7:])
    body = frame[:-2] if wire == "rtu" else unhexlify(frame[1:-4])
    return Adu(0, body[0], body[1:])
