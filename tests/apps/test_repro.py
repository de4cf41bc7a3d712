"""A divergence as a small file: pytest alone shows it, and shows that the cause explains it; for every controller."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from lockstep.bench_world import Watched, World
from lockstep.other_world import OtherWorld
from lockstep.test_other_lockstep import begun_in
from recording.conftest import Run
from typer.testing import CliRunner

from ahgateway.apps.monitor import Report, Sample
from ahgateway.apps.repro import Repros
from ahgateway.cli.main import app
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.repro import Case, differences, load
from ahgateway.core.verdict import Verdict
from ahgateway.errors import StateError
from ahgateway.lockstep.judge import Execution

ROOT = Path(__file__).parent.parent.parent
DELTA: dict[str, dict[str, Any]] = {
    "DPIDE": {"Kc_Kp": 2.0, "Ti_Ki": 0.3, "Td_Kd": 0.4, "Tf": 0.5, "BIAS": 3.0},
    "DPID": {"Kp": 2.0, "Ki": 0.3, "Kd": 0.1},
}
FAULTS = {
    "DPID": "ki-1-percent",
    "DPIDE": "gain-1-percent",
    "PID_Temp": "kp-1-percent",
    "PID_REG_CE": "luft-ignored",
    "MELSEC_PID": "act-reversed",
}
STEPS = {"PID_Temp": (55.0, 60.0), "PID_REG_CE": (50.0, 53.0), "MELSEC_PID": (400, 520)}


async def diverged(name: str, fault: str = "") -> Watched:
    """A loop of this controller that runs well, then computes wrongly until it has diverged a few times."""
    world: Any
    if name in DELTA:
        world = World(name, DELTA[name], seed=3)
    else:
        world = OtherWorld(name, counter=True)
        await begun_in(world, name)
    await world.follow(60)
    world.plc.fail("L1", fault or FAULTS[name])
    for turn in range(40):
        if turn % 5 == 0:
            sv = CONTROLLERS[name].roles.sv
            world.plc.write("L1", sv, STEPS.get(name, (57.0, 48.0))[turn // 5 % 2])
        await world.follow(20)
        if world.follower.counts.diverged > 2:
            break
    return world


def written(world: Watched, folder: Path) -> list[Path]:
    repros = Repros(world.station)  # type: ignore[attr-defined]
    for picture, event in world.events:
        repros.take(Report(0, "L1", picture.tick, event))
        repros.take(Report(0, "L1", picture.tick, Sample(picture)))
    return repros.write(folder)


def played(*folders: Path) -> str:
    """What pytest says of the files, with the core alone to import from."""
    command = [sys.executable, "-m", "pytest", "-q", "-rA", "--import-mode=importlib", "-p", "no:cacheprovider"]
    found = subprocess.run(
        [*command, "-p", "no:asyncio", "-p", "no:hypothesispytest", "-p", "no:xdist", *map(str, folders)],
        capture_output=True,
        text=True,
        cwd=folders[0].parent,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_ADDOPTS": ""},
        timeout=300,
        check=False,
    )
    return found.stdout + found.stderr


def case_in(path: Path) -> Case:
    return load(path.with_name(path.name.removeprefix("test_")).with_suffix(".json").read_text(encoding="utf-8"))


@pytest.mark.slow
async def test_pytest_alone_shows_the_divergence_of_every_controller(tmp_path: Path) -> None:
    folders = []
    for name in FAULTS:
        world = await diverged(name)
        assert world.follower.counts.diverged, name
        folders.append(tmp_path / name)
        (test,) = written(world, folders[-1])
        case = case_in(test)
        assert 1 == len(case.executions)
        assert differences(case), name

    said = played(*folders)
    for name in FAULTS:
        file = next((tmp_path / name).glob("test_*.py")).name
        assert f"FAILED {name}/{file}::test_the_reference_leaves_what_the_plc_wrote" in said, said
        if case_in(tmp_path / name / file).likeliest is not None:
            assert f"PASSED {name}/{file}::test_the_likeliest_cause_leaves_what_the_plc_wrote" in said, said
    assert 5 == sum(line.startswith("FAILED ") for line in said.splitlines())
    assert 2 <= sum(line.startswith("PASSED ") for line in said.splitlines())


async def test_it_fails_as_the_divergence_says_and_passes_with_the_gain_that_the_plc_had(tmp_path: Path) -> None:
    world = await diverged("DPIDE")
    (test,) = written(world, tmp_path)
    picture, execution = next(
        (picture, event)
        for picture, event in world.events
        if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
    )
    assert execution.terms is not None
    case = case_in(test)

    assert [f"execution 1: MV plc {float(picture.seen['MV']):.9g}"] == [
        each.split(" (")[0] for each in differences(case)
    ]
    file = test.with_name(test.name.removeprefix("test_")).with_suffix(".json")
    found = json.loads(file.read_text(encoding="utf-8"))
    assert "0x40000000" == found["executions"][0]["inputs"]["kc_kp"]
    found["executions"][0]["inputs"]["kc_kp"] = "0x400147ae"  # 2.02, the product of 2 and 1.01 in REAL
    assert [] == differences(load(json.dumps(found)))


async def test_a_dialect_as_the_plc_has_it_passes_too(tmp_path: Path) -> None:
    (test,) = written(await diverged("DPIDE", "other-order"), tmp_path)
    file = test.with_name(test.name.removeprefix("test_")).with_suffix(".json")
    found = json.loads(file.read_text(encoding="utf-8"))

    assert differences(load(json.dumps(found)))
    assert [] == differences(load(json.dumps({**found, "dialect": {"sum_order": "p_id"}})))


async def test_the_same_divergence_makes_the_same_bytes(tmp_path: Path) -> None:
    first = written(await diverged("DPID"), tmp_path / "a")
    second = written(await diverged("DPID"), tmp_path / "b")
    for left, right in zip(sorted(first[0].parent.iterdir()), sorted(second[0].parent.iterdir()), strict=True):
        assert left.read_bytes() == right.read_bytes()


async def test_what_does_not_matter_is_left_out(tmp_path: Path) -> None:
    (test,) = written(await diverged("DPIDE"), tmp_path)
    (start,) = case_in(test).starts

    # D of a filter matters, and with it what is differentiated; what a transfer would need does not.
    assert start.d != 0
    assert start.e1 != 0
    assert start.mv == 0
    assert not start.man1


async def test_nothing_is_written_where_nothing_diverged(tmp_path: Path) -> None:
    world = World("DPID", DELTA["DPID"])
    await world.follow(60)
    assert [] == written(world, tmp_path / "none")
    assert not (tmp_path / "none").exists()


async def test_a_folder_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(StateError, match="file"):
        written(await diverged("DPID"), tmp_path / "file")


def test_a_file_of_another_form_is_refused() -> None:
    with pytest.raises(ValueError, match="form 1"):
        load('{"form": 2}')


async def test_replay_writes_it_and_says_how_to_run_it(tmp_path: Path) -> None:
    run = Run(tmp_path / "run.ahrec", World("DPID", DELTA["DPID"], seed=3))
    await run.polls(100)
    run.world.plc.fail("L1", "gain-1-percent")
    run.world.plc.write("L1", "SV", 57.0)
    await run.polls(60)
    run.close()
    found = CliRunner().invoke(app, ["replay", str(run.path), "--summary", "--repro", str(tmp_path / "out")])

    (test,) = (tmp_path / "out").glob("test_*.py")
    assert 1 == found.exit_code
    assert f"run it with: python -m pytest {test}" in found.stderr
    assert differences(case_in(test))
