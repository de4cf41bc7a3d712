"""A station and its loops as the rest of the house sees them: immutable, checked, with no trace of the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.devices import Device, DeviceMap
from ahgateway.codec.ways import Each, Recorder, Trigger, Way
from ahgateway.core.controllers import Controller


@dataclass(frozen=True, slots=True)
class Const:
    """An operand that is a literal in the PLC program and stands nowhere in its memory."""

    value: float | int | bool


Binding = Device | Const


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Differences that are reported apart instead of convicted; all 0 means bits alone count.

    Attributes:
        ulp_max: Largest distance in units of the last place.
        mv_max: Largest difference of I and MV in the loop's output unit.
    """

    ulp_max: int = 0
    mv_max: float = 0.0


@dataclass(frozen=True, slots=True)
class Pacing:
    """How politely this station wants to be spoken to."""

    reply_timeout_ms: int = 1000
    words_per_request_max: int = 100
    requests_in_flight_max: int = 1
    pause_after_connect_ms: int = 0
    pause_between_requests_ms: int = 0
    poll_ms: int = 0
    gap_words_max: int = 16
    line_share_max: float = 1.0
    close_when_idle_ms: int = 0
    connections_max: int = 8
    request_wait_max_ms: int = 60_000


@dataclass(frozen=True, slots=True)
class WriteLimit:
    """What may be written to one operand; compared after rounding to the operand's own kind.

    Attributes:
        minimum: Smallest value, in the operand's unit; None for a BOOL.
        maximum: Largest value; None for a BOOL.
        step_max: Largest difference from the value that stands there; None for a BOOL.
        interval_s: Shortest time between two writes of this operand.
    """

    minimum: float | None = None
    maximum: float | None = None
    step_max: float | None = None
    interval_s: float = 1.0


@dataclass(frozen=True, slots=True)
class LeaseSpec:
    """Where the PLC keeps the lease of a loop, and when it puts the loop back by itself.

    Attributes:
        data: First word of the block; the PLC's program must not use its words for anything else.
        timeout_ms: The beat must change within this time.
        task_ms: Period of the interval task that calls the snippet.
    """

    data: Device
    timeout_ms: int = 5000
    task_ms: int = 100


@dataclass(frozen=True, slots=True)
class Loop:
    """One PID instruction in the PLC program.

    Attributes:
        name: The loop's tag, `TIC-101`.
        controller: The instruction's law.
        bindings: Operand name in the manual's spelling to where it stands; every operand of the instruction is there.
        en: Device of the instruction's EN contact, None when it is always on or not known.
        dialect: How this PLC discretises; the controller's default when it is left out.
        tolerance: What is not convicted.
        scan_ms_max: Longest scan to expect, which bounds how early an execution can follow another.
        pv_unit: Engineering unit of SV and PV.
        mv_unit: Engineering unit of MV.
        shared: Operands whose device another loop uses too; they are never written.
        pv_range: Lowest and highest value of SV and PV in `pv_unit`, None when nobody said.
        mv_range: Lowest and highest value of MV in `mv_unit`, None when nobody said.
        writes: Operands that may be written, and within which limits; all others are refused.
        counter: Word that the program counts up by one at each execution, wrapping at 65536; None when there is none.
        pv_held: PV's register holds still from one execution to the next, so that it shows what was read; None: as
            usual for the controller.
        lease: The lease that the PLC keeps, None when it holds no such snippet.
        pv_rate_max: Most that PV can move, in its unit per second; 0 where only we move it; None when nobody said.
        interval_ms: Period of the interval task in which the instruction stands: every call executes, and this is the
            sampling time whatever CYCLE says (MANUAL, spec ah500 §1.4); None in the cyclic task.
        recorder: Where the PLC records every scan or call; None where it records nothing.
        trigger: What lets one execution through at a time; None where the instruction runs by itself.
        way: How its executions are seen; `COUNTED` is what `POLLED` comes to when it is slower than CYCLE.
    """

    name: str
    controller: Controller
    bindings: Mapping[str, Binding]
    en: Device | None = None
    dialect: Any = None
    tolerance: Tolerance = Tolerance()
    scan_ms_max: int = 10
    pv_unit: str = ""
    mv_unit: str = "%"
    shared: frozenset[str] = frozenset()
    pv_range: tuple[float, float] | None = None
    mv_range: tuple[float, float] | None = None
    writes: Mapping[str, WriteLimit] = field(default_factory=dict)
    counter: Device | None = None
    pv_held: bool | None = None
    lease: LeaseSpec | None = None
    pv_rate_max: float | None = None
    interval_ms: int | None = None
    recorder: Recorder | None = None
    trigger: Trigger | None = None
    way: Way = Way.POLLED

    def __post_init__(self) -> None:
        if self.dialect is None:
            object.__setattr__(self, "dialect", self.controller.dialect)
        placed = self.controller.with_pv_word(self.dialect)
        if placed is not self.controller:
            object.__setattr__(self, "controller", placed)

    @property
    def is_called(self) -> bool:
        """True when each record is exactly one execution."""
        return self.recorder is not None and self.recorder.each is Each.CALL

    @property
    def holds_pv(self) -> bool:
        """True when PV's register shows what the last execution read."""
        return self.controller.roles.held if self.pv_held is None else self.pv_held


@dataclass(frozen=True, slots=True)
class Station:
    """One PLC and the loops in it.

    Attributes:
        name: What people call it.
        target: URI of the link.
        unit: Modbus station number.
        devices: Its device map.
        running: Device that is on while the PLC is in RUN, None when it is not known.
        bench: True only when nothing but our own simulation hangs on this PLC.
        pacing: Limits of the line.
        loops: In the profile's order.
        scratch: Two words that nothing in the PLC uses, for a marker; None when nobody named any.
        can: Its CANopen objects and PDOs; None when the profile names none.
    """

    name: str
    target: str
    unit: int
    devices: DeviceMap
    loops: tuple[Loop, ...]
    running: Device | None = None
    bench: bool = False
    pacing: Pacing = field(default_factory=Pacing)
    scratch: Device | None = None
    can: CanMap | None = None

    @property
    def is_snapshot(self) -> bool:
        """True where one request shows one moment of the PLC; SDO reads each object at its own time."""
        return not self.target.startswith("canopen:")


@dataclass(frozen=True, slots=True)
class PlantSpec:
    """A simulated process on a loop, in the fake PLC or on a bench: PV follows MV.

    Attributes:
        kind: `fopdt` first order with dead time, `sopdt` two lags, `second_order` by damping, `integrating`, `tank` a
            level with a free outlet, or `heat_cool`, first order with a heater and a cooler; all with dead time.
        gain: PV per MV; PV per MV and second for `integrating` and `tank`.
        tau_s: Time constant in s; not used by `integrating` and `tank`.
        dead_time_s: Dead time in s.
        bias: PV at MV = 0; drift of PV per second for `integrating` and `tank`.
        noise: Standard deviation of the noise on PV.
        initial: PV at the start.
        cool_gain: PV per % of cooling, `heat_cool` only.
        stroke_s: Time of a motor valve in front of the plant from closed to open; None for no valve, but PID_REG_CE
            always drives one. So the next three.
        backlash: Backlash of its gear in %.
        stiction: Further way before a resting stem breaks loose, in %.
        position: Where it stands at the start, in %.
        tau2_s: Second time constant in s, `sopdt` only.
        zeta: Damping, `second_order` only.
        outflow: What leaves a `tank` at PV = 1, per second; as the square root of PV elsewhere.
        pwm_s: Period in s of the pulses that MV is turned into; 0 for none.
        filter_s: Time constant in s of the sensor's lag.
        resolution: Smallest step that the sensor shows.
        span: Where the sensor ends below and above; None for nowhere.
        load_noise: Standard deviation of a random load at the plant's input, in MV's unit.
        load_tau_s: Its time constant in s.
    """

    kind: str
    gain: float
    tau_s: float = 0.0
    dead_time_s: float = 0.0
    bias: float = 0.0
    noise: float = 0.0
    initial: float = 0.0
    cool_gain: float = 0.0
    stroke_s: float | None = None
    backlash: float = 0.0
    stiction: float = 0.0
    position: float = 0.0
    tau2_s: float = 0.0
    zeta: float = 0.0
    outflow: float = 0.0
    pwm_s: float = 0.0
    filter_s: float = 0.0
    resolution: float = 0.0
    span: tuple[float, float] | None = None
    load_noise: float = 0.0
    load_tau_s: float = 10.0


@dataclass(frozen=True, slots=True)
class FakeLoop:
    """What the fake PLC starts a loop with: operand values that differ from the defaults, and its process or none."""

    initial: Mapping[str, float | int | bool] = field(default_factory=dict)
    plant: PlantSpec | None = None
