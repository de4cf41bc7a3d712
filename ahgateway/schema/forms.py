"""The file form of a profile: every table and key that a person may write, with its bounds and default.

Only the shape is decided here. What the keys mean together (devices, overlaps, ranges) is checked in `profile`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, GetJsonSchemaHandler, WithJsonSchema, model_validator
from pydantic_core import CoreSchema

from ahgateway.schema.form import Form
from ahgateway.schema.plant import PlantForm

MINUTE_MS = 60_000
HOUR_MS = 3_600_000

Scalar = Annotated[Any, WithJsonSchema({"type": ["boolean", "number"]})]


class PacingForm(Form):
    """How politely the station wants to be spoken to."""

    reply_timeout_ms: int = Field(default=1000, ge=1, le=MINUTE_MS, description="longest wait for a reply")
    words_per_request_max: int = Field(default=100, ge=1, le=125, description="longest read or write in words")
    requests_in_flight_max: int = Field(default=1, ge=1, le=32, description="requests under way at once, TCP only")
    pause_after_connect_ms: int = Field(default=0, ge=0, le=MINUTE_MS, description="silence after a connection is made")
    pause_between_requests_ms: int = Field(default=0, ge=0, le=MINUTE_MS, description="silence after each reply")
    poll_ms: int = Field(default=0, ge=0, le=HOUR_MS, description="period of polling, 0 as fast as the line allows")
    gap_words_max: int = Field(default=16, ge=0, le=124, description="words read in vain to save a request")
    line_share_max: float = Field(default=1.0, gt=0.0, le=1.0, description="share of the time that our requests take")
    close_when_idle_ms: int = Field(
        default=0, ge=0, le=HOUR_MS, description="close when nothing was asked so long, or 0"
    )
    connections_max: int = Field(default=8, ge=1, le=128, description="connections to this host at a time, TCP only")
    request_wait_max_ms: int = Field(
        default=MINUTE_MS,
        ge=1,
        le=HOUR_MS,
        description="longest wait for its turn; a request that waits longer is not sent",
    )


class CanItemForm(Form):
    """Words or flags that travel together."""

    device: str = Field(min_length=1, description="the first one, D100 or M1")
    length: int | None = Field(default=None, ge=1, le=100, description="words, 2 by default, or flags, 1 by default")


class CanObjectForm(CanItemForm):
    """Objects at consecutive sub-indices that hold consecutive devices."""

    index: int = Field(ge=0x2000, le=0xFFFF, description="object index")
    sub: int = Field(default=0, ge=0, le=254, description="sub-index of the first")
    count: int = Field(default=1, ge=1, le=254, description="how many objects of this length follow each other")


class CanPdoForm(Form):
    """A PDO that the PLC sends after each SYNC."""

    cob_id: int = Field(ge=1, le=0x7FF, description="its identifier")
    maps: list[CanItemForm] = Field(
        min_length=1, max_length=64, description="what it carries, in the order of its bytes"
    )


class CanTakeForm(CanItemForm):
    """A PDO that the PLC takes: the process value of a loop on a bench, and nothing else."""

    cob_id: int = Field(ge=1, le=0x7FF, description="its identifier")


class CanSyncForm(Form):
    """The tick of the cyclic role."""

    cob_id: int = Field(default=0x80, ge=1, le=0x7FF, description="identifier of SYNC")
    period_ms: float = Field(default=20.0, gt=0, le=MINUTE_MS, description="time between two")
    window_ms: float = Field(default=10.0, gt=0, le=MINUTE_MS, description="a PDO later than this is not believed")


class CanForm(Form):
    """What the PLC's CANopen module publishes; typed in from its EDS or from the program that configured it."""

    confidence: Literal["V", "S", "I", "R"] = Field(
        default="R", description="V read in the module's manual or EDS, S decoded, I inferred, R remembered"
    )
    objects: list[CanObjectForm] = Field(min_length=1, max_length=512, description="objects that SDO reads")
    pdos: list[CanPdoForm] = Field(default_factory=list, max_length=512, description="PDOs that the PLC sends")
    takes: list[CanTakeForm] = Field(
        default_factory=list, max_length=512, description="PDOs that the PLC takes, a bench only"
    )
    sync: CanSyncForm = Field(default_factory=CanSyncForm)


class StationForm(Form):
    """The PLC and the way to it."""

    name: str = Field(min_length=1, description="what people call it")
    target: str = Field(min_length=1, description="URI of the link")
    unit: int | None = Field(
        default=None, ge=0, le=255, description="Modbus station number; without it that of the URI, or 1"
    )
    device_map: str = Field(default="ah500", description="name of a shipped device map, or path of one")
    kind: Literal["plant", "bench"] = Field(
        default="plant", description="bench: only our own simulation hangs on this PLC"
    )
    running: str | None = Field(default=None, description="bit device that is on while the PLC is in RUN")
    scratch: str | None = Field(default=None, description="two words that nothing uses, for a marker: D900")
    pacing: PacingForm = Field(default_factory=PacingForm)
    can: CanForm | None = Field(default=None, description="where operands stand on CANopen")


class OperandForm(Form):
    """Where one operand stands: a device, or a literal of the PLC program."""

    device: str | None = Field(
        default=None, description="Delta's spelling, D100 or M1; of 32-bit values the lower word"
    )
    const: Scalar = Field(default=None, description="the operand is this literal in the PLC program")

    @model_validator(mode="before")
    @classmethod
    def _from_device_name(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"device": data}
        if not isinstance(data, dict):
            raise ValueError("is neither a device name in quotes nor a table")
        return data

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        return {"anyOf": [{"type": "string"}, handler(schema)]}


class ToleranceForm(Form):
    """Differences that are reported apart instead of convicted; 0 means bits alone count."""

    ulp_max: int = Field(default=0, ge=0, description="units of the last place")
    mv_max: float = Field(default=0.0, ge=0, description="difference of I and MV in the loop's output unit")


class UnitsForm(Form):
    """Engineering units, for people."""

    pv: str = Field(default="", description="unit of SV and PV")
    mv: str = Field(default="%", description="unit of MV")


class RangesForm(Form):
    """Engineering ranges, lowest and highest value."""

    pv: list[float] | None = Field(default=None, min_length=2, max_length=2, description="range of SV and PV")
    mv: list[float] | None = Field(default=None, min_length=2, max_length=2, description="range of MV")


class EvidenceForm(Form):
    """Who learned the dialect, and from what; typed in by a person or written by `identify`."""

    by: str = Field(default="", description="person or command")
    date: str = Field(default="", description="ISO date")
    executions: int = Field(default=0, ge=0, description="executions that agreed")
    firmware: str = Field(default="", description="firmware of the PLC, as its label or programming tool shows it")
    earlier: dict[str, str] = Field(
        default_factory=dict, description="axis to the date of the earlier run that decided it, where the last did not"
    )


class FakeForm(Form):
    """What only the fake PLC reads."""

    initial: dict[str, Scalar] = Field(default_factory=dict, description="operand to its value at the start")
    plant: PlantForm | None = None


class WriteForm(Form):
    """What may be written to one operand; a BOOL needs only the interval."""

    min: float | None = Field(default=None, description="smallest value that may be written")
    max: float | None = Field(default=None, description="largest value that may be written")
    step_max: float | None = Field(default=None, gt=0, description="largest change by one write")
    interval_s: float = Field(default=1.0, ge=0, le=3600, description="shortest time between two writes")


class LeaseForm(Form):
    """The lease of a loop that the PLC itself keeps, by the snippet of `plc-code heartbeat`."""

    data: str = Field(min_length=1, description="first word of the block, D900; nothing else may use its words")
    timeout_ms: int = Field(default=5000, ge=200, le=MINUTE_MS, description="the beat must change within this time")
    task_ms: int = Field(default=100, ge=1, le=1000, description="period of the interval task with the snippet")


class TriggerForm(Form):
    """What lets one execution through at a time, on a bench."""

    coil: str = Field(description="coil that is the contact EN: we set it, the program clears it behind the execution")
    counter: str = Field(description="word that the program counts up at each execution that the coil let through")


class RecorderForm(Form):
    """The ring in which the PLC records the loop; without `fields` that of `plc-code recorder`."""

    ring: str = Field(description="first word of the ring")
    records: int = Field(default=64, ge=4, le=4096, description="records in the ring")
    head: str = Field(description="word with the slot that is written next, from 0; our snippet takes six more")
    each: Literal["scan", "call", "change"] = Field(
        default="scan",
        description="what makes a record: a scan, a call in an interval task, a scan that changed a word",
    )
    unrecorded: list[str] = Field(default_factory=list, description="operands that no record holds")
    length: int | None = Field(default=None, ge=2, le=125, description="words of a record")
    fields: dict[str, int | str] | None = Field(
        default=None, description='operand to its first word in the record, or its bit, "3.0"'
    )
    sequence: int = Field(default=0, ge=0, description="word of the record's number")
    sequence_words: Literal[1, 2] = Field(default=1, description="words of that number")
    sequence_range: int | None = Field(default=None, ge=8, description="it begins at 0 again here; else with its words")
    sequence_end: int | None = Field(default=None, ge=0, description="word of the same number at the record's end")
    time: int | None = Field(default=None, ge=0, description="word of the PLC's time")
    time_words: Literal[1, 2] = Field(default=2, description="words of that time")
    time_range: int | None = Field(default=None, ge=8, description="it begins at 0 again here; else with its words")
    time_unit: Literal["1 us", "0.1 ms", "1 ms", "10 ms", "100 ms"] = Field(default="1 ms", description="its unit")
    first: str | None = Field(default=None, description="bit that is set in the first record behind STOP")
    head_is: Literal["next", "last"] = Field(default="next", description="slot that the head names")


class LoopForm(Form):
    """One PID instruction of the PLC program."""

    instruction: str = Field(description="name of the instruction, DPIDE")
    layout: Literal["manual"] | None = Field(default=None, description="place operands as the manual's example does")
    data: str | None = Field(
        default=None, description="first register of the layout instead of D100; MV stays 100 behind it"
    )
    flags: str | None = Field(default=None, description="first flag of the layout instead of M1")
    en: str | None = Field(default=None, description="bit device of the instruction's EN contact")
    scan_ms_max: int = Field(default=10, ge=1, le=10_000, description="longest scan to expect")
    operands: dict[str, OperandForm] = Field(default_factory=dict, description="operand to device or constant")
    dialect: dict[str, str | float] = Field(default_factory=dict, description="axis to value, how this PLC discretises")
    counter: str | None = Field(default=None, description="word that the program counts up at each execution")
    pv_held: bool | None = Field(
        default=None, description="PV's register holds still between executions; without it as usual for the block"
    )
    evidence: EvidenceForm = Field(default_factory=EvidenceForm)
    tolerance: ToleranceForm = Field(default_factory=ToleranceForm)
    units: UnitsForm = Field(default_factory=UnitsForm)
    ranges: RangesForm = Field(default_factory=RangesForm)
    write: dict[str, WriteForm] = Field(
        default_factory=dict, description="operand to what may be written; nothing else ever is"
    )
    interval_ms: int | None = Field(
        default=None, ge=1, le=40_000, description="period of the interval task in which the instruction stands"
    )
    pv_rate_max: float | None = Field(
        default=None, ge=0, description="most that PV can move per second; 0 where only we move it"
    )
    follow: Literal["recorded", "polled"] | None = Field(
        default=None, description="how executions are seen; without it recorded where there is a recorder"
    )
    recorder: RecorderForm | None = Field(default=None, description="the PLC records its scans or calls")
    trigger: TriggerForm | None = Field(default=None, description="executions are let through one at a time")
    lease: LeaseForm | None = Field(default=None, description="the PLC puts the loop back when we vanish")
    fake: FakeForm = Field(default_factory=FakeForm)


class ProfileForm(Form):
    """A profile: one station and its loops."""

    station: StationForm
    loops: dict[str, LoopForm] = Field(min_length=1, description="tag of the loop to its table")
