"""Codes are stable, every cause has a page, and the command finds both."""

from __future__ import annotations

import json

from typer.testing import CliRunner

from ahgateway.apps.commission.catalogue import CATALOGUE
from ahgateway.cli.main import app
from ahgateway.errors import ProfileError
from ahgateway.lockstep.cause_pages import PAGES, code_of

CODES = {
    "AHG251": "gain",
    "AHG252": "cycle",
    "AHG253": "direction",
    "AHG254": "mode-change",
    "AHG255": "stale-pv",
    "AHG256": "clamp",
    "AHG257": "dialect",
    "AHG258": "operand-written",
    "AHG259": "integral",
    "AHG260": "missed-execution",
    "AHG261": "torn-picture",
    "AHG262": "link",
    "AHG263": "firmware-change",
    "AHG264": "rounding",
    "AHG299": "unknown",
}


def test_codes_never_change() -> None:
    assert CODES == {page.code: page.name for page in PAGES}
    assert all(code == code_of(name) for code, name in CODES.items())


def test_a_code_is_explained() -> None:
    result = CliRunner().invoke(app, ["explain", "ahg251", "--output", "json"])
    assert 0 == result.exit_code
    assert "gain" == json.loads(result.stdout)["name"]


def test_what_no_data_can_tell_from_a_cause_is_said_with_it() -> None:
    result = CliRunner().invoke(app, ["explain", "direction", "--output", "json"])
    assert json.loads(result.stdout)["classes"]["sign"].startswith("direction PID_DIR, dialect direction: ")


def test_a_code_of_commissioning_is_explained_too_and_no_code_has_two_meanings() -> None:
    result = CliRunner().invoke(app, ["explain", "AHG101", "--output", "json"])
    assert "no-answer" == json.loads(result.stdout)["name"]
    assert not {page.code for page in PAGES} & {kind.code for kind in CATALOGUE.values()}


def test_an_axis_is_explained() -> None:
    result = CliRunner().invoke(app, ["explain", "sum_order", "--output", "json"])
    assert {"pi_d": "(P+I)+D", "p_id": "P+(I+D)", "pd_i": "(P+D)+I"} == json.loads(result.stdout)["values"]


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    result = CliRunner().invoke(app, ["explain", "sum_ordr"])
    assert isinstance(result.exception, ProfileError)
    assert "sum_order" in str(result.exception.hint)
