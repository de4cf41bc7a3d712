"""The advice that `identify` prints for an open axis, taken literally on the fake PLC by an operator in virtual time.

For each axis: how the loop stands before, and what the operator does. K, I and D name the gains of either instruction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from lockstep.bench_world import World

from ahgateway.apps.identify import Learned, learn
from ahgateway.codec.station import PlantSpec
from ahgateway.core.dialect import AXES, DEFAULT
from ahgateway.core.dialect_axes import BY_NAME
from ahgateway.lockstep.candidates import SAME_ON_DPID
from ahgateway.lockstep.picture import Picture

GAINS = {
    "DPID": {"K": "Kp", "I": "Ki", "D": "Kd"},
    "DPIDE": {"K": "Kc_Kp", "I": "Ti_Ki", "D": "Td_Kd"},
}
PLAIN: dict[str, Any] = {"SV": 50.0, "K": 1.3, "I": 0.37, "D": 0.0, "MV_MAX": 100.0, "MV_MIN": -40.0}
DEPENDENT: dict[str, Any] = {"PID_EQ": True, "I": 2.7}

PLANT = PlantSpec("fopdt", 1.2, 3.0, 0.2, 10.0, 0.05, 45.0)
POLLS = 8
"""Polls after each thing that the operator does: two CYCLEs of 100 ms."""

Move = tuple[Any, ...]


class Operated(World):
    """A world in which an operator sets what the sensor shows; `near` moves on by a last digit with each picture."""

    near: float | None = None


@dataclass(frozen=True)
class Advice:
    """One axis, the loop before, and what is done to it.

    Attributes:
        axis: Name of the axis.
        moves: One after the other: `(operand, value)`; of the sensor `("PV", value)`, `("near", value)` with a last
            digit that goes on moving, `("once", value)` for just one execution, `("flick", there, back)` between two
            executions; `("EN", on)`, `("STOP",)`, `("RUN",)`; `("wait", polls)`, and `("execution",)`, which waits
            until one has been; several in a tuple are done at once.
        before: What the loop has at the start, beside `PLAIN`.
        world: What the fake PLC is given, beside the usual.
        values: The values that are walked, all of them where None.
        left: What stays open beside a value, because it does the same whatever an operator does.
    """

    axis: str
    moves: tuple[Move, ...] = ()
    before: dict[str, Any] = field(default_factory=dict)
    world: dict[str, Any] = field(default_factory=dict)
    values: tuple[int, ...] | None = None
    left: dict[int, tuple[int, ...]] = field(default_factory=dict)


INTO_A_LIMIT: tuple[Move, ...] = (
    ("SV", 130.0), ("wait", 16), ("SV", 50.0), ("wait", 160), ("MV_MAX", 10.0), ("SV", 39.0), ("wait", 16),
)  # fmt: skip
"""Into a limit and back out of it by SV; then MV_MAX below I_MV."""

MANUAL: tuple[Move, ...] = (
    ("PID_MAN", True), ("wait", 16), ("SV", 56.0), ("MOUT", 38.5), ("PID_MAN", False), ("wait", 12),
)  # fmt: skip
TRANSFERS: tuple[Move, ...] = tuple(
    move for mout in (38.5, 21.7, 33.3) for move in (*MANUAL[:3], ("MOUT", mout), *MANUAL[4:])
)
STANDSTILL: tuple[Move, ...] = (("PID_RUN", False), ("wait", 16), ("PID_RUN", True), ("wait", 12))
FILTER: tuple[Move, ...] = (("D", 0.4), ("Tf", 0.31), ("SV", 57.3), ("wait", 60))
FILTERED: tuple[Move, ...] = (*FILTER, ("SV", 49.1), ("D", 0.27), ("wait", 24))
"""What tells `filter` and `filter_content`, on which the history of a DPIDE waits."""

SLOW: dict[str, Any] = {"cycle_ms": 1300, "poll_ms": 50}

NUDGES: tuple[Move, ...] = tuple(
    move for step in (1.37, -1.71, 2.23, -1.19, 1.93, -2.41) * 3 for move in (("SV", 50.0 + step), ("wait", 4))
)
"""Odd steps of SV, each of which D answers."""
SWINGS: tuple[Move, ...] = tuple(move for sv in (61.3, 22.7) * 3 for move in (("SV", sv), ("wait", 24)))
"""Steps of SV that let I_MV swing through 0."""

EITHER: tuple[Advice, ...] = (
    Advice("freeze", INTO_A_LIMIT),
    Advice("run_off", STANDSTILL),
    Advice("direction"),
    Advice("ts_unit", before={"I": 0.003}, world={"cycle_ms": 130}, values=(0, 1, 2, 4)),
    Advice("ts_scale", (("CYCLE", 0.13), ("wait", 40), ("CYCLE", 0.07), ("wait", 40))),
    Advice("integrator"),
    Advice("integral_used"),
    Advice("product", SWINGS),
    Advice("derivative_product", (("D", 0.93), *NUDGES)),
    Advice("first_history", (*FILTERED, *STANDSTILL), left={1: (0, 1)}),
    Advice("sum_order", (("D", 0.437), *NUDGES)),
    Advice("freeze_test", (*INTO_A_LIMIT, ("SV", 50.0), ("MV_MAX", 45.0), ("D", 9.0), ("wait", 80))),
    Advice(
        "limit_edge",
        (*INTO_A_LIMIT, ("SV", 50.0), ("PV", 42.0), ("K", 1.0), ("I", 0.0), ("MV_MAX", 16.0), ("I", 0.5), ("wait", 60)),
        world={"cycle_ms": 500, "poll_ms": 60},
    ),
    Advice(
        "limited_output",
        (*INTO_A_LIMIT, ("SV", 50.0), ("K", 0.0), ("MV_MAX", 60.0), ("I", 2.9), ("SV", 90.0), ("wait", 80)),
    ),
    Advice("limits", (("MV_MIN", 60.0), ("MV_MAX", 20.0), ("wait", 16))),
    Advice("clamped", (("K", -1.0), ("wait", 8), ("K", 1.3))),
    Advice("ki_off", (("I", 0.0), ("wait", 16), ("I", 0.37))),
    Advice("run_off_history", (*FILTERED, *STANDSTILL), left={1: (0, 1)}),
    Advice("run_off_mout", (("MOUT_AUTO", True), *STANDSTILL, *STANDSTILL)),
    Advice("run_off_scan", (("execution",), ("PID_RUN", False), ("wait", 52), ("PID_RUN", True)), world=SLOW),
    Advice(
        "run_on",
        (("execution",), ("PID_RUN", False), ("wait", 70), ("PID_RUN", True), ("wait", 65)),
        world=SLOW,
    ),
    Advice(
        "en_off_time", (("execution",), ("EN", False), ("wait", 5), ("EN", True), ("wait", 65)),
        world={**SLOW, "en": "M50"},
    ),
    Advice(
        "en_on_history", (*FILTERED, *STANDSTILL, ("EN", False), ("wait", 16), ("EN", True), ("wait", 12)),
        world={"en": "M50"},
    ),
    Advice("stop_history", (*FILTERED, *STANDSTILL, ("STOP",), ("wait", 16), ("RUN",), ("wait", 12))),
    Advice("manual_integral", MANUAL),
    Advice("manual_history", (("D", 0.11), *MANUAL)),
    Advice(
        "manual_refresh", (("PID_MAN", True), ("wait", 52), ("execution",), ("MOUT", 38.5), ("wait", 39)),
        world=SLOW,
    ),
    Advice("mout_auto", (("MOUT_AUTO", True), ("PID_MAN", True), *(("MOUT", 120.0), ("MOUT", 130.0)) * 3)),
    Advice("transfer", MANUAL),
    Advice("preset_order", (("D", 0.0437), ("BIAS", 3.3), *TRANSFERS, *TRANSFERS)),
    Advice("preset_d", (("D", 0.11), *TRANSFERS)),
    Advice("preset_integrates", MANUAL),
    Advice("preset_limit", (("K", 30.0), *MANUAL)),
    Advice("bad_input", (("SV", float("nan")), ("wait", 16), ("SV", 50.0))),
    Advice(
        "form_change",
        (
            ("D", 0.11), *NUDGES[:12], ("PID_DIR", False), ("wait", 4), ("PID_DIR", True), ("wait", 8),
            ("PID_DE", True), ("wait", 4), ("PID_DE", False),
        ),
    ),
    Advice("cycle_change", (("execution",), ("CYCLE", 0.26), ("wait", 60)), world=SLOW),
    Advice(
        "mout_scan", (("MOUT_AUTO", True), *(("execution",), ("MOUT", 5.0), ("wait", 20)) * 3),
        world={"cycle_ms": 1000, "poll_ms": 6, "scan_ms": 20},
    ),
    Advice("ts_source", (("CYCLE", 0.13), ("wait", 600)), world={"scan_ms": 17.313, "poll_ms": 4}),
    Advice("schedule", (("CYCLE", 0.13), ("wait", 300)), world={"scan_ms": 9, "poll_ms": 4}),
    Advice(
        "run_off_manual",
        (
            *MANUAL, ("PID_MAN", True), ("wait", 8), ("PID_RUN", False), ("PID_MAN", False), ("PID_RUN", True),
            ("wait", 12), ("PID_RUN", False), ("PID_MAN", True), (("PID_MAN", False), ("PID_RUN", True)), ("wait", 12),
        ),
    ),
    Advice("preset_mv", (*MANUAL, ("PID_MAN", True), ("wait", 8), (("MOUT", 21.7), ("PID_MAN", False)), ("wait", 12))),
)  # fmt: skip

BAND: tuple[Move, ...] = (
    ("near", 44.0), ("ERR_DBW", 3.0), ("near", 48.5), ("near", 51.0), ("near", 54.0), ("near", 51.0),
)  # fmt: skip
CROSS_BAND: tuple[Move, ...] = (
    ("near", 40.0), ("ERR_DBW", 6.0), ("near", 46.0), ("near", 47.0), ("near", 51.0), ("near", 52.0), ("near", 58.0),
)  # fmt: skip
FLICK: tuple[Move, ...] = (
    ("near", 40.0), ("near", 46.0), ("near", 47.0), ("flick", 51.0, 47.5), ("near", 48.0), ("near", 48.5),
)  # fmt: skip
"""PV passes SV and comes back between two executions."""
CROSSED: tuple[Move, ...] = (("near", 40.0), ("near", 46.0), ("near", 52.0))
"""PV enters the band from below and passes SV = 50."""
ON_AND_OFF: tuple[Move, ...] = (("PID_MAN", True), ("PID_MAN", False), ("near", 52.5))

OF_DPID: tuple[Advice, ...] = (
    Advice("integral_store", values=(0, 1)),
    Advice("band", BAND),
    Advice("band_edge", (*BAND, ("near", 54.0), ("once", 47.0), ("near", 46.0))),
    Advice("derivative_of", (("D", 0.11), ("wait", 12), ("SV", 53.0))),
    Advice("transfer_2", (("PID_MODE", 2), *MANUAL)),
)

OF_DPIDE: tuple[Advice, ...] = (
    Advice("cross_band", (*CROSS_BAND, *FLICK)),
    Advice("cross_edge", (*CROSS_BAND, *FLICK, *CROSSED, ("once", 56.0), ("near", 57.0))),
    Advice("cross_touch", (*CROSS_BAND, *FLICK, *CROSSED[:2], ("once", 50.0), ("near", 48.0), ("near", 47.0))),
    Advice("cross_manual", (*MANUAL, ("SV", 50.0), *CROSS_BAND, *FLICK, *CROSSED, *ON_AND_OFF)),
    Advice("cross_d", (("D", 0.11), *CROSS_BAND, *FLICK, *CROSSED, ("near", 51.0), ("near", 58.0))),
    Advice("cross_jump", (*CROSS_BAND, *FLICK, ("near", 42.0), ("SV", 38.0), ("near", 43.0))),
    Advice("cross_sv", (*CROSS_BAND, *FLICK, *CROSSED, ("SV", 50.5), ("near", 53.0))),
    Advice("cross_scan", (("ERR_DBW", 6.0), *FLICK)),
    Advice("ratio", (("PID_EQ", True), ("I", 0.9), *SWINGS)),
    Advice("dependent_sum", (("PID_EQ", True), ("I", 2.7), ("D", 0.437), *NUDGES)),
    Advice("integral_store", (("wait", 30),), before=DEPENDENT),
    Advice("filter", (*FILTER, ("SV", 44.7), ("wait", 60))),
    Advice("filter_content", (*FILTER, ("SV", 44.7), ("wait", 8), ("D", 0.27), ("wait", 40))),
    Advice("tf_unit", (("PID_EQ", True), ("I", 2.7), *FILTER)),
    Advice("bias_joins", (("D", 0.437), ("BIAS", 3.3), *NUDGES)),
    Advice(
        "kc_off",
        (("I", 0.0), ("wait", 16), ("PID_EQ", True), ("I", 2.7), ("wait", 20), ("K", 0.0), ("wait", 12), ("K", 1.3)),
    ),
    Advice("run_off_filter", (*FILTERED, *STANDSTILL)),
    Advice("manual_filter", (*FILTERED, *MANUAL, ("wait", 30))),
    Advice(
        "form_integral", (("PID_EQ", True), ("I", 2.7), ("wait", 20), ("PID_EQ", False), ("wait", 12)),
    ),
)  # fmt: skip

NOT_IN_PICTURES = ("first_call",)
"""Only the time from power-up to the first change of MV shows it."""


def every() -> Iterator[tuple[str, Advice, int]]:
    """Each instruction, axis and value to walk."""
    for name, own in (("DPID", OF_DPID), ("DPIDE", OF_DPIDE)):
        for advice in (*EITHER, *own):
            wanted = [int(value) for value in AXES[advice.axis]] if advice.values is None else advice.values
            for value in wanted:
                if name != "DPID" or SAME_ON_DPID.get(advice.axis) != value:
                    yield name, advice, value


def alike(name: str, advice: Advice, value: int) -> tuple[int, ...]:
    """Every value of the axis that leaves the same bits as this one in the dialect that is walked."""
    if value in advice.left:
        return advice.left[value]
    dialect = _dialect(advice, value)
    for rule in BY_NAME[advice.axis].alike:
        given = {axis: values for axis, values in rule.given.items() if BY_NAME[axis].concerns(name)}
        is_met = rule.instruction in ("", name) and all(getattr(dialect, axis) in held for axis, held in given.items())
        if is_met and (not rule.own or value in rule.own):
            return tuple(int(each) for each in rule.own or AXES[advice.axis])
    return (value,)


def _dialect(advice: Advice, value: int) -> Any:
    chosen: Any = {advice.axis: AXES[advice.axis](value)}
    return DEFAULT._replace(**chosen)


async def walked(name: str, advice: Advice, value: int, *, is_taken: bool = True) -> Learned:
    """Let the loop run, take the advice or go on without it, and learn from every picture."""
    dialect = _dialect(advice, value)
    settings = {"cycle_ms": 100, "poll_ms": 25, "scan_ms": 5, **advice.world}
    start = {GAINS[name].get(key, key): held for key, held in {**PLAIN, **advice.before}.items()}
    world = Operated(
        name,
        start,
        plant=PLANT,
        loop_changes={"dialect": dialect, "scan_ms_max": max(10, math.ceil(settings["scan_ms"]))},
        **settings,
    )
    if settings.get("en"):
        _en(world, True)
    pictures: list[Picture] = []
    await _watched(world, pictures, 10 * settings["cycle_ms"] // settings["poll_ms"] + 20)
    for move in advice.moves if is_taken else (("wait", 40),):
        await _moved(world, name, move, pictures)
    await _watched(world, pictures, 30)
    return learn(world.station, {"L1": pictures})[0]


async def _watched(world: Operated, pictures: list[Picture], polls: int) -> None:
    for _ in range(polls):
        if world.near is not None:
            world.near += 0.01
            world.plc.write("L1", "PV", world.near)
        world.clock.advance_ns(world.poll_ns)
        pictures.extend(each for each in await world.sampler.pictures() if isinstance(each, Picture))


async def _moved(world: Operated, name: str, move: Move, pictures: list[Picture]) -> None:
    what = move[0]
    if what == "wait":
        await _watched(world, pictures, move[1])
    elif what == "execution":
        count = world.plc.executed("L1")
        while world.plc.executed("L1") == count:
            await _watched(world, pictures, 1)
    elif what == "once":
        for each in (("execution",), (("PV", move[1]),), ("execution",), ("near", move[1])):
            await _moved(world, name, each, pictures)
    elif what == "flick":
        await _moved(world, name, ("execution",), pictures)
        for pv, polls in ((move[1], 2), (move[2], 1)):
            _done(world, name, ("near", pv))
            await _watched(world, pictures, polls)
        await _watched(world, pictures, POLLS)
    else:
        for each in move if isinstance(what, tuple) else (move,):
            _done(world, name, each)
        await _watched(world, pictures, 0 if isinstance(what, tuple) and len(move) == 1 else POLLS)


def _done(world: Operated, name: str, move: Move) -> None:
    what, *rest = move
    if what == "STOP":
        world.plc.stop()
    elif what == "RUN":
        world.plc.run()
    elif what == "EN":
        _en(world, rest[0])
    elif what in ("PV", "near"):
        world.plc.freeze_pv("L1")
        world.plc.write("L1", "PV", rest[0])
        world.near = rest[0] if what == "near" else None
    elif what == "CYCLE":
        world.plc.write("L1", "CYCLE", round(rest[0] * (100 if name == "DPID" else 1000)))
    elif GAINS[name].get(what, what) in {row.name for row in world.loop.controller.operands}:
        world.plc.write("L1", GAINS[name].get(what, what), rest[0])


def _en(world: Operated, is_on: bool) -> None:
    """Switch the contact by which the program calls the instruction."""
    device = world.loop.en
    assert device is not None
    place = world.station.devices.address(device)
    world.plc.memory.write(place.table, place.address, (int(is_on),))
