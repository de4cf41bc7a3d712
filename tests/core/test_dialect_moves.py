"""What is said of an axis to an operator: what has to be known before, and what nobody can tell apart."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest
from dialects import excited, random_dialect

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import AXES
from ahgateway.core.dialect_axes import BY_NAME, TABLE, Axis
from ahgateway.core.dialect_moves import Alike, spoken
from ahgateway.core.real import REAL, bits, quiet

SEEDS = 12
EXECUTIONS = 50

OUTSIDE_THE_LAW = {"cross_scan"}
"""Between two executions; `crossings` and the fake PLC know it."""

RULES = [
    (name, axis, rule)
    for name in ("DPID", "DPIDE")
    for axis in TABLE
    for rule in axis.alike
    if axis.concerns(name) and rule.instruction in ("", name) and axis.name not in OUTSIDE_THE_LAW
]


def harsh(name: str, seed: int) -> Iterator[Any]:
    """Ordinary excitation on a coarse grid, so that edges are met by bits, and the corners that operators keep off."""
    law, chance = CONTROLLERS[name], random.Random(f"harsh {seed}")
    gains = ("kp", "ki", "kd") if name == "DPID" else ("kc_kp", "ti_ki", "td_kd")
    for inputs in excited(law, seed, EXECUTIONS):
        changes: dict[str, Any] = {}
        if seed % 2:
            changes = {each: REAL(round(float(getattr(inputs, each)) / 2) * 2) for each in ("pv", "sv", "err_dbw")}
        if seed % 3 == 0:
            changes |= dict(zip(gains, (REAL(1), REAL(0.5), REAL(0)), strict=True))
            changes |= {"mv_max": REAL(16), "mv_min": REAL(-16), "cycle": 50 if name == "DPID" else 500}
        if chance.random() < 0.05:
            changes |= {"mv_max": inputs.mv_min, "mv_min": inputs.mv_max}
        if chance.random() < 0.05:
            changes["pid_dir"] = not inputs.pid_dir
        if chance.random() < 0.05:
            changes[chance.choice(gains)] = REAL(0)
        yield inputs._replace(**changes)


def words(name: str, seed: int, dialect: Any) -> list[tuple[int, ...]]:
    """Every word that an operator can see, as bits, behind each execution."""
    law = CONTROLLERS[name]
    state, mout, found = law.state(), None, []
    for inputs in harsh(name, seed):
        read = inputs._replace(mout=mout) if mout is not None and inputs.mout_auto else inputs
        with quiet(all="ignore"):
            state, terms = law.step(read, state, dialect, law.ts(read, dialect, 130))
        mout = terms.mout
        found.append(tuple(bits(REAL(each)) for each in (state.i, state.mv, terms.mout, state.pv1)))
    return found


def shown(name: str, axis: Axis, rule: Alike, seed: int, *, is_met: bool) -> int:
    """How many different words the values leave that are said to be alike, where the rule is met or not."""
    chance = random.Random(f"given {seed}")
    dialect = random_dialect(seed, share=0.5)
    for other, held in rule.given.items():
        values = [each for each in AXES[other] if (each in held) == is_met]
        dialect = dialect._replace(**{other: chance.choice(values)})
    own = rule.own or tuple(AXES[axis.name])
    return len({tuple(words(name, seed, dialect._replace(**{axis.name: each}))) for each in own})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "axis", "rule"), RULES, ids=[f"{n}-{a.name}-{'-'.join(r.given)}" for n, a, r in RULES]
)
def test_what_cannot_be_told_apart_has_equal_bits_and_shows_elsewhere(name: str, axis: Axis, rule: Alike) -> None:
    assert {1} == {shown(name, axis, rule, seed, is_met=True) for seed in range(SEEDS)}
    if axis.name not in RARE:
        assert any(shown(name, axis, rule, seed, is_met=False) > 1 for seed in range(4 * SEEDS))


RARE = {"cross_manual", "cross_jump", "cross_sv", "run_off_manual", "preset_mv", "limit_edge", "cross_touch"}
"""Ordinary excitation seldom meets them; `bench_advice` shows each of them on the fake PLC."""


def test_what_waits_waits_for_something_that_comes_first() -> None:
    for axis in TABLE:
        waiting = list(axis.after)
        seen: set[str] = set()
        while waiting:
            name = waiting.pop()
            assert name != axis.name, "they would wait for each other"
            if name not in seen:
                seen.add(name)
                waiting += BY_NAME[name].after


def test_the_gains_are_called_as_on_the_instruction() -> None:
    assert "Kd above 0, Ki to 0" == spoken("the D gain above 0, the I gain to 0", "DPID")
    assert "Td_Kd above 0, Kc_Kp" == spoken("the D gain above 0, the P gain", "DPIDE")


def test_what_cannot_be_told_apart_is_said_in_words() -> None:
    assert ("kept and rescaled are the same with integral_store = term",) == BY_NAME["form_integral"].unseen()
    assert ("all values are the same with freeze = never or previous_mv",) == BY_NAME["limit_edge"].unseen()
