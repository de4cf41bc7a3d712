"""Divergences of a run as files: for each loop the smallest case that differs, and a pytest case that plays it."""

from __future__ import annotations

import re
from pathlib import Path

from ahgateway.apps.monitor import Report, Sample
from ahgateway.codec.station import Station
from ahgateway.core.repro import Case
from ahgateway.core.verdict import Verdict
from ahgateway.errors import StateError
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.repro import case_of
from ahgateway.lockstep.suspects import Blame

TEST = '''"""{title}

Plays {name}.json, which lies beside it, by the law alone: `python -m pytest {file}`.
"""

from pathlib import Path

from ahgateway.core.repro import differences, load

CASE = load(Path(__file__).with_name("{name}.json").read_text(encoding="utf-8"))


def test_the_reference_leaves_what_the_plc_wrote() -> None:
    assert [] == differences(CASE)
'''
LIKELIEST = """

def test_the_likeliest_cause_leaves_what_the_plc_wrote() -> None:
    assert CASE.likeliest is not None
    assert [] == differences(CASE, CASE.likeliest)
"""


class Repros:
    """Takes a run's reports and keeps, of each loop, the first divergence of which the smallest case is known."""

    def __init__(self, station: Station) -> None:
        self._loops = {loop.name: loop for loop in station.loops}
        self._waiting: dict[str, Blame] = {}
        self._cases: dict[str, Case] = {}

    def take(self, report: Report) -> None:
        """Take in one report; an execution's picture comes behind it."""
        event = report.event
        if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED and event.blame is not None:
            self._waiting[report.loop] = event.blame
        elif isinstance(event, Sample):
            blame = self._waiting.pop(report.loop, None)
            known = self._cases.get(report.loop)
            if blame is None or (known is not None and (known.likeliest is not None or len(known.starts) == 1)):
                return
            case = case_of(self._loops[report.loop], blame, event.picture)
            if case is not None and (known is None or len(case.starts) < len(known.starts)):
                self._cases[report.loop] = case

    def write(self, folder: Path) -> list[Path]:
        """Write a file and a pytest case for each loop that diverged; return the pytest files.

        Raises:
            StateError: The folder cannot be written to.
        """
        tests = []
        try:
            if self._cases:
                folder.mkdir(parents=True, exist_ok=True)
            for loop, case in self._cases.items():
                name = f"{re.sub(r'[^A-Za-z0-9]+', '_', loop)}_tick_{case.told['tick']}"
                (folder / f"{name}.json").write_text(case.text(), encoding="utf-8")
                tests.append(folder / f"test_{name}.py")
                tests[-1].write_text(_test(loop, name, case), encoding="utf-8")
        except OSError as error:
            raise StateError(
                f"{folder}: the divergences cannot be written: {error.strerror}", hint="name another folder"
            ) from error
        return tests


def _test(loop: str, name: str, case: Case) -> str:
    title = f"Loop {loop} left the reference at tick {case.told['tick']}; likely cause {case.told['cause']}."
    text = TEST.format(title=title, name=name, file=f"test_{name}.py")
    return text + LIKELIEST if case.likeliest is not None else text
