"""What an adapter can do to us, played by a scripted bus on virtual time: loss, bus-off, silence, damaged lines."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import can
import pytest

from ahgateway.clock import MILLISECOND, SECOND, VirtualClock, WallClock
from ahgateway.codec.can_frame import CanFrame, pack, service, unpack
from ahgateway.errors import FrameError, LinkError, StateError
from ahgateway.transports.can.bus import CanBus, channel
from ahgateway.transports.can.reader import BusReader, Health, Trouble
from ahgateway.transports.uri import parse_uri

FRAME = can.Message(arbitration_id=0x183, data=[1, 2], is_extended_id=False, timestamp=4e9)


class Scripted:
    """An adapter that does what a list says, a step for each `recv`; each step takes 100 ms, a frame takes none.

    A step is a frame, an error to raise, a state to go to, or None for nothing heard.
    """

    def __init__(self, clock: VirtualClock, steps: Iterator[object]) -> None:
        self.state = can.BusState.ACTIVE
        self.shutdowns = 0
        self.sent: list[can.Message] = []
        self._clock = clock
        self._steps = steps

    def recv(self, timeout: float | None = None) -> can.Message | None:
        step = next(self._steps, None)
        if isinstance(step, can.Message):
            return step
        self._clock.advance_ns(100 * MILLISECOND)
        if isinstance(step, Exception):
            raise step
        if isinstance(step, can.BusState):
            self.state = step
        return None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg)

    def shutdown(self) -> None:
        self.shutdowns += 1


class Bench:
    """A reader on a scripted adapter; `openings` may hold errors that opening raises."""

    def __init__(self, steps: list[object], openings: list[Exception | None] | None = None) -> None:
        self.clock = VirtualClock()
        self.frames: list[CanFrame] = []
        self.troubles: list[Trouble] = []
        self.raws: list[Scripted] = []
        self._openings = iter(openings or [])
        self._steps = iter(steps)
        self.reader = BusReader(self._open, self.clock, self.frames.append, self.troubles.append)

    def _open(self) -> Scripted:
        error = next(self._openings, None)
        if error is not None:
            raise error
        self.raws.append(Scripted(self.clock, self._steps))
        return self.raws[-1]

    def run(self, turns: int) -> list[str]:
        for _ in range(turns):
            self.reader.turn(lambda seconds: self.clock.advance_ns(round(seconds * SECOND)))
        return [trouble.name for trouble in self.troubles]


def test_a_frame_gets_our_time_and_not_the_adapter_s() -> None:
    bench = Bench([None, FRAME])
    bench.run(3)
    assert [CanFrame(0x183, b"\1\2", now_ns=100 * MILLISECOND)] == bench.frames


def test_an_unplugged_adapter_is_seen_at_once_counted_and_opened_again() -> None:
    gone = can.CanOperationError("Could not read from serial device")
    bench = Bench([FRAME, gone, FRAME], [None, OSError(2, "no such device"), None])
    assert ["open", "lost", "lost", "open"] == bench.run(9)
    lost = bench.troubles[1]
    assert "Could not read from serial device" in lost.text
    assert lost.now_ns <= SECOND
    figures = bench.reader.figures
    assert (2, 1, 2) == (figures.opens, figures.losses, figures.received)
    assert "Could not read" in figures.first_cause
    assert 1 == bench.raws[0].shutdowns


def test_the_backoff_doubles_up_to_two_seconds() -> None:
    bench = Bench([], [OSError(2, "nothing")] * 8)
    bench.run(70)
    tried = [trouble.now_ns // MILLISECOND for trouble in bench.troubles]
    assert [0, 100, 300, 700, 1500, 3100, 5100] == tried[:7]


def test_bus_off_is_a_loss_with_its_own_name_and_count() -> None:
    bench = Bench([None, can.BusState.ERROR, None, None, None, None, FRAME])
    names = bench.run(11)
    assert ["open", "bus-off", "open"] == names
    assert (1, 1) == (bench.reader.figures.bus_offs, bench.reader.figures.losses)
    assert bench.troubles[1].now_ns < SECOND
    assert 1 == len(bench.frames)


def test_error_passive_is_told_once_and_so_is_its_end() -> None:
    passive, active = can.BusState.PASSIVE, can.BusState.ACTIVE
    bench = Bench([passive, None, None, None, active, None, None, None])
    assert ["open", "error-passive", "error-active"] == bench.run(9)
    assert Health.ACTIVE is bench.reader.health


@pytest.mark.parametrize(
    ("can_id", "data", "health"),
    [
        (0x004, [0, 0x10, 0, 0, 0, 0, 0, 0], Health.PASSIVE),  # receive errors
        (0x004, [0, 0x20, 0, 0, 0, 0, 0, 0], Health.PASSIVE),  # send errors
        (0x004, [0, 0x40, 0, 0, 0, 0, 0, 0], Health.ACTIVE),
        (0x100, [0] * 8, Health.ACTIVE),  # restarted
        (0x040, [0] * 8, Health.CLOSED),  # bus-off: closed, to be opened again
        (0x020, [0] * 8, Health.UNKNOWN),  # no acknowledge says nothing of the state
    ],
)
def test_error_frames_tell_the_state(can_id: int, data: list[int], health: Health) -> None:
    bench = Bench([can.Message(arbitration_id=can_id, data=data, is_error_frame=True)])
    bench.run(2)
    assert health is bench.reader.health
    assert [] == bench.frames
    assert 1 == bench.reader.figures.error_frames


def test_silence_is_told_within_a_second_and_ends_with_a_frame() -> None:
    bench = Bench([FRAME, *[None] * 12, FRAME])
    assert ["open", "silent", "heard"] == bench.run(15)
    assert SECOND == bench.troubles[1].now_ns
    assert 1 == bench.reader.figures.silences


def test_a_damaged_line_is_counted_and_the_next_frame_comes_through() -> None:
    bench = Bench([ValueError("invalid literal"), FRAME])
    bench.run(3)
    assert (1, 1) == (bench.reader.figures.garbage, len(bench.frames))


def test_an_adapter_that_reports_no_state_is_unknown_and_not_active() -> None:
    clock = VirtualClock()
    reader = BusReader(
        lambda: can.Bus(interface="virtual", channel="no-state"), clock, lambda frame: None, lambda trouble: None
    )
    reader.turn(lambda seconds: None)
    clock.advance_ns(SECOND)
    reader.turn(lambda seconds: None)
    assert Health.UNKNOWN is reader.health
    reader.shut()
    assert Health.CLOSED is reader.health


def bus(name: str, **options: object) -> CanBus:
    return CanBus(lambda: can.Bus(interface="virtual", channel=name), WallClock(), name, **options)  # type: ignore[arg-type]


async def test_what_nobody_fetches_is_dropped_counted_and_bounded() -> None:
    """The event loop stands still while a hundred frames come in; eight may wait."""
    sender = can.Bus(interface="virtual", channel="flood")
    receiver = bus("flood", queue_max=8)
    got: list[CanFrame] = []
    receiver.subscribe(got.append)
    await receiver.open()
    for number in range(100):
        sender.send(can.Message(arbitration_id=0x100, data=[number], is_extended_id=False))
    while receiver.figures.received < 100:
        pass
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert [bytes([number]) for number in range(8)] == [frame.data for frame in got]
    assert 92 == receiver.figures.overflows
    await receiver.close()
    sender.shutdown()


async def test_a_listen_only_bus_never_sends() -> None:
    quiet, other = bus("quiet", is_listen_only=True), can.Bus(interface="virtual", channel="quiet")
    await quiet.open()
    with pytest.raises(StateError, match="listen-only, frame 603"):
        await quiet.send(CanFrame(0x603, b"\x40"))
    assert other.recv(timeout=0) is None
    await quiet.close()
    other.shutdown()


async def test_a_bus_that_cannot_be_opened_says_why_and_how_to_look() -> None:
    def opener() -> can.BusABC:
        raise OSError(19, "No such device")

    closed = CanBus(opener, WallClock(), "canopen://socketcan/can0")
    with pytest.raises(LinkError, match=r"can0: cannot be opened: \[Errno 19\] No such device") as caught:
        await closed.open()
    assert "plugged in" in str(caught.value.hint)
    with pytest.raises(LinkError, match="not open"):
        await closed.send(CanFrame(0, b""))
    await closed.close()
    with pytest.raises(LinkError, match="closed"):
        await closed.open()


def test_a_packed_frame_is_candump_s_and_comes_back() -> None:
    for packed, frame in [
        ("00000183 0102", CanFrame(0x183, b"\1\2")),
        ("80012345", CanFrame(0x12345, b"", is_extended=True)),
        ("40000701", CanFrame(0x701, b"", is_remote=True)),
        ("20000040 0000000000000000", CanFrame(0x40, bytes(8), is_error=True)),
    ]:
        assert bytes.fromhex(packed) == pack(frame)
        assert frame == unpack(bytes.fromhex(packed))
    for wrong in ("000001", "00000800", "00000100" + "00" * 9):
        with pytest.raises(FrameError):
            unpack(bytes.fromhex(wrong))


@pytest.mark.parametrize(
    ("can_id", "name"),
    [
        (0x000, ("NMT", 0)),
        (0x080, ("SYNC", 0)),
        (0x083, ("EMCY", 3)),
        (0x183, ("TPDO1", 3)),
        (0x57F, ("RPDO4", 127)),
        (0x583, ("SDO reply", 3)),
        (0x603, ("SDO request", 3)),
        (0x703, ("heartbeat", 3)),
        (0x7E5, ("", 0)),
    ],
)
def test_the_predefined_connection_set(can_id: int, name: tuple[str, int]) -> None:
    assert name == service(can_id)


def test_a_serial_channel_gets_its_slash_back() -> None:
    assert "/dev/ttyACM0" == channel(parse_uri("canopen://slcan/dev/ttyACM0?node=3"))
    assert "COM3" == channel(parse_uri("canopen://slcan/COM3?node=3"))
    assert "can0" == channel(parse_uri("canopen://socketcan/can0?node=3"))
