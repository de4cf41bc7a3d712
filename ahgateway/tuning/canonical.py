"""The canonical set: what any of the controllers is set to, in one form (spec 7.1), and physical scaling.

Inside it keeps the parallel gains, because they exist where the standard form does not (Kc = 0 with an integral).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum


class Band(Enum):
    """What kind of dead band a controller has; two kinds are never the same law."""

    NONE = "none"
    PLAIN = "plain"
    ZERO_CROSS = "zero-cross"
    SHIFTED = "shifted"
    ZONE = "zone"


@dataclass(frozen=True, slots=True)
class Canonical:
    """One controller's settings, u = Kp·(b·w − x) + Ki∫(w − x) + Kd·d(c·w − x)/dt filtered, + bias, times `sign`.

    Attributes:
        kp: Proportional gain, MV/PV.
        ki: Integral gain, MV/(PV·s).
        kd: Derivative gain, MV·s/PV.
        tf_s: Time constant of the derivative's filter in s.
        b: Weight of SV in P.
        c: Weight of SV in D.
        sign: +1 for E = SV − PV, −1 for E = PV − SV.
        ts_s: Sampling time in s.
        umin: Lower limit of MV, −inf for none.
        umax: Upper limit of MV, inf for none.
        bias: Added to the sum, in MV.
        tau_pv_s: Time constant of a filter on PV in s.
        band: Half width of the dead band in PV.
        band_kind: Which dead band.
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    tf_s: float = 0.0
    b: float = 1.0
    c: float = 1.0
    sign: int = 1
    ts_s: float = 1.0
    umin: float = -math.inf
    umax: float = math.inf
    bias: float = 0.0
    tau_pv_s: float = 0.0
    band: float = 0.0
    band_kind: Band = Band.NONE

    @property
    def kc(self) -> float:
        """Gain of the standard form."""
        return self.kp

    @property
    def ti_s(self) -> float:
        """Integral time in s; inf without an integral."""
        return self.kp / self.ki if self.ki > 0.0 else math.inf

    @property
    def td_s(self) -> float:
        """Derivative time in s; 0 without a derivative."""
        return self.kd / self.kp if self.kp > 0.0 else 0.0

    def scaled(self, scaling: Scaling) -> Canonical:
        """Return the same controller for other units of PV and MV: times stay, gains by the spans, limits by MV."""
        ratio = scaling.mv_ratio / scaling.pv_ratio
        # Without an integral nothing else takes up where MV's scale begins.
        bias = scaling.mv(self.bias) if self.ki == 0.0 else self.bias * scaling.mv_ratio
        return replace(
            self,
            kp=self.kp * ratio,
            ki=self.ki * ratio,
            kd=self.kd * ratio,
            umin=scaling.mv(self.umin),
            umax=scaling.mv(self.umax),
            bias=bias,
            band=self.band * scaling.pv_ratio,
        )


def standard(
    kc: float, ti_s: float = math.inf, td_s: float = 0.0, *, kind: Band = Band.NONE, band: float = 0.0, **rest: float
) -> Canonical:
    """Return the canonical set for gains in standard form; `ti_s` of inf or 0 is no integral, a band of 0 none."""
    ki = kc / ti_s if math.isfinite(ti_s) and ti_s > 0.0 else 0.0
    found = Canonical(kc, ki, kc * td_s, band=band, band_kind=kind if band else Band.NONE)
    return replace(found, **rest)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Scaling:
    """Ranges of PV and MV, lowest and highest, on the source's and on the target's side."""

    pv_from: tuple[float, float] = (0.0, 1.0)
    mv_from: tuple[float, float] = (0.0, 1.0)
    pv_to: tuple[float, float] = (0.0, 1.0)
    mv_to: tuple[float, float] = (0.0, 1.0)

    @property
    def pv_ratio(self) -> float:
        """Target's PV units per source's."""
        return (self.pv_to[1] - self.pv_to[0]) / (self.pv_from[1] - self.pv_from[0])

    @property
    def mv_ratio(self) -> float:
        """Target's MV units per source's."""
        return (self.mv_to[1] - self.mv_to[0]) / (self.mv_from[1] - self.mv_from[0])

    def pv(self, value: float) -> float:
        """A PV of the source in the target's units."""
        return self.pv_to[0] + (value - self.pv_from[0]) * self.pv_ratio

    def mv(self, value: float) -> float:
        """An MV of the source in the target's units."""
        return self.mv_to[0] + (value - self.mv_from[0]) * self.mv_ratio


SAME = Scaling()
"""Both sides in the same units."""
