"""What the fake is taken for, asked of a real AH500; only reads, and only when AHG_TARGET names one."""

from __future__ import annotations

import os

import pytest

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.transports.uri import open_link, parse_uri

pytestmark = pytest.mark.hil


async def test_a_real_plc_answers_each_read_with_as_much_as_was_asked_for() -> None:
    target = parse_uri(os.environ["AHG_TARGET"])
    unit = 1 if target.unit is None else target.unit
    asked = [Read(unit, Table.HOLDING, 0, 2), Read(unit, Table.HOLDING, 0, 100), Read(unit, Table.COIL, 0, 8)]
    link = open_link(target, WallClock())
    try:
        counts = [len((await link.exchange(read)).values) for read in asked]
    finally:
        await link.close()

    assert counts == [2, 100, 8]
