"""A link out of a recording: memory as it stood then, no writes, an end."""

from __future__ import annotations

import pytest
from recording.conftest import Run

from ahgateway.clock import MILLISECOND, SECOND, VirtualClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.errors import LinkError, PlcRefusedError, ProfileError
from ahgateway.lockstep.picture import Sampler
from ahgateway.recording.reader import Recording
from ahgateway.transports.replay import RecordedClock, ReplayLink
from ahgateway.transports.uri import parse_uri


async def test_a_sampler_sees_the_recorded_words_at_their_time(run: Run) -> None:
    await run.polls(20)
    run.close()
    clock = VirtualClock()
    recording = Recording(run.path)
    rows = list(recording.rows())
    link = ReplayLink(recording, clock)
    sampler = Sampler(run.world.loop, recording.station, link, clock)
    for row in rows:
        picture = await sampler.picture()
        assert picture is not None
        assert (row.words, row.running) == (picture.words, picture.running)
        clock.advance_ns(rows[1].last_ns - rows[0].last_ns)
    await link.close()


async def test_a_recording_takes_no_writes_knows_its_addresses_and_ends(run: Run) -> None:
    await run.polls(2)
    run.close()
    clock = VirtualClock()
    link = ReplayLink(Recording(run.path), clock)
    with pytest.raises(PlcRefusedError, match="takes no writes"):
        await link.exchange(Write(1, Table.HOLDING, 100, (1,)))
    with pytest.raises(PlcRefusedError, match="holding register 0x1388 was not recorded"):
        await link.exchange(Read(1, Table.HOLDING, 5000, 2))
    # SV is 50.0 = 0x42480000.
    assert (0x0000, 0x4248) == (await link.exchange(Read(1, Table.HOLDING, 100, 2))).values
    clock.advance_ns(10 * SECOND)
    with pytest.raises(LinkError, match="the recording is over"):
        await link.exchange(Read(1, Table.HOLDING, 100, 2))
    await link.close()
    with pytest.raises(LinkError, match="has been closed"):
        await link.exchange(Read(1, Table.HOLDING, 100, 2))


async def test_a_recorded_clock_runs_as_fast_as_asked() -> None:
    inner = VirtualClock()
    clock = RecordedClock(inner, 1000, 5000, 4.0)
    inner.advance_ns(MILLISECOND)
    assert (1000 + 4 * MILLISECOND, 5000 + 4 * MILLISECOND) == (clock.now_ns(), clock.utc_ns())
    await clock.sleep_ns(8 * MILLISECOND)
    assert 3 * MILLISECOND == inner.now_ns()
    with pytest.raises(ValueError, match="above 0"):
        RecordedClock(inner, 0, 0, 0.0)


@pytest.mark.parametrize(("speed", "is_legal"), [("4", True), ("0.5", True), ("0", False), ("-1", False), ("x", False)])
def test_the_speed_in_a_target_is_a_number_above_0(speed: str, is_legal: bool) -> None:
    text = f"replay://run.ahrec?speed={speed}"
    if is_legal:
        assert speed == parse_uri(text).options["speed"]
        return
    with pytest.raises(ProfileError, match="a number above 0"):
        parse_uri(text)
