"""The page about the fake PLC names every fault, with its own words."""

from __future__ import annotations

from pathlib import Path

from ahgateway.fake.faults import FAULTS

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "fake.md"


def test_the_page_lists_every_fault_and_no_other():
    rows = [line.split("|") for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    listed = {cells[1].strip(" `"): cells[2:4] for cells in rows if len(cells) == 5}
    for fault in FAULTS.values():
        text, instruction = listed[fault.name]
        assert text.strip() == fault.text
        assert instruction.strip() == ("both" if len(fault.controllers) == 2 else "DPIDE")
