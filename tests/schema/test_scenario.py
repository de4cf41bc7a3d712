"""Scenario files: what a technician may write, and what a wrong one is told."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from ahgateway.errors import ProfileError
from ahgateway.schema.formula import holds, names_of
from ahgateway.schema.scenario import collected, known_differences, parse

STEP = """
title = "A step"
instruction = "DPID"
duration = 10.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 3.0 }

[initial]
SV = 50.0
CYCLE = 10

[[step]]
at = 5.0
set = { SV = 60.0 }

[expect]
clamps = true
"""


def refusal(text: str) -> ProfileError:
    with pytest.raises(ProfileError) as caught:
        parse(text, "step.toml", "mine/step")
    return caught.value


def test_a_scenario_is_read() -> None:
    scenario = parse(STEP, "step.toml", "mine/step")

    assert ("mine/step", "DPID", 10.0) == (scenario.name, scenario.controller.name, scenario.duration_s)
    assert {"SV": 50.0, "CYCLE": 10} == dict(scenario.initial)
    assert (5.0, {"SV": 60.0}) == (scenario.actions[0].at_s, dict(scenario.actions[0].set))
    assert scenario.plant is not None
    assert ("fopdt", 1.2, 3.0) == (scenario.plant.kind, scenario.plant.gain, scenario.plant.tau_s)


def test_a_load_needs_a_plant_to_act_on() -> None:
    bare = STEP.replace('plant = { kind = "fopdt", gain = 1.2, tau_s = 3.0 }', "")

    assert 3.5 == parse(STEP.replace("set = { SV = 60.0 }", "load = 3.5"), "s.toml", "mine/s").actions[0].load
    assert "step.0.load: acts on a plant" in refusal(bare.replace("set = { SV = 60.0 }", "load = 3.5")).message


def test_what_only_delta_has_is_not_expected_of_others() -> None:
    other = STEP.replace("DPID", "PID_REG_CE").replace("SV = 50.0\nCYCLE = 10", "").replace("SV = 60.0", "KP = 2.0")

    assert "expect.clamps: is told of DPID and DPIDE only, not of PID_REG_CE" in refusal(other).message


def test_the_time_line_is_put_in_order() -> None:
    late = STEP + "\n[[step]]\nat = 2.0\nset = { Kp = 2.0 }\n"

    assert [2.0, 5.0] == [each.at_s for each in parse(late, "step.toml", "mine/step").actions]


def test_a_sensor_may_deliver_no_number() -> None:
    scenario = parse(STEP.replace("SV = 60.0", "PV = nan"), "step.toml", "mine/step")

    assert math.isnan(scenario.actions[0].set["PV"])


@pytest.mark.parametrize(
    ("old", "new", "message", "hint"),
    [
        ("clamps", "clamp", "step.toml: expect.clamp: unknown key", "did you mean `clamps`?"),
        ("SV = 60.0", "SW = 60.0", "step.toml: step.0.set.SW: DPID has no operand of that name", "did you mean `SV`?"),
        ("CYCLE = 10", "CYCLE = 1.5", "step.toml: initial.CYCLE: CYCLE is a DINT, 1.5 is not", None),
        ('"DPID"', '"DPIDF"', 'step.toml: instruction: "DPIDF" cannot be checked, allowed are DPID, DPIDE', "did you"),
        ("at = 5.0", "at = 15.0", "step.toml: step.0.at: is 15, but the scenario ends at 10", None),
        ("set = { SV = 60.0 }", "ramp = { SV = 60.0 }", "step.toml: step.0.until: is missing, a ramp needs", None),
        ("set = { SV = 60.0 }", "", "step.toml: step.0: does nothing", "give it set, ramp, load or do"),
        ("set = { SV = 60.0 }", 'do = "halt"', 'step.toml: step.0.do: "halt" is not known', None),
        (", tau_s = 3.0", "", "step.toml: plant.tau_s: is missing, a plant of kind fopdt needs it", None),
        ('kind = "fopdt"', 'kind = "sopdt"', "step.toml: plant.tau2_s: is missing", None),
        ("clamps = true", 'shadow = "ulp"', "step.toml: expect.ulp_max: is missing", None),
        (", tau_s = 3.0", ", tau_s = 3.0, zeta = 0.5", "plant.zeta: means nothing for a plant of kind fopdt", None),
        (", tau_s = 3.0", ", tau_s = 3.0, backlash = 1.0", "plant.backlash: belongs to a motor valve", "add stroke_s"),
        (", tau_s = 3.0", ", tau_s = 3.0, span = [9.0, 1.0]", "plant.span: 9 is not below 1", None),
        (", tau_s = 3.0", ", tau_s = 3.0, stroke_s = 9.0, pwm_s = 1.0", "plant.pwm_s: is given", "leave out one"),
        ("clamps = true", "recovery = 1.0", "step.toml: expect.recovery: has nothing to recover from", None),
        ("clamps = true", "bumpless = 1.0", "expect.bumpless: 1.0 stands where a table belongs", "its keys are within"),
        ("[[step]]", "[step]", "step.toml: step: is one table, and a list of tables", "head each with [[step]]"),
        ("10.0", '"10 s"', 'step.toml: duration: "10 s" is text, and a number belongs here', "leave out the quotes"),
        ("10.0", "-10.0", "step.toml: duration: -10.0 should be greater than 0", None),
        ("at = 5.0", "at = -5.0", "step.toml: step.0.at: -5.0 should be greater than or equal to 0", None),
        (
            "at = 5.0",
            "at = 5.0\nuntil = 11.0\nload = 1.0",
            "step.toml: step.0.until: is 11, but the scenario ends",
            None,
        ),
        (
            "clamps = true",
            "[[expect.response]]\nafter = 1.0",
            "expect.response.0: asks for nothing",
            "give it at least",
        ),
        ("clamps = true", "[[expect.response]]\nfinaly = 'PV > 1'", "finaly: unknown key", "did you mean `finally`?"),
        ("clamps = true", "[[expect.response]]\nalways = 'PV = 1'", '"PV = 1": it cannot be read', "such as `abs(PV"),
    ],
)
def test_a_wrong_scenario_is_refused(old: str, new: str, message: str, hint: str | None) -> None:
    error = refusal(STEP.replace(old, new))

    assert message in error.message
    assert (error.hint or "").startswith(hint or "")


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("PV + 1", "a comparison is wanted"),
        ("PW < 1", "`PW` is no operand"),
        ("__import__('os') == 1", "is not allowed"),
        ("PV.real < 1", "is not allowed"),
        ("PV ** 9 < 1", "is not allowed"),
        ("abs(PV, SV) < 1", "`abs` takes 1 values"),
        ("PV <", "it cannot be read"),
        ("PV < 1; PV > 0", "it cannot be read"),
        ("(PV := 3) < 1", "is not allowed"),
        ("PV < [x for x in (1, 2)][0]", "is not allowed"),
        ("PV < True.real", "is not allowed"),
        ("PV < 1j", "`1j` is not allowed"),
        ("PV < '1'", "`'1'` is not allowed"),
        ("max(*PV) < 1", "`max` takes 2…9 values"),
        ("abs < 1", "`abs` is no operand"),
        ("PV < 1e999", "`1e999` is not allowed"),
        ("PV < " + "9" * 400, "is not allowed"),
        ("PV" + ".x" * 240 + " < 1", "is not allowed"),
        ("(" * 240 + "PV" + ")" * 240 + " < 1", "it cannot be read"),
        ("PV < 1 or " * 60 + "PV < 1", "it has 606 characters, at most 500 are read"),
    ],
)
def test_a_formula_outside_the_grammar_is_refused(formula: str, message: str) -> None:
    window = f'\n[[expect.response]]\nafter = 1.0\nalways = "{formula}"\n'

    assert message in refusal(STEP + window).message


def test_several_errors_are_told_together() -> None:
    error = refusal(STEP.replace("at = 5.0", "at = 15.0").replace("CYCLE = 10", "CYCLE = true"))

    assert "2 errors" in error.message


@pytest.mark.parametrize(
    ("text", "is_met"),
    [
        ("abs(PV - SV) < 0.5", False),
        ("0 <= MV <= 100 and not PID_MAN", True),
        ("max(PV, SV) == 50 or MV > 99", True),
        ("MV / (SV - 50) > 1", False),
        ("-PV * 2 != -98", False),
        ("PV<50and SV>49", True),
        ("not " * 118 + "PV < 50", True),
        ("-" * 400 + "PV < 50", True),
        ("*".join(["999999999"] * 45) + " > PV", True),  # beyond binary64, and no whole number of 400 digits
        ("OUT != 1", False),  # a NaN is neither
        ("not (OUT > 1)", False),
        ("OUT == OUT", False),
        ("PV < 50 or OUT > 1", True),
    ],
)
def test_a_formula_is_worth_what_arithmetic_says(text: str, is_met: bool) -> None:
    values = {"PV": 49.0, "SV": 50.0, "MV": 33.0, "PID_MAN": False, "OUT": math.nan}

    assert is_met is holds(text, values)
    assert names_of(text) <= set(values)


def test_the_shipped_library_is_whole() -> None:
    names = [each.name for each in collected(["conformance"])]

    assert 33 == len(names) == len(set(names))
    assert {"dpid", "dpide"} == {name.partition("/")[0] for name in names}


def test_a_path_that_leads_nowhere_names_what_is_shipped(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="shipped are conformance, dpid, dpide") as caught:
        collected(["dpidd"])
    assert "did you mean `dpid`?" == caught.value.hint
    with pytest.raises(ProfileError) as one:
        collected(["dpid/saturation"])
    assert "one scenario of a set is picked with `dpid -k saturation`" == one.value.hint
    with pytest.raises(ProfileError, match="holds no scenario"):
        collected([str(tmp_path)])


def test_a_file_named_twice_runs_once_and_two_of_one_name_are_refused(tmp_path: Path) -> None:
    assert 15 == len(collected(["dpid", "dpid"]))
    for folder in ("a", "b"):
        (tmp_path / folder / "mine").mkdir(parents=True)
        (tmp_path / folder / "mine" / "step.toml").write_text(STEP)
    with pytest.raises(ProfileError, match="are both named `mine/step`"):
        collected([str(tmp_path)])


def test_a_known_difference_has_reason_owner_and_expiry(tmp_path: Path) -> None:
    file = tmp_path / "known.toml"
    file.write_text('[[known]]\nscenario = "dpid/*"\nreason = "firmware 2.1"\nexpires = 2026-12-31\n')

    with pytest.raises(ProfileError, match=r"known\.0\.owner: is missing"):
        known_differences(file)
    file.write_text(file.read_text() + 'owner = "Kim"\n')
    assert ["Kim"] == [each.owner for each in known_differences(file)]
