"""The file form of a device map: which devices a PLC family has and where they stand. Nothing else knows addresses."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ahgateway.codec.access import Table
from ahgateway.codec.devices import KINDS, WORD_BITS, DeviceMap, DeviceRange
from ahgateway.schema import files
from ahgateway.schema.findings import Findings, near

ADDRESS_MAX = 0xFFFF


class RangeForm(BaseModel):
    """Consecutive devices at consecutive addresses."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    device: str = Field(description="kind of device, D")
    numbers: list[int] = Field(min_length=2, max_length=2, description="first and last number, both included")
    table: Literal["coil", "discrete input", "holding register", "input register"]
    address: int = Field(ge=0, le=ADDRESS_MAX, description="0-based address of the first number")
    functions: list[int] = Field(min_length=1, description="Modbus function codes the PLC accepts here")
    confidence: Literal["V", "S", "I", "R"] = Field(description="V read, S damaged scan, I inferred, R remembered")
    writable: bool = Field(description="the PLC takes writes here at all")
    source: str = Field(default="", description="where the row comes from")
    bits: bool = Field(default=False, description="sixteen bits per number, X0.0…X0.15")
    words: Literal[1, 2] = Field(default=1, description="words per number, 2 for 32-bit counters")
    octal: bool = Field(default=False, description="people write the numbers in octal")
    operands: bool = Field(default=True, description="PID operands may stand here")


class DeviceMapForm(BaseModel):
    """One file of a device map."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    name: str = Field(min_length=1)
    title: str = ""
    ranges: list[RangeForm] = Field(min_length=1)


def load(name_or_path: str, beside: Path | None = None) -> DeviceMap:
    """Return a shipped device map by its name, `ah500`, or one from a file.

    Args:
        name_or_path: Shipped name or path.
        beside: Directory to which a relative path refers.

    Raises:
        ProfileError: There is none, or it is wrong; all errors of the file together.
    """
    path = files.find(name_or_path, files.shipped(), "device maps", beside)
    return _shipped(path) if path.parent == files.shipped() else parse(files.read(path, str(path)), str(path))


@lru_cache(maxsize=16)
def _shipped(path: Path) -> DeviceMap:
    return parse(files.read(path, str(path)), str(path))


def parse(text: str, file: str) -> DeviceMap:
    """Return the device map in a TOML text; `file` is its name in messages.

    Raises:
        ProfileError: All errors of the text together.
    """
    findings = Findings(file)
    try:
        form = DeviceMapForm.model_validate(files.tables(text, file))
    except ValidationError as error:
        findings.add_all(error, DeviceMapForm)
        findings.raise_any()
        raise
    ranges = [_range(row, f"ranges.{position}", findings) for position, row in enumerate(form.ranges)]
    _refuse_overlaps(ranges, findings)
    findings.raise_any()
    return DeviceMap(form.name, form.title or form.name, tuple(ranges))


def _range(row: RangeForm, key: str, findings: Findings) -> DeviceRange:
    table = Table(row.table)
    first, last = row.numbers
    made = DeviceRange(
        row.device,
        first,
        last,
        table,
        row.address,
        WORD_BITS if row.bits else row.words,
        tuple(row.functions),
        row.confidence,
        row.writable,
        row.octal,
        row.operands,
    )
    if row.device not in KINDS:
        findings.add(
            f"{key}.device",
            f'unknown kind of device "{row.device}", known are {", ".join(KINDS)}',
            near(row.device, KINDS),
        )
    if not 0 <= first <= last:
        findings.add(f"{key}.numbers", f"[{first}, {last}] is no range from low to high")
    elif made.end > ADDRESS_MAX + 1:
        findings.add(f"{key}.numbers", f"{made} ends at address {made.end - 1:#07x}, allowed is {ADDRESS_MAX:#06x}")
    if row.bits and not table.is_bits:
        findings.add(f"{key}.bits", f"sixteen bits per number need a table of bits, not {row.table}")
    if row.words == 2 and table.is_bits:
        findings.add(f"{key}.words", f"two words per number need a table of words, not {row.table}")
    if row.writable and table in (Table.DISCRETE, Table.INPUT):
        findings.add(f"{key}.writable", f"no Modbus function writes {row.table}s")
    return made


def _refuse_overlaps(ranges: list[DeviceRange], findings: Findings) -> None:
    for position, row in enumerate(ranges):
        for other in ranges[:position]:
            if row.table is other.table and row.base < other.end and other.base < row.end:
                findings.add(
                    f"ranges.{position}",
                    f"{row} and {other} overlap in the {row.table.value}s from address "
                    f"{max(row.base, other.base):#06x}",
                )
            if (row.kind, row.table.is_bits) == (other.kind, other.table.is_bits) and (
                row.first <= other.last and other.first <= row.last
            ):
                findings.add(f"ranges.{position}", f"{row} and {other} have numbers in common")
