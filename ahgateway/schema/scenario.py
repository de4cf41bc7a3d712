"""A scenario: the file in which a person says what to do to a loop, and what must be seen while it is done.

This module decides what a scenario file may say. What happens while one runs stands in `apps.check`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field, ValidationError

from ahgateway.codec.station import PlantSpec
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.operands import Kind
from ahgateway.schema import files
from ahgateway.schema.binding import typed_value
from ahgateway.schema.findings import Findings, near, shown
from ahgateway.schema.form import Form
from ahgateway.schema.forms import Scalar
from ahgateway.schema.plant import PlantForm, plant_spec

HOUR_S = 3600.0

DELTA_ONLY = ("bumpless", "clamps", "quiet_in_band", "fresh_pv")
"""Expectations that are judged by operands which only DPID and DPIDE have."""

SHIPPED = {"conformance": ("dpid", "dpide")}
"""Names of several shipped folders together."""

BASELINES = ("fresh-pv", "setpoint-step")
"""The shipped scenario of an instruction with which a bench is tried; the first that its folder has."""

BASELINE_S = 20.0
"""So much of it."""


class StepForm(Form):
    """One entry of the time line."""

    at: float = Field(ge=0, le=HOUR_S, description="when, in seconds from the start")
    until: float | None = Field(
        default=None, gt=0, le=HOUR_S, description="end of a ramp, or of what is done until then"
    )
    set: dict[str, Scalar] = Field(default_factory=dict, description="operand to the value it gets at once")
    ramp: dict[str, float] = Field(default_factory=dict, description="operand to the value it reaches at `until`")
    do: Literal["stop", "restart", "freeze-pv", "link-down"] | None = Field(
        default=None, description="what is done to the PLC, the sensor or the link"
    )
    load: float | None = Field(
        default=None, description="a load at the plant's input, in MV's unit, until `until` or for good"
    )


class BumplessForm(Form):
    """What a transfer from manual to automatic may do to MV."""

    within: float = Field(ge=0, description="largest movement of MV by the first execution behind the transfer")


class ResponseForm(Form):
    """What the loop does in a window of time; figures count from SV's step at its beginning."""

    after: float = Field(default=0.0, ge=0, description="begin of the window in s")
    before: float | None = Field(default=None, gt=0, description="end of the window in s; without it the scenario's")
    overshoot: float | None = Field(default=None, ge=0, description="largest overshoot, in % of the step of SV")
    settling: float | None = Field(default=None, gt=0, description="longest time in s until PV stays within the band")
    band: float = Field(default=5.0, gt=0, description="half the band of settling, in % of the step of SV")
    iae: float | None = Field(default=None, ge=0, description="largest integral of |SV - PV|, in PV·s")
    steady_error: float | None = Field(
        default=None, ge=0, description="largest mean of |SV - PV| in the last fifth of the window"
    )
    direction: Literal["up", "down"] | None = Field(default=None, description="first movement of MV in the window")
    always: str | None = Field(default=None, description="a comparison that holds at each moment: `MV <= MV_MAX`")
    finally_: str | None = Field(default=None, alias="finally", description="a comparison that holds at the end")


ASKED_FOR = ("overshoot", "settling", "iae", "steady_error", "direction", "always", "finally_")
"""What a response can ask for."""


class ExpectForm(Form):
    """What must be seen."""

    shadow: Literal["bits", "ulp", "tolerance", "none"] = Field(
        default="bits", description="how well PLC and reference agree"
    )
    ulp_max: int = Field(default=0, ge=0, description="with shadow = ulp: units of the last place")
    mv_max: float = Field(default=0.0, ge=0, description="with shadow = tolerance: difference of I and MV")
    coverage: float = Field(default=0.0, ge=0, le=1, description="smallest share of executions proven by bits")
    bumpless: BumplessForm | None = None
    clamps: bool = Field(default=False, description="MV stays within MV_MIN and MV_MAX while the instruction computes")
    quiet_in_band: bool = Field(
        default=False, description="MV stands still while the error stays inside the dead band, in automatic"
    )
    fresh_pv: bool = Field(
        default=False, description="each execution uses the PV of its own scan; pictures are taken at every scan then"
    )
    recovery: float | None = Field(
        default=None, gt=0, description="longest time in s from the link's return to the next execution proven"
    )
    response: list[ResponseForm] = Field(default_factory=list, description="windows of time")


class ScenarioForm(Form):
    """A scenario file."""

    title: str = Field(min_length=1, description="what is checked, one sentence")
    instruction: str = Field(description="DPID, DPIDE, MELSEC_PID, PID_REG_CE or PID_Temp")
    duration: float = Field(gt=0, le=HOUR_S, description="simulated time in s")
    limit: float = Field(default=60.0, gt=0, le=HOUR_S, description="longest real time in s")
    plant: PlantForm | None = Field(default=None, description="without it PV stands where it is set")
    initial: dict[str, Scalar] = Field(default_factory=dict, description="operand to its value at the start")
    step: list[StepForm] = Field(default_factory=list, description="the time line")
    expect: ExpectForm = Field(default_factory=ExpectForm)


class KnownForm(Form):
    """One difference that is known and waits for somebody."""

    scenario: str = Field(min_length=1, description="name of the scenario, * stands for anything")
    expectation: str = Field(default="*", description="name of the expectation, * stands for anything")
    reason: str = Field(min_length=1, description="why it is known")
    owner: str = Field(min_length=1, description="who will see to it")
    expires: date = Field(description="from the day behind this one it counts again")


class KnownFileForm(Form):
    """A file of known differences."""

    known: list[KnownForm] = Field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Action:
    """One thing that is done to a loop, at a time in s from the start.

    Attributes:
        at_s: When.
        until_s: When it ends; None for what is done at once.
        set: Operand to value, at once.
        ramp: Operand to the value reached at the end.
        do: What is done to the PLC, the sensor or the link; empty for nothing.
        load: Load at the plant's input; None for none.
        holds_pv: The sensor stands still from then on, or until `until_s`.
    """

    at_s: float
    until_s: float | None
    set: Mapping[str, Any]
    ramp: Mapping[str, float]
    do: str
    load: float | None = None
    holds_pv: bool = False


@dataclass(frozen=True)
class Scenario:
    """A scenario that has passed every check.

    Attributes:
        name: Folder and file without ending, `dpid/step`.
        file: Its path in messages.
        text: The file as it was read.
        title: What is checked.
        controller: Its instruction.
        duration_s: Simulated time.
        limit_s: Longest real time.
        plant: The process; None for none.
        initial: Operand to value, of the operand's own kind.
        actions: The time line, by time.
        expect: What must be seen.
    """

    name: str
    file: str
    text: str
    title: str
    controller: Controller
    duration_s: float
    limit_s: float
    plant: PlantSpec | None
    initial: Mapping[str, Any]
    actions: tuple[Action, ...]
    expect: ExpectForm


def library() -> Path:
    """Directory of the shipped scenarios: a folder per instruction, one of plants, and the bench that they run on."""
    return files.shipped() / "scenarios"


def collected(paths: list[str]) -> list[Scenario]:
    """Return the scenarios in files and folders, in order; shipped are the folders of `library`, and `conformance`.

    Raises:
        ProfileError: A path leads nowhere, a folder holds no scenario, or a scenario is wrong.
    """
    found: list[Scenario] = []
    for text in paths:
        path = Path(text)
        if path.is_dir():
            found.extend(_inside(path))
        elif path.is_file():
            found.append(load(path))
        elif text in SHIPPED or text in shipped_folders():
            for folder in SHIPPED.get(text, (text,)):
                found.extend(_inside(library() / folder))
        else:
            names = (*SHIPPED, *shipped_folders())
            folder, _, name = text.partition("/")
            is_one = folder in names and (library() / folder / f"{name}.toml").is_file()
            raise _missing(
                f"`{text}` is no file, no folder and no shipped set; shipped are {', '.join(names)}",
                f"one scenario of a set is picked with `{folder} -k {name}`" if is_one else near(text, names),
            )
    return _distinct(found)


def _inside(folder: Path) -> list[Scenario]:
    found = [load(each) for each in sorted(folder.rglob("*.toml"))]
    if not found:
        raise _missing(f"`{folder}` holds no scenario, a scenario is a file *.toml")
    return found


def _distinct(found: list[Scenario]) -> list[Scenario]:
    """Each file once; two files that results could not tell apart are refused."""
    named: dict[str, Scenario] = {}
    for each in found:
        other = named.setdefault(each.name, each)
        if Path(other.file).resolve() != Path(each.file).resolve():
            raise _missing(f"{other.file} and {each.file} are both named `{each.name}`", "rename one file or folder")
    return list(named.values())


def baselines(scenarios: Sequence[Scenario]) -> list[Scenario]:
    """Return the beginning of a shipped scenario of each instruction among these, with which a bench is tried first."""
    found = []
    for name in dict.fromkeys(each.controller.name.lower() for each in scenarios):
        files_of = (library() / name / f"{each}.toml" for each in BASELINES)
        whole = load(next(each for each in files_of if each.exists()))
        found.append(replace(whole, duration_s=min(whole.duration_s, BASELINE_S)))
    return found


def shipped_folders() -> tuple[str, ...]:
    """Names of the shipped sets: one per instruction, and `plants`."""
    return tuple(sorted(each.name for each in library().iterdir() if each.is_dir()))


def load(path: Path) -> Scenario:
    """Return the scenario in a file.

    Raises:
        ProfileError: It cannot be read, or is wrong; all errors together.
    """
    return parse(files.read(path, str(path)), str(path), f"{path.parent.name}/{path.stem}")


def parse(text: str, file: str, name: str) -> Scenario:
    """Return the scenario in a TOML text.

    Args:
        text: The scenario.
        file: How messages name it.
        name: How results name it.

    Raises:
        ProfileError: The text is no TOML, or anything in it is wrong; all errors together.
    """
    return made(files.tables(text, file), text, file, name)


def made(tables: dict[str, Any], text: str, file: str, name: str) -> Scenario:
    """Return the scenario of tables that have been read already; see `parse`."""
    findings = Findings(file)
    form = _read(ScenarioForm, tables, findings)
    findings.raise_any()
    assert isinstance(form, ScenarioForm)
    controller = CONTROLLERS.get(form.instruction)
    if controller is None:
        findings.add(
            "instruction",
            f"{shown(form.instruction)} cannot be checked, allowed are {', '.join(CONTROLLERS)}",
            near(form.instruction, CONTROLLERS),
        )
        findings.raise_any()
    assert controller is not None
    initial = _values(form.initial, "initial", controller, findings)
    actions = tuple(
        _action(entry, f"step.{number}", form.duration, controller, findings, has_plant=form.plant is not None)
        for number, entry in enumerate(form.step)
    )
    _check_expectations(form, controller, findings)
    plant = None if form.plant is None else plant_spec(form.plant, "plant", controller, findings)
    findings.raise_any()
    ordered = tuple(sorted(actions, key=lambda each: each.at_s))
    return Scenario(
        name, file, text, form.title, controller, form.duration, form.limit, plant, initial, ordered, form.expect
    )


def known_differences(path: Path) -> tuple[KnownForm, ...]:
    """Return the entries of a file of known differences.

    Raises:
        ProfileError: It cannot be read, or is wrong; all errors together.
    """
    findings = Findings(str(path))
    form = _read(KnownFileForm, files.tables(files.read(path, str(path)), str(path)), findings)
    findings.raise_any()
    assert isinstance(form, KnownFileForm)
    return tuple(form.known)


def _missing(message: str, hint: str | None = None) -> Exception:
    from ahgateway.errors import ProfileError

    return ProfileError(message, hint=hint)


def _read(form: type[BaseModel], data: dict[str, Any], findings: Findings) -> BaseModel | None:
    try:
        return form.model_validate(data)
    except ValidationError as error:
        findings.add_all(error, form)
        return None


def _values(values: Mapping[str, Any], key: str, controller: Controller, findings: Findings) -> dict[str, Any]:
    rows = {row.name: row for row in controller.operands if row.kind is not Kind.BLOCK}
    found: dict[str, Any] = {}
    for name, value in values.items():
        if name not in rows:
            findings.add(
                f"{key}.{name}",
                f"{controller.name} has no operand of that name that takes a value, it has {', '.join(rows)}",
                near(name, rows),
            )
        elif isinstance(value, float) and not math.isfinite(value) and rows[name].kind is Kind.REAL:
            found[name] = value  # what a broken sensor delivers
        else:
            found[name] = typed_value(rows[name], value, f"{key}.{name}", findings)
    return found


def _action(
    form: StepForm, key: str, duration_s: float, controller: Controller, findings: Findings, *, has_plant: bool
) -> Action:
    if form.at > duration_s:
        findings.add(f"{key}.at", f"is {form.at:g}, but the scenario ends at {duration_s:g}")
    if form.until is not None and form.until <= form.at:
        findings.add(f"{key}.until", f"is {form.until:g}, not behind at = {form.at:g}")
    if form.until is not None and form.until > duration_s:
        findings.add(f"{key}.until", f"is {form.until:g}, but the scenario ends at {duration_s:g}")
    if not (form.set or form.ramp or form.do or form.load is not None):
        findings.add(key, "does nothing", "give it set, ramp, load or do")
    if form.ramp and form.until is None:
        findings.add(f"{key}.until", "is missing, a ramp needs its end")
    if form.do == "link-down" and form.until is None:
        findings.add(f"{key}.until", "is missing, a link that stays down shows nothing more")
    if form.do == "restart" and form.until is not None:
        findings.add(f"{key}.until", f"is {form.until:g}, but a restart has no end")
    if form.load is not None and not has_plant:
        findings.add(f"{key}.load", "acts on a plant, and the scenario has none", "give it a table `plant`")
    ramp = _values(form.ramp, f"{key}.ramp", controller, findings)
    for name, value in ramp.items():
        if controller.operand(name).kind is not Kind.REAL and value is not None:
            findings.add(f"{key}.ramp.{name}", f"{name} is a {controller.operand(name).kind.value}, only a REAL ramps")
    values = _values(form.set, f"{key}.set", controller, findings)
    holds_pv = form.do == "freeze-pv" or any(name in controller.roles.pvs for name in (*values, *ramp))
    return Action(form.at, form.until, values, ramp, form.do or "", form.load, holds_pv)


def _check_expectations(form: ScenarioForm, controller: Controller, findings: Findings) -> None:
    expect = form.expect
    for name in DELTA_ONLY:
        if getattr(expect, name) and "MV_MAX" not in {row.name for row in controller.operands}:
            findings.add(
                f"expect.{name}", f"is told of DPID and DPIDE only, not of {controller.name}",
                "`always` and `finally` of a response say the same by its own operands",
            )  # fmt: skip
    if expect.shadow == "ulp" and not expect.ulp_max:
        findings.add("expect.ulp_max", "is missing, agreement by ULP needs its distance")
    if expect.shadow == "tolerance" and not expect.mv_max:
        findings.add("expect.mv_max", "is missing, agreement by tolerance needs its size")
    if expect.recovery is not None and not any(each.do == "link-down" for each in form.step):
        findings.add("expect.recovery", "has nothing to recover from", 'the time line needs do = "link-down"')
    for number, window in enumerate(expect.response):
        key = f"expect.response.{number}"
        if all(getattr(window, name) is None for name in ASKED_FOR):
            known = ", ".join(name.rstrip("_") for name in ASKED_FOR)
            findings.add(key, "asks for nothing", f"give it at least one of {known}")
        end = form.duration if window.before is None else window.before
        if not window.after < end <= form.duration:
            findings.add(f"{key}.after", f"{window.after:g} to {end:g} is no window within 0 to {form.duration:g}")
        for name, text in (("always", window.always), ("finally", window.finally_)):
            if text is not None:
                _check_formula(text, f"{key}.{name}", controller, findings)


def _check_formula(text: str, key: str, controller: Controller, findings: Findings) -> None:
    from ahgateway.schema.formula import names_of

    known = [row.name for row in controller.operands if row.kind is not Kind.BLOCK]
    try:
        used = names_of(text)
    except ValueError as error:
        findings.add(key, f"{shown(text)}: {error}", "such as `abs(PV - SV) < 0.5 and not PID_MAN`; equal is `==`")
        return
    for name in sorted(used - {*known, "t"}):
        findings.add(key, f"`{name}` is no operand, known are t, {', '.join(known)}", near(name, known))
