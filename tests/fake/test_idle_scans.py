"""Scans that only take PV in are run as one: nothing that anybody can see may tell that they were."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial

import pytest
from dialects import random_dialect

from ahgateway.clock import MILLISECOND
from ahgateway.codec.station import FakeLoop, PlantSpec
from ahgateway.fake.plc import FakePlc

PLANTS = (
    PlantSpec("fopdt", 1.3, tau_s=2.0, dead_time_s=0.23, noise=0.05, initial=5.0),
    PlantSpec("sopdt", 0.8, tau_s=1.0, tau2_s=0.4, noise=0.01),
    PlantSpec("second_order", 1.1, tau_s=0.9, zeta=0.5, dead_time_s=0.1, resolution=0.01),
    PlantSpec("integrating", 0.2, bias=-1.0, noise=0.02),
    PlantSpec("tank", 0.3, outflow=0.5, initial=4.0),
    PlantSpec("fopdt", 1.3, tau_s=2.0, noise=0.05, load_noise=0.5),
    PlantSpec("fopdt", 1.3, tau_s=2.0, filter_s=0.3),
    PlantSpec("fopdt", 1.3, tau_s=2.0, pwm_s=0.5),
)


@pytest.fixture
def plc_of(make_plc, make_dpid, make_dpide) -> Callable[[int], FakePlc]:
    return partial(two_loops, make_plc, (make_dpid, make_dpide))


def two_loops(make_plc, makes, seed: int) -> FakePlc:
    """Two loops that share one source of chance, in a dialect and on plants of their own."""
    chance = random.Random(f"plants {seed}")
    loops = [make(dialect=random_dialect(seed + at, share=seed % 4 / 3)) for at, make in enumerate(makes)]
    setups = {
        each.name: FakeLoop({"SV": 50.0, "PID_RUN": True, "CYCLE": cycle}, chance.choice(PLANTS))
        for each, cycle in zip(loops, (chance.choice((7, 31)), chance.choice((70, 95))), strict=True)
    }
    return make_plc(loops, setups, seed=seed, scan_ns=chance.choice((3, 5, 10)) * MILLISECOND)


def meddle(plc: FakePlc, chance: random.Random) -> None:
    """Do to a PLC what may be done between two scans."""
    loop = chance.choice(list(plc.items))
    deed = chance.randrange(8)
    if deed == 0:
        plc.write(loop, "SV", chance.uniform(0.0, 80.0))
    elif deed == 1:
        plc.write(loop, "PID_MAN", chance.random() < 0.5)
    elif deed == 2:
        plc.write(loop, "PID_RUN", chance.random() < 0.7)
    elif deed == 3:
        plc.write(loop, "MOUT", chance.uniform(0.0, 90.0))
    elif deed == 4:
        plc.freeze_pv(loop, chance.random() < 0.5)
    elif deed == 5:
        plc.slow_down(chance.randrange(5, 40) * MILLISECOND, 2)
    elif deed == 6:
        plc.stop() if chance.random() < 0.3 else plc.run()
    else:
        load = chance.uniform(-5.0, 5.0)
        at_ns = plc.now_ns + chance.randrange(200) * MILLISECOND
        plc.at(at_ns, lambda plc: setattr(plc.processes[loop].rig, "load", load))


def everything(plc: FakePlc) -> tuple:
    """All that a reader of the memory, of the log or of the plants can see."""
    words = {
        (name, row.name): item.wiring.words(row.name).tolist()
        for name, item in plc.items.items()
        for row in item.loop.controller.operands
        if row.words
    }
    done = {name: [(each.time_ns, each.since_ns) for each in item.log] for name, item in plc.items.items()}
    return plc.now_ns, plc.scans, words, done, {name: each.pv for name, each in plc.processes.items()}


@pytest.mark.parametrize("seed", range(12))
def test_what_is_seen_does_not_tell_how_many_scans_were_run_as_one(plc_of, seed: int) -> None:
    whole, single = plc_of(seed), plc_of(seed)
    single._may_pass = False
    deeds = random.Random(seed)
    for number in range(60):
        duration_ns = deeds.choice((1, 7, 40, 400)) * MILLISECOND
        for plc in (whole, single):
            meddle(plc, random.Random(f"{seed} {number}"))
            plc.advance(duration_ns)
        assert everything(whole) == everything(single)


def test_a_quiet_loop_is_looked_at_only_when_it_is_due(make_plc) -> None:
    plc = make_plc(setups={"LIC-201": FakeLoop({"SV": 5.0, "PID_RUN": True, "CYCLE": 100})})
    item, seen = plc.items["LIC-201"], []
    scan = item.scan
    plc._program[0] = lambda now_ns, elapsed_ns: seen.append(now_ns // MILLISECOND) or scan(now_ns, elapsed_ns)
    plc.advance(2500 * MILLISECOND)
    assert [5, 1005, 2005] == seen
