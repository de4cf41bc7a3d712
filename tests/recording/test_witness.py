"""Commands that write: what they saw and wrote stands in the recording, with the journal's last hash."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from lockstep.gate.gate_world import GateWorld

from ahgateway.apps.record import Tape
from ahgateway.apps.replay import Comparison, Replay
from ahgateway.apps.tune import tune
from ahgateway.apps.tune_experiment import Kind, Wanted
from ahgateway.apps.tune_session import Session
from ahgateway.apps.tune_sitting import Envelope
from ahgateway.apps.witness import Witness
from ahgateway.codec.access import Request, Table, Write
from ahgateway.codec.station import PlantSpec
from ahgateway.errors import AhGatewayError, ReplyTimeoutError, StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.picture import Sampler
from ahgateway.recording.reader import Recording


class Bench:
    """A loop that may be written, its gate and its tape."""

    def __init__(self, folder: Path, link: Any = None) -> None:
        self.world = world = GateWorld(folder / "gates")
        self.path = folder / "run.ahrec"
        self.tape = Tape(self.path, world.station, world.clock)
        self.witness = Witness(world.loop, self.tape)
        self.gate = Gate(
            world.station, world.loop, link or world.link, world.clock, world.folder, who="Ada",
            sees=self.witness.see, told=self.witness.told,
        )  # fmt: skip

    def recording(self) -> Recording:
        self.tape.recorder.close()
        return Recording(self.path)


async def test_a_write_stands_with_old_new_outcome_and_the_last_hash_of_the_journal(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    async with bench.gate.armed("a trial"):
        await bench.gate.write({"SV": 52.0}, "because")
    with bench.recording() as recording:
        found = [(loop, operand, each) for _, loop, operand, each in recording.writes()]
        journal = [event.found for event in recording.events("journal")]
        assert [] == recording.check().texts
    texts = [(loop, operand, each["kind"], each["outcome"], each["why"]) for loop, operand, each in found]
    assert [("L1", "SV", "write", "verified", "because"), ("L1", "SV", "restore", "verified", "")] == texts
    # SV 50.0 is 0x42480000, 52.0 is 0x42500000; words low first.
    assert ([0, 0x4248], [0, 0x4250], "50.0", "52.0", "D100", "Ada") == tuple(
        found[0][2][key] for key in ("old", "new", "old_value", "new_value", "device", "who")
    )
    kinds = ["armed", "write", "verified", "restoring", "restore", "verified", "ended"]
    assert kinds == [each["record"]["kind"] for each in journal]
    assert (bench.gate.anchor, str(bench.gate.path)) == (journal[-1]["record"]["hash"], journal[-1]["file"])


async def test_a_write_that_nobody_answered_stands_as_what_was_found_with_the_doubt(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    inner = bench.world.link.exchange

    async def lossy(request: Request) -> Any:
        reply = await inner(request)
        if isinstance(request, Write) and request.table is Table.HOLDING:
            raise ReplyTimeoutError("no reply")
        return reply

    bench.world.link.exchange = lossy  # type: ignore[method-assign]
    async with bench.gate.armed("a trial", keep=True):
        await bench.gate.write({"SV": 52.0})
    with bench.recording() as recording:
        found = [each for _, _, _, each in recording.writes()]
    assert [("verified", "no reply")] == [(each["outcome"], each["doubt"]) for each in found]


async def test_a_write_whose_end_nobody_knows_stands_as_open(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    inner = bench.world.link.exchange
    silent = []

    async def lost(request: Request) -> Any:
        if silent:
            raise ReplyTimeoutError("no reply")
        reply = await inner(request)
        if isinstance(request, Write):
            silent.append(request)
            raise ReplyTimeoutError("no reply")
        return reply

    bench.world.link.exchange = lost  # type: ignore[method-assign]
    with pytest.raises(AhGatewayError):
        async with bench.gate.armed("a trial"):
            await bench.gate.write({"SV": 52.0})
    with bench.recording() as recording:
        found = [each for _, _, _, each in recording.writes()]
        kinds = [event.found["record"]["kind"] for event in recording.events("journal")]
    assert [("open", "no reply")] == [(each["outcome"], each["doubt"]) for each in found]
    assert ["armed", "write", "doubt", "restoring", "left"] == kinds


async def test_a_write_that_somebody_undoes_stands_as_mismatch(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    inner = bench.world.link.exchange

    async def contested(request: Request) -> Any:
        reply = await inner(request)
        if isinstance(request, Write):
            bench.world.plc.write("L1", "SV", 50.0)
        return reply

    bench.world.link.exchange = contested  # type: ignore[method-assign]
    with pytest.raises(StateError, match=r"holds 50\.0 again, not 52\.0"):
        async with bench.gate.armed("a trial"):
            await bench.gate.write({"SV": 52.0})
    with bench.recording() as recording:
        assert "mismatch" == next(each for _, _, _, each in recording.writes())["outcome"]


async def test_pictures_of_gate_and_sampler_are_one_history_that_replays_to_the_same_verdicts(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    world = bench.world
    sampler = Sampler(world.loop, world.station, world.link, world.clock, bench.witness.see)

    async def watch() -> None:
        for _ in range(30):
            world.clock.advance_ns(25_000_000)
            await sampler.picture()

    await watch()
    async with bench.gate.armed("a trial"):
        await bench.gate.write({"SV": 52.0})
        await watch()
    await watch()
    with bench.recording() as recording:
        rows = list(recording.rows())
        again = Replay(recording)
        then = Comparison(again)
        for report in again.reports():
            then.take(report)
        assert list(range(len(rows))) == [row.tick for row in rows]
        assert 90 < len(rows)
        assert then.result().is_whole
        assert 20 < then.result().same
        assert 0 == again.followers["L1"].counts.diverged


async def test_an_experiment_stands_in_the_recording_with_every_picture_and_write(tmp_path: Path) -> None:
    plant = PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0)
    start = {"SV": 80.0, "CYCLE": 200, "Kc_Kp": 1.0, "Ti_Ki": 0.15, "Td_Kd": 0.0}
    world = GateWorld(tmp_path / "gates", start, plant=plant, scan_ms=20)
    world.clock.advance_ns(120_000_000_000)
    tape = Tape(tmp_path / "tune.ahrec", world.station, world.clock)
    session = Session(
        world.station, world.loop, world.link, world.clock, world.folder, Envelope((40.0, 120.0), (10.0, 90.0)),
        witness=Witness(world.loop, tape),
    )  # fmt: skip
    await session.excited(Wanted(Kind.STEP, 2.5, hold_s=8.0), tune)
    tape.recorder.close()
    with Recording(tmp_path / "tune.ahrec") as recording:
        found = [(each["kind"], operand, each["outcome"]) for _, _, operand, each in recording.writes()]
        rows = list(recording.rows())
    assert {("write", "PID_MAN", "verified"), ("write", "MOUT", "verified"), ("restore", "PID_MAN", "verified")} <= set(
        found
    )
    assert 80 < len(rows)
    assert list(range(len(rows))) == [row.tick for row in rows]


async def test_without_a_tape_nothing_is_kept_and_nothing_fails(tmp_path: Path) -> None:
    world = GateWorld(tmp_path / "gates")
    witness = Witness(world.loop, None)
    gate = Gate(world.station, world.loop, world.link, world.clock, world.folder, sees=witness.see, told=witness.told)
    async with gate.armed("a trial"):
        await gate.write({"SV": 52.0})
    assert "restored" == gate.session.end if gate.session else ""
