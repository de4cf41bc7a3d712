"""From SYNC and PDOs to whole pictures of memory: which PDOs belong to one SYNC, and which cycles are not believed.

This file alone decides that a set of PDOs is one cycle. All PDOs behind one SYNC are taken at one moment by the sender
(ASSUMED for a PLC's CANopen module: its manual must say so, and lockstep will show it). A cycle counts only when each
PDO of the profile came inside the window behind its SYNC, and none came twice with different bytes. Everything else
is counted, never repaired.

Source:
    MANUAL CiA 301 v4.2 §7.2.5 SYNC with an optional counter 1…240, §7.5.2.7 synchronous window length.
    MANUAL ISO 11898-1: a frame that a receiver missed the last bit of is sent again at once, so that a duplicate
    follows its original.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ahgateway.codec.access import Span, Table
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.can_objects import CanMap, Pdo

MICROSECOND = 1000


@dataclass(frozen=True, slots=True)
class Cycle:
    """What the PLC sent behind one SYNC.

    Attributes:
        number: SYNCs seen before this one, missed ones among them as far as they were recognised.
        sync_ns: When the SYNC was taken from the adapter.
        last_ns: When the last PDO was.
        cells: Table to address to word or bit.
    """

    number: int
    sync_ns: int
    last_ns: int
    cells: Mapping[Table, Mapping[int, int]]

    def values(self, span: Span) -> tuple[int, ...] | None:
        """Return the words or bits of a span, None when some of it is in no PDO."""
        cells = self.cells.get(span.table, {})
        if not all(address in cells for address in range(span.address, span.end)):
            return None
        return tuple(cells[address] for address in range(span.address, span.end))


@dataclass(slots=True)
class CycleFigures:
    """Running totals.

    `jitter_ns_max` is the largest difference of a SYNC interval from the profile's period; `sent` counts our own PDOs,
    which left between `sent_ns_min` and `sent_ns_max` behind the SYNC before them, as our clock saw both.
    """

    syncs: int = 0
    syncs_missed: int = 0
    syncs_repeated: int = 0
    complete: int = 0
    incomplete: int = 0
    contradicted: int = 0
    repeated: int = 0
    late: int = 0
    malformed: int = 0
    jitter_ns_max: int = 0
    sent: int = 0
    sent_ns_min: int = 0
    sent_ns_max: int = 0

    @property
    def sent_jitter_ns(self) -> int:
        """By how much the times differ at which our PDOs left behind their SYNC."""
        return self.sent_ns_max - self.sent_ns_min


class CycleAssembler:
    """Collects the PDOs of a station.

    Args:
        can: SYNC and PDOs of the profile.

    Attributes:
        latest: The last complete cycle, None before there is one.
        figures: Running totals.
    """

    def __init__(self, can: CanMap) -> None:
        self.latest: Cycle | None = None
        self.figures = CycleFigures()
        self._sync = can.sync
        self._pdos: dict[int, Pdo] = {pdo.cob_id: pdo for pdo in can.pdos}
        self._number = 0
        self._sync_ns: int | None = None
        self._counter: int | None = None
        self._taken: dict[int, bytes] = {}
        self._last_ns = 0
        self._is_contradicted = False
        self._is_open = False
        self._has_sent = False

    def feed(self, frame: CanFrame) -> Cycle | None:
        """Take a frame in the order of arrival; return the cycle that a SYNC closes, if it is complete."""
        if frame.is_extended or frame.is_remote or frame.is_error:
            return None
        if frame.can_id == self._sync.cob_id:
            return self._tick(frame)
        pdo = self._pdos.get(frame.can_id)
        if pdo is not None:
            self._take(pdo, frame)
        return None

    def settle(self, now_ns: int) -> Cycle | None:
        """Return the cycle under way when its window is over by this time and it is complete."""
        if self._sync_ns is None or now_ns - self._sync_ns <= self._sync.window_us * MICROSECOND:
            return None
        return self._close()

    def sent(self, now_ns: int) -> None:
        """Note that a PDO of ours left."""
        figures = self.figures
        figures.sent += 1
        if self._sync_ns is not None:
            behind_ns = now_ns - self._sync_ns
            is_first = not self._has_sent
            figures.sent_ns_min = behind_ns if is_first else min(figures.sent_ns_min, behind_ns)
            figures.sent_ns_max = max(figures.sent_ns_max, behind_ns)
            self._has_sent = True

    def _tick(self, frame: CanFrame) -> Cycle | None:
        period_ns = self._sync.period_us * MICROSECOND
        counter = frame.data[0] if len(frame.data) == 1 else None
        missed = 0
        if self._sync_ns is not None:
            interval_ns = frame.now_ns - self._sync_ns
            is_same = counter is not None and counter == self._counter
            if is_same or (counter is None and 2 * interval_ns < period_ns):
                self.figures.syncs_repeated += 1
                return None
            missed = max(0, round(interval_ns / period_ns) - 1)
            self.figures.syncs_missed += missed
            if not missed:
                self.figures.jitter_ns_max = max(self.figures.jitter_ns_max, abs(interval_ns - period_ns))
        closed = self._close()
        self.figures.syncs += 1
        self._number += 1 + missed
        self._sync_ns, self._counter = frame.now_ns, counter
        self._taken, self._is_contradicted, self._is_open = {}, False, True
        return closed

    def _take(self, pdo: Pdo, frame: CanFrame) -> None:
        window_ns = self._sync.window_us * MICROSECOND
        if self._sync_ns is None or not self._is_open or frame.now_ns - self._sync_ns > window_ns:
            self.figures.late += 1
            return
        if len(frame.data) != pdo.size:
            self.figures.malformed += 1
            self._is_contradicted = True
            return
        before = self._taken.get(pdo.cob_id)
        if before is not None:
            self.figures.repeated += 1
            self._is_contradicted |= before != frame.data
            return
        self._taken[pdo.cob_id] = frame.data
        self._last_ns = frame.now_ns

    def _close(self) -> Cycle | None:
        if not self._is_open or self._sync_ns is None:
            return None
        self._is_open = False
        if self._is_contradicted:
            self.figures.contradicted += 1
            return None
        if len(self._taken) < len(self._pdos):
            self.figures.incomplete += 1
            return None
        cells: dict[Table, dict[int, int]] = {}
        for cob_id, data in self._taken.items():
            for span, values in self._pdos[cob_id].decoded(data):
                cells.setdefault(span.table, {}).update(zip(range(span.address, span.end), values, strict=True))
        self.figures.complete += 1
        self.latest = Cycle(self._number - 1, self._sync_ns, self._last_ns, cells)
        return self.latest
