"""Whose reply is it? The proof that a line without transaction numbers is not one reply behind.

RTU and ASCII replies carry no number, and a reply to a read does not say which address it holds. So a reply is
believed only while no other reply of the same shape can still be on its way. This file alone decides that.

Theory of operation. A request that was sent and not answered leaves a *ghost*: the first bytes its late reply
would have. While a unit has ghosts, nothing of it is believed; the next exchange is an *alignment probe*, a read of
a count that no ghost has, nor a count next to it, so that its reply can be mistaken for none of theirs. A unit
answers in the order in which it was asked and the line is first in, first out: once the probe's reply is here, every
ghost has come or will never come. An exception carries no count and proves nothing while a ghost of the same function
is out. A probe that stays unanswered is a ghost itself. After (re)connecting, or when a whole stray frame was heard,
every unit is proven anew. What this cannot see: a second copy of a reply, held back longer than the pause between
requests, exactly in the place of a later reply of the same shape.

Source: ASSUMED a unit answers in order; ASSUMED a second copy follows the first within the pause;
ASSUMED no reply is later than `HORIZON_TIMEOUTS`.
"""

from __future__ import annotations

from collections.abc import Iterator

from ahgateway.codec.access import Read, Request
from ahgateway.transports.pdu import READ_BITS_MAX, READ_WORDS_MAX

HORIZON_TIMEOUTS = 60
"""A reply that is later than this many time-outs is not expected any more; bounds the ghosts of a dead unit."""

NEAR_SIZE = 2
"""Bytes by which a miscounted reply may differ from what was asked."""

_WORDS = (7, 5, 3, 11, 13, 9, 1, 2, 4, 6, 8, 10, *range(12, READ_WORDS_MAX + 1))
"""Counts of a probe in order of preference: short, and odd, which block reads of 32-bit values seldom are."""


def _ranked(known: int, most: int) -> Iterator[int]:
    """Yield counts up to `most`; what is not above a read that worked lies surely inside the map and comes first."""
    yield from (count for count in _WORDS if count <= known)
    yield from (count for count in _WORDS if known < count <= most)


class Alignment:
    """What is known of each unit on one line since the line was opened."""

    def __init__(self, timeout_ns: int) -> None:
        self._horizon_ns = HORIZON_TIMEOUTS * timeout_ns
        self._since_ns: dict[int, int] = {}
        self._ghosts: dict[int, dict[bytes, int]] = {}
        self._readable: dict[int, Read] = {}

    def since_ns(self, unit: int) -> int | None:
        """Since when every reply of `unit` is proven to belong to its request; None while that is in doubt."""
        return self._since_ns.get(unit)

    def answered(self, request: Request) -> None:
        """Note a read that this unit carries out, as a place where a probe can read."""
        if type(request) is Read:
            self._readable[request.unit] = request

    def missed(self, unit: int, head: bytes, now_ns: int) -> None:
        """Note that the reply which would begin with `head` did not come in time."""
        self._since_ns.pop(unit, None)
        self._ghosts.setdefault(unit, {})[head] = now_ns

    def doubt_all(self) -> None:
        """Believe no unit before it has been probed: the line was opened, or carried a frame that nobody asked for."""
        self._since_ns.clear()

    def probe(self, request: Request, now_ns: int) -> Read:
        """Return the read that proves the line for `request.unit`."""
        ghosts = self._ghosts.get(request.unit, {})
        for head in [head for head, seen_ns in ghosts.items() if now_ns - seen_ns > self._horizon_ns]:
            del ghosts[head]
        place = self._readable.get(request.unit, request)
        table, address = place.table, place.address
        step, function = 1, {"holding register": 3, "input register": 4}.get(table.value, 0)
        if table.is_bits:
            step, function = 8, {"coil": 1, "discrete input": 2}[table.value]
        size = 1 if table.is_bits else 2
        count_max = (READ_BITS_MAX // 8) if table.is_bits else READ_WORDS_MAX
        most = min(count_max, (0x10000 - address) // step)
        known = min(most, place.count // step if type(place) is Read else 1)
        owed = [head[1] for head in ghosts if head[0] == function]
        # Not even near a ghost: a unit that miscounts by one must not be taken for one that answers the probe.
        for distance in (NEAR_SIZE, 0):
            for count in _ranked(known, most):
                if all(abs(count * size - each) > distance for each in owed):
                    return Read(request.unit, table, address, count * step)
        oldest = min(ghosts, key=lambda head: ghosts[head])
        return Read(request.unit, table, address, max(1, oldest[1] // size if oldest[0] == function else 1) * step)

    def proven(self, unit: int, now_ns: int) -> None:
        """Note that the probe's own reply is here."""
        self._since_ns[unit] = now_ns
        self._ghosts.pop(unit, None)

    def refusal_proves(self, unit: int, function: int) -> bool:
        """Tell whether an exception to a probe of `function` can only be the probe's."""
        return all(head[0] != function for head in self._ghosts.get(unit, ()))
