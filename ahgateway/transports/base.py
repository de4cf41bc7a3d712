"""The one protocol that everything above a wire speaks: a request goes out, its proven reply or an error comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from ahgateway.codec.access import Request
from ahgateway.codec.can_cycle import CycleFigures


class Reply(NamedTuple):
    """The PLC's answer to exactly this request. A tuple, because one is made for every exchange.

    Attributes:
        request: What was asked.
        values: Bits (0 or 1) or words (0…65535) read, `request.count` of them; empty for a write.
        sent_ns: Monotonic time just before the first byte of the request left.
        first_ns: Monotonic time when the first byte of the reply was there.
        last_ns: Monotonic time when the last byte of the reply was there.
        aligned_since_ns: Since when every reply on this line has been proven to belong to its request.
    """

    request: Request
    values: tuple[int, ...]
    sent_ns: int
    first_ns: int
    last_ns: int
    aligned_since_ns: int


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame as it crossed the wire: `direction` is `>` out or `<` in; times monotonic and UTC, in ns."""

    direction: str
    data: bytes
    now_ns: int
    utc_ns: int


Tap = Callable[[Frame], None]

ROUND_TRIPS_KEPT_MAX = 4096


@dataclass(slots=True)
class LinkFigures:
    """Running totals of a link since it was made; round trips in ns, the latest few thousand of them kept.

    `late` counts replies that came after their request had been given up; they were dropped. `cycles` is there on a
    link that listens to PDOs.
    """

    requests: int = 0
    replies: int = 0
    refused: int = 0
    timeouts: int = 0
    late: int = 0
    reconnects: int = 0
    garbage_bytes: int = 0
    round_trip_last_ns: int = 0
    round_trip_worst_ns: int = 0
    round_trip_total_ns: int = 0
    first_cause: str = ""
    round_trips_ns: list[int] = field(default_factory=list)
    cycles: CycleFigures | None = None

    def answered(self, took_ns: int) -> None:
        """Count a reply that came after so long."""
        self.replies += 1
        self.round_trip_last_ns = took_ns
        self.round_trip_total_ns += took_ns
        self.round_trip_worst_ns = max(self.round_trip_worst_ns, took_ns)
        self.round_trips_ns.append(took_ns)
        if len(self.round_trips_ns) > ROUND_TRIPS_KEPT_MAX:
            del self.round_trips_ns[: ROUND_TRIPS_KEPT_MAX // 2]


class Link(Protocol):
    """A way to one PLC, or to one line of them.

    A link connects when it is first used and reconnects by itself with backoff. It never retries a write.
    """

    target: str
    figures: LinkFigures

    async def exchange(self, request: Request) -> Reply:
        """Send one request and return its reply.

        Raises:
            LinkError: There is no connection and none could be made, or it went away.
            ReplyTimeoutError: No reply within the link's time-out.
            FrameError: The bytes that came are no answer to this request.
            PlcRefusedError: The PLC answered with an exception.
        """

    async def close(self) -> None:
        """Release the line; every request still waiting fails with LinkError. May be called twice."""


class Device(Protocol):
    """The PLC's side of a link, as a server or a memory link needs it."""

    def answer(self, request: Request) -> tuple[int, ...] | None:
        """Carry out one request on the memory image and return the values read (empty for a write).

        None means silence: no such station on this line.

        Raises:
            PlcRefusedError: With the Modbus exception code that the PLC would send.
        """
