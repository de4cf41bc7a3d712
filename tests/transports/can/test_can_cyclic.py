"""Pictures from PDOs: which sets count, and that lost and repeated frames never convict a right PLC."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from transports.can.cyclic_world import CyclicWorld

from ahgateway.clock import SECOND, VirtualClock
from ahgateway.codec.access import Read, Span, Table, Write
from ahgateway.codec.can_cycle import Cycle, CycleAssembler
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.can_objects import CanMap, Pdo, Sync, span_bytes, span_values
from ahgateway.core.verdict import Verdict
from ahgateway.errors import CodecError, ReplyTimeoutError
from ahgateway.fake.can import CanPlc
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.judge import Execution
from ahgateway.schema.profile import load

MS = 1_000_000
SYNCS = 2500
SYNC = CanFrame(0x80, b"")
A, B = Span(Table.HOLDING, 100, 2), Span(Table.COIL, 1, 6)
MAP = CanMap((), (Pdo(0x183, (A,)), Pdo(0x283, (B,))), Sync(0x80, 20_000, 10_000))
ONE, TWO = CanFrame(0x183, bytes.fromhex("0000A042")), CanFrame(0x283, b"\x31")


def play(*script: tuple[float, CanFrame]) -> tuple[CycleAssembler, list[Cycle]]:
    """Feed frames at times in ms; return the cycles that came out."""
    assembler = CycleAssembler(MAP)
    found = []
    for at_ms, frame in script:
        cycle = assembler.feed(CanFrame(frame.can_id, frame.data, now_ns=round(at_ms * MS)))
        if cycle is not None:
            found.append(cycle)
    return assembler, found


def test_words_and_flags_have_the_bytes_of_the_standard() -> None:
    """80.0 is 0x42A00000; little-endian, low word first; the first flag is the lowest bit."""
    assert bytes.fromhex("0000A042") == span_bytes(A, (0x0000, 0x42A0))
    assert (0x0000, 0x42A0) == span_values(A, bytes.fromhex("0000A042"))
    assert b"\x31" == span_bytes(B, (1, 0, 0, 0, 1, 1))
    assert (1, 0, 0, 0, 1, 1) == span_values(B, b"\x31")
    with pytest.raises(CodecError, match="are 4 bytes, 2 bytes came"):
        span_values(A, b"\0\0")


def test_a_complete_set_is_a_cycle_with_the_times_of_its_frames() -> None:
    _, cycles = play((0, SYNC), (1, TWO), (2, ONE), (20, SYNC))
    assert [(0, 0, 2 * MS)] == [(cycle.number, cycle.sync_ns, cycle.last_ns) for cycle in cycles]
    assert (0x0000, 0x42A0) == cycles[0].values(A)
    assert (1, 0, 0, 0, 1, 1) == cycles[0].values(B)
    assert cycles[0].values(Span(Table.HOLDING, 101, 2)) is None, "D102 is in no PDO"


@pytest.mark.parametrize(
    ("script", "figure"),
    [
        ([(0, SYNC), (1, ONE), (20, SYNC)], "incomplete"),
        ([(0, SYNC), (1, ONE), (2, CanFrame(0x183, bytes(4))), (3, TWO), (20, SYNC)], "contradicted"),
        ([(0, SYNC), (1, ONE), (11, TWO), (20, SYNC)], "late"),
        ([(0, SYNC), (1, CanFrame(0x183, b"\0")), (2, TWO), (20, SYNC)], "malformed"),
        ([(1, ONE), (2, TWO), (20, SYNC)], "late"),
    ],
)
def test_what_is_not_one_whole_set_is_counted_and_not_believed(
    script: list[tuple[float, CanFrame]], figure: str
) -> None:
    assembler, cycles = play(*script)
    assert [] == cycles
    assert getattr(assembler.figures, figure) >= 1


def test_a_frame_repeated_with_the_same_bytes_changes_nothing() -> None:
    assembler, cycles = play((0, SYNC), (0.1, SYNC), (1, ONE), (1.1, ONE), (2, TWO), (20, SYNC))
    assert 1 == len(cycles)
    assert (1, 1) == (assembler.figures.repeated, assembler.figures.syncs_repeated)


def test_missed_syncs_are_recognised_by_time_and_their_pdos_are_late() -> None:
    assembler, cycles = play((0, SYNC), (1, ONE), (2, TWO), (21, ONE), (22, TWO), (60, SYNC), (61, ONE), (62, TWO))
    assert (0, None) == (cycles[0].number, assembler.settle(65 * MS))
    last = assembler.settle(71 * MS)
    assert last is not None
    assert 3 == last.number
    assert (2, 2) == (assembler.figures.syncs_missed, assembler.figures.late)


def test_the_counter_of_sync_tells_a_repetition_from_an_early_one() -> None:
    first, second = CanFrame(0x80, b"\x07"), CanFrame(0x80, b"\x08")
    assembler, _ = play((0, first), (9, second), (9.1, second))
    assert (2, 1) == (assembler.figures.syncs, assembler.figures.syncs_repeated)


def test_jitter_is_the_largest_difference_from_the_period() -> None:
    assembler, _ = play((0, SYNC), (20.3, SYNC), (39.6, SYNC))
    assert round(0.7 * MS) == assembler.figures.jitter_ns_max


async def follow(world: CyclicWorld, syncs: int) -> list[Execution]:
    for _ in range(syncs):
        with contextlib.suppress(ReplyTimeoutError):
            await world.sync()
    return [event for event in world.events if isinstance(event, Execution)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 1 + 10_000 // SYNCS))
async def test_lost_and_repeated_frames_cost_coverage_and_convict_nobody(seed: int) -> None:
    """Ten thousand cycles in all, each run with other frames lost."""
    world = CyclicWorld(lost=0.01, repeated=0.02, seed=seed)
    found = await follow(world, SYNCS)
    figures, counts = world.link.figures.cycles, world.follower.summary()
    assert figures is not None
    assert [] == [each for each in found if each.verdict is Verdict.DIVERGED]
    assert 0 < figures.syncs_missed < 0.03 * SYNCS
    assert 0 < figures.incomplete < 0.15 * SYNCS
    assert figures.repeated > 0
    assert figures.complete == SYNCS - figures.syncs_missed - figures.incomplete
    executed = world.plc.executed("TIC-101")
    assert abs(counts.total - executed) <= 2, "what was not seen is counted too"
    assert counts.informative > 0.8 * executed
    assert [] == world.wire.sent, "nothing is asked for"


@pytest.mark.slow
async def test_a_wrong_gain_is_convicted_over_pdos_at_once() -> None:
    world = CyclicWorld()
    await follow(world, 100)
    world.plc.fail("TIC-101", "gain-1-percent")
    found = await follow(world, 12)
    assert Verdict.DIVERGED in [each.verdict for each in found]
    assert "gain" == world.follower.suspects[0].cause


async def test_without_pdos_the_link_says_what_it_heard() -> None:
    world = CyclicWorld(lost=1.0)
    with pytest.raises(ReplyTimeoutError, match="no complete cycle within 1 ms; 0 SYNC, 0 complete"):
        await world.sync()


def process(pv: float, mv: float) -> float:
    """First order, 4 s, 1.5 per %, 20 at MV 0, one step of 20 ms."""
    return pv + 0.005 * (20.0 + 1.5 * mv - pv)


class Ticking(VirtualClock):
    """A clock on which the bus goes on while somebody sleeps: each sleep lets one SYNC cross."""

    world: CyclicWorld | None = None

    async def sleep_ns(self, duration_ns: int) -> None:
        if self.world is not None:
            self.advance_ns(20 * MS - self.now_ns() % (20 * MS))
            self.world.cross()


@pytest.mark.slow
async def test_pv_goes_out_by_pdo_and_mv_comes_in_through_the_write_gate(tmp_path: Path) -> None:
    """A simulated process in lockstep with SYNC: nothing goes out but PDO 203h, and the PLC's PV is what it carried."""
    clock = Ticking()
    world = clock.world = CyclicWorld(has_plant=False, clock=clock)
    gate = Gate(world.station, world.station.loops[0], world.link, clock, tmp_path)
    async with gate.armed("simulation", duration_ns=3600 * SECOND, keep=True):
        pv = 20.0
        for step in range(1000):
            picture = await world.sync(behind_ns=(step % 3) * MS)
            pv = process(pv, float(picture.seen["MV"]))
            await gate.stream("PV", pv, picture.words)
            assert np.float32(pv) == world.plc.read("TIC-101", "PV")
    assert {0x203} == {frame.can_id for frame in world.wire.sent}
    figures = world.link.figures.cycles
    assert figures is not None
    assert 1000 == len(world.wire.sent) == figures.sent
    assert 2 * MS == figures.sent_jitter_ns, "the test answers 0, 1 or 2 ms later than at once"
    executions = [event for event in world.events if isinstance(event, Execution)]
    assert [] == [each for each in executions if each.verdict is Verdict.DIVERGED]
    assert world.follower.summary().informative > 0.8 * world.plc.executed("TIC-101")
    assert 60.0 < pv < 90.0, "the PLC's controller brings the simulated process from 20 towards SV, 80"


async def test_a_write_that_no_pdo_takes_goes_by_sdo_and_a_pdo_is_sent_whole() -> None:
    world = CyclicWorld()
    await world.link.exchange(Write(1, Table.HOLDING, 102, (0x0000, 0x4120)))  # 10.0
    assert [CanFrame(0x203, bytes.fromhex("00002041"))] == world.wire.sent
    assert np.float32(10.0) == world.plc.read("TIC-101", "PV")
    with pytest.raises(ReplyTimeoutError, match="node 3 answers no SDO request"):
        await world.link.exchange(Write(1, Table.HOLDING, 100, (0x0000, 0x4120)))
    assert {0x603} == {frame.can_id for frame in world.wire.sent[1:]}


async def test_what_is_read_behind_a_pdo_of_ours_belongs_to_a_later_cycle() -> None:
    world = CyclicWorld(has_plant=False)
    world.cross()
    await world.link.exchange(Write(1, Table.HOLDING, 102, (0x0000, 0x4120)))
    with pytest.raises(ReplyTimeoutError, match="no complete cycle within 1 ms; 1 SYNC, 1 complete"):
        await world.link.exchange(Read(1, Table.HOLDING, 102, 2))
    world.cross()
    reply = await world.link.exchange(Read(1, Table.HOLDING, 102, 2))
    assert (0x0000, 0x4120) == reply.values


class Running(VirtualClock):
    """Goes on by 7 ms whenever somebody looks at it, as a clock does on a busy machine."""

    def now_ns(self) -> int:
        self.advance_ns(7 * MS)
        return super().now_ns()


def test_the_fake_plc_takes_all_pdos_of_a_sync_between_the_same_two_scans() -> None:
    loaded = load("can")
    plc = FakePlc(loaded.station(), loaded.fake_setup(), clock=Running())
    objects = loaded.station().can
    assert objects is not None
    content = CanPlc(plc, objects)
    for _ in range(200):
        frames = {frame.can_id: frame.data for frame in content.on_sync(0)}
        for pdo in objects.pdos:
            held = [plc.memory.read(span.table, span.address, span.count) for span in pdo.spans]
            assert frames[pdo.cob_id] == pdo.encoded(held)
