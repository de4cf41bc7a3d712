"""MELSEC's tuning tables. a = 10, τ = 40 s, τon = 10 s: τon(1 − τon/τ) = 7.5 s."""

from __future__ import annotations

import pytest

from ahgateway.core.controllers.melsec_tuning import Law, Tuned, limit_cycle, step_response, wait_s


@pytest.mark.parametrize(
    ("law", "expected"), [(Law.P, (1000, 0, 0)), (Law.PI, (900, 247.5, 0)), (Law.PID, (1200, 150, 375))]
)
def test_limit_cycle_and_step_response_are_one_rule(law: Law, expected: tuple[float, ...]) -> None:
    """The integrating response has L = 7.5 s and R·L = 10, the peak-to-peak amplitude; the step is ULV − LLV."""
    assert expected == pytest.approx(limit_cycle(law, 10.0, 40.0, 10.0, 80.0, -20.0), rel=1e-12)
    assert expected == pytest.approx(step_response(law, 7.5, 10.0 / 7.5, 100.0), rel=1e-12)


def test_wait_after_the_tuning_cycle() -> None:
    assert 15.0 == wait_s(0, 40.0, 10.0)
    assert 0.0 == wait_s(-50, 40.0, 10.0)
    assert 0.0 == wait_s(-51, 40.0, 10.0)
    assert 0.0 == wait_s(32718, 40.0, 10.0)


def test_impossible_measurements_are_refused() -> None:
    with pytest.raises(ValueError, match="amplitude is 0"):
        limit_cycle(Law.P, 0.0, 40.0, 10.0, 1.0, 0.0)
    with pytest.raises(ValueError, match="on_s is 41"):
        limit_cycle(Law.P, 1.0, 40.0, 41.0, 1.0, 0.0)
    with pytest.raises(ValueError, match="slope is -1"):
        step_response(Law.P, 1.0, -1.0, 1.0)
    assert Tuned(100.0, 0.0, 0.0) == step_response(Law.P, 1.0, 1.0, 1.0)
