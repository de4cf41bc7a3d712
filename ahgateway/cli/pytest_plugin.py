"""The pytest plugin: a bench as fixtures, and scenario files collected as tests. Loads nothing heavy by itself.

A broken bench is an error, never a failed test: pytest counts it where it counts a broken fixture.
"""

from __future__ import annotations

import asyncio
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ahgateway.apps.check.bench_test import BenchTest
    from ahgateway.codec.station import Station
    from ahgateway.errors import AhGatewayError
    from ahgateway.schema.scenario import Scenario

FOLDER = "ah_scenarios"
"""Folder whose files *.toml are collected as tests, unless the ini file names others."""


class NotTestedError(Exception):
    """Nothing can be said of the product: a wrong file, a broken bench, or nothing was checked."""


class ViolatedError(Exception):
    """A scenario's expectations that the product violated."""


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("ahgateway", "PID loops on a bench")
    group.addoption("--ah-target", metavar="URI", help="the PLC: fake://PROFILE, or a real bench with --ah-arm")
    group.addoption("--ah-profile", metavar="PROFILE", help="profile of the bench; the shipped one otherwise")
    group.addoption("--ah-arm", action="store_true", help="really drive a real bench; everything is put back")
    group.addoption("--ah-directory", metavar="FOLDER", help="where journals and leases of a real bench stand")
    group.addoption("--ah-seed", type=int, default=1, metavar="N", help="of the noise; equal seeds give equal words")
    parser.addini("ah_profile", "profile of the bench, relative to the ini file", default="")
    parser.addini("ah_scenarios", "folders whose *.toml files are scenarios", type="args", default=[FOLDER])


def pytest_configure(config: pytest.Config) -> None:
    for text in (
        "ah_loop(instruction, name=''): the loop that `ah_loop` drives",
        "ah_plant(**plant): the process behind it, as in a scenario's table `plant`",
        "ah_scenario: a scenario file",
    ):
        config.addinivalue_line("markers", text)


@pytest.fixture(scope="session")
def ah_station(pytestconfig: pytest.Config) -> Station:
    """The bench's station: what the profile says of the PLC."""
    from ahgateway.schema.profile import load
    from ahgateway.schema.scenario import library

    return load(_profile(pytestconfig) or str(library() / "bench.toml")).station()


@pytest.fixture
def ah_plant(request: pytest.FixtureRequest) -> dict[str, Any] | None:
    """The process of the marker `ah_plant`; None without one: PV stands where it is set."""
    marker = request.node.get_closest_marker("ah_plant")
    return None if marker is None else dict(marker.kwargs)


@pytest.fixture
def ah_loop(request: pytest.FixtureRequest, pytestconfig: pytest.Config, ah_plant: dict[str, Any] | None) -> BenchTest:
    """One loop on the bench, to be started, changed over time and looked at; see `BenchTest`."""
    from ahgateway.apps.check.bench_test import BenchTest

    marker = request.node.get_closest_marker("ah_loop")
    arguments: list[str] = [] if marker is None else [str(each) for each in marker.args]
    instruction, name = [*arguments, "DPIDE", ""][:2] if not arguments else [*arguments, ""][:2]
    return BenchTest(request.node.name, instruction, ah_plant, lambda each: _run(pytestconfig, each, name))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    if file_path.suffix == ".toml" and file_path.parent.name in parent.config.getini("ah_scenarios"):
        collected: pytest.Collector = ScenarioFile.from_parent(parent, path=file_path)
        return collected
    return None


class ScenarioFile(pytest.File):
    """A scenario file; it holds one test."""

    def collect(self) -> Iterable[pytest.Item]:
        yield ScenarioItem.from_parent(self, name=self.path.stem)


class ScenarioItem(pytest.Item):
    """A scenario as a test."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.add_marker("ah_scenario")

    def runtest(self) -> None:
        from ahgateway.apps.check.junit import lines
        from ahgateway.apps.check.result import Verdict
        from ahgateway.errors import AhGatewayError
        from ahgateway.schema.scenario import load

        try:
            scenario = load(self.path)
        except AhGatewayError as error:
            raise NotTestedError(_with_hint(error)) from error
        result = _run(self.config, scenario, "")
        self.add_report_section("call", "ahgateway", "\n".join([result.title, *lines(result)]))
        if result.verdict is Verdict.FAIL:
            raise ViolatedError("\n".join([result.reason, *lines(result)]))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *_: Any) -> Any:
        if isinstance(excinfo.value, NotTestedError | ViolatedError):
            return f"{self.path.name}: {excinfo.value}"
        return super().repr_failure(excinfo)

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, f"scenario {self.name}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Count what the bench is to blame for as an error of the set-up, not as a failure of the product."""
    report = yield
    if call.excinfo is not None and call.excinfo.errisinstance(NotTestedError):
        report.when = "setup"
    return report


def _profile(config: pytest.Config) -> str:
    """The profile that counts: typed, else the ini file's, which stands beside that file."""
    typed = config.getoption("--ah-profile")
    if typed:
        return str(typed)
    text = str(config.getini("ah_profile"))
    beside = config.rootpath / text
    return str(beside) if text and beside.is_file() else text


def _run(config: pytest.Config, scenario: Scenario, loop: str) -> Any:
    """Run one scenario on the bench of the options; a bench that cannot be trusted raises."""
    from ahgateway.apps.check.result import Verdict
    from ahgateway.errors import AhGatewayError

    try:
        result = asyncio.run(_ran(config, scenario, loop))
    except AhGatewayError as error:
        raise NotTestedError(_with_hint(error)) from error
    if result.verdict in (Verdict.ERROR, Verdict.INCONCLUSIVE):
        raise NotTestedError(f"{result.verdict.value}: {result.reason}")
    return result


def _with_hint(error: AhGatewayError) -> str:
    return f"{error.message}; hint: {error.hint}" if error.hint else error.message


async def _ran(config: pytest.Config, scenario: Scenario, loop: str) -> Any:
    from ahgateway.apps.check.suite import results
    from ahgateway.cli.check_ground import Asked, ground
    from ahgateway.clock import WallClock

    folder = config.getoption("--ah-directory")
    asked = Asked(
        _profile(config) or None, config.getoption("--ah-target"), loop,
        is_armed=bool(config.getoption("--ah-arm")), directory=Path(folder) if folder else None,
    )  # fmt: skip
    sound = config.stash.setdefault(_SOUND, set())
    async with ground(asked) as bench:
        wall, seed = WallClock(), config.getoption("--ah-seed")
        if scenario.controller.name not in sound:
            async for instruction, floor in bench.floors([scenario], seed, wall):
                if not floor.is_sound:
                    raise NotTestedError(f"the bench fails against itself ({instruction}): {floor.text}")
            sound.add(scenario.controller.name)
        return await anext(results([scenario], bench, wall, seed=seed))


_SOUND = pytest.StashKey[set[str]]()
