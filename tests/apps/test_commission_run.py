"""The guided list: resumed where it ended, silent unless armed and consented to, killed without harm, on paper."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from apps.commission_bench import WISHES, Bench

from ahgateway.apps.commission import sheet
from ahgateway.apps.commission.catalogue import CATALOGUE, page
from ahgateway.apps.commission.checks import (
    Outcome,
    Progress,
    Step,
    exit_for,
    failed,
    passed,
    resume,
    save,
    skipped,
    unclear,
)
from ahgateway.apps.commission.link import amended
from ahgateway.apps.commission.observe import Observation, observe
from ahgateway.apps.commission.reading import judge_shadow
from ahgateway.apps.commission.wiring import Envelope, envelope
from ahgateway.codec.access import Table
from ahgateway.codec.block import COUNTER
from ahgateway.codec.devices import parse_device
from ahgateway.core.dialect import TsSource
from ahgateway.core.verdict import Exit
from ahgateway.errors import LinkError, ProfileError, StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.journal import verify

DOCS = Path(__file__).parents[2] / "docs" / "reference"


def test_the_page_of_findings_is_made_of_the_catalogue() -> None:
    assert page() == (DOCS / "findings.md").read_text("utf-8")


def test_every_finding_has_its_own_code_in_the_hundred_of_its_step() -> None:
    assert len(CATALOGUE) == len({kind.code for kind in CATALOGUE.values()})
    assert [] == [kind.code for kind in CATALOGUE.values() if int(kind.code[3]) != kind.step.value]


@pytest.mark.parametrize(
    ("checks", "code"),
    [
        ([], Exit.INCONCLUSIVE),
        ([skipped("busy", "no")], Exit.INCONCLUSIVE),
        ([passed("busy", "yes"), skipped("bump", "no")], Exit.PASS),
        ([passed("busy", "yes"), unclear("bump", "who knows")], Exit.INCONCLUSIVE),
        ([failed("busy", "no"), unclear("bump", "who knows")], Exit.DIFFERENT),
    ],
)
def test_the_worst_check_decides_and_nothing_checked_is_no_pass(checks, code: Exit) -> None:
    assert code is exit_for(checks)


def test_progress_survives_the_file_and_another_profile_begins_anew(tmp_path) -> None:
    progress = Progress("L", "hash", facts={"trace": {"t": [0.5]}})
    progress.take(Step.MAP, [passed("off-by-one", "fits", score=22)], 7)
    save(progress, tmp_path / "state.json")
    assert progress == resume(tmp_path / "state.json", "L", "hash")
    assert Progress("L", "other") == resume(tmp_path / "state.json", "L", "other")
    assert Progress("M", "hash") == resume(tmp_path / "state.json", "M", "hash")
    (tmp_path / "state.json").write_text("{", "utf-8")
    with pytest.raises(ProfileError, match="is no progress of `commission`"):
        resume(tmp_path / "state.json", "L", "hash")


async def test_a_killed_run_goes_on_with_the_step_that_was_not_done(tmp_path) -> None:
    bench = Bench(tmp_path)
    work = bench.work()
    told: list[int] = []

    def say(step: Step, checks) -> None:
        told.append(step.value)
        if step is Step.MAP and told == [1, 2]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        await work.run(replace(WISHES, is_armed=False), say, consent=lambda bounds: True)
    kept = resume(tmp_path / "state.json", "L", "hash")
    assert [Step.LINK, Step.MAP] == list(kept.steps)
    await bench.work(kept).run(replace(WISHES, is_armed=False), say, consent=lambda bounds: True)
    assert [1, 2, 3, 4, 5] == told


async def test_a_marker_lands_where_it_is_read_and_is_taken_away_again(tmp_path) -> None:
    bench = Bench(tmp_path, changes={"scratch": parse_device("D900")})
    bench.plc.memory.write(Table.HOLDING, 900, (7, 8))
    checks = await bench.commission(replace(WISHES, is_armed=False, is_marked=True))
    assert "0x12345678 at D900 reads 5678 1234; ISPSoft shows 305419896 there while it stands" == checks["marker"].text
    assert [(900, (0x5678, 0x1234)), (900, (7, 8))] == [(each.address, each.values) for each in bench.plc.writes]


async def test_a_sheet_has_the_journal_s_last_hash_whatever_wrote(tmp_path) -> None:
    """Here only the marker did, in step 2; and a sheet before any write says that there was none."""
    bench = Bench(tmp_path, changes={"scratch": parse_device("D900")})
    heading = sheet.Heading()
    await bench.commission(replace(WISHES, is_armed=False))
    text = sheet.html(bench.progress, bench.station, bench.loop(), heading, 0)
    assert "nothing was ever written to this loop from this machine" in text
    await bench.commission(replace(WISHES, is_armed=False, is_marked=True))
    (path,) = (tmp_path / "gates").glob("*.jsonl")
    text = sheet.html(bench.progress, bench.station, bench.loop(), heading, 0)
    assert f"--anchor {verify(path).last}" in text


async def test_a_count_that_begins_anew_is_a_restart_and_one_that_goes_round_is_none(tmp_path) -> None:
    bench = Bench(tmp_path)
    seen = await observe(bench.station, bench.loop(), await bench.open(bench.station), bench.clock, executions=3)
    first, second = seen.pictures[:2]

    def said(before: int, after: int) -> tuple[Outcome, str]:
        counts = [
            replace(picture, words={**picture.words, COUNTER: (count,)})
            for picture, count in ((first, before), (second, after))
        ]
        check = judge_shadow(bench.loop(), Observation(counts), 0.0)[-1]
        return check.outcome, check.text

    assert (Outcome.FAIL, "the program counted 812 executions and then 3: it restarted and kept its registers") == said(
        812, 3
    )
    assert Outcome.PASS is said(65_534, 2)[0]
    assert Outcome.PASS is said(812, 813)[0]


async def test_without_scratch_words_or_consent_there_is_no_marker(tmp_path) -> None:
    bench = Bench(tmp_path)
    checks = await bench.commission(replace(WISHES, is_armed=False, is_marked=True))
    assert "the profile names no scratch words" == checks["marker"].text
    assert set() == bench.touched()


async def test_a_filter_that_nobody_sees_is_no_divergence(tmp_path) -> None:
    bench = Bench(tmp_path, initial={"Tf": 1.0, "Td_Kd": 4.0, "PID_DE": True})
    checks = await bench.commission(replace(WISHES, is_armed=False, coverage_min=0.0))
    assert Outcome.FAIL is not checks["diverged"].outcome, checks["diverged"].text


async def test_without_arm_or_consent_nothing_is_written(tmp_path) -> None:
    bench = Bench(tmp_path)
    checks = await bench.commission(replace(WISHES, is_armed=False))
    assert "not armed: --arm L allows it" == checks["bump"].text
    checks = await bench.commission(WISHES, consents=False)
    assert "nobody consented" == checks["bump"].text
    assert set() == bench.touched()


async def test_a_step_5_that_was_asked_for_and_cannot_begin_is_no_pass(tmp_path) -> None:
    bench = Bench(tmp_path)
    loop = bench.station.loops[0]
    bench.station = replace(bench.station, loops=(replace(loop, writes={}),))
    checks = await bench.commission()
    assert Outcome.INCONCLUSIVE is checks["pv-does-not-answer"].outcome
    assert "MOUT and PID_MAN are not on the list" in checks["bump"].text
    assert Exit.INCONCLUSIVE is exit_for(checks.values())
    assert not bench.progress.is_done(Step.WIRING)


async def test_the_dialect_stands_beside_the_verdict_and_on_the_sheet(tmp_path) -> None:
    bench = Bench(tmp_path)
    loop = bench.station.loops[0]
    measured = loop.dialect._replace(ts_source=TsSource.MS)
    bench.station = replace(bench.station, loops=(replace(loop, dialect=measured),))
    checks = await bench.commission(replace(WISHES, is_armed=False))
    assert checks["diverged"].text.endswith("; dialect: ts_source = ms")
    assert '<td colspan="3">ts_source = ms</td>' in sheet.html(
        bench.progress, bench.station, bench.loop(), sheet.Heading(), 0
    )


async def test_step_2_says_where_d_ends_and_how_far_the_map_goes(tmp_path) -> None:
    bench = Bench(tmp_path)
    checks = await bench.commission(replace(WISHES, is_armed=False))
    assert "D0…D29999 answers to its end, D30000…D40959 answers to its end" == checks["d-range"].text
    bench = Bench(tmp_path)
    bench.plc.refuse(Table.HOLDING, 24_576, 40_959, 3)
    checks = await bench.commission(replace(WISHES, is_armed=False))
    said = "D0…D29999 is refused behind D24575, D30000…D40959 is refused whole"
    assert (Outcome.PASS, said) == (checks["d-range"].outcome, checks["d-range"].text)


async def test_step_5_is_not_begun_before_step_3_is_clean(tmp_path) -> None:
    bench = Bench(tmp_path, initial={"MV_MAX": 0.0, "MV_MIN": 100.0})
    checks = await bench.commission()
    assert "not before step 3 is clean: limits-exchanged" == checks["bump"].text
    assert set() == bench.touched()


async def test_a_link_lost_in_step_5_puts_the_loop_back_when_it_returns(tmp_path) -> None:
    bench = Bench(tmp_path)
    start_ns = None

    def cut(request) -> None:
        nonlocal start_ns
        if start_ns is None and bench.plc.read("L", "PID_MAN"):
            start_ns = bench.clock.now_ns() + 2_000_000_000
        if start_ns is not None and start_ns <= bench.clock.now_ns() < start_ns + 5_000_000_000:
            raise LinkError("unplugged")

    bench.effects.append(cut)
    checks = await bench.commission()
    assert Outcome.INCONCLUSIVE is checks["not-written"].outcome
    assert "unplugged; PID_MAN, MOUT put back" == checks["not-written"].text
    assert Outcome.PASS is checks["not-as-found"].outcome
    assert [False, 0.0] == [bench.plc.read("L", "PID_MAN"), float(bench.plc.read("L", "MOUT"))]


async def test_a_process_killed_in_step_5_is_put_back_by_the_next_start(tmp_path) -> None:
    class Killed(BaseException):
        pass

    bench = Bench(tmp_path)
    is_dead = False

    def kill(request) -> None:
        nonlocal is_dead
        held = sum(each.who == "link" for each in bench.plc.writes)
        if is_dead or held >= 3:
            is_dead = True
            raise Killed

    bench.effects.append(kill)
    with pytest.raises(Killed):
        await bench.commission()
    assert bench.plc.read("L", "PID_MAN")
    bench.effects.clear()
    link = await bench.open(bench.station)
    gate = Gate(bench.station, bench.loop(), link, bench.clock, tmp_path / "gates")
    async with gate.armed("next start"):
        assert [False, 0.0] == [bench.plc.read("L", "PID_MAN"), float(bench.plc.read("L", "MOUT"))]


async def test_the_envelope_comes_from_the_profile_and_is_refused_without_one(tmp_path) -> None:
    bench = Bench(tmp_path)
    await bench.commission(replace(WISHES, is_armed=False))
    picture = type("Stands", (), {"inputs": type("Inputs", (), {"pv": 58.0})})
    assert Envelope(5.0, 38.0, 78.0) == envelope(bench.loop(), picture)
    assert Envelope(2.0, 57.0, 59.0) == envelope(bench.loop(), picture, step=2.0, pv=1.0)
    assert Envelope(5.0, 38.0, 78.0) == envelope(bench.loop(), picture, step=50.0)
    with pytest.raises(StateError, match="nothing says how far PV may go"):
        envelope(replace(bench.loop(), pv_range=None), picture)
    with pytest.raises(StateError, match="MOUT and PID_MAN are not on the list"):
        envelope(replace(bench.loop(), writes={}), picture)


async def test_the_sheet_stands_alone_and_says_what_was_found(tmp_path) -> None:
    bench = Bench(tmp_path)
    await bench.commission()
    heading = sheet.Heading("A. <Lovelace>", ("Fluke 754",), "none")
    text = sheet.html(bench.progress, bench.station, bench.loop(), heading, 1_767_225_600_000_000_000)
    assert "A. &lt;Lovelace&gt;" in text
    assert "2026-01-01 00:00:00 UTC" in text
    assert 2 == text.count("<svg")
    assert bench.progress.facts["journal"]["hash"] in text
    assert [] == re.findall(r'(?:src|href)="(?!#)[^"]*"', text.partition("<svg")[0])
    assert [] == [kind.code for kind in CATALOGUE.values() if kind.code not in text]
    facts = sheet.sheet_json(bench.progress, bench.station, bench.loop(), heading, 0)
    assert ("PASS", "DPIDE") == (facts["verdict"], facts["loop"]["instruction"])
    rows = {row["operand"]: row for row in facts["operands"]}
    assert {
        "operand": "SV",
        "device": "D100",
        "unit": "°C",
        "as_found": 58.0,
        "as_left": 58.0,
        "changed": False,
    } == rows["SV"]
    json.dumps(facts, allow_nan=False)


async def test_the_sheet_shows_what_somebody_changed_meanwhile(tmp_path) -> None:
    bench = Bench(tmp_path)
    bench.later(2.0, lambda plc: plc.write("L", "Td_Kd", 0.125))
    await bench.commission(replace(WISHES, is_armed=False))
    facts = sheet.sheet_json(bench.progress, bench.station, bench.loop(), sheet.Heading(), 0)
    assert [("Td_Kd", 0.05, 0.125)] == [
        (row["operand"], round(row["as_found"], 6), row["as_left"]) for row in facts["operands"] if row["changed"]
    ]


def test_what_step_1_found_goes_into_the_profile_and_comments_stay() -> None:
    text = '# ours\n[station]\nname = "S"   # the name\ntarget = "modbus+tcp://192.0.2.10"\n\n[loops.A]\n'
    changed = amended(text, {"unit": 3, "pacing.words_per_request_max": 64, "target": "modbus+tcp://192.0.2.11"})
    assert "# ours" in changed
    assert '"S"   # the name' in changed
    assert 'target = "modbus+tcp://192.0.2.11"' in changed
    assert "unit = 3" in changed
    assert "[station.pacing]\nwords_per_request_max = 64" in changed
