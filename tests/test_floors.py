"""The house stands: imports go down only, and the front door carries nothing heavy.

Both tests are needed: the import graph cannot see an import inside a function, and a run sees only one way through.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
HEAVY = (
    "numpy",
    "pydantic",
    "pymodbus",
    "serial",
    "can",
    "canopen",
    "scipy",
    "matplotlib",
    "textual",
    "numba",
    "pyarrow",
)
DOOR = """
import sys
sys.argv = ["ahgateway", *sys.argv[1:]]
from ahgateway.cli.main import main
try:
    main()
except SystemExit as left:
    code = left.code or 0
else:
    code = 0
print("LOADED", code, *sorted({name.partition(".")[0] for name in sys.modules}))
"""


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=200, check=False
    )


def test_every_import_goes_down() -> None:
    done = python("-c", "from importlinter.cli import lint_imports_command; lint_imports_command()")
    assert done.returncode == 0, done.stdout + done.stderr


def loaded_by(arguments: list[str]) -> list[str]:
    """Heavy packages that are loaded when the command has answered."""
    done = python("-c", DOOR, *arguments)
    marks = [line for line in done.stdout.splitlines() if line.startswith("LOADED ")]
    assert 1 == len(marks), done.stdout + done.stderr
    _, code, *loaded = marks[0].split()
    assert "0" == code, done.stdout + done.stderr
    return [name for name in HEAVY if name in loaded]


@pytest.mark.parametrize("arguments", [["--help"], ["--version"]])
def test_the_front_door_loads_nothing_heavy(arguments: list[str]) -> None:
    assert [] == loaded_by(arguments)


@pytest.mark.parametrize("command", ["monitor", "fake", "profile"])
def test_a_command_s_help_loads_nothing_heavy_of_ours(command: str) -> None:
    """Typer itself asks pydantic to convert a command's options."""
    assert set() == set(loaded_by([command, "--help"])) - {"pydantic"}


def test_the_core_alone_loads_no_wire_and_no_clock() -> None:
    done = python("-c", "import ahgateway.core.controllers, sys; print(*{n.partition('.')[0] for n in sys.modules})")
    assert set() == {"pymodbus", "serial", "can", "canopen", "pydantic", "typer", "asyncio"} & set(done.stdout.split())


def test_what_follows_a_loop_loads_nothing_that_fits_models() -> None:
    """A model is fitted after minutes, beside the run; scipy's parts take a second to load."""
    done = python("-c", "import ahgateway.apps.board, sys; print(*sys.modules)")
    assert "ahgateway.tuning.fit" in done.stdout.split()
    assert set() == {"scipy.stats", "scipy.signal", "scipy.optimize"} & set(done.stdout.split())
