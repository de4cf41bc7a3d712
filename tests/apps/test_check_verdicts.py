"""Scenarios: what passes, what each expectation convicts, and what a broken bench may never be taken for."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from datetime import date

import pytest
from apps.check_bench import BENCH, HEAD, STATION, STEP, floored, ran, scenario, with_dialect

from ahgateway.apps.check.result import Outcome, State, Trouble, Verdict, concluded, excused, run_exit
from ahgateway.apps.check.suite import results, sharded, unused
from ahgateway.apps.check.wires import WIRES
from ahgateway.codec.devices import parse_device
from ahgateway.core.dialect import Integrator
from ahgateway.fake.faults import FAULTS
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.scenario import KnownForm, collected, library, load

WINDOW = "\n[[expect.response]]\nafter = 4.0\n"


def test_a_healthy_loop_passes_and_says_how_much_was_proven() -> None:
    result = ran(scenario(STEP + "\n[expect]\ncoverage = 0.9\nclamps = true\n"))

    assert (Verdict.PASS, "3 expectations met") == (result.verdict, result.reason)
    assert result.counts.informative >= 75


def test_equal_seeds_give_equal_words_and_other_seeds_others() -> None:
    first, again, other = (ran(scenario(STEP), seed=seed).digests for seed in (1, 1, 2))

    assert first == again != other


VIOLATIONS = {
    "overshoot": ("", WINDOW + "overshoot = 0.0"),
    "settling": ("", WINDOW + "settling = 0.2"),
    "iae": ("", WINDOW + "iae = 0.1"),
    "steady_error": ("", WINDOW + "steady_error = 0.0001"),
    "direction": ("", WINDOW + 'direction = "down"'),
    "always": ("", WINDOW + 'always = "PV < 55"'),
    "finally": ("", WINDOW + 'finally = "PV < 55"'),
}


@pytest.mark.parametrize("name", VIOLATIONS)
def test_a_response_that_misses_what_is_asked_fails(name: str) -> None:
    head, window = VIOLATIONS[name]
    result = ran(scenario(head + STEP + '\n[expect]\nshadow = "none"' + window, HEAD.replace("Ki = 0.9", "Ki = 3.5")))

    assert (Verdict.FAIL, [f"response.0.{name}"]) == (result.verdict, [each.name for each in result.outcomes])


def test_a_load_moves_pv_and_is_taken_away_again() -> None:
    push = "\n[[step]]\nat = 4.0\nuntil = 4.5\nload = 8.0\n" + '\n[expect]\nshadow = "none"' + WINDOW
    head = HEAD.replace("noise = 0.02", "noise = 0.0")

    assert Verdict.FAIL is ran(scenario(push + 'always = "PV - SV < 1.0"', head)).verdict
    assert Verdict.PASS is ran(scenario(push + 'finally = "abs(PV - SV) < 0.5"', head)).verdict


@pytest.mark.parametrize("name", sorted(each.stem for each in (library() / "plants").glob("*.toml")))
def test_every_kind_of_process_runs_in_lockstep(name: str) -> None:
    """The first seconds of each shipped scenario of a plant; the whole of them runs in the bench program."""
    wanted = load(library() / "plants" / f"{name}.toml")
    short = replace(wanted, duration_s=5.0, expect=wanted.expect.model_copy(update={"response": []}))

    assert Verdict.PASS is ran(short).verdict


def test_a_transfer_with_a_bump_fails() -> None:
    manual = (
        "\n[[step]]\nat = 2.0\nset = { PID_MAN = true, MOUT = 20.0 }\n[[step]]\nat = 4.0\nset = { PID_MAN = false }"
    )
    expect = '\n[expect]\nshadow = "none"\nbumpless = { within = 1.0 }\n'

    assert Verdict.PASS is ran(scenario(manual + expect)).verdict
    bumpy = ran(scenario(manual + expect), replace(BENCH, fault="no-bumpless"))
    assert (Verdict.FAIL, True) == (bumpy.verdict, bumpy.figures["bumpless"] > 1.0)


def test_an_output_beyond_its_limits_fails() -> None:
    far = '\n[[step]]\nat = 3.0\nset = { SV = 120.0 }\n\n[expect]\nshadow = "none"\nclamps = true\n'
    head = HEAD + "Kd = 0.4\n"

    assert Verdict.PASS is ran(scenario(far, head)).verdict
    assert Verdict.FAIL is ran(scenario(far, head), replace(BENCH, fault="limits-before-sum")).verdict


def test_an_output_that_moves_inside_the_dead_band_fails() -> None:
    quiet = '\n[expect]\nshadow = "none"\nquiet_in_band = true\n'
    head = HEAD.replace("noise = 0.02", "noise = 0.0") + "ERR_DBW = 4.0\n"

    assert Verdict.PASS is ran(scenario(quiet, head)).verdict
    assert Verdict.FAIL is ran(scenario(quiet, head), replace(BENCH, fault="dead-band-ignored")).verdict


def test_a_recovery_that_takes_too_long_fails() -> None:
    cut = '\n[[step]]\nat = 3.0\nuntil = 4.0\ndo = "link-down"\n\n[expect]\nshadow = "none"\nrecovery = '

    assert Verdict.PASS is ran(scenario(cut + "1.0")).verdict
    assert Verdict.FAIL is ran(scenario(cut + "0.01")).verdict


def test_a_coverage_that_is_missed_is_inconclusive_not_a_failure() -> None:
    cut = '\n[[step]]\nat = 3.0\nuntil = 5.0\ndo = "link-down"\n\n[expect]\ncoverage = 0.9\n'

    assert Verdict.INCONCLUSIVE is ran(scenario(cut)).verdict


def test_a_late_pv_is_seen_by_the_block_that_records_it() -> None:
    fresh = '\n[expect]\nshadow = "none"\nfresh_pv = true\n'

    assert Verdict.PASS is ran(replace(scenario(fresh), duration_s=2.0)).verdict
    assert (
        Verdict.FAIL is ran(replace(scenario(fresh), duration_s=2.0), replace(BENCH, fault="pv-one-scan-late")).verdict
    )


@pytest.mark.parametrize(
    "expect", ['shadow = "bits"', 'shadow = "ulp"\nulp_max = 4', 'shadow = "tolerance"\nmv_max = 0.001']
)
def test_a_shadow_that_leaves_is_violated_however_much_is_tolerated(expect: str) -> None:
    wanted = replace(scenario(f"\n[expect]\n{expect}\n"), duration_s=1.0)

    assert Verdict.FAIL is not ran(wanted).verdict
    assert Verdict.FAIL is ran(wanted, replace(BENCH, fault="gain-1-percent")).verdict


CAUGHT_BY = {
    "dead-band-ignored": ("dead-band", 12.0),
    "direction-reversed": ("dead-band", 2.0),
    "derivative-of-the-other": ("fresh-pv", 3.5),
    "pv-one-scan-late": ("fresh-pv", 3.0),
    "limits-before-sum": ("saturation", 9.0),
    "windup": ("saturation", 9.0),
    "no-bumpless": ("manual-auto", 14.5),
    "bias-after-limits": ("bias", 14.0),
    "filter-ignored": ("derivative-of-pv", 4.0),
}
"""Faults that show themselves only where somebody looks, and until when; all others in the first seconds anywhere."""


def delta_faults(instruction: str) -> list[str]:
    return [name for name, each in FAULTS.items() if instruction.upper() in each.controllers]


@pytest.mark.parametrize(
    ("instruction", "fault"), [(law, name) for law in ("dpid", "dpide") for name in delta_faults(law)]
)
def test_every_wrong_controller_is_caught_by_a_shipped_scenario(instruction: str, fault: str) -> None:
    name, until_s = CAUGHT_BY.get(fault, ("setpoint-step", 2.0))
    wanted = load(library() / instruction / f"{name}.toml")
    short = replace(wanted, expect=wanted.expect.model_copy(update={"response": []}))
    # Each further conviction costs the search for its cause: most are wrong at once, and no more is asked of them.
    verdicts = (ran(replace(short, duration_s=s), replace(BENCH, fault=fault)).verdict for s in (0.3, until_s))

    assert Verdict.FAIL in verdicts


def test_another_dialect_is_a_failure_and_another_fingerprint() -> None:
    other = with_dialect(STATION, integrator=Integrator.TRAPEZOID)
    short = replace(scenario(""), duration_s=1.5)
    usual = ran(short)

    assert Verdict.FAIL is ran(short, replace(BENCH, fake=other)).verdict
    known = ran(short, replace(BENCH, station=other, fake=other))
    assert (Verdict.PASS, True) == (known.verdict, known.digests != usual.digests)


# What is wrong with the bench is never the product's fault.


def stopped(plc: FakePlc) -> None:
    plc.at(3_000_000_000, FakePlc.stop)


def silent(plc: FakePlc) -> None:
    def cut(plc: FakePlc) -> None:
        plc.station = replace(plc.station, unit=9)

    plc.at(3_000_000_000, cut)


def refusing(plc: FakePlc) -> None:
    place = plc.station.devices.address(parse_device("D300"))
    plc.at(3_000_000_000, lambda plc: plc.refuse(place.table, place.address, place.address, 2))


@pytest.mark.parametrize(
    ("prepare", "text"),
    [(stopped, "the PLC is in STOP"), (silent, "link down"), (refusing, "the PLC refuses")],
)
def test_a_bench_that_breaks_is_inconclusive(prepare, text: str) -> None:
    strict = scenario(STEP + "\n[expect]\ncoverage = 0.99" + WINDOW + "settling = 0.1\nsteady_error = 0.0")
    result = ran(strict, replace(BENCH, prepare=prepare))

    assert Verdict.INCONCLUSIVE is result.verdict
    assert text in result.reason
    assert not floored(strict, replace(BENCH, prepare=prepare)).is_sound


def test_a_profile_that_looks_elsewhere_is_not_the_products_fault() -> None:
    loops = tuple(
        replace(loop, bindings={**loop.bindings, "Kp": parse_device("D900")}) if loop.name == "DPID" else loop
        for loop in STATION.loops
    )
    result = ran(scenario(STEP), replace(BENCH, station=replace(STATION, loops=loops)))

    assert Verdict.FAIL is not result.verdict
    assert "Kp at D900 reads [0, 0], [52429, 16268] was set: wrong profile" == result.troubles[0].text


def test_a_laptop_that_is_too_slow_is_not_the_products_fault() -> None:
    class Slow:
        """A clock on which every look takes a second."""

        def __init__(self) -> None:
            self.t = 0

        def now_ns(self) -> int:
            self.t += 1_000_000_000
            return self.t

    async def first():
        return await anext(results([replace(scenario(STEP), limit_s=5.0)], BENCH, Slow()))

    result = asyncio.run(first())
    assert Verdict.FAIL is not result.verdict
    assert "the limit of 5 s of real time is over" == result.troubles[0].text


def test_what_was_convicted_before_the_bench_broke_stands() -> None:
    early = Outcome("shadow", State.VIOLATED, "3 executions diverged", 3.0, 1.0)
    late = Outcome("clamps", State.VIOLATED, "MV left its limits", 5.0, 6.0)
    trouble = (Trouble(5.0, "link down"),)

    kept = excused([early, late], trouble)
    assert [State.VIOLATED, State.UNKNOWN] == [each.state for each in kept]
    assert Verdict.FAIL is concluded(kept, trouble)[0]


def test_nothing_checked_is_an_error() -> None:
    result = ran(scenario('\n[expect]\nshadow = "none"\n'))

    assert (Verdict.ERROR, "nothing was checked: the scenario expects nothing") == (result.verdict, result.reason)
    assert 3 == run_exit([])


def test_a_bench_without_the_instruction_is_an_error_that_names_what_it_has() -> None:
    lone = replace(STATION, loops=STATION.loops[1:])
    result = ran(scenario(STEP), replace(BENCH, station=lone))

    assert Verdict.ERROR is result.verdict
    assert "has no loop with DPID, it has DPIDE (DPIDE)" in result.reason


# Known differences, shards.


def entry(expires: date, expectation: str = "shadow") -> KnownForm:
    return KnownForm(scenario="mine/*", expectation=expectation, reason="firmware 2.1", owner="Kim", expires=expires)


@pytest.mark.parametrize(
    ("known", "verdict"),
    [
        (entry(date(2026, 12, 31)), Verdict.KNOWN),
        (entry(date(2026, 11, 1)), Verdict.FAIL),
        (entry(date(2026, 12, 31), "clamps"), Verdict.FAIL),
    ],
)
def test_a_known_difference_counts_until_it_expires(known: KnownForm, verdict: Verdict) -> None:
    bad = replace(BENCH, fault="ki-1-percent")

    assert verdict is ran(replace(scenario(""), duration_s=1.5), bad, known=[known], today=date(2026, 11, 22)).verdict


def test_a_known_difference_that_is_gone_is_named() -> None:
    known = [entry(date(2026, 12, 31))]

    assert known == unused(known, [ran(scenario(STEP))])


def test_shards_together_are_the_whole() -> None:
    everything = collected(["conformance"])
    parts = [sharded(everything, index, 4) for index in (1, 2, 3, 4)]

    assert sorted(each.name for each in everything) == sorted(each.name for part in parts for each in part)


# Wires.


WHOLE = [(folder, each.stem) for folder in ("dpid", "dpide") for each in sorted((library() / folder).glob("*.toml"))]
BRIEF_S = 0.4
"""So much of each scenario goes over the sockets here; the bench program sends the whole library over them."""


@pytest.mark.parametrize("wire", ["tcp", "rtu", "ascii"])
def test_the_library_leaves_the_same_words_over_every_wire(wire: str) -> None:
    for folder, name in WHOLE:
        wanted = load(library() / folder / f"{name}.toml")
        brief = replace(wanted, duration_s=BRIEF_S, expect=wanted.expect.model_copy(update={"response": []}))
        here, there = ran(brief), ran(brief, replace(BENCH, wire=WIRES[wire]))

        assert (here.digests, here.counts, here.troubles) == (there.digests, there.counts, there.troubles), name


def test_a_scenario_gives_the_same_words_over_a_socket() -> None:
    short = replace(scenario(""), duration_s=1.5)
    result = ran(short, replace(BENCH, wire=WIRES["rtu"]))

    assert (Verdict.PASS, ran(short).digests) == (result.verdict, result.digests)
