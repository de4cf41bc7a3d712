"""A simulated process as a person writes it, in the fake part of a profile or in a scenario: one table for both."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ahgateway.codec.station import PlantSpec
from ahgateway.core.controllers import Controller
from ahgateway.schema.findings import Findings
from ahgateway.schema.form import Form

NEEDED = {
    "fopdt": ("tau_s",),
    "sopdt": ("tau_s", "tau2_s"),
    "second_order": ("tau_s", "zeta"),
    "integrating": (),
    "tank": ("outflow",),
    "heat_cool": ("tau_s",),
}
"""Kind to the keys without which it is no plant."""

OWN = {"tau2_s": "sopdt", "zeta": "second_order", "outflow": "tank", "cool_gain": "heat_cool"}
"""Key to the only kind that has it."""

VALVE = ("backlash", "stiction", "position")


class PlantForm(Form):
    """The process behind a loop, with its actuator, its load and its sensor."""

    kind: Literal["fopdt", "sopdt", "second_order", "integrating", "tank", "heat_cool"]
    gain: float = Field(description="PV per MV; PV per MV and second for integrating and tank")
    tau_s: float | None = Field(default=None, gt=0, description="time constant; not for integrating and tank")
    tau2_s: float | None = Field(default=None, gt=0, description="sopdt: second time constant")
    zeta: float | None = Field(default=None, gt=0, description="second_order: damping, below 1 it swings")
    outflow: float | None = Field(default=None, ge=0, description="tank: what leaves per second, times the root of PV")
    dead_time_s: float = Field(default=0.0, ge=0, description="dead time")
    bias: float = Field(default=0.0, description="PV at MV = 0; drift of PV per second for integrating and tank")
    initial: float | None = Field(
        default=None, description="PV at the start; without it bias, 0 for integrating and tank"
    )
    cool_gain: float | None = Field(default=None, ge=0, description="heat_cool: PV per % of cooling")
    pwm_s: float | None = Field(default=None, gt=0, description="period of the pulses that MV in % is turned into")
    stroke_s: float | None = Field(
        default=None, gt=0, description="time of a motor valve before the plant; PID_REG_CE always has one, of 60 s"
    )
    backlash: float = Field(default=0.0, ge=0, description="backlash of the valve in %")
    stiction: float = Field(default=0.0, ge=0, description="way in % before a resting valve breaks loose")
    position: float = Field(default=0.0, ge=0, le=100, description="position of the valve at the start in %")
    noise: float = Field(default=0.0, ge=0, description="standard deviation of the noise on PV")
    filter_s: float = Field(default=0.0, ge=0, description="time constant of the sensor's lag")
    resolution: float = Field(default=0.0, ge=0, description="smallest step that the sensor shows")
    span: list[float] | None = Field(
        default=None, min_length=2, max_length=2, description="where the sensor ends below and above"
    )
    load_noise: float = Field(
        default=0.0, ge=0, description="standard deviation of a random load at the plant's input, in MV's unit"
    )
    load_tau_s: float = Field(default=10.0, gt=0, description="time constant of the random load")


def plant_spec(form: PlantForm, key: str, controller: Controller, findings: Findings) -> PlantSpec:
    """Return the process of a table; what is wrong goes to `findings` under `key`."""
    for name in NEEDED[form.kind]:
        if getattr(form, name) is None:
            findings.add(f"{key}.{name}", f"is missing, a plant of kind {form.kind} needs it")
    for name, kind in OWN.items():
        if getattr(form, name) is not None and form.kind != kind:
            findings.add(f"{key}.{name}", f"means nothing for a plant of kind {form.kind}, {kind} has it")
    has_valve = form.stroke_s is not None or "OPEN_OUT" in {row.name for row in controller.operands}
    for name in VALVE:
        if getattr(form, name) and not has_valve:
            findings.add(
                f"{key}.{name}", f"belongs to a motor valve, and {controller.name} drives none", "add stroke_s"
            )
    if form.pwm_s is not None and has_valve:
        findings.add(f"{key}.pwm_s", "is given, but a motor valve takes no pulses of a heater", "leave out one of them")
    if form.span is not None and not form.span[0] < form.span[1]:
        findings.add(f"{key}.span", f"{form.span[0]:g} is not below {form.span[1]:g}")
    start = 0.0 if form.kind in ("integrating", "tank") else form.bias
    return PlantSpec(
        form.kind,
        form.gain,
        tau_s=form.tau_s or 0.0,
        dead_time_s=form.dead_time_s,
        bias=form.bias,
        noise=form.noise,
        initial=start if form.initial is None else form.initial,
        cool_gain=form.cool_gain or 0.0,
        stroke_s=form.stroke_s,
        backlash=form.backlash,
        stiction=form.stiction,
        position=form.position,
        tau2_s=form.tau2_s or 0.0,
        zeta=form.zeta or 0.0,
        outflow=form.outflow or 0.0,
        pwm_s=form.pwm_s or 0.0,
        filter_s=form.filter_s,
        resolution=form.resolution,
        span=None if form.span is None else (form.span[0], form.span[1]),
        load_noise=form.load_noise,
        load_tau_s=form.load_tau_s,
    )
