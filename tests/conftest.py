"""What every test has: a virtual clock, Hypothesis without surprises, and hardware tests that ask for hardware."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from ahgateway.cli.compiled_laws import keep_compiled
from ahgateway.clock import VirtualClock
from ahgateway.core.real import quiet

# Equal runs see equal examples: a build fails because of a change and never by chance. `tests/bench` looks further.
settings.register_profile(
    "house", max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("house")

TARGET = "AHG_TARGET"
"""Environment variable with the URI of a real PLC."""


TOGETHER = {
    "tests/cli/test_cli_identify.py": "search",
    "tests/conformance/test_stand_in.py": "search",
    "tests/lockstep/test_identify.py": "search",
    "tests/lockstep/test_identify_dpide.py": "search",
    "tests/lockstep/test_identify_foreign.py": "search",
    "tests/lockstep/test_identify_proof.py": "search",
    "tests/lockstep/test_million.py": "walk",
    "tests/core/test_fast.py": "walk",
}
"""Files that compile the same: where tests run in several processes, one of them has all of these."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hand tests out one by one, but for those that are compiled together; these go first."""
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return TOGETHER.get(nodeid.partition("::")[0], nodeid)

    return Scheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests marked hil unless a target is given: the only skip of this house."""
    if os.environ.get(TARGET):
        return
    for item in items:
        if item.get_closest_marker("hil"):
            reason = f"hil: needs a real AH500; set {TARGET}=modbus+tcp://HOST:502?unit=1 in the environment"
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(autouse=True, scope="session")
def state_elsewhere(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What programs keep between runs is not this user's; subprocesses inherit it."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(autouse=True, scope="session")
def laws_compiled_once() -> None:
    """A law is compiled once for each version of its source, as for a user: it takes half a minute."""
    keep_compiled()


@pytest.fixture
def clock() -> VirtualClock:
    """Time that moves when told to; starts at 0 and 2026-01-01T00:00Z."""
    return VirtualClock()


@pytest.fixture
def overflow_is_legal() -> Iterator[None]:
    """For tests that drive a law with infinities: a PLC overflows without a word."""
    with quiet(all="ignore"):
        yield
