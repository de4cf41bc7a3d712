"""The figures of a loop's health as text, and what shadow and figures say together."""

from __future__ import annotations

from textwrap import wrap

from ahgateway.apps.health import Health
from ahgateway.apps.health_process import Statement


def health_lines(found: Health | None, said: Statement | None, units: tuple[str, str], width: int) -> list[str]:
    """Return the figures as lines no wider than `width`; units are those of PV and MV."""
    if found is None:
        return ["health: too few samples yet"]
    pv, mv = units
    swing = found.oscillation
    lines = [
        f"health over {found.duration_s:.0f} s, {found.samples} samples",
        f"auto {found.auto_share:.0%}  at low limit {found.low_share:.0%}  at high limit {found.high_share:.0%}",
        f"IAE {found.iae:.4g} {pv}·s  mean error {found.error_mean_abs:.3g} {pv}  σ {found.error_std:.3g} {pv}"
        + (f"  variability {found.variability:.3g} %" if found.variability is not None else ""),
        f"MV travel {found.mv_travel:.4g} {mv} ({found.mv_travel_per_h:.4g} per h)  reversals {found.reversals}",
        f"PV noise {found.noise:.3g} {pv}  resolution "
        + (f"{found.resolution:.3g} {pv}" if found.resolution else "not seen"),
    ]
    if swing is None:
        lines.append("oscillation: window too short to tell")
    else:
        word = "oscillates" if found.oscillates else "no oscillation"
        lines.append(
            f"{word}: period {swing.period_s:.3g} s  amplitude {swing.amplitude:.3g} {pv}  "
            f"regularity {swing.regularity:.2g}  strength {swing.strength:.2g}"
        )
    if found.stiction is not None:
        lines.append(
            f"stiction: {found.stiction.says} (lag skew {found.stiction.lag_skew:.2f}, "
            f"size skew {found.stiction.size_skew:.2f}; self-regulating processes only)"
        )
    if said is not None:
        lines.append(f"! {said.text}")
    return [part for line in lines for part in wrap(line, max(20, width), subsequent_indent="  ")]
