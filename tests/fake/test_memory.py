"""The memory image: what stands where, what is the same bit under two names, and what is refused."""

from __future__ import annotations

import pytest

from ahgateway.codec.access import Table
from ahgateway.codec.devices import Address, parse_device
from ahgateway.errors import PlcRefusedError
from ahgateway.fake.memory import Limits, Memory


@pytest.fixture
def memory(small_map):
    return Memory(small_map)


def test_words_come_back_as_written(memory):
    memory.write(Table.HOLDING, 100, (0x70A4, 0x4145))
    assert memory.read(Table.HOLDING, 99, 4) == (0, 0x70A4, 0x4145, 0)


def test_bits_come_back_as_written(memory):
    memory.write(Table.COIL, 1, (1, 0, 1))
    assert memory.read(Table.COIL, 0, 5) == (0, 1, 0, 1, 0)


def test_bits_of_y_are_the_bits_of_its_words(memory):
    memory.write(Table.COIL, 0xA000 + 16 * 1 + 2, (1, 1))
    assert memory.read(Table.HOLDING, 0xA001, 1) == (0b1100,)
    memory.write(Table.HOLDING, 0xA000, (0x8001,))
    assert memory.read(Table.COIL, 0xA000, 20) == (1, *[0] * 14, 1, 0, 0, 1, 1)


def test_bits_of_x_are_the_bits_of_its_words(memory, small_map):
    memory.bit_at(small_map.address(parse_device("X1.3"))).put(True)
    assert memory.read(Table.INPUT, 0x8001, 1) == (8,)
    assert memory.read(Table.DISCRETE, 0x6010, 4) == (0, 0, 0, 1)


def test_a_bit_of_a_register_is_that_registers_bit(memory, small_map):
    bit = memory.bit_at(small_map.address(parse_device("D100.3")))
    bit.put(True)
    assert memory.read(Table.HOLDING, 100, 1) == (8,)
    memory.write(Table.HOLDING, 100, (0xFFF7,))
    assert bit.get() is False


def test_contact_and_value_of_a_timer_are_two_things(memory):
    memory.write(Table.HOLDING, 0xE000, (0xFFFF,))
    assert memory.read(Table.COIL, 0xE000, 1) == (0,)


def test_a_view_of_words_is_live(memory):
    view = memory.words_at(Address(Table.HOLDING, 10), 2)
    memory.write(Table.HOLDING, 10, (1, 2))
    assert view.tolist() == [1, 2]
    view[:] = (3, 4)
    assert memory.read(Table.HOLDING, 10, 2) == (3, 4)


@pytest.mark.parametrize(
    ("table", "address", "count", "code"),
    [
        (Table.HOLDING, 999, 1, None),
        (Table.HOLDING, 1000, 1, 2),
        (Table.HOLDING, 999, 2, 2),
        (Table.HOLDING, 0, 125, None),
        (Table.HOLDING, 0, 126, 3),
        (Table.HOLDING, 0, 0, 3),
        (Table.COIL, 0x6000, 1, 2),
        (Table.DISCRETE, 0x6000, 64, None),
        (Table.COIL, 0, 2001, 3),
    ],
)
def test_reads_are_refused_at_the_edge_and_not_before(memory, table, address, count, code):
    if code is None:
        assert memory.read(table, address, count) == (0,) * count
        return
    with pytest.raises(PlcRefusedError) as refused:
        memory.read(table, address, count)
    assert refused.value.code == code


@pytest.mark.parametrize(
    ("table", "address", "count", "code"),
    [
        (Table.DISCRETE, 0x6000, 1, 1),
        (Table.INPUT, 0x8000, 1, 1),
        (Table.COIL, 0x4190, 1, 2),
        (Table.HOLDING, 998, 3, 2),
        (Table.HOLDING, 0, 124, 3),
    ],
)
def test_writes_are_refused_and_change_nothing(memory, table, address, count, code):
    with pytest.raises(PlcRefusedError) as refused:
        memory.write(table, address, (1,) * count)
    assert refused.value.code == code
    assert memory.read(Table.HOLDING, 998, 2) == (0, 0)
    assert memory.read(Table.COIL, 0x4190, 1) == (0,)


def test_a_smaller_limit_counts_for_words_and_bits(small_map):
    memory = Memory(small_map, Limits.of_words(4))
    assert memory.read(Table.HOLDING, 0, 4) == (0, 0, 0, 0)
    assert len(memory.read(Table.COIL, 0, 64)) == 64
    for table, count in ((Table.HOLDING, 5), (Table.COIL, 65)):
        with pytest.raises(PlcRefusedError) as refused:
            memory.read(table, 0, count)
        assert refused.value.code == 3


def test_a_power_cut_clears_everything(memory):
    memory.write(Table.HOLDING, 5, (1,))
    memory.write(Table.COIL, 5, (1,))
    memory.clear()
    assert memory.read(Table.HOLDING, 5, 1) == memory.read(Table.COIL, 5, 1) == (0,)
