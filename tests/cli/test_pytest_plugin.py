"""The pytest plugin: the example project runs, a violated scenario fails, a broken bench is an error."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

import ahgateway

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "pytest-bench"
LOOP = """
title = "A loop at rest"
instruction = "DPID"
duration = 1.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 1.0, bias = 10.0, noise = 0.02, initial = 49.0 }
initial = { SV = 50.0, CYCLE = 10, Kp = 1.1, Ki = 0.9 }
"""


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """An environment in which the plugin is installed by its entry point, as pip would do it."""
    entry = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"]["pytest11"]
    info = tmp_path / "site" / "ahgateway_plugin-0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ahgateway-plugin\nVersion: 0\n")
    (info / "entry_points.txt").write_text(
        "[pytest11]\n" + "\n".join(f"{name} = {place}" for name, place in entry.items()) + "\n"
    )
    paths = [str(tmp_path / "site"), str(Path(ahgateway.__file__).parents[1])]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    return kept | {"PYTHONPATH": os.pathsep.join(paths)}


def project(folder: Path, **scenarios: str) -> Path:
    """A project of scenario files alone."""
    (folder / "mine" / "ah_scenarios").mkdir(parents=True)
    (folder / "mine" / "pytest.ini").write_text("[pytest]\naddopts = --strict-markers\n")
    for name, text in scenarios.items():
        (folder / "mine" / "ah_scenarios" / f"{name}.toml").write_text(text)
    (folder / "mine" / "other").mkdir()
    (folder / "mine" / "other" / "no_scenario.toml").write_text("[tool]\n")
    return folder / "mine"


def ran(folder: Path, environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rA", "--junitxml=out.xml", *arguments]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300.0, check=False
    )


def told(folder: Path) -> dict[str, list[str]]:
    """Test case to what pytest says of it in JUnit XML."""
    root = ElementTree.parse(folder / "out.xml").getroot()
    kinds = ("failure", "error", "skipped")
    return {str(case.get("name")): [each.tag for each in case if each.tag in kinds] for case in root.iter("testcase")}


@pytest.mark.slow
def test_the_example_project_runs(tmp_path: Path, installed: dict[str, str]) -> None:
    folder = tmp_path / "example"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    done = ran(folder, installed)

    assert 0 == done.returncode, done.stdout + done.stderr
    assert {
        "step": [], "test_a_step_of_sv_is_followed": [], "test_a_level_is_held_against_a_draw": []
    } == told(folder)  # fmt: skip


@pytest.mark.slow
def test_a_violation_is_a_failure_and_a_broken_bench_an_error(tmp_path: Path, installed: dict[str, str]) -> None:
    folder = project(
        tmp_path,
        violated=LOOP + '\n[[expect.response]]\nalways = "PV > 60"\n',
        too_slow=LOOP.replace("duration", "limit = 1e-6\nduration"),
        nothing=LOOP + '\n[expect]\nshadow = "none"\n',
        wrong=LOOP.replace("CYCLE", "CYCLES"),
    )
    done = ran(folder, installed)

    assert 1 == done.returncode, done.stdout + done.stderr
    assert {"violated": ["failure"], "too_slow": ["error"], "nothing": ["error"], "wrong": ["error"]} == told(folder)
    assert "`PV > 60` does not hold at 0.00 s" in done.stdout
    assert "did you mean `CYCLE`?" in done.stdout
    assert "Traceback" not in done.stdout


@pytest.mark.slow
def test_a_real_target_is_not_driven_without_being_armed(tmp_path: Path, installed: dict[str, str]) -> None:
    folder = project(tmp_path, rest=LOOP)
    done = ran(folder, installed, "--ah-target", "modbus+tcp://192.0.2.1:502", "--ah-profile", "live_bench")

    assert {"rest": ["error"]} == told(folder)
    assert "nothing was sent" in done.stdout


def test_the_plugin_loads_nothing_heavy() -> None:
    heavy = ("numpy", "scipy", "pydantic", "pymodbus", "serial", "can", "textual", "matplotlib", "typer")
    code = f"import sys, ahgateway.cli.pytest_plugin; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=200.0, check=True)

    assert "[]" == done.stdout.strip()
