"""What a run of scenarios leaves behind: JUnit XML, fingerprints, the page."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
import xmlschema

from ahgateway.apps.check.fingerprint import compared, fingerprint, read, text_of
from ahgateway.apps.check.history import Past
from ahgateway.apps.check.junit import junit
from ahgateway.apps.check.page import page
from ahgateway.apps.check.result import Floor, Outcome, Result, State, Trouble, Verdict
from ahgateway.errors import ProfileError

TRACE = {"t": [0.0, 1.0], "SV": [50.0, 50.0], "PV": [49.0, 49.5], "MV": [30.0, 31.0]}
PASSED = Result("dpid/step", "Steps", "DPID", Verdict.PASS, "1 expectations met", digests=(1, 2, 3), trace=TRACE)
FAILED = Result(
    "dpid/level", "A level <b>", "DPID", Verdict.FAIL, "shadow: I \x00 & more",
    outcomes=(Outcome("shadow", State.VIOLATED, "I \x00 & more", 1.0, 0.5),), digests=(4, 5), trace=TRACE,
)  # fmt: skip
BROKEN = Result(
    "dpid/cut", "A cut", "DPID", Verdict.INCONCLUSIVE, "bench: link down", troubles=(Trouble(2.0, "link down"),)
)
KNOWN = Result("dpid/old", "An old one", "DPID", Verdict.KNOWN, "known to Kim")
ALL = [PASSED, FAILED, BROKEN, KNOWN]
NOON = 1_795_262_400_000_000_000


def test_junit_says_failure_for_the_product_and_error_for_the_bench() -> None:
    root = ElementTree.fromstring(junit(ALL, "fake://bench", NOON))
    suite = root[0]

    assert ("4", "1", "1", "1") == tuple(suite.get(key) for key in ("tests", "failures", "errors", "skipped"))
    assert "2026-11-21T12:00:00" == suite.get("timestamp")
    told = {case.get("name"): [child.tag for child in case] for case in suite.iter("testcase")}
    assert {
        "step": ["system-out"],
        "level": ["failure", "system-out"],
        "cut": ["error", "system-out"],
        "old": ["skipped", "system-out"],
    } == told


def test_junit_is_what_its_schema_allows() -> None:
    schema = xmlschema.XMLSchema(Path(__file__).parents[1] / "golden" / "junit.xsd")

    schema.validate(junit(ALL, "fake://bench", NOON))
    schema.validate(junit([], "fake://bench", NOON))
    with pytest.raises(xmlschema.XMLSchemaValidationError):
        schema.validate(
            junit(ALL, "fake://bench", NOON).replace("<failure", "<failed").replace("</failure", "</failed")
        )


def test_junit_holds_what_no_xml_may_hold() -> None:
    case = next(ElementTree.fromstring(junit([FAILED], "fake://bench", NOON)).iter("failure"))

    assert "shadow: I \ufffd & more" == case.get("message")


def test_a_fingerprint_comes_back_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "print.json"
    file.write_text(text_of(fingerprint(ALL, 7)))

    assert {"dpid/step": ["00000001", "00000002", "00000003"], "dpid/level": ["00000004", "00000005"]} == read(file)[
        "scenarios"
    ]
    assert [] == compared(read(file), fingerprint(ALL, 7))


def test_two_fingerprints_name_the_first_change_that_differs() -> None:
    other = Result("dpid/step", "Steps", "DPID", Verdict.PASS, "", digests=(1, 9, 3))
    found = compared(fingerprint([PASSED, FAILED], 1), fingerprint([other], 1))

    assert [
        ("dpid/level", "only the old fingerprint has it", 0),
        ("dpid/step", "differs from change 2 of 3 on", 2),
    ] == [(each.scenario, each.text, each.change) for each in found]
    assert ["dpid/step"] == [
        each.scenario for each in compared(fingerprint([PASSED, FAILED], 1), fingerprint([other], 1), is_part=True)
    ]


def test_fingerprints_of_different_seeds_are_not_compared() -> None:
    with pytest.raises(ProfileError, match="taken with seeds 1 and 2"):
        compared(fingerprint([PASSED], 1), fingerprint([PASSED], 2))


def test_words_of_a_fake_are_not_compared_with_expectations_of_a_real_plc() -> None:
    with pytest.raises(ProfileError, match="one fingerprint is of words, the other of expectations"):
        compared(fingerprint([PASSED], 1), fingerprint([PASSED], 1, is_repeatable=False))


def test_a_file_that_is_no_fingerprint_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "print.json"
    file.write_text('{"kind": "other"}')

    with pytest.raises(ProfileError, match="is no fingerprint"):
        read(file)


def test_the_page_shows_the_last_nights_and_draws_what_drifts() -> None:
    past = Past(
        "dpid/level", 4, "2026-11-21 12:00 UTC", 2, {"response.0.iae": (10.0, 12.0), "clamps": (1.0, 1.01)},
        ("a", "b", "c", "d"), ("pass", "inconclusive", "pass", "fail"),
        {"response.0.iae": (10.0, None, 11.0, 12.0), "clamps": (1.0, 1.0, 1.0, 1.01)},
    )  # fmt: skip
    first = Past("dpid/step", 1, None, 0, {})
    text = page(
        ALL, floor=Floor(True, "agrees"), target="fake://bench", claim="", seed=1, utc_ns=NOON, past=[past, first]
    )  # fmt: skip

    assert (
        '<code><span class="pass">.</span><span class="inconclusive">?</span><span class="pass">.</span>'
        '<span class="fail">F</span></code>'
    ) in text
    assert 3 == text.count("<svg")
    assert "dpid/level: response.0.iae" in text
    assert "dpid/level: clamps" not in text
    assert 1 == text.count("<tr><td>dpid/step</td>") + text.count('">dpid/step</a></td><td>pass')


def test_the_page_shows_every_scenario_and_escapes_what_files_say() -> None:
    text = page(
        ALL, floor=Floor(True, "agrees"), target="fake://bench", claim="4 scenarios", seed=1, utc_ns=NOON
    )  # fmt: skip

    assert all(each.name in text for each in ALL)
    assert "A level &lt;b&gt;" in text
    assert 2 == text.count("<svg")
    assert "From 2.00" not in text
    assert "Bench, from 2.00 s on: link down" in text
