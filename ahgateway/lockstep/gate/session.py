"""What one arming has done, told by its journal, and what may be put back. Pure: records in, decision out.

This file alone decides what still is ours. For each operand it carries the set of words that can stand there because of
us: as found, then every value whose request may have reached the PLC, cut to one when a fresh read has shown it. What
stands there and is not in the set was written by somebody else, who is never overwritten.

What the instruction writes because we set PID_MODE to 1 is ours too: any gains, until a picture has shown them.

An operator takes over by the operands of the mode, or by the manual value while the loop is in manual: then nothing is
put back at all. Any other operand that somebody changed is left alone, and the rest is put back.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ahgateway.codec.block import Raw
from ahgateway.core.controllers import Roles
from ahgateway.lockstep.gate.change import follows_mv, in_manual
from ahgateway.lockstep.gate.journal import Record

Words = tuple[int, ...]
TUNING: Words = (1, 0)
"""PID_MODE = 1: the instruction tunes itself, writes its gains, and ends with PID_MODE = 0 (spec A.5)."""
TUNED: Words = (0, 0)
GAINS = ("Kp", "Ki", "Kd", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf")
ANY: Words = ()
"""Among the possible words of an operand: whatever comes to stand there at our request."""


@dataclass(slots=True)
class Session:
    """One arming, from as-found to its end.

    Attributes:
        loop: The loop's tag.
        as_found: Words of every operand before the first write.
        written: Operands that a write was begun for, in the order of their first.
        possible: Operand to the words that can stand there because of us.
        end: How it ended: `kept`, `restored`, `accepted`; empty while it has not.
        anchor: Hash of the record that armed it.
        lease: Owner word by which it held the PLC's lease, 0 without one.
        is_put_back: The PLC itself put everything back at the end of the lease.
    """

    loop: str
    as_found: dict[str, Words]
    written: list[str] = field(default_factory=list)
    possible: dict[str, set[Words]] = field(default_factory=dict)
    end: str = ""
    anchor: str = ""
    lease: int = 0
    is_put_back: bool = False

    def stream(self, operand: str, old: Words, new: Words) -> None:
        """From now on requests with any value reach the PLC, this one first."""
        self.intend(operand, old, new)
        self.possible[operand].add(ANY)

    def is_streamed(self, operand: str) -> bool:
        """Tell whether any value that stands there is ours."""
        return ANY in self.possible.get(operand, ())

    def intend(self, operand: str, old: Words, new: Words) -> None:
        """A request that replaces this value by that may reach the PLC from now on."""
        self._may_hold(operand, old, new)
        if operand == "PID_MODE" and new == TUNING:
            self._may_hold(operand, old, TUNED)
            for name in GAINS:
                if name in self.as_found:
                    self._may_hold(name, self.as_found[name], ANY)

    def _may_hold(self, operand: str, old: Words, new: Words) -> None:
        if operand not in self.possible:
            # What stood there just before may be another than as found: MOUT follows MV in automatic.
            self.possible[operand] = {self.as_found[operand], old}
            self.written.append(operand)
        self.possible[operand].add(new)

    def prove(self, operand: str, new: Words) -> None:
        """A fresh read has shown this value behind the last request."""
        self.possible[operand] = {new, TUNED} if operand == "PID_MODE" and new == TUNING else {new}

    def put_back(self) -> None:
        """The PLC itself may have put back any of it."""
        self.is_put_back = True
        for operand, words in self.possible.items():
            words.add(self.as_found[operand])

    def is_ours(self, operand: str, now: Raw) -> bool:
        """Tell whether what stands there can be as found or as we left it."""
        possible = self.possible.get(operand, {self.as_found[operand]})
        return now[operand] in possible or ANY in possible


@dataclass(frozen=True, slots=True)
class Conflict:
    """An operand that holds what neither we wrote nor found: somebody else has taken it over."""

    operand: str
    found: Words
    ours: tuple[Words, ...]
    now: Words


@dataclass(frozen=True, slots=True)
class Decision:
    """What to put back.

    Attributes:
        stages: Operand to words, stage by stage; () when everything is as found or nothing may be touched.
        conflicts: What somebody else has changed.
        is_taken_over: The mode changed, so that nothing is touched.
    """

    stages: tuple[Mapping[str, Words], ...]
    conflicts: tuple[Conflict, ...]
    is_taken_over: bool = False


def decide(session: Session, roles: Roles, now: Raw) -> Decision:
    """Decide what may be put back, given what stands in the PLC now."""
    ignored = {roles.mout} if follows_mv(roles, now) else set()
    # Scratch words that the profile does not name any more are out of reach, and nobody's.
    judged = [name for name in session.written if name not in ignored and name in now]
    differing = [name for name in judged if now[name] != session.as_found[name]]
    mode = [name for name in roles.modes if name in now and not session.is_ours(name, now)]
    if in_manual(roles, now) and roles.mout in judged and not session.is_ours(roles.mout, now):
        mode.append(roles.mout)
    lost = [name for name in differing if not session.is_ours(name, now)]
    conflicts = tuple(_conflict(session, name, now) for name in dict.fromkeys([*mode, *lost]))
    if not differing:
        return Decision((), ())
    if mode:
        return Decision((), conflicts, is_taken_over=True)
    wanted = {name: session.as_found[name] for name in differing if name not in lost}
    return Decision(tuple(_staged(roles, wanted)), conflicts)


def _staged(roles: Roles, wanted: Mapping[str, Words]) -> list[dict[str, Words]]:
    """PID_MODE first, so that no tuner writes behind us; gains and limits; MOUT behind manual, or before automatic."""
    mode = {name: wanted[name] for name in ("PID_MODE",) if name in wanted}
    rest = {name: words for name, words in wanted.items() if name not in ("PID_MODE", roles.manual, roles.mout)}
    mout = {name: wanted[name] for name in (roles.mout,) if name in wanted}
    man = {name: wanted[name] for name in (roles.manual,) if name in wanted}
    ordered = [mode, rest, mout, man] if man and in_manual(roles, man) else [mode, rest, man, mout]
    return [stage for stage in ordered if stage]


def _conflict(session: Session, name: str, now: Raw) -> Conflict:
    ours = tuple(sorted(session.possible.get(name, {session.as_found[name]}) - {ANY}))
    return Conflict(name, session.as_found[name], ours, now[name])


def words_json(words: Mapping[str, Words]) -> dict[str, list[int]]:
    """Return operand to words as JSON holds it."""
    return {name: list(each) for name, each in words.items()}


def last_session(records: Sequence[Record]) -> Session | None:
    """Return the journal's last session, ended or not; None when there never was one."""
    start = next((at for at in range(len(records) - 1, -1, -1) if records[at]["kind"] == "armed"), None)
    return None if start is None else replayed(records[start:])


def replayed(records: Iterable[Record]) -> Session:
    """Return the session that these records tell, the first of which armed it."""
    session: Session | None = None
    for record in records:
        kind = record["kind"]
        if kind == "armed":
            found = {name: tuple(words) for name, words in record["as_found"].items()}
            session = Session(str(record["loop"]), found, anchor=str(record["hash"]), lease=int(record.get("lease", 0)))
        elif session is not None:
            _take_in(session, kind, record)
    assert session is not None, "the first record arms the session"
    return session


def _take_in(session: Session, kind: str, record: Mapping[str, Any]) -> None:
    if kind in ("write", "restore"):
        for change in record["items"]:
            session.intend(change["operand"], tuple(change["old"]), tuple(change["new"]))
        if kind == "restore":
            session.end = ""
    elif kind == "stream":
        for change in record["items"]:
            session.stream(change["operand"], tuple(change["old"]), tuple(change["new"]))
    elif kind == "verified":
        for operand, words in record["holds"].items():
            session.prove(operand, tuple(words))
    elif kind == "put-back":
        session.put_back()
    elif kind == "ended":
        session.end = str(record["how"])
