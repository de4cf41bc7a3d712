"""Every planted defect is found and named, nothing crashes, and no write leaves the allow-list."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from apps.commission_bench import ALLOWED, NOT_ASKED, PLANT, WISHES, Bench, station

from ahgateway.apps.commission.checks import Outcome
from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.codec.access import Table
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import PlantSpec

READ_ONLY = replace(WISHES, is_armed=False)


@dataclass(frozen=True)
class Defect:
    """What is wrong, and the finding that must name it; `also` may fail with it."""

    name: str
    finding: str
    setup: dict[str, Any] = field(default_factory=dict)
    plant: Callable[[Bench], None] = lambda bench: None
    also: frozenset[str] = frozenset()
    outcome: Outcome = Outcome.FAIL
    is_armed: bool = False


def written_by_another(bench: Bench) -> None:
    bench.later(1.0, lambda plc: plc.write("L", "SV", 57.0 if plc.scans % 2 else 59.0, who="HMI"), every_s=0.73)


def quantised(bench: Bench) -> None:
    bench.plc.freeze_pv("L")
    bench.later(
        0.0,
        lambda plc: plc.write("L", "PV", round(plc.processes["L"].pv * 2 + (plc.scans // 7) % 2) / 2),
        every_s=0.1,
    )


def overwritten(bench: Bench) -> None:
    bench.later(0.0, lambda plc: plc.write("L", "MOUT", 0.0), every_s=0.02)


def moved_gain(bench: Bench) -> None:
    bench.plc.fail("L", "gain-1-percent")


def disturbed(bench: Bench) -> None:
    bench.later(2.0, lambda plc: plc.write("L", "SV", 60.0))


def elsewhere(bench: Bench) -> None:
    """The profile's MV_MAX is another register, which holds 100 by chance."""
    loop = bench.station.loops[0]
    loop = replace(loop, bindings={**loop.bindings, "MV_MAX": parse_device("D900")})
    bench.station = replace(bench.station, loops=(loop,))
    bench.plc.memory.write(station().devices.address(parse_device("D900")).table, 900, (0, 0x42C8))


def overlapping(bench: Bench) -> None:
    loop = bench.station.loops[0]
    loop = replace(loop, bindings={**loop.bindings, "BIAS": parse_device("D130")})
    bench.station = replace(bench.station, loops=(loop,))


def taken_over(bench: Bench) -> None:
    def take(plc) -> None:
        if plc.read("L", "PID_MAN"):
            plc.write("L", "MOUT", 33.0, who="operator")

    bench.later(16.0, take)


def sv_in_manual(bench: Bench) -> None:
    def move(plc) -> None:
        if plc.read("L", "PID_MAN"):
            plc.write("L", "SV", 64.0, who="operator")

    bench.later(20.0, move, every_s=0.5)


def left(bench: Bench) -> None:
    def burst(plc) -> None:
        if plc.read("L", "PID_MAN"):
            plc.freeze_pv("L")
            plc.write("L", "PV", 150.0)

    bench.later(16.0, burst)


LOST = frozenset(
    {"restarted", "not-a-number", "limits-exchanged", "out-of-range", "cycle-below-scan", "diverged", "program-writes"}
)
DEFECTS = [
    Defect("words swapped on the way", "swapped-word-order", {"is_swapping": True}),
    Defect("one register too far", "off-by-one", {"shift": 1}),
    Defect("one register too early", "off-by-one", {"shift": -1}),
    Defect("a DVP under an AH500 profile", "wrong-device-map", {"map_name": "dvp"}),
    Defect(
        "registers of 0", "no-loop-there", plant=lambda b: b.plc.restart(is_retained=False) or b.plc.memory.clear(),
        also=frozenset({"system-flags"}),
    ),
    Defect(
        "a CPU with fewer D than its family", "d-range", {"changes": {"scratch": parse_device("D25000")}},
        lambda b: b.plc.refuse(Table.HOLDING, 24_576, 40_959, 2),
    ),
    Defect("STOP", "plc-stopped", plant=lambda b: b.plc.stop()),
    Defect("MV limits exchanged", "limits-exchanged", {"initial": {"MV_MAX": 0.0, "MV_MIN": 100.0}}),
    Defect("a negative gain", "negative-gain", {"initial": {"Td_Kd": -1.0}}),
    Defect("CYCLE of 50 s", "out-of-range", {"initial": {"CYCLE": 50_000}}),
    Defect("CYCLE shorter than a scan", "cycle-below-scan", {"initial": {"CYCLE": 5}}, also=frozenset({"slow-link"})),
    Defect("NaN in SV", "not-a-number", {"initial": {"SV": math.nan}}, also=frozenset({"outside-process-range"})),
    Defect("a dead sensor", "pv-stuck", plant=lambda b: (b.plc.freeze_pv("L"), b.plc.write("L", "SV", 62.0))),
    Defect("a noisy sensor", "pv-noisy", {"plant": replace(PLANT, noise=4.0)}),
    Defect("a coarse sensor", "pv-quantised", plant=quantised),
    Defect(
        "a dead band below the resolution", "dead-band", {"initial": {"ERR_DBW": 0.01}}, quantised,
        frozenset({"pv-quantised", "diverged"}),
    ),
    Defect("I_MV on an operand", "overlap", plant=overlapping, also=frozenset({"diverged", "program-writes"})),
    Defect("the wrong unit", "wrong-unit", plant=lambda b: setattr(b, "station", replace(b.station, unit=7))),
    Defect(
        "ASCII where RTU was meant", "wrong-framing",
        {"only_scheme": "modbus+ascii", "changes": {"target": "modbus+rtu:///dev/ttyUSB0?baud=19200"}},
        also=frozenset({"wrong-line"}),
    ),
    Defect("a limit of 64 words", "short-requests", {"words_max": 64}),
    Defect("a busy PLC", "busy", plant=lambda b: b.later(0.02, lambda plc: setattr(plc, "busy", 2), every_s=0.05)),
    Defect("a slow line", "slow-link", {"latency_ns": 60 * MILLISECOND}),
    Defect("another master writes SV", "program-writes", plant=written_by_another),
    Defect(
        "a restart that loses everything", "restarted",
        plant=lambda b: b.later(2.0, lambda plc: plc.restart(is_retained=False)), also=LOST,
    ),
    Defect(
        "a restart that keeps its registers", "restarted",
        plant=lambda b: b.later(2.0, lambda plc: plc.restart(is_retained=True)), also=frozenset({"diverged"}),
    ),
    Defect("STOP in between", "restarted", plant=lambda b: b.later(2.0, lambda plc: plc.stop()),
           also=frozenset({"plc-stopped"})),
    Defect("wrong arithmetic", "diverged", plant=lambda b: (moved_gain(b), disturbed(b)),
           also=frozenset({"program-writes"})),
    Defect("a link that breaks", "link-lost", plant=lambda b: b.lose_link(1.5, 2.5)),
    Defect("PV beyond its range", "outside-process-range", {"plant": replace(PLANT, bias=230.0, initial=230.0)}),
    Defect("in manual", "out-of-service", {"initial": {"PID_MAN": True, "MOUT": 40.0}}, outcome=Outcome.INCONCLUSIVE),
    Defect(
        "direction reversed", "wrong-direction", {"initial": {"PID_DIR": False, "SV": 10.0}}, is_armed=True,
    ),
    Defect("an actuator that is not wired", "pv-does-not-answer", {"plant": replace(PLANT, gain=1e-9, bias=57.9)},
           is_armed=True),
    Defect("the program writes MOUT", "not-written", plant=overwritten, is_armed=True),
    Defect("a limit bound elsewhere", "clamp-ignored", plant=elsewhere, is_armed=True),
    Defect("no integral to transfer with", "bump", {"initial": {"Ti_Ki": 0.0, "Kc_Kp": 5.0, "BIAS": 20.0}},
           sv_in_manual, is_armed=True),
    Defect("an operator takes over", "taken-over", plant=taken_over, also=frozenset({"not-as-found"}), is_armed=True),
    Defect("PV leaves the envelope", "envelope-left", plant=left, is_armed=True),
]  # fmt: skip


@pytest.mark.parametrize("defect", DEFECTS, ids=[defect.name for defect in DEFECTS])
async def test_a_planted_defect_is_found_and_named(tmp_path, defect: Defect) -> None:
    bench = Bench(tmp_path, **defect.setup)
    defect.plant(bench)
    checks = await bench.commission(WISHES if defect.is_armed else READ_ONLY)
    said = {name: check.text for name, check in checks.items() if check.outcome is not Outcome.PASS}
    assert defect.outcome is checks[defect.finding].outcome, (checks[defect.finding].text, said)
    assert bench.failed() - {defect.finding} <= defect.also, said
    assert bench.touched() <= {*ALLOWED, *([(table, 900) for table, _ in ALLOWED] if defect.plant is elsewhere else [])}
    if not defect.is_armed:
        assert set() == bench.touched()


async def test_a_sound_loop_passes_everything_and_is_left_as_found(tmp_path) -> None:
    bench = Bench(tmp_path)
    before = {name: bench.plc.read("L", name) for name in ("SV", "PID_MAN", "MOUT", "MV_MAX", "MV_MIN")}
    checks = await bench.commission()
    assert NOT_ASKED == {name for name, check in checks.items() if check.outcome is not Outcome.PASS}
    assert before == {name: bench.plc.read("L", name) for name in before}
    assert bench.touched() == ALLOWED
    assert SECOND < bench.clock.now_ns()


def test_there_are_more_than_25_defects() -> None:
    assert len(DEFECTS) > 25
    assert PlantSpec is type(PLANT)
