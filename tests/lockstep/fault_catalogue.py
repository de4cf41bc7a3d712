"""Every fault of the fake against the judge: a loop in some dialect runs well, goes wrong, and is stirred.

Whether a fault changed a bit is read from the PLC's own log: its executions are stepped again by the right law.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from dialects import random_dialect
from lockstep.bench_world import World
from lockstep.dialect_traces import suited
from lockstep.inseparable import is_possible, leaves_the_same, may_have_crossed
from lockstep.ways_world import ground

from ahgateway.codec.ways import Way
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import Dialect
from ahgateway.core.real import REAL, bits, quiet
from ahgateway.fake.faults import FAULTS
from ahgateway.fake.plc import FakePlc
from ahgateway.fake.program import Execution
from ahgateway.lockstep.cause_classes import class_of
from ahgateway.lockstep.picture import predicted
from ahgateway.lockstep.suspects import Suspect

WELL = 120
WRONG = 240
LOOKS = 4
"""Looks at the PLC that one look of a way other than polling stands for: it sees at least one execution each."""
STOOD = 12
"""A trial ends early when one cause has stood first through so many divergences."""
CYCLE_MS = 100
SCHEDULES = ("first_call", "run_on", "run_off_scan", "en_off_time", "schedule", "ts_source")

GAINS: dict[str, dict[str, Any]] = {
    "DPIDE": {"Kc_Kp": 1.7, "Ti_Ki": 0.63, "Td_Kd": 0.21, "Tf": 0.37, "BIAS": 3.3},
    "DPID": {"Kp": 1.7, "Ki": 0.63, "Kd": 0.11},
}

STIR: dict[str, list[tuple[int, str, Any]]] = {
    "dead-band-ignored": [(1, "ERR_DBW", 4.0), (60, "SV", 51.0), (120, "SV", 46.0)],
    "no-bumpless": [(2, "PID_MAN", True), (3, "MOUT", 35.0), (30, "PID_MAN", False)],
    "windup": [(2, "SV", 150.0), (100, "SV", 60.0)],
    "limits-before-sum": [(2, "MV_MAX", 55.0), (60, "SV", 80.0), (120, "SV", 40.0)],
    "bias-after-limits": [(2, "MV_MAX", 55.0), (60, "SV", 80.0), (120, "SV", 40.0)],
}
"""What an operator does, poll by poll, where ordinary control would not show the fault."""

WORK = [
    ("SV", 30.0, 110.0),
    ("MOUT", -5.0, 110.0),
    ("MV_MAX", 50.0, 100.0),
    ("ERR_DBW", 0.0, 6.0),
    ("PID_MAN", 0.0, 0.0),
    ("PID_MAN", 0.0, 0.0),
    ("MOUT_AUTO", 0.0, 0.0),
    ("PID_RUN", 0.0, 0.0),
    ("PID_DIR", 0.0, 0.0),
]
"""What an operator does where nothing is wrong: an operand, and between which values; a switch is turned."""
WORKS = 0.06
"""So often, for each poll."""

TRUTH: dict[str, tuple[str, ...]] = {
    "gain-1-percent": ("gain Kp", "gain Kc_Kp"),
    "ki-1-percent": ("gain Ki", "gain Ti_Ki"),
    "binary64-inside": ("rounding",),
    "truncation": ("rounding",),
    "other-order": ("dialect sum_order", "rounding"),
    "derivative-of-the-other": ("dialect derivative_of", "dialect PID_DE"),
    "direction-reversed": ("direction PID_DIR",),
    "dead-band-ignored": ("gain ERR_DBW",),
    "wrong-ts": ("cycle CYCLE",),
    "limits-before-sum": ("clamp MV", "unknown", "dialect sum_order", "dialect bias_joins", "rounding"),
    "windup": ("dialect freeze",),
    "integral-late": ("dialect integral_used",),
    "no-bumpless": ("dialect transfer",),
    "bias-after-limits": ("clamp MV", "unknown", "dialect bias_joins", "rounding"),
    "filter-ignored": ("gain Tf",),
}
"""Fault to the causes that are true of it; those of the same published class count as right."""

Words = tuple[int, ...]

CASES = [(name, law) for name, fault in FAULTS.items() for law in sorted(fault.controllers) if not fault.is_pv_late]


@dataclass(frozen=True)
class Trial:
    """What came of one fault in one dialect.

    Attributes:
        changed: Executions whose bits the fault changed.
        seen: Those of them whose words were looked at, and that changed a word: polling cannot tell one that changes
            none from no execution, of which it reports `no-execution`.
        convicted: Executions that diverged.
        false: Executions that diverged before the fault.
        suspects: What the loop is suspected of in the end.
        is_right: The likeliest cause is true of the fault, within its class.
        is_tied: It is not, but a true one stands beside it, and both leave every bit of the PLC's own log.
        is_excused: Nothing was convicted, and enumeration finds that the right law can have left every picture, or
            every execution.
    """

    changed: int
    seen: int
    convicted: int
    false: int
    suspects: tuple[Suspect, ...]
    is_right: bool
    is_tied: bool
    is_excused: bool


def label(suspect: Suspect) -> str:
    """The cause and what it concerns, as the classes spell it."""
    cause = "dialect" if suspect.cause == "firmware-change" else suspect.cause
    return f"{cause} {suspect.operand or suspect.setting.partition(' = ')[0]}".strip()


def _true_ones(name: str, suspects: tuple[Suspect, ...]) -> list[Suspect]:
    """Those of the suspects that are true of the fault, within their class."""
    allowed = {member for truth in TRUTH[name] for member in class_of(truth)}
    return [suspect for suspect in suspects if label(suspect) in allowed]


async def warm(law: str, dialect: int, seed: int, way: Way = Way.POLLED) -> World:
    """A loop that has run well for a while, with one step of SV; the same for every fault."""
    chosen = random_dialect(dialect, share=(dialect % 4) / 4, without=SCHEDULES)
    chance = random.Random(f"catalogue {law} {dialect} {seed}")
    gains = {operand: value * chance.uniform(0.8, 1.25) for operand, value in GAINS[law].items()}
    if law == "DPIDE":
        gains |= {"PID_EQ": chance.random() < 0.3, "PID_DE": chance.random() < 0.3}
        gains["Ti_Ki"] = 1.0 / gains["Ti_Ki"] if gains["PID_EQ"] else gains["Ti_Ki"]
    world = ground(
        way, law, _suited(law, gains, chosen), seed=seed, cycle_ms=CYCLE_MS, loop_changes={"dialect": chosen}
    )
    looks = looks_of(world)
    world.plc.write("L1", "SV", 52.0)
    for poll in range(WELL // looks):
        if poll == WELL // looks // 2:
            world.plc.write("L1", "SV", 48.0)
        await _look(world)
    return world


async def go_wrong(world: World, name: str) -> Trial:
    """Let a loop that has run well go wrong in this way."""
    looks = looks_of(world)
    chance = random.Random(f"moments {name}")
    false = world.follower.counts.diverged
    before = world.plc.executed("L1")
    world.plc.fail("L1", name)
    stir: dict[int, tuple[str, Any]] = {}
    for poll, operand, value in STIR.get(name, [(10, "SV", 55.0), (120, "SV", 47.0)]):
        stir[max(poll // looks, max(stir, default=-1) + 1)] = (operand, value)
    first, stood, diverged = "", 0, false
    begun = len(world.looks)
    for poll in range(WRONG // looks):
        if poll in stir:
            # At any moment between two looks, as operators do.
            moment = world.plc.now_ns + chance.randrange(world.poll_ns)
            world.plc.at(moment, partial(_write, *stir[poll]))
        await _look(world)
        if world.follower.counts.diverged > diverged:
            now = label(world.follower.suspects[0])
            stood = stood + 1 if now == first else 1
            first, diverged = now, world.follower.counts.diverged
        if stood >= STOOD:
            break
    log = list(world.plc.log("L1"))[before - world.plc.executed("L1") :]
    wrong = _wrong(world, log)
    looks_seen = {_words(look.seen) for look in world.looks[begun:]}
    seen = [words for words, is_new in wrong if world.loop.way is not Way.POLLED or (is_new and words in looks_seen)]
    convicted = world.follower.counts.diverged - false
    suspects = world.follower.suspects
    true_ones = _true_ones(name, suspects)
    is_right = bool(true_ones) and true_ones[0] is suspects[0]
    # Rounding is no law of its own: what the PLC computes is in its log.
    rivals = [each for each in (suspects[0], true_ones[0]) if each.cause != "rounding"] if true_ones else []
    return Trial(
        len(wrong),
        len(seen),
        convicted,
        false,
        suspects,
        is_right,
        not is_right and bool(rivals) and all(leaves_the_same(world.loop, each, log) for each in rivals),
        bool(seen) and not convicted and _is_excused(world, log),
    )


def _is_excused(world: World, log: list[Execution]) -> bool:
    if may_have_crossed(world.loop, log):
        return True
    return world.loop.way is Way.POLLED and is_possible(world, world.looks)


async def go_on(world: World) -> Trial:
    """Let an operator work on a loop that goes on well: nobody is to be convicted."""
    looks, chance = looks_of(world), random.Random(f"operator {world.loop.controller.name} {world.poll_ns}")
    for _ in range(WRONG // looks):
        if chance.random() < WORKS * looks:
            operand, low, high = chance.choice(WORK)
            value = not world.plc.read("L1", operand) if low == high else round(chance.uniform(low, high), 1)
            world.plc.at(world.plc.now_ns + chance.randrange(world.poll_ns), partial(_write, operand, value))
        await _look(world)
    follower = world.follower
    return Trial(0, 0, 0, follower.counts.diverged, follower.suspects, False, False, False)


async def _look(world: World) -> None:
    await world.poll()
    assert world.follower.picture is not None
    world.looks.append(world.follower.picture)


async def tried(name: str, law: str, dialect: int, seed: int, way: Way = Way.POLLED) -> Trial:
    """Run one fault on one loop."""
    return await go_wrong(await warm(law, dialect, seed, way), name)


def _suited(law: str, gains: dict[str, Any], dialect: Dialect) -> dict[str, Any]:
    """The gains with which a loop works in this dialect: its sign, its unit of time."""
    controller = CONTROLLERS[law]
    given = {name.lower(): REAL(value) if isinstance(value, float) else value for name, value in gains.items()}
    cycle = CYCLE_MS // 10 if law == "DPID" else CYCLE_MS
    fit = suited(controller, controller.inputs(**given, cycle=cycle), dialect)
    return {name: getattr(fit, name.lower()) for name in (*gains, "PID_DIR")}


def _write(operand: str, value: Any, plc: FakePlc) -> None:
    plc.write("L1", operand, value)


def looks_of(world: World) -> int:
    return 1 if world.loop.way is Way.POLLED and world.poll_ns < 100_000_000 else LOOKS


def _wrong(world: World, log: list[Execution]) -> list[tuple[Words, bool]]:
    """Of these executions, those whose words the right law does not leave; and whether they changed any."""
    law, found, last = world.loop.controller, [], None
    for entry in log:
        with quiet(all="ignore"):
            state, terms = law.step(entry.inputs, entry.before, world.loop.dialect, entry.ts)
        words = _words(predicted(law, entry.state, entry.terms))
        if words != _words(predicted(law, state, terms)):
            found.append((words, words != last))
        last = words
    return found


def _words(seen: Mapping[str, Any]) -> Words:
    return tuple(bits(seen[name]) for name in sorted(seen))
