"""The judge convicts every wrong controller at the first execution whose bits differ, and never the true law."""

from __future__ import annotations

from typing import Any

import pytest
from mutants.lineup import LAWS, Suspect, binary64_inside, changed, one_scan_late

from ahgateway.core.compare import compare
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.real import REAL, quiet

Script = dict[int, dict[str, Any]]

BOTH: Script = {
    30: {"sv": 20.0},
    50: {"pid_man": True, "mout": 35.0},
    56: {"pid_man": False},
    70: {"sv": 90.0, "mv_max": 48.5},  # saturates above
    85: {"sv": 60.0},
    95: {"sv": 5.0, "mv_min": 12.25},  # saturates below
    110: {"sv": 20.0, "mv_min": 0.0},
    120: {"err_dbw": 5.0, "sv": 40.0},  # PV crosses the edges on its way, and SV
    150: {"sv": 41.0},
    160: {"err_dbw": 0.0, "mout_auto": True, "sv": 55.0},
    175: {"pid_run": False},
    178: {"pid_run": True, "sv": 50.0},
    190: {"pid_man": True, "mout": 130.0},
    194: {"pid_man": False},
    200: {"mv_max": 0.0, "mv_min": 45.5},  # the wrong way round
    210: {"mv_max": 30.5, "mv_min": 30.5, "sv": 30.0},
    220: {"mv_max": 100.0, "mv_min": 0.0},
    230: {"pid_dir": False, "sv": 45.0},
    236: {"pid_dir": True},
}
SCRIPTS: dict[str, tuple[dict[str, Any], Script]] = {
    "DPID": (
        {"sv": 50.0, "cycle": 7, "kp": 1.1, "ki": 0.3, "kd": 0.13},
        BOTH
        | {
            240: {"pid_mode": 2, "pid_man": True, "mout": 20.0},
            245: {"pid_man": False},
            255: {"ki": 0.0},
            258: {"kp": -1.0, "ki": 0.3},
            270: {"kp": 2.0, "ki": 0.0, "kd": 0.0},
            271: {"ki": 0.5, "cycle": 100, "sv": 50.0, "pv": 30.0, "mv_max": 50.0},  # the sum is 40 + 10
        },
    ),
    "DPIDE": (
        {"sv": 50.0, "cycle": 70, "kc_kp": 1.1, "ti_ki": 0.37, "td_kd": 0.13, "tf": 0.21, "bias": 3.3},
        BOTH
        | {
            10: {"pid_eq": True, "ti_ki": 2.1},
            20: {"pid_de": True},
            29: {"pid_eq": False, "ti_ki": 0.37},
            140: {"pid_de": False},
            240: {"pid_eq": True, "ti_ki": 2.1},
            250: {"sv": 30.0, "bias": 60.7},
            260: {"kc_kp": 0.0},
            263: {"kc_kp": 1.3},
            264: {"err_dbw": 5.0, "sv": 40.0, "pv": 30.0},
            265: {"pv": 45.0},  # from one side onto the other edge
            266: {"pv": 30.0},
            267: {"pv": 38.0},
            268: {"pv": 40.0},  # touches SV and turns back
            269: {"pv": 38.0},
            270: {"err_dbw": 0.0, "pid_eq": False, "kc_kp": 2.0, "ti_ki": 0.0, "td_kd": 0.0, "bias": 0.0},
            271: {"ti_ki": 0.5, "cycle": 1000, "sv": 50.0, "pv": 30.0, "mv_max": 50.0},  # the sum is 40 + 10
        },
    ),
}
EXECUTIONS = 280


def outputs(controller: Controller, state: Any, terms: Any) -> list[REAL]:
    return [getattr(state if hasattr(state, seen.attr) else terms, seen.attr) for seen in controller.seen]


def trial(name: str, suspect: Suspect) -> tuple[int | None, int | None]:
    """Drive suspect (as the PLC) and law side by side over a plant: first conviction, first difference."""
    controller = CONTROLLERS[name]
    start, script = SCRIPTS[name]
    kinds = {row.attr: row.kind.value for row in controller.operands}
    operands = controller.inputs(**{key: REAL(v) if kinds[key] == "REAL" else v for key, v in start.items()})
    plc = ref = controller.state()
    level, mout = 10.0, None
    for number in range(EXECUTIONS):
        changes = {k: REAL(v) if kinds[k] == "REAL" else v for k, v in script.get(number, {}).items()}
        if mout is not None and "mout" not in changes:
            changes["mout"] = mout
        changes.setdefault("pv", REAL(round(level * 4) / 4))  # a converter's grid
        operands = operands._replace(**changes)
        plc, plc_terms = suspect.step(operands, plc, DEFAULT, suspect.nominal_ts(operands))
        ref, ref_terms = controller.step(operands, ref, DEFAULT, controller.nominal_ts(operands))
        mout = plc_terms.mout
        pairs = list(zip(outputs(controller, plc, plc_terms), outputs(controller, ref, ref_terms), strict=True))
        convicted = any(compare(left, right) is None for left, right in pairs)
        if convicted or any(left != right for left, right in pairs):
            return (number if convicted else None, number)
        level += (1.3 * float(plc.mv) - level) * 0.11 + (0.9 if number % 17 == 0 else 0.0)
    return None, None


CASES = [(name, title) for name, (_, mutants) in LAWS.items() for title in mutants]


@pytest.mark.parametrize(("name", "title"), CASES, ids=[f"{name} {title}" for name, title in CASES])
def test_a_wrong_controller_is_convicted_at_the_first_difference(name: str, title: str) -> None:
    law, mutants = LAWS[name]
    with quiet(all="ignore"):
        convicted, differs = trial(name, changed(law, mutants[title]))
    assert differs is not None, "the excitation never showed the fault"
    assert convicted == differs


@pytest.mark.parametrize("make", [one_scan_late, binary64_inside])
@pytest.mark.parametrize("name", LAWS)
def test_a_wrong_machine_is_convicted_at_the_first_difference(name: str, make: Any) -> None:
    convicted, differs = trial(name, make(CONTROLLERS[name]))
    assert differs is not None
    assert convicted == differs


@pytest.mark.parametrize("name", LAWS)
def test_the_true_law_is_acquitted(name: str) -> None:
    assert (None, None) == trial(name, changed(LAWS[name][0], ()))


@pytest.mark.parametrize("name", LAWS)
def test_there_are_a_dozen_suspects_at_least(name: str) -> None:
    assert len(LAWS[name][1]) >= 12
