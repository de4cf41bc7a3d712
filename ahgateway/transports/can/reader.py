"""The thread's side of a CAN interface: opens it, reads it, notices when it is gone, opens it again.

This file alone knows python-can's messages and errors. `BusReader.turn` does one step of the work, so that a scripted
bus on virtual time can be read like a real one; the thread only repeats it.

Source:
    MANUAL Linux `include/uapi/linux/can/error.h`: classes and details of error frames.
    MEASURED python-can 4.6.1: slcan raises ValueError for a damaged line, and the default of `state` is ACTIVE for
    every adapter that does not report one; so that one counts as unknown here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import can

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.can_frame import DATA_SIZE_MAX, CanFrame

RECV_TIMEOUT_S = 0.1
STATE_POLL_NS = 250 * MILLISECOND
BACKOFF_MIN_NS = 100 * MILLISECOND
BACKOFF_MAX_NS = 2 * SECOND

_ERR_BUS_OFF, _ERR_CONTROLLER, _ERR_RESTARTED = 0x40, 0x04, 0x100
_PASSIVE_BITS, _ACTIVE_BIT = 0x30, 0x40


class RawBus(Protocol):
    """What we use of a `can.BusABC`."""

    def recv(self, timeout: float | None = None) -> can.Message | None: ...

    def send(self, msg: can.Message, timeout: float | None = None) -> None: ...

    def shutdown(self) -> None: ...


class Health(Enum):
    """State of the adapter's controller, as far as the adapter tells."""

    CLOSED = "closed"
    UNKNOWN = "open, the adapter reports no state"
    ACTIVE = "error-active"
    PASSIVE = "error-passive"
    OFF = "bus-off"


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something happened to the bus; `name` is stable.

    Names: `open`, `lost`, `bus-off`, `error-passive`, `error-active`, `silent`, `heard`.
    """

    name: str
    text: str
    now_ns: int


@dataclass(slots=True)
class BusFigures:
    """Running totals of one interface; `overflows` are frames dropped because nobody fetched them in time."""

    received: int = 0
    sent: int = 0
    overflows: int = 0
    garbage: int = 0
    error_frames: int = 0
    bus_offs: int = 0
    losses: int = 0
    opens: int = 0
    silences: int = 0
    first_cause: str = ""


class BusReader:
    """Reads one interface step by step.

    Args:
        opener: Opens the interface; raises `can.CanError`, OSError or ValueError.
        clock: Stamps frames and times the backoff.
        on_frame: Takes each frame; called where `turn` runs.
        on_trouble: Takes each change; called where `turn` runs.
        silence_ns: A bus without a frame for so long is said to be silent.

    Attributes:
        health: State of the controller.
        figures: Running totals.
        raw: The open interface, None while there is none.
    """

    def __init__(
        self,
        opener: Callable[[], RawBus],
        clock: Clock,
        on_frame: Callable[[CanFrame], None],
        on_trouble: Callable[[Trouble], None],
        *,
        silence_ns: int = SECOND,
    ) -> None:
        self.health = Health.CLOSED
        self.figures = BusFigures()
        self.raw: RawBus | None = None
        self._opener = opener
        self._clock = clock
        self._on_frame = on_frame
        self._on_trouble = on_trouble
        self._silence_ns = silence_ns
        self._heard_ns = 0
        self._is_silent = False
        self._polled_ns = 0
        self._backoff_ns = BACKOFF_MIN_NS
        self._retry_ns: int | None = None

    def turn(self, pause: Callable[[float], object]) -> None:
        """Do one step: open, wait out the backoff with `pause(seconds)`, or receive for up to 0.1 s."""
        if self.raw is None:
            wait_ns = 0 if self._retry_ns is None else self._retry_ns - self._clock.now_ns()
            if wait_ns > 0:
                pause(min(wait_ns / SECOND, RECV_TIMEOUT_S))
            else:
                self._open()
            return
        try:
            message = self.raw.recv(timeout=RECV_TIMEOUT_S)
        except (can.CanError, OSError) as error:
            self._lose("lost", f"{error or type(error).__name__}")
            return
        except (ValueError, IndexError, KeyError):
            self.figures.garbage += 1
            return
        now_ns = self._clock.now_ns()
        if message is not None:
            self._take(message, now_ns)
        self._watch(now_ns)

    def shut(self) -> None:
        """Release the interface; `turn` would open it again."""
        raw, self.raw = self.raw, None
        self.health = Health.CLOSED
        if raw is not None:
            try:
                raw.shutdown()
            except (can.CanError, OSError, ValueError):
                return  # it is gone already, which is what we wanted

    def _open(self) -> None:
        try:
            self.raw = self._opener()
        except (can.CanError, OSError, ValueError, ImportError) as error:
            self._lose("lost", f"cannot be opened: {error or type(error).__name__}")
            return
        self.figures.opens += 1
        self.health = Health.UNKNOWN
        self._heard_ns = self._polled_ns = self._clock.now_ns()
        self._is_silent = False
        self._tell("open", "the interface is open")

    def _lose(self, name: str, cause: str) -> None:
        if self.raw is not None:
            self.figures.losses += 1
        self.shut()
        self.figures.first_cause = self.figures.first_cause or cause
        self._retry_ns = self._clock.now_ns() + self._backoff_ns
        self._backoff_ns = min(2 * self._backoff_ns, BACKOFF_MAX_NS)
        self._tell(name, cause)

    def _tell(self, name: str, text: str) -> None:
        self._on_trouble(Trouble(name, text, self._clock.now_ns()))

    def _take(self, message: can.Message, now_ns: int) -> None:
        if message.is_error_frame:
            self.figures.error_frames += 1
            self._error_frame(message)
            return
        if len(message.data) > DATA_SIZE_MAX:
            self.figures.garbage += 1
            return
        self._backoff_ns = BACKOFF_MIN_NS
        self._heard_ns = now_ns
        self.figures.received += 1
        if self._is_silent:
            self._is_silent = False
            self._tell("heard", "frames again")
        self._on_frame(
            CanFrame(
                message.arbitration_id,
                bytes(message.data),
                bool(message.is_extended_id),
                bool(message.is_remote_frame),
                False,
                now_ns,
            )
        )

    def _error_frame(self, message: can.Message) -> None:
        detail = message.data[1] if len(message.data) > 1 else 0
        if message.arbitration_id & _ERR_BUS_OFF:
            self._is(Health.OFF)
        elif message.arbitration_id & _ERR_CONTROLLER and detail & _PASSIVE_BITS:
            self._is(Health.PASSIVE)
        elif message.arbitration_id & _ERR_RESTARTED or detail & _ACTIVE_BIT:
            self._is(Health.ACTIVE)

    def _watch(self, now_ns: int) -> None:
        if self.raw is None:
            return
        if now_ns - self._polled_ns >= STATE_POLL_NS:
            self._polled_ns = now_ns
            self._poll_state()
        if not self._is_silent and now_ns - self._heard_ns >= self._silence_ns and self.raw is not None:
            self._is_silent = True
            self.figures.silences += 1
            self._tell("silent", f"no frame for {(now_ns - self._heard_ns) / SECOND:.1f} s")

    def _poll_state(self) -> None:
        kind: Any = type(self.raw)
        if getattr(kind, "state", None) is can.BusABC.state:
            return
        try:
            state = getattr(self.raw, "state", None)
        except (can.CanError, OSError) as error:
            self._lose("lost", f"{error or type(error).__name__}")
            return
        reported = {
            can.BusState.ACTIVE: Health.ACTIVE,
            can.BusState.PASSIVE: Health.PASSIVE,
            can.BusState.ERROR: Health.OFF,
        }.get(state)  # type: ignore[arg-type]
        if reported is not None:
            self._is(reported)

    def _is(self, health: Health) -> None:
        before, self.health = self.health, health
        if health is before:
            return
        if health is Health.OFF:
            self.figures.bus_offs += 1
            self._lose("bus-off", "bus-off: the controller has left the bus after too many errors")
        elif health is Health.PASSIVE:
            self._tell("error-passive", "error-passive: frames are being lost; see bit rate, termination, wiring")
        elif before is Health.PASSIVE:
            self._tell("error-active", "error-active again")
