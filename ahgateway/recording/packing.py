"""Rows of raw words as one small blob, and back: columns, differences, bytes by place, zlib.

This file alone decides what a blob looks like; the layout is normative in docs/reference/recording.md. Every bit that
goes in comes out again, signalling NaNs and system words included.

Theory of operation: rows of one second are sorted by loop. Times are stored as differences to the row before, words as
XOR with the row before; what does not change becomes zeros. Then the first byte of all rows stands together, then
the second and so on, and zlib at level 1 packs the zeros away.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahgateway.errors import CodecError

LEVEL = 1
SECTION = struct.Struct("<HI")
COUNT = struct.Struct("<I")
RUNNING_UNKNOWN, RUNNING_OFF, RUNNING_ON = 0, 1, 2
IMPORTED = 0x80
"""Bit of `quality`: the row comes from someone else's trend, its words were put together from values."""

Ints = NDArray[np.int64]
Words = NDArray[np.uint16]


class Entry(NamedTuple):
    """One loop at one tick, as it is stored.

    Attributes:
        loop: Number of the loop in its file, from 0.
        tick: Number of the picture in its loop.
        sent_ns: Monotonic time when the first request left.
        last_ns: Monotonic time when the last reply was complete.
        utc_ns: UTC of `last_ns`.
        aligned_since_ns: Since when the line has been proven aligned.
        quality: RUNNING_UNKNOWN, RUNNING_OFF or RUNNING_ON, and IMPORTED.
        words: 2n bytes: n words, each low byte first, in the order of the loop's columns.
    """

    loop: int
    tick: int
    sent_ns: int
    last_ns: int
    utc_ns: int
    aligned_since_ns: int
    quality: int
    words: bytes


class Block(NamedTuple):
    """Rows of one loop in the order of their ticks, as columns.

    Attributes:
        loop: Number of the loop in its file.
        ticks: Number of each picture.
        sent_ns: As in `Entry`.
        last_ns: As in `Entry`.
        utc_ns: As in `Entry`.
        aligned_since_ns: As in `Entry`.
        quality: As in `Entry`.
        words: Shape (rows, words).
    """

    loop: int
    ticks: Ints
    sent_ns: Ints
    last_ns: Ints
    utc_ns: Ints
    aligned_since_ns: Ints
    quality: NDArray[np.uint8]
    words: Words


def pack(entries: Sequence[Entry]) -> bytes:
    """Return the blob of any rows of one second; b"" for none."""
    if not entries:
        return b""
    by_width: dict[int, list[Entry]] = {}
    for entry in entries:
        by_width.setdefault(len(entry.words) // 2, []).append(entry)
    return zlib.compress(b"".join(_section(width, rows) for width, rows in sorted(by_width.items())), LEVEL)


def unpack(blob: bytes) -> Iterator[Block]:
    """Yield the rows of a blob, loop by loop.

    Raises:
        CodecError: The blob is damaged.
    """
    raw = _inflated(blob)
    at = 0
    while at < len(raw):
        width, count = SECTION.unpack_from(raw, at)
        at += SECTION.size
        sizes = (2 * count, 40 * count, count, 2 * width * count)
        if at + sum(sizes) > len(raw):
            raise CodecError(f"a block of {count} rows needs {sum(sizes)} bytes, {len(raw) - at} are left")
        parts = []
        for size in sizes:
            parts.append(raw[at : at + size])
            at += size
        yield from _blocks(width, count, parts)


def pack_verdicts(verdicts: Sequence[tuple[int, int, int]]) -> bytes:
    """Return the blob of verdicts, each (loop, tick, number of its text); b"" for none."""
    if not verdicts:
        return b""
    table = np.array(sorted(verdicts, key=lambda each: each[0]), np.int64)
    return zlib.compress(COUNT.pack(len(table)) + _planes(_zigzag(_differences(table))), LEVEL)


def unpack_verdicts(blob: bytes) -> list[tuple[int, int, int]]:
    """Inverse of `pack_verdicts`, sorted by loop; CodecError when the blob is damaged."""
    if not blob:
        return []
    raw = _inflated(blob)
    (count,) = COUNT.unpack_from(raw)
    table = np.cumsum(_unzigzag(_joined(raw[COUNT.size :], count, 3)), axis=0)
    return [(int(loop), int(tick), int(text)) for loop, tick, text in table]


def pack_frames(frames: Sequence[tuple[int, int, str, bytes]]) -> bytes:
    """Return the blob of frames, each (monotonic ns, UTC ns, `>` or `<`, bytes), in order; b"" for none."""
    if not frames:
        return b""
    table = np.array([(now, utc - now, len(data)) for now, utc, _, data in frames], np.int64)
    signs = "".join(direction for _, _, direction, _ in frames).encode("ascii")
    data = b"".join(data for _, _, _, data in frames)
    return zlib.compress(COUNT.pack(len(table)) + _planes(_zigzag(_differences(table))) + signs + data, LEVEL)


def unpack_frames(blob: bytes) -> Iterator[tuple[int, int, str, bytes]]:
    """Inverse of `pack_frames`; CodecError when the blob is damaged."""
    if not blob:
        return
    raw = _inflated(blob)
    (count,) = COUNT.unpack_from(raw)
    at = COUNT.size + 24 * count
    table = np.cumsum(_unzigzag(_joined(raw[COUNT.size : at], count, 3)), axis=0)
    signs = raw[at : at + count].decode("ascii")
    at += count
    for (now, offset, size), sign in zip(table.tolist(), signs, strict=True):
        yield now, now + offset, sign, raw[at : at + size]
        at += size


def _section(width: int, rows: list[Entry]) -> bytes:
    rows.sort(key=lambda entry: entry.loop)
    count = len(rows)
    loops = np.array([row.loop for row in rows], "<u2")
    times = np.array([(r[1], r[2], r[3] - r[2], r[4] - r[3], r[5]) for r in rows], np.int64)
    quality = bytes([row.quality for row in rows])
    words = np.frombuffer(b"".join([row.words for row in rows]), "<u2").reshape(count, width)
    changed = words.copy()
    changed[1:] ^= words[:-1]
    packed = changed.view(np.uint8).reshape(count, 2 * width).T.tobytes()
    return SECTION.pack(width, count) + loops.tobytes() + _planes(_zigzag(_differences(times))) + quality + packed


def _blocks(width: int, count: int, parts: list[bytes]) -> Iterator[Block]:
    loops = np.frombuffer(parts[0], "<u2")
    times = np.cumsum(_unzigzag(_joined(parts[1], count, 5)), axis=0)
    quality = np.frombuffer(parts[2], np.uint8)
    planes = np.frombuffer(parts[3], np.uint8).reshape(2 * width, count)
    changed = np.ascontiguousarray(planes.T).view("<u2")
    words = np.bitwise_xor.accumulate(changed, axis=0) if count else changed
    edges = [0, *(np.flatnonzero(np.diff(loops)) + 1).tolist(), count]
    for first, end in pairwise(edges):
        tick, sent, took, offset, aligned = (times[first:end, column] for column in range(5))
        yield Block(
            int(loops[first]),
            tick,
            sent,
            sent + took,
            sent + took + offset,
            aligned,
            quality[first:end],
            words[first:end],
        )


def _differences(table: Ints) -> Ints:
    found = table.copy()
    found[1:] -= table[:-1]
    return found


def _zigzag(table: Ints) -> Ints:
    """Small numbers of either sign become small numbers without one."""
    found: Ints = (table << 1) ^ (table >> 63)
    return found


def _unzigzag(table: Ints) -> Ints:
    plain = table.view(np.uint64)
    found: Ints = (plain >> np.uint64(1)).view(np.int64) ^ -(table & 1)
    return found


def _planes(table: Ints) -> bytes:
    """Column by column, byte place by byte place, lowest first."""
    count, columns = table.shape
    bytewise = np.ascontiguousarray(table, "<i8").view(np.uint8).reshape(count, columns, 8)
    return bytewise.transpose(1, 2, 0).tobytes()


def _joined(data: bytes, count: int, columns: int) -> Ints:
    if len(data) != 8 * columns * count:
        raise CodecError(f"{count} rows of {columns} numbers need {8 * columns * count} bytes, {len(data)} are there")
    bytewise = np.frombuffer(data, np.uint8).reshape(columns, 8, count)
    found: Ints = np.ascontiguousarray(bytewise.transpose(2, 0, 1)).view("<i8").reshape(count, columns)
    return found.astype(np.int64)


def _inflated(blob: bytes) -> bytes:
    try:
        return zlib.decompress(blob)
    except zlib.error as error:
        raise CodecError(f"a block of {len(blob)} bytes does not unpack: {error}") from error


def concatenated(blocks: Iterable[Block]) -> Block | None:
    """Join blocks of one loop in their order; None for none."""
    found = list(blocks)
    if not found:
        return None
    columns: list[Any] = [np.concatenate([block[place] for block in found]) for place in range(1, len(Block._fields))]
    return Block(found[0].loop, *columns)
