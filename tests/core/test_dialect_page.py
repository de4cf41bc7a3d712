"""The pages of the tables are made from the tables."""

from __future__ import annotations

from pathlib import Path

from ahgateway.core.dialect import AXES
from ahgateway.core.dialect_axes import TABLE
from ahgateway.lockstep.cause_classes import CLASSES
from ahgateway.lockstep.cause_pages import PAGES

REFERENCE = Path(__file__).parent.parent.parent / "docs" / "reference"


def test_the_page_of_the_dialects_holds_every_axis_and_value() -> None:
    text = (REFERENCE / "dialects.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    assert [axis.name for axis in TABLE] == [line.split("`")[1] for line in rows]
    for axis, row in zip(TABLE, rows, strict=True):
        values = [f"`{value.name.lower()}` {text}" for value, text in zip(AXES[axis.name], axis.values, strict=True)]
        assert "; ".join(values) in row
        assert row.endswith(f"| {axis.excitation} | {', '.join(axis.after)} |")
    unseen = [f"- `{axis.name}`: {phrase}" for axis in TABLE for phrase in axis.unseen()]
    assert unseen == [line for line in text.splitlines() if line.startswith("- `")]


def test_the_page_of_the_causes_holds_every_class() -> None:
    text = (REFERENCE / "causes.md").read_text(encoding="utf-8")
    heads = [line.removeprefix("## ") for line in text.splitlines() if line.startswith("## AHG")]
    assert [f"{page.code} {page.name}" for page in PAGES] == heads
    assert all(page.meaning in text and page.action in text for page in PAGES)


def test_the_page_of_the_causes_holds_what_no_data_can_tell_apart() -> None:
    text = (REFERENCE / "causes.md").read_text(encoding="utf-8")
    names = {page.name for page in PAGES}
    for each in CLASSES:
        assert f"| {each.name} | {', '.join(f'`{member}`' for member in each.members)} | {each.why} |" in text
        assert {member.split()[0] for member in each.members} <= names
