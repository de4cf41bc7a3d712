"""One loop under each of the four ways of seeing its executions: the ground on which ways are compared.

`ground(way, …)` is a `World` whatever the way; `follow`, `poll`, `plc`, `follower` and `events` are used alike. One
call of `poll` is one look at the PLC: a picture, a drain of the ring, or one triggered execution.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lockstep.bench_world import World

from ahgateway.clock import MILLISECOND
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import PlantSpec
from ahgateway.codec.ways import Each, Place, Recorder, Trigger, Way
from ahgateway.core.controllers import CONTROLLERS, Controller

WAYS = (Way.STEPPED, Way.RECORDED, Way.POLLED, Way.COUNTED)

DPID_FIELDS = {
    "SV": Place(4),
    "PV": Place(6),
    "PID_MODE": Place(8),
    "CYCLE": Place(10),
    "Kp": Place(12),
    "Ki": Place(14),
    "Kd": Place(16),
    "ERR_DBW": Place(18),
    "MV_MAX": Place(20),
    "MV_MIN": Place(22),
    "MOUT": Place(24),
    "I_MV": Place(26),
    "I_MV+1": Place(28),
    "MV": Place(30),
    "PID_RUN": Place(3, 0),
    "PID_MAN": Place(3, 1),
    "MOUT_AUTO": Place(3, 2),
    "PID_DIR": Place(3, 3),
}
DPIDE_FIELDS = {
    "SV": Place(4),
    "PV": Place(6),
    "PID_MODE": Place(8),
    "CYCLE": Place(10),
    "Kc_Kp": Place(12),
    "Ti_Ki": Place(14),
    "Td_Kd": Place(16),
    "Tf": Place(18),
    "ERR_DBW": Place(20),
    "MV_MAX": Place(22),
    "MV_MIN": Place(24),
    "MOUT": Place(26),
    "BIAS": Place(28),
    "I_MV": Place(30),
    "I_MV+6": Place(32),
    "MV": Place(34),
    "PID_RUN": Place(3, 0),
    "PID_MAN": Place(3, 1),
    "MOUT_AUTO": Place(3, 2),
    "PID_EQ": Place(3, 3),
    "PID_DE": Place(3, 4),
    "PID_DIR": Place(3, 5),
}
FIELDS = {"DPID": DPID_FIELDS, "DPIDE": DPIDE_FIELDS}
STILL = PlantSpec("fopdt", 0.0, 3.0, 0.2, 47.0, 0.0, 47.0)
"""A process that nothing moves: what is known of PV at both ends of an interval is known of all of it."""


def recorded_pv(law: Controller) -> str:
    """The word of I_MV in which the instruction records PV."""
    return next(word.name for word in law.seen if word.attr == "pv1")


def layout(controller: str, dialect: Any = None, **changes: Any) -> Recorder:
    """A ring of 64 records at D2000: number, time in ms, flags and first scan, operands, number again."""
    fields = FIELDS[controller]
    law = CONTROLLERS[controller]
    usual, placed = (recorded_pv(each) for each in (law, law if dialect is None else law.with_pv_word(dialect)))
    fields = {placed if name == usual else name: place for name, place in fields.items()}
    length = max(place.offset for place in fields.values()) + 3
    given: dict[str, Any] = {
        "ring": parse_device("D2000"),
        "records": 64,
        "length": length,
        "head": parse_device("D1999"),
        "fields": fields,
        "sequence": 0,
        "sequence_end": length - 1,
        "time": 1,
        "time_words": 2,
        "time_unit_ns": MILLISECOND,
        "first": Place(3, 15),
    }
    return Recorder(**{**given, **changes})


def ground(
    way: Way,
    controller: str = "DPIDE",
    initial: Mapping[str, Any] | None = None,
    *,
    each: Each = Each.SCAN,
    loop_changes: Mapping[str, Any] | None = None,
    cycle_ms: int = 100,
    **world: Any,
) -> World:
    """Return a loop that is followed in this way.

    Args:
        way: The way.
        controller: DPID or DPIDE.
        initial: Operands at the start.
        each: What makes a record, for `RECORDED`; `CALL` puts the instruction into an interval task, for `STEPPED` too.
        loop_changes: Fields of the `Loop`, `dialect` above all.
        cycle_ms: CYCLE; also the period of the interval task where there is one.
        world: Further arguments of `World`.
    """
    changes = dict(loop_changes or {})
    if way is Way.RECORDED:
        changes |= {"way": way, "recorder": layout(controller, changes.get("dialect"), each=each)}
        if each is Each.CALL:
            changes["interval_ms"] = cycle_ms
    elif way is Way.STEPPED:
        trigger = Trigger(parse_device("M50"), parse_device("D1990"))
        changes |= {"way": way, "trigger": trigger, "en": trigger.coil}
        if each is Each.CALL:
            changes["interval_ms"] = cycle_ms
        world = {"is_bench": True, **world}
    elif way is Way.COUNTED:
        world = {"poll_ms": cycle_ms * 5 // 2, "plant": STILL, **world}
        if world["plant"] is STILL:
            changes.setdefault("pv_rate_max", 0.0)
    made = World(controller, initial, loop_changes=changes, cycle_ms=cycle_ms, **world)
    if way in (Way.RECORDED, Way.STEPPED):
        made.poll_ns = cycle_ms * MILLISECOND
    return made
