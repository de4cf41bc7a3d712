"""Random dialects in which a bound need not enclose the truth, or older history counts: no execution is convicted."""

from __future__ import annotations

from typing import Any

import pytest
from bench.bench_dialects import soak

from ahgateway.core.dialect import AXES, Dialect

FORWARD = """
freeze=never run_off=clear first_call=after_cycle cross_band=off cross_touch=ignored cross_d=true_error
ts_source=ms integrator=trapezoid integral_store=without_kc product=k_ets ratio=gain dependent_sum=factored
derivative_of=pv filter=forward sum_order=p_id bias_joins=outer limit_edge=at limited_output=recomputed
limits=as_written ki_off=held run_off_history=tracked run_off_filter=kept run_off_scan=every_scan
run_on=after_cycle en_off_time=runs en_on_history=forgotten stop_history=forgotten manual_integral=tracks
manual_history=held manual_filter=cleared transfer_2=bumpless preset_integrates=yes preset_limit=limited
schedule=drifting
"""

OLDER = """
freeze=back_calculated run_off=clear first_call=after_cycle direction=inverted band=off cross_band=off
cross_touch=ignored cross_d=true_error ts_unit=counts integrator=previous integral_used=old
dependent_sum=factored derivative_of=pv derivative_product=slope_first filter=ignored filter_content=slope
first_history=stale sum_order=p_id limits=written_back clamped=written_back run_off_history=kept
run_off_filter=kept en_on_history=forgotten stop_history=forgotten manual_integral=tracks
manual_history=held manual_filter=cleared transfer=direct transfer_2=bumpless preset_order=bias_p_d
preset_limit=limited
"""

BACK = """
freeze=back_calculated run_off=clear first_call=after_cycle ts_unit=left_out integrator=dvp
integral_store=sum integral_used=old product=kts_e dependent_sum=factored derivative_of=pv filter=forward
filter_content=slope sum_order=pd_i limit_edge=at limited_output=recomputed limits=as_written
en_on_history=forgotten stop_history=forgotten mout_auto=always transfer=mv_as_i preset_order=d_p_bias
preset_integrates=yes
"""

HIDDEN = """
freeze=outward run_off=clear direction=inverted cross_band=plain cross_edge=inclusive cross_touch=ignored
cross_manual=cleared cross_d=true_error ts_scale=multiplied integrator=previous integral_store=sum
product=kts_e dependent_sum=factored derivative_of=pv derivative_product=slope_first filter=ignored
sum_order=p_id bias_joins=second freeze_test=without_d limit_edge=at limits=written_back
run_off_history=tracked run_on=at_once en_on_history=forgotten manual_integral=tracks manual_history=held
manual_filter=cleared mout_auto=always transfer=mv_as_i transfer_2=bumpless preset_order=bias_p_d
preset_integrates=yes
"""


def spelled_out(text: str) -> Any:
    """A dialect from `axis=value` pairs."""
    pairs = [each.split("=") for each in text.split()]
    return Dialect(**{axis: AXES[axis][value.upper()] for axis, value in pairs})


@pytest.mark.parametrize(
    ("name", "seed", "polls", "dialect"),
    [("DPIDE", 139, 30, FORWARD), ("DPID", 151, 230, OLDER), ("DPIDE", 154, 300, BACK), ("DPID", 7, 290, HIDDEN)],
    ids=["forward-filter", "history-older-than-the-picture", "back-calculated-at-a-limit", "manual-without-pv"],
)
async def test_what_cannot_be_known_convicts_nobody(name: str, seed: int, polls: int, dialect: str) -> None:
    world = await soak(name, seed, polls, spelled_out(dialect))

    assert world.follower.counts.diverged == 0
    assert world.follower.counts.proven > 0
