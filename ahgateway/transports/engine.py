"""The request/response engine of every Modbus link: queue, window, deadline, matching; no sockets, no threads.

Whoever owns the wire hands bytes and times in and asks what to send next:

    submit → outgoing → (write) → received | tick | lost → the waiter has its reply or its error

Framings that number their transactions match by number, unit, function, byte count and echo; a late reply is
dropped by its number. Framings that do not (RTU, ASCII) have one request in flight, a quiet line before the next one
after anything odd, and `alignment` decides what may be believed. No request is ever sent twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Read, Request
from ahgateway.errors import CodecError, FrameError, LinkError, PlcRefusedError, ReplyTimeoutError, TransportError
from ahgateway.transports.alignment import Alignment
from ahgateway.transports.base import Frame, LinkFigures, Reply, Tap
from ahgateway.transports.framing import Adu, Framing
from ahgateway.transports.pdu import Shape, decode_reply, describe, encode_request, reply_shape
from ahgateway.transports.waiting import Job, Waiter, Waiting

KNOWN_MAX = 256
"""A poller asks the same request objects again and again; so many of them are encoded once (MEASURED 3 µs each)."""
EXPIRED_MAX = 1000
"""Transaction numbers whose late replies may still come; beyond that only a new connection is clean."""
UNANSWERED_MAX = 3
"""After so many time-outs in a row without a byte the peer is taken for half open."""
PROBES_MAX = 3
"""So many alignment probes may precede one request; a line that stays in doubt fails it."""
STRAY_FRAME_SIZE_MIN = 5
"""Fewer stray bytes cannot be a frame: the shortest, an RTU exception, has 5; an ASCII one has 11 characters."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a line allows.

    Attributes:
        timeout_ns: From the last byte of the request to the last byte of the reply, wire time not counted.
        window: Requests in flight; 1 where the framing does not number them.
        pause_ns: Between the end of a reply and the next request.
        pause_after_connect_ns: Before the first request of a connection.
        quiet_ns: How long a line without transaction numbers must be silent after anything odd.
        byte_ns: Wire time of one byte; 0 where it does not count.
        share: Of the time, what our exchanges may take; after each the line rests accordingly.
        wait_max_ns: How long a request may wait for its turn before it is refused unsent; 0 for any time.
    """

    timeout_ns: int
    window: int = 1
    pause_ns: int = 0
    pause_after_connect_ns: int = 0
    quiet_ns: int = 50 * MILLISECOND
    byte_ns: int = 0
    share: float = 1.0
    wait_max_ns: int = 0


class Engine:
    """One line or connection.

    Args:
        framing: How frames look on this wire.
        limits: What the line allows.
        clock: Only to stamp tapped frames with UTC; all other times come in as arguments.
        figures: Running totals to keep.
        target: How errors name the line.
        tap: Gets every frame, or None.
    """

    def __init__(
        self, framing: Framing, limits: Limits, clock: Clock, figures: LinkFigures, target: str, tap: Tap | None = None
    ) -> None:
        self.framing = framing
        self.unanswered_in_a_row = 0
        self.replies_on_connection = 0
        self._limits = limits
        self._identifies = framing.identifies
        self._timeout_ns = limits.timeout_ns
        self._pause_ns = limits.pause_ns
        self._rest = 1.0 / limits.share - 1.0
        self._clock = clock
        self._figures = figures
        self._target = target
        self._tap = tap
        self._window = limits.window if framing.identifies else 1
        self._queue = Waiting(limits.wait_max_ns)
        self._known: dict[int, tuple[Request, bytes, Shape]] = {}
        self._flying: dict[int, Job] = {}
        self._expired: set[int] = set()
        self._tag = 0
        self._send_after_ns = 0
        self._first_ns: int | None = None
        self._connected_ns = 0
        self._alignment = Alignment(limits.timeout_ns)
        self._heard = bytearray()
        self._probes = 0
        self._probe_frame = b""
        self._noisy_since_ns: int | None = None

    @property
    def is_busy(self) -> bool:
        """True while anything is queued or in flight."""
        return bool(self._flying or self._queue)

    @property
    def is_flying(self) -> bool:
        """True while a reply is waited for."""
        return bool(self._flying)

    @property
    def has_queue(self) -> bool:
        """True while anything waits to be sent."""
        return bool(self._queue)

    @property
    def is_worn(self) -> bool:
        """True when only a new connection is clean: too many answers are still owed on this one."""
        return self.unanswered_in_a_row >= UNANSWERED_MAX or len(self._expired) > EXPIRED_MAX

    def connected(self, now_ns: int) -> None:
        """Start on a fresh connection; nothing that was said on the old one counts."""
        self.framing.drain()
        self._heard.clear()
        self._expired.clear()
        self._alignment.doubt_all()
        self._first_ns = None
        self._connected_ns = now_ns
        self._send_after_ns = now_ns + self._limits.pause_after_connect_ns
        self.unanswered_in_a_row = 0
        self.replies_on_connection = 0

    def submit(self, request: Request, waiter: Waiter, asked_ns: int) -> None:
        """Queue a request that was asked at `asked_ns`.

        Raises:
            CodecError: No PDU can hold it; nothing has been queued.
        """
        self._queue.append(self._job(request, waiter, asked_ns))

    def offer(self, request: Request, waiter: Waiter, now_ns: int) -> bytes | None:
        """Queue a request and return the next frame to write at once, or None: `submit` and `outgoing` in one.

        Raises:
            CodecError: No PDU can hold it; nothing has been queued.
        """
        job = self._job(request, waiter, now_ns)
        if self._queue or not self._identifies:
            self._queue.append(job)
            return self.outgoing(now_ns)
        if len(self._flying) >= self._window or now_ns < self._send_after_ns:
            self._queue.append(job)
            return None
        return self._launch(job, self._next_tag(), now_ns)

    def _job(self, request: Request, waiter: Waiter, asked_ns: int) -> Job:
        known = self._known.get(id(request))
        if known is None:
            if request.unit == 0 and not self._identifies:
                raise CodecError(
                    f"cannot {describe(request)}: unit 0 is everybody on a serial line and nobody answers",
                    hint="units on a serial line are 1…247",
                )
            pdu = encode_request(request)
            if len(self._known) >= KNOWN_MAX:
                self._known.clear()
            known = self._known[id(request)] = (request, pdu, reply_shape(request, pdu))
        return Job(known, waiter, asked_ns)

    def outgoing(self, now_ns: int) -> bytes | None:
        """Return the next frame to write at once, or None when nothing may be sent now."""
        queue = self._queue
        if not queue or len(self._flying) >= self._window or now_ns < self._send_after_ns:
            return None
        if not self._identifies:
            provable = self._provable(now_ns)
            if provable is None:
                return self.outgoing(now_ns)
            self.framing.expect(provable.request.unit, provable.shape.head, provable.shape.size)
            return self._launch(provable, 0, now_ns)
        job = queue.popleft()
        if job.waiter is not None and job.waiter.done():
            return self.outgoing(now_ns)  # its caller has gone; what was not sent is not sent
        return self._launch(job, self._next_tag(), now_ns)

    def _launch(self, job: Job, tag: int, now_ns: int) -> bytes:
        frame = self.framing.wrap(tag, job.request.unit, job.pdu)
        job.sent_ns = now_ns
        job.deadline_ns = now_ns + self._timeout_ns
        if self._limits.byte_ns:
            job.deadline_ns += self._limits.byte_ns * (len(frame) + self.framing.frame_size(job.shape.size))
        self._flying[tag] = job
        self._figures.requests += 1
        self._noisy_since_ns = None
        if self._tap is not None:
            self._tap(Frame(">", frame, now_ns, self._clock.utc_ns()))
        return frame

    def received(self, piece: bytes | memoryview, now_ns: int) -> None:
        """Take bytes from the wire that were there at `now_ns`.

        Raises:
            FrameError: The stream cannot be read on; close the connection, then call `lost`.
        """
        if self._tap is not None:
            self._heard += piece
        first_ns = self._first_ns
        if first_ns is None:
            first_ns = now_ns
        self.unanswered_in_a_row = 0
        framing = self.framing
        found = framing.feed(piece)
        if found and self._tap is not None:
            self._flush_heard(now_ns)  # before the waiter goes on: what it asks next comes after
        for adu in found:
            self._match(adu, first_ns, now_ns)
            first_ns = now_ns
        self._first_ns = None
        if framing.kept:
            self._first_ns = first_ns
            if not self._identifies and not self._flying:
                self._wait_for_silence(now_ns)

    def _wait_for_silence(self, now_ns: int) -> None:
        # More than was asked for: let the line fall silent, then look at what it was. A line that never falls
        # silent must not hold a caller for ever: after one time-out the next request goes out all the same.
        if self._noisy_since_ns is None:
            self._noisy_since_ns = now_ns
        latest_ns = self._noisy_since_ns + self._limits.timeout_ns
        silent_ns = min(now_ns + max(self._limits.quiet_ns, self._limits.pause_ns), latest_ns)
        self._send_after_ns = max(self._send_after_ns, silent_ns)

    def tick(self, now_ns: int) -> None:
        """Fail what has passed its deadline."""
        for tag in [tag for tag, job in self._flying.items() if job.deadline_ns <= now_ns]:
            job = self._flying.pop(tag)
            self._figures.timeouts += 1
            self.unanswered_in_a_row += 1
            if self._identifies:
                self._expired.add(tag)
                self._fail(job, self._timeout_error(job, 0))
            else:
                heard = len(self.framing.drain())
                self._figures.garbage_bytes = self.framing.garbage_bytes
                self._alignment.missed(job.request.unit, job.shape.head, now_ns)
                self._send_after_ns = now_ns + self._limits.quiet_ns
                self._fail(job, self._timeout_error(job, heard))
            self._flush_heard(now_ns)
        for job in self._queue.expired(now_ns):
            self._fail(job, self._expiry_error(job, now_ns))

    def wake_ns(self) -> int | None:
        """Return when `tick` and `outgoing` should be called next if nothing else happens, None for never."""
        wake = None
        for job in self._flying.values():
            wake = job.deadline_ns  # all time-outs are equal: the first sent is the first due
            break
        if self._queue and len(self._flying) < self._window and (wake is None or self._send_after_ns < wake):
            wake = self._send_after_ns
        due_ns = self._queue.due_ns()
        return wake if due_ns is None or (wake is not None and wake < due_ns) else due_ns

    def lost(self, now_ns: int, message: str, hint: str | None = None, kind: type[TransportError] = LinkError) -> None:
        """Fail everything that waits; the connection is gone."""
        self._flush_heard(now_ns)
        jobs = [*self._flying.values(), *self._queue]
        flying = len(self._flying)
        self._flying.clear()
        self._queue.clear()
        self.framing.drain()
        self._figures.garbage_bytes = self.framing.garbage_bytes
        for index, job in enumerate(jobs):
            fate = (
                ""
                if type(job.request) is Read
                else ("; whether the PLC carried it out is not known" if index < flying else "; it was not sent")
            )
            self._fail(
                job, kind(f"{self._target}: {message}, before an answer to: {describe(job.request)}{fate}", hint=hint)
            )

    def _provable(self, now_ns: int) -> Job | None:
        """Return the queue's head, or the alignment probe that must come before it; None when the head is no more."""
        head = self._queue.head
        waiter = head.waiter
        if waiter is not None and waiter.done():
            self._queue.popleft()
            return None
        stray = self.framing.drain()
        # Only a probe's own reply may come twice without harm: nothing else has its shape.
        if len(stray) >= STRAY_FRAME_SIZE_MIN and stray != self._probe_frame:
            self._alignment.doubt_all()
        self._flush_heard(now_ns)
        self._figures.garbage_bytes = self.framing.garbage_bytes
        request = head.request
        if self._alignment.since_ns(request.unit) is not None:
            self._probes = 0
            return self._queue.popleft()
        if self._probes >= PROBES_MAX:
            self._probes = 0
            message = f"{self._target}: frames that nobody asked for keep coming, cannot {describe(request)}"
            self._fail(self._queue.popleft(), FrameError(message, hint="is a second master on this line?"))
            return None
        self._probes += 1
        probe = self._alignment.probe(request, now_ns)
        pdu = encode_request(probe)
        return Job((probe, pdu, reply_shape(probe, pdu)), None, now_ns, ahead_of=head)

    def _next_tag(self) -> int:
        tag = self._tag = (self._tag + 1) & 0xFFFF
        while tag in self._flying or tag in self._expired:
            tag = self._tag = (self._tag + 1) & 0xFFFF
        return tag

    def _match(self, adu: Adu, first_ns: int, now_ns: int) -> None:
        job = self._flying.pop(adu.tag, None)
        if job is None:
            self._expired.discard(adu.tag)
            self._figures.late += 1
            return
        request = job.request
        if self._pause_ns or self._rest:
            self._send_after_ns = now_ns + max(self._pause_ns, round(self._rest * (now_ns - job.sent_ns)))
        if adu.unit != request.unit:
            self._fail(job, FrameError(f"{self._target}: unit {adu.unit} answered to: {describe(request)}"))
            return
        try:
            values = decode_reply(request, job.shape, adu.pdu)
        except (PlcRefusedError, FrameError) as error:
            self._refused(job, adu, error, now_ns)
            return
        self.replies_on_connection += 1
        aligned_ns = self._connected_ns
        if not self._identifies:
            self._probe_frame = b""
            if job.waiter is None:
                self._prove(job, adu, now_ns)
                return
            self._alignment.answered(request)
            aligned_ns = self._alignment.since_ns(request.unit) or now_ns
        self._figures.answered(now_ns - job.sent_ns)
        waiter = job.waiter
        if waiter is not None and not waiter.done():
            waiter.set_result(Reply(request, values, job.sent_ns, first_ns, now_ns, aligned_ns))

    def _prove(self, job: Job, adu: Adu, now_ns: int) -> None:
        self._alignment.proven(job.request.unit, now_ns)
        self._probe_frame = self.framing.wrap(0, adu.unit, adu.pdu)

    def _refused(self, job: Job, adu: Adu, error: PlcRefusedError | FrameError, now_ns: int) -> None:
        if isinstance(error, PlcRefusedError):
            self.replies_on_connection += 1
            if job.waiter is not None:
                self._figures.refused += 1
            elif self._alignment.refusal_proves(job.request.unit, job.shape.function):
                self._prove(job, adu, now_ns)
                return
        if job.waiter is None:
            self._alignment.missed(job.request.unit, job.shape.head, now_ns)
            self._send_after_ns = now_ns + self._limits.quiet_ns
            error = FrameError(
                f"{self._target}: unit {job.request.unit} refused the alignment probe, which proves nothing while an "
                f"earlier request is unanswered ({error.message})",
                hint="the link probes again with the next request",
            )
        self._fail(job, error)

    def _fail(self, job: Job, error: Exception) -> None:
        waiter = job.waiter
        if job.ahead_of is not None:
            self._probes = 0
            if self._queue.remove(job.ahead_of):  # a probe fails the request for which it went out
                waiter = job.ahead_of.waiter
        if waiter is not None and not waiter.done():
            waiter.set_exception(error)

    def _timeout_error(self, job: Job, heard: int) -> TransportError:
        request, timeout_ms = job.request, self._limits.timeout_ns // MILLISECOND
        is_probe = job.waiter is None
        asked = f"the alignment probe of unit {request.unit}" if is_probe else describe(request)
        if heard:
            return FrameError(
                f"{self._target}: {heard} bytes within {timeout_ms} ms, but no answer to: {asked}",
                hint="check baud rate, parity, RTU against ASCII, wiring, termination; or a second master is speaking",
            )
        where = "unit number" if self.framing.identifies else "unit number, baud rate, parity and wiring"
        believed = "; nothing on this line is believed before it answers" if is_probe else ""
        return ReplyTimeoutError(
            f"{self._target}: no reply within {timeout_ms} ms to: {asked}{believed}",
            hint=f"check the {where}; if the PLC is slow, raise reply_timeout_ms",
        )

    def _expiry_error(self, job: Job, now_ns: int) -> TransportError:
        waited_ms = (now_ns - job.asked_ns) // MILLISECOND
        return ReplyTimeoutError(
            f"{self._target}: waited {waited_ms} ms for its turn and was not sent: {describe(job.request)}",
            hint="the line is slower than what is asked of it: raise poll_ms or line_share_max, or request_wait_max_ms",
        )

    def _flush_heard(self, now_ns: int) -> None:
        if self._heard and self._tap is not None:
            self._tap(Frame("<", bytes(self._heard), now_ns, self._clock.utc_ns()))
            self._heard.clear()
