"""Count what a link did from the frames that were kept of it: requests, replies, exceptions, round trips."""

from __future__ import annotations

from collections.abc import Callable

from ahgateway.transports.base import Frame, LinkFigures
from ahgateway.transports.framing import Adu, Framing
from ahgateway.transports.tracer import Tracer

EXCEPTION_BIT = 0x80


class Tally(Tracer):
    """Counts the frames of one Modbus link.

    A request without a reply within twice the link's time-out (on a busy machine its timer rings late), or with another
    one behind it on a line that has no tags, counts as a time-out.

    Args:
        asked: Makes the framing of requests.
        answered: Makes the framing of replies.
        timeout_ns: The link's time-out.

    Attributes:
        figures: What was counted so far.
    """

    def __init__(self, asked: Callable[[], Framing], answered: Callable[[], Framing], timeout_ns: int) -> None:
        super().__init__(asked, answered)
        self.figures = LinkFigures()
        self._given_up_ns = 2 * timeout_ns
        self._now_ns = 0
        self._sent_ns: dict[int, int] = {}

    def take(self, frame: Frame) -> None:
        """Count one frame."""
        self._now_ns = frame.now_ns
        while self._sent_ns and frame.now_ns - next(iter(self._sent_ns.values())) > self._given_up_ns:
            self._give_up(next(iter(self._sent_ns)))
        self._meaning(frame)

    def _give_up(self, tag: int) -> None:
        del self._sent_ns[tag]
        self._asked.pop(tag, None)
        self.figures.timeouts += 1

    def _request(self, adu: Adu) -> str:
        if adu.tag in self._sent_ns:
            self._give_up(adu.tag)
        self.figures.requests += 1
        self._sent_ns[adu.tag] = self._now_ns
        return super()._request(adu)

    def _reply(self, adu: Adu) -> str:
        sent_ns = self._sent_ns.pop(adu.tag, None)
        if sent_ns is None:
            self.figures.late += 1
        else:
            self.figures.answered(self._now_ns - sent_ns)
            self.figures.refused += bool(adu.pdu[0] & EXCEPTION_BIT)
        return super()._reply(adu)
