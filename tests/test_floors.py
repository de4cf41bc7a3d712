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
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )


def test_every_import_goes_down() -> None:
    done = python("-c", "from importlinter.cli import lint_imports_command; lint_imports_command()")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["monitor", "--help"], ["profile", "--help"]])
def test_help_and_version_load_nothing_heavy(arguments: list[str]) -> None:
    done = python("-c", DOOR, *arguments)
    word, code, *loaded = done.stdout.rstrip().rpartition("\n")[2].split()
    assert ("LOADED", "0") == (word, code), done.stdout + done.stderr
    assert [] == [name for name in HEAVY if name in loaded]


def test_the_core_alone_loads_no_wire_and_no_clock() -> None:
    done = python("-c", "import ahgateway.core.controllers, sys; print(*{n.partition('.')[0] for n in sys.modules})")
    assert set() == {"pymodbus", "serial", "can", "canopen", "pydantic", "typer", "asyncio"} & set(done.stdout.split())
