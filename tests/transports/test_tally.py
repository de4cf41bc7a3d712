"""What a link did, counted from its frames; expected figures are counted by hand."""

from __future__ import annotations

from ahgateway.clock import MILLISECOND
from ahgateway.transports.base import Frame
from ahgateway.transports.framing import Mbap
from ahgateway.transports.rtu import RtuReplies, RtuRequests
from ahgateway.transports.tally import Tally

TIMEOUT_NS = 500 * MILLISECOND
RTU_READ, RTU_REPLY = "01 03 00 6b 00 01 f5 d6", "01 03 02 02 2b f9 3b"


def fed(tally: Tally, *frames: tuple[int, str]) -> Tally:
    """Hand it frames: time in ms, direction and bytes."""
    for at_ms, text in frames:
        tally.take(Frame(text[0], bytes.fromhex(text[1:]), at_ms * MILLISECOND, 0))
    return tally


def read(tag: int) -> str:
    return f"> 00 {tag:02x} 00 00 00 06 01 03 00 6b 00 01"


def reply(tag: int) -> str:
    return f"< 00 {tag:02x} 00 00 00 05 01 03 02 02 2b"


def refused(tag: int) -> str:
    return f"< 00 {tag:02x} 00 00 00 03 01 83 02"


def test_replies_and_exceptions_are_round_trips_each_of_its_own_request() -> None:
    tally = fed(
        Tally(Mbap, Mbap, TIMEOUT_NS), (0, read(1)), (1, read(2)), (4, reply(2)), (10, reply(1)), (11, read(3)),
        (13, refused(3)),
    )  # fmt: skip
    found = tally.figures
    assert [3, 3, 1, 0, 0] == [found.requests, found.replies, found.refused, found.timeouts, found.late]
    assert [3 * MILLISECOND, 10 * MILLISECOND, 2 * MILLISECOND] == found.round_trips_ns
    assert [2 * MILLISECOND, 10 * MILLISECOND] == [found.round_trip_last_ns, found.round_trip_worst_ns]


def test_a_request_older_than_twice_the_time_out_was_given_up_and_its_reply_is_late() -> None:
    found = fed(
        Tally(Mbap, Mbap, TIMEOUT_NS), (0, read(1)), (1000, read(2)), (1001, reply(1)), (1002, reply(2))
    ).figures
    assert [2, 1, 1, 1] == [found.requests, found.replies, found.timeouts, found.late]


def test_on_a_line_without_tags_the_next_request_ends_the_one_before() -> None:
    tally = Tally(RtuRequests, RtuReplies, TIMEOUT_NS)
    found = fed(tally, (0, f"> {RTU_READ}"), (100, f"> {RTU_READ}"), (120, f"< {RTU_REPLY}")).figures
    assert [2, 1, 1, 0] == [found.requests, found.replies, found.timeouts, found.late]
    assert [20 * MILLISECOND] == found.round_trips_ns
