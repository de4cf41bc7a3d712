"""Rings that wrap, tear, run over, begin anew: served word by word by a link that the test writes, judged by counts."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from lockstep.bench_world import DEVICES, bindings

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Read, Request
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.codec.ways import Each, Place, Recorder, Way
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.lockstep.events import Lost
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.ring import MOVED, OVERRUN, RESTARTED, SILENT, STARTED, TORN, Ring
from ahgateway.transports.base import LinkFigures, Reply

DPID = CONTROLLERS["DPID"]
FIELDS = {"PV": Place(2), "I_MV": Place(4), "I_MV+1": Place(6), "MV": Place(8), "MOUT": Place(10)}
LENGTH, SLOTS, RING, HEAD, SV = 13, 8, 2000, 1999, 100


def layout(**changes: object) -> Recorder:
    others = frozenset({"SV"})
    given = {
        "sequence_end": 12, "sequence_range": 100, "time": 1, "time_words": 1, "time_unit_ns": 10 * MILLISECOND,
        "each": Each.CALL, "unrecorded": others, **changes,
    }  # fmt: skip
    return Recorder(parse_device("D2000"), SLOTS, LENGTH, parse_device("D1999"), FIELDS, **given)  # type: ignore[arg-type]


class Words:
    """A PLC that is nothing but words; `before` may change them before each read."""

    def __init__(self, clock: VirtualClock) -> None:
        self.cells: dict[int, int] = {}
        self.clock, self.target, self.figures = clock, "words:", LinkFigures()
        self.before: Callable[[Read], None] = lambda read: None
        self.head = 0
        self.put(HEAD, 0)

    def put(self, address: int, *words: int) -> None:
        self.cells.update(enumerate(words, address))

    def record(self, sequence: int, *, end: int | None = None, first: int = 0) -> None:
        """Write the next slot: number, time, PV = the number as its low word, the rest 0."""
        body = [sequence, sequence, sequence, 0x4248, *(0,) * 7, first, sequence if end is None else end]
        self.put(RING + self.head * LENGTH, *body)
        self.head = (self.head + 1) % SLOTS
        self.put(HEAD, self.head)

    async def exchange(self, request: Request) -> Reply:
        assert isinstance(request, Read)
        self.before(request)
        self.clock.advance_ns(MILLISECOND)
        values = tuple(self.cells.get(request.address + at, 0) for at in range(request.count))
        now_ns = self.clock.now_ns()
        return Reply(request, values, now_ns - MILLISECOND, now_ns, now_ns, 0)

    async def close(self) -> None:
        """Nothing is held."""


class Bench:
    """A ring over such words; `seen` is the low word of PV in every picture, losses as their count and reason."""

    def __init__(self, **changes: object) -> None:
        self.clock = VirtualClock()
        self.plc = Words(self.clock)
        consts = dict.fromkeys(("PID_RUN", "PID_MAN", "MOUT_AUTO", "PID_DIR"), False)
        consts |= dict.fromkeys(("PID_MODE", "Kp", "Ki", "Kd", "ERR_DBW", "MV_MAX", "MV_MIN"), 0)
        bound = bindings(DPID, SV, 1, 200, {**consts, "CYCLE": 1})
        loop = Loop("L1", DPID, bound, way=Way.RECORDED, recorder=layout(**changes), interval_ms=10)
        assert isinstance(loop.bindings["Kp"], Const)
        self.ring = Ring(loop, Station("t", "words:", 1, DEVICES, (loop,)), self.plc, self.clock)

    async def drain(self) -> list[object]:
        found: list[object] = []
        for each in await self.ring.pictures():
            if isinstance(each, Picture):
                found.append(each.words["PV"][0])
            elif isinstance(each, Lost):
                found.append((each.records, each.why))
        return found


@pytest.fixture
async def bench() -> Bench:
    made = Bench()
    made.plc.record(1)
    assert [1] == await made.drain()
    return made


async def test_records_are_read_in_order_and_once_over_the_rings_end(bench: Bench) -> None:
    seen: list[object] = []
    for number in range(2, 32):
        bench.plc.record(number)
        if number % 3 == 0:
            seen += await bench.drain()
    assert list(range(2, 31)) == seen
    assert [] == [each for each in [await bench.drain()] if each != [31]]
    assert 0 == bench.ring.lost_count


async def test_the_number_may_begin_at_0_again(bench: Bench) -> None:
    seen: list[object] = []
    for number in [*range(2, 100), 0, 1, 2]:
        bench.plc.record(number)
        seen += await bench.drain()
    assert [*range(2, 100), 0, 1, 2] == seen


async def test_a_ring_that_is_nearly_full_is_given_up_to_its_newer_half(bench: Bench) -> None:
    for number in range(2, 9):
        bench.plc.record(number)
    assert [(3, OVERRUN), 5, 6, 7, 8] == await bench.drain()
    assert 3 == bench.ring.lost_count


async def test_what_was_overwritten_before_the_head_was_read_is_lost_and_counted(bench: Bench) -> None:
    for number in range(2, 13):  # eleven records into eight slots: the head is three further, a lap is hidden
        bench.plc.record(number)
    found = await bench.drain()
    assert [(1, OVERRUN)] * 3 + [(8, OVERRUN)] == found
    bench.plc.record(13)
    assert [13] == await bench.drain()


async def test_a_whole_lap_leaves_the_head_where_it_was_and_is_seen_all_the_same(bench: Bench) -> None:
    for number in range(2, 10):
        bench.plc.record(number)
    assert [(7, OVERRUN), 9] == await bench.drain()


async def test_what_is_overwritten_while_it_is_read_is_lost_and_the_rest_is_not(bench: Bench) -> None:
    for number in (2, 3, 4):
        bench.plc.record(number)

    def run_over(read: Read) -> None:
        if read.address >= RING:
            bench.plc.before = lambda read: None
            head, bench.plc.head = bench.plc.head, 1
            bench.plc.record(10)
            bench.plc.head = head

    bench.plc.before = run_over
    assert [(1, OVERRUN), 3, 4] == await bench.drain()


async def test_a_torn_record_is_read_once_more(bench: Bench) -> None:
    bench.plc.record(2)
    bench.plc.record(3, end=95)
    bench.plc.record(4)
    mended = iter([None, (RING + 2 * LENGTH + 12, 3)])

    def mend(read: Read) -> None:
        place = next(mended, None) if read.address >= RING else None
        if place is not None:
            bench.plc.put(*place)

    bench.plc.before = mend
    assert [2, 3, 4] == await bench.drain()
    assert (1, 0) == (bench.ring.torn_count, bench.ring.lost_count)


async def test_a_record_that_stays_torn_is_lost_and_not_judged(bench: Bench) -> None:
    bench.plc.record(2)
    bench.plc.record(3, end=95)
    bench.plc.record(4)
    assert [2, (1, TORN), 4] == await bench.drain()


async def test_numbers_that_go_back_are_a_ring_that_began_anew(bench: Bench) -> None:
    bench.plc.record(2)
    assert [2] == await bench.drain()
    bench.plc.record(1)
    assert [(0, RESTARTED)] == await bench.drain()
    bench.plc.record(2)
    assert [2] == await bench.drain()


async def test_an_operand_that_no_record_holds_takes_the_records_with_it_when_it_changes(bench: Bench) -> None:
    bench.plc.record(2)
    assert [2] == await bench.drain()
    bench.plc.put(SV, 0, 0x4270)
    bench.plc.record(3)
    bench.plc.record(4)
    assert [(2, MOVED)] == await bench.drain()
    bench.plc.record(5)
    assert [(1, MOVED)] == await bench.drain()
    bench.plc.record(6)
    assert [6] == await bench.drain()


async def test_silence_is_said_once_and_forgets(bench: Bench) -> None:
    found: list[object] = []
    for _ in range(30):
        bench.clock.advance_ns(100 * MILLISECOND)
        found += await bench.drain()
    assert [(0, SILENT)] == found


async def test_a_first_record_behind_stop_forgets_before_it_is_seen() -> None:
    bench = Bench(first=Place(11, 0))
    bench.plc.record(1)
    assert [1] == await bench.drain()
    bench.plc.record(2, first=1)
    assert [(0, STARTED), 2] == await bench.drain()


async def test_a_program_that_writes_one_number_only_is_read_too() -> None:
    bench = Bench(sequence_end=None)
    bench.plc.record(1)
    assert [1] == await bench.drain()
    bench.plc.record(2)
    assert [2] == await bench.drain()
