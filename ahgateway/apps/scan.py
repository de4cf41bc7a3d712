"""Who answers on this line or host? Each unit is asked for one register; who answers is asked again in another length.

An exception is an answer too: the unit is there and knows no such register. Nothing is written.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass

from ahgateway.clock import Clock
from ahgateway.codec.access import Read, Table
from ahgateway.errors import FrameError, LinkError, PlcRefusedError, ProfileError, ReplyTimeoutError, TransportError
from ahgateway.transports.base import Link

UNIT_MAX = 255
PROOF_TRIES = 3
PROOF_COUNT = 2


@dataclass(frozen=True, slots=True)
class Answer:
    """What one unit said.

    Attributes:
        unit: Its number.
        text: For people: what it answered, or what came instead.
        words: The registers read, empty where it refused or stayed silent.
        is_there: It answered; False for silence and for bytes that are no answer.
        is_proven: A second read in another length agrees, or it refused both alike.
        round_trip_ns: Time of the first answer, 0 without one.
    """

    unit: int
    text: str
    words: tuple[int, ...] = ()
    is_there: bool = False
    is_proven: bool = False
    round_trip_ns: int = 0


def units_of(text: str) -> tuple[int, ...]:
    """Return the unit numbers of `1-247` or `1,2,10-20`, each once, in the order written.

    Raises:
        ProfileError: It is no such list.
    """
    found: dict[int, None] = {}
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        ends = (first, last if dash else first)
        if not all(end.isascii() and end.isdigit() and int(end) <= UNIT_MAX for end in ends) or int(ends[0]) > int(
            ends[1]
        ):
            raise ProfileError(
                f"`{part.strip()}` in `{text}` is no unit number and no range, allowed 0…{UNIT_MAX}",
                key="--units",
                hint="1-247, or 1,2,10-20",
            )
        found.update(dict.fromkeys(range(int(ends[0]), int(ends[1]) + 1)))
    return tuple(found)


async def scan(
    link: Link, clock: Clock, units: Iterable[int], ends_ns: int, *, table: Table = Table.HOLDING, address: int = 0
) -> AsyncIterator[Answer]:
    """Ask every unit in turn until the time is over, and yield what each said, silence included.

    Args:
        link: To the line or host.
        clock: Tells when the time is over.
        units: Whom to ask; on a serial line 1…247.
        ends_ns: No unit is asked after this time.
        table: Where the proof is read.
        address: Its first register.

    Raises:
        LinkError: No connection can be made, or not any more.
    """
    for unit in units:
        if clock.now_ns() >= ends_ns:
            return
        yield await _asked(link, Read(unit, table, address, 1))


async def _asked(link: Link, read: Read) -> Answer:
    sent = link.figures.requests
    try:
        reply = await link.exchange(read)
    except PlcRefusedError as error:
        return await _refused(link, read, error)
    except ReplyTimeoutError:
        return Answer(read.unit, "silent")
    except FrameError as error:
        return Answer(read.unit, f"something came that is no answer: {error.message}")
    except LinkError as error:
        if link.figures.requests == sent:
            raise
        return Answer(read.unit, f"asked, and no answer: {error.message}")  # some converters hang up then
    took_ns = reply.last_ns - reply.sent_ns
    words = reply.values
    for _ in range(PROOF_TRIES):
        try:
            longer = (await link.exchange(Read(read.unit, read.table, read.address, PROOF_COUNT))).values
            again = (await link.exchange(read)).values
        except (PlcRefusedError, TransportError) as error:
            return Answer(read.unit, f"answered once, then: {error.message}", words, True, False, took_ns)
        if words[0] == longer[0] or longer[0] == again[0]:
            return Answer(read.unit, "answers", longer, True, True, took_ns)
        words = again
    return Answer(read.unit, "answers, the register changes all the time", words, True, False, took_ns)


async def _refused(link: Link, read: Read, first: PlcRefusedError) -> Answer:
    try:
        await link.exchange(read)
    except PlcRefusedError as error:
        is_same = error.code == first.code
        return Answer(read.unit, f"answers, and refuses to read here: exception {first.code:02d}", (), True, is_same)
    except TransportError as error:
        return Answer(read.unit, f"refused once, then: {error.message}", (), True)
    return Answer(read.unit, "refused once, then answered", (), True)
