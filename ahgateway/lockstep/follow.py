"""Follows one loop from picture to picture: when an execution happened, what it was worth, what was not seen.

This file alone decides how many executions fit between two pictures and how many there must have been. Everything is
a function of pictures and their times, so a recording can be followed like a PLC.

Theory of operation: an execution that changes a word shows itself as a change between two pictures. How many can have
happened is bounded by time: two executions are at least CYCLE less one scan apart, counted from the earliest moment
at which the last one can have been. Executions that change no word cannot be told from none; their number is an
estimate, time by CYCLE, and they are never counted as proven.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.codec.station import Loop
from ahgateway.codec.ways import COUNTS, Each, Way
from ahgateway.core.real import same_bits
from ahgateway.core.verdict import Counts, Verdict
from ahgateway.lockstep.call_shadow import changed as changed_beside_calls
from ahgateway.lockstep.calls import Calls
from ahgateway.lockstep.counting import counted, explains
from ahgateway.lockstep.events import Change, Finding, Lost
from ahgateway.lockstep.inquiry import REPEATED_MIN, Inquiry
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.reads import changed_inputs, input_variants
from ahgateway.lockstep.restarts import forgotten, restarted
from ahgateway.lockstep.shadow import Bound, Shadow, explain, judged_names, merged, recalled, without_pv
from ahgateway.lockstep.suspects import Suspect
from ahgateway.lockstep.unseen import lingered, refreshed

STALL_CYCLES = 3
"""After this many CYCLEs without an execution that must have changed a word, the loop stands still."""

WRITABLE = frozenset({"MOUT", "I_MV"})
"""Seen words that the manual lets people write: a change of these alone need not be an execution."""


Event = Execution | Change | Finding | Lost


class Follower:
    """What is known of one loop at its last picture."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.counts = Counts()
        self.picture: Picture | None = None
        self.last: Execution | None = None
        self.first_diverged: tuple[Picture, Execution] | None = None
        self._inquiry = Inquiry(loop)
        self._shadow: Shadow = ()
        self._calls = None if loop.controller.begin is None else Calls(loop)
        self._expected = 0.0
        self._earliest_ns: int | None = None
        self._quiet_since_ns: int | None = None
        self._moved_ns: int | None = None
        self._moves = 0
        self._findings: set[str] = set()

    @property
    def suspects(self) -> tuple[Suspect, ...]:
        """Causes that explain the loop's divergences, likeliest first; () while there are none."""
        return self._inquiry.suspects

    def lost(self, executions: float) -> None:
        """The link was gone for so many CYCLEs: what the instruction did meanwhile is not known."""
        self.counts = replace(self.counts, link=self.counts.link + max(0, round(executions)))
        self.picture = None
        self._shadow = ()
        self._inquiry.forget()
        if self._calls is not None:
            self._calls.forget()
        self._earliest_ns = None
        self._quiet_since_ns = None

    def summary(self) -> Counts:
        """Return the counts with the executions that nobody saw added as unobservable, by the clock's estimate."""
        counted = self.counts.compared + self.counts.unobservable
        unseen = max(0, int(self._expected) - counted)
        return replace(
            self.counts,
            unobservable=self.counts.unobservable + unseen,
            expected=max(counted, int(self._expected)) + self.counts.link,
        )

    def take(self, found: Picture | Lost) -> list[Event]:
        """Take the next picture, or the news that some executions will never be seen."""
        if isinstance(found, Picture):
            return self.see(found)
        self.lost(found.executions)
        return [found]

    def see(self, picture: Picture) -> list[Event]:
        """Take the next picture and return what happened since the one before, in order."""
        before, self.picture = self.picture, picture
        events: list[Event] = list(self._look(picture))
        if before is None:
            self._quiet_since_ns = picture.last_ns
            if self._calls is not None:
                self._calls.see(None, picture, cycle_ns(self.loop, picture))
            return events
        if computes(self.loop, before) and computes(self.loop, picture):
            self._expected += self._estimate(before, picture)
        events.extend(self._changes(before, picture))
        if self._calls is not None:
            return [*events, *self._called(self._calls, before, picture)]
        changed = {name for name in judged_names(self.loop) if not same_bits(before.seen[name], picture.seen[name])}
        told = counts_between(before, picture)
        if told is not None and told[0] > 0:
            events.append(self._execution(before, picture))
            events.extend(self._stale_pv(before, picture))
        elif not changed or (changed <= {"MV", "MOUT"} and self._is_refreshed(picture)):
            events.extend(self._nothing_changed(before, picture))
        elif changed == {"MOUT"} or (changed <= WRITABLE and self._is_written(before, picture)):
            events.extend(self._written(before, picture, changed))
        else:
            events.append(self._execution(before, picture))
            events.extend(self._stale_pv(before, picture))
        return events

    def _called(self, calls: Calls, before: Picture, after: Picture) -> list[Event]:
        """What a block that is called again and again did; silence is told by its shadow."""
        found: list[Event] = []
        for event in calls.see(before, after, cycle_ns(self.loop, after)):
            if not isinstance(event, Execution):
                found.append(event)
                continue
            execution = self._inquiry.hear(event, before, after)
            self._quiet_since_ns = after.last_ns
            self._count(execution, after)
            found.append(execution)
            found.extend(self._set(NO_EXECUTION, False))
        if found or not computes(self.loop, after) or self._quiet_since_ns is None or after.count is not None:
            return found
        silent_ns = after.sent_ns - self._quiet_since_ns
        if silent_ns > STALL_CYCLES * cycle_ns(self.loop, after) + self.loop.scan_ms_max * MILLISECOND:
            found.extend(
                self._set(NO_EXECUTION, not calls.rests(before, after), f"silent for {silent_ns / SECOND:.1f} s")
            )
        return found

    def _is_refreshed(self, picture: Picture) -> bool:
        """MV has followed MOUT at a scan, which is no execution; take it over."""
        mv = refreshed(self.loop, picture)
        if mv is None or not same_bits(mv, picture.seen["MV"]):
            return False

        def change(shadow: Shadow) -> Shadow:
            return merged(Bound(bound.low._replace(mv=mv), bound.high._replace(mv=mv)) for bound in shadow)

        self._shadow = change(self._shadow)
        self._inquiry.pass_on(change)
        return True

    def _is_written(self, before: Picture, after: Picture) -> bool:
        """Only words changed that people may write, and no execution leaves them so: somebody wrote them."""
        if explains(self.loop, self._shadow, before, after, max(1, self._executions_max(before, after))):
            return False
        # An integral that runs on in manual follows a PV that nothing shows: that is no write either.
        if without_pv(self.loop, self._shadow, input_variants(self.loop, before, after), after.seen):
            return False
        if self._inquiry.explains(before, after, self._executions_max(before, after)):
            return False
        return not self._keeps_moving(before, after)

    def _keeps_moving(self, before: Picture, after: Picture) -> bool:
        """Tell whether I_MV alone has moved so at several executions in a row: nobody's hand is that steady."""
        last_ns, self._moved_ns = self._moved_ns, after.last_ns
        apart = cycle_ns(self.loop, after) + self.loop.scan_ms_max * MILLISECOND
        self._moves = self._moves + 1 if last_ns is not None and before.sent_ns <= last_ns + apart else 1
        return self._moves >= REPEATED_MIN and is_executing(after)

    def _written(self, before: Picture, after: Picture, changed: set[str]) -> list[Event]:
        """Take over what was written; MOUT is an input and reported as such already.

        A change of MOUT alone is never taken for an execution: at rest the two cannot be told apart.
        """
        found: list[Event] = [
            Change(name, before.seen[name], after.seen[name]) for name in sorted(changed) if name != "MOUT"
        ]
        if changed != {"MOUT"}:
            self._inquiry.forget()
        shown = {word.attr: after.seen[word.name] for word in self.loop.controller.seen if word.attr == "i"}
        self._shadow = merged(
            Bound(bound.low._replace(**shown), bound.high._replace(**shown)) for bound in self._shadow
        )
        return found + list(self._nothing_changed(before, after))

    def _stale_pv(self, before: Picture, after: Picture) -> list[Finding]:
        """The PV that the instruction recorded is not what the register holds, though that stood still meanwhile."""
        recorded = [word.name for word in self.loop.controller.seen if word.attr == "pv1"]
        still = after.is_exact or same_bits(before.inputs.pv, after.inputs.pv)
        if not recorded or not computes(self.loop, after) or not still:
            return []
        used, held = after.seen[recorded[0]], after.inputs.pv
        detail = f"{recorded[0]} records {float(used):g}, PV holds {float(held):g}"
        return self._set(STALE_PV, not same_bits(used, held), detail)

    def _execution(self, before: Picture, after: Picture) -> Execution:
        least, most = counts_between(before, after) or (1, self._executions_max(before, after))
        self._pass_en(before)
        if is_at_changes(self.loop):
            # What changed no word made no picture, and whatever changes one ends the wait.
            most = 1
            silent, reached = self._silent_max(before, after), self._shadow
            self._shadow = lingered(self.loop, reached, before, before, silent)
            if self._shadow is not reached:
                self._inquiry.rests(before, before, silent)
        possible = max(1, least), max(1, most)
        execution, self._shadow = counted(self.loop, self._shadow, before, after, possible, self.suspects)
        execution = self._inquiry.hear(execution, before, after, possible[1])
        if execution.blame is not None and self._inquiry.hidden:
            self._shadow = (*self._inquiry.hidden, *self._shadow)
        self._earliest_ns = before.sent_ns
        self._quiet_since_ns = after.last_ns
        self._count(execution, after)
        return execution

    def _pass_en(self, before: Picture) -> None:
        """Where EN off forgets the history an execution behind it begins anew; a trigger is the contact itself."""
        if getattr(self.loop.dialect, "en_on_history", 0) and (self.loop.way is Way.STEPPED or before.enabled is False):
            change = forgotten if self.loop.way is Way.STEPPED else restarted
            self._shadow = change(self._shadow)
            self._inquiry.pass_on(change)

    def _count(self, execution: Execution, after: Picture) -> None:
        for _ in range(execution.count):
            self.counts = self.counts.plus(execution.verdict, execution.proof, execution.weight)
        self.last = execution
        if execution.blame is not None and self.first_diverged is None:
            self.first_diverged = (after, execution)

    def _nothing_changed(self, before: Picture, after: Picture) -> list[Finding]:
        """Carry what executions that changed no word can have left hidden; notice when there should have been one."""
        possible = self._executions_max(before, after)
        if self._shadow and possible and is_called(after):
            self._shadow = lingered(self.loop, self._shadow, before, after, possible)
            self._inquiry.rests(before, after, possible)
        if not computes(self.loop, after) or self._quiet_since_ns is None:
            self._quiet_since_ns = after.last_ns
            return self._set(NO_EXECUTION, False)
        silent_ns = after.sent_ns - self._quiet_since_ns
        if silent_ns < STALL_CYCLES * cycle_ns(self.loop, after) + self.loop.scan_ms_max * MILLISECOND:
            return []
        if self._rests(before, after):
            return self._set(NO_EXECUTION, False)
        if self._shadow:
            self._shadow = restarted(self._shadow)
        return self._set(NO_EXECUTION, True, f"no execution for {silent_ns / SECOND:.1f} s")

    def _rests(self, before: Picture, after: Picture) -> bool:
        """Tell whether an execution now would change no word."""
        shadow = self._shadow or recalled(self.loop, (after.inputs,), after.seen)
        variants = input_variants(self.loop, before, after)
        return explain(self.loop, shadow, variants, after.seen, judged_names(self.loop)).may_fit

    def _estimate(self, before: Picture, after: Picture) -> float:
        """How many executions there were between two pictures, as well as that is known."""
        told = counts_between(before, after)
        by_time = max(0, after.last_ns - before.last_ns) / cycle_ns(self.loop, after)
        if told is None:
            return by_time
        return min(max(by_time, told[0]), 1 if is_at_changes(self.loop) else told[1])

    def _executions_max(self, before: Picture, after: Picture) -> int:
        """How many executions fit between the first request of one picture and the last reply of the next."""
        by_time, told = self._by_time(before, after), counts_between(before, after)
        return by_time if told is None else min(by_time, told[1])

    def _silent_max(self, before: Picture, after: Picture) -> int:
        """How many executions that changed nothing fit before the one that is seen."""
        by_time, told = self._by_time(before, after), counts_between(before, after)
        return max(0, (by_time if told is None or self.loop.way is Way.RECORDED else min(by_time, told[1])) - 1)

    def _by_time(self, before: Picture, after: Picture) -> int:
        interval = cycle_ns(self.loop, after)
        apart = max(interval - self.loop.scan_ms_max * MILLISECOND, interval // 2)
        start = before.sent_ns
        if self._earliest_ns is not None:
            start = max(start, self._earliest_ns + apart)
        possible = 0 if after.last_ns < start else 1 + (after.last_ns - start) // apart
        dialect = self.loop.dialect
        begins_anew = getattr(dialect, "run_on", 0) or getattr(dialect, "run_off_scan", 0)
        # There, PID_RUN has an execution of its own beside the schedule's.
        return possible + 1 if begins_anew and before.inputs.pid_run != after.inputs.pid_run else possible

    def _changes(self, before: Picture, after: Picture) -> list[Change]:
        if self._calls is not None:
            names = changed_beside_calls(self.loop, before, after)
        else:
            own = {"mout"} if after.inputs.mout_auto else set()
            names = [name for name in changed_inputs(self.loop, before, after) if name not in own]
        spelled = {operand.attr: operand.name for operand in self.loop.controller.operands}
        return [Change(spelled[name], getattr(before.inputs, name), getattr(after.inputs, name)) for name in names]

    def _look(self, picture: Picture) -> list[Finding]:
        """Compare one picture with what a loop in service looks like."""
        zero = not any(any(words) for words in picture.words.values())
        sv, pv = target_of(self.loop, picture), process_value_of(self.loop, picture)
        bad = not (np.isfinite(sv) and np.isfinite(pv))
        is_stopped = not getattr(picture.inputs, "pid_run", True)
        return [
            *self._set(STOPPED, picture.running is False),
            *self._set(DISABLED, picture.enabled is False),
            *self._set(ALL_ZERO, zero),
            *self._set(BAD_VALUE, bad, f"SV is {float(sv):g}, PV is {float(pv):g}"),
            *self._set(TUNING, self.loop.controller.tunes(picture.inputs, picture.seen)),
            *self._set(RUN_OFF, is_stopped and not zero),
        ]

    def _set(self, name: str, is_on: bool, detail: str = "") -> list[Finding]:
        """Return the finding when it begins or ends, nothing in between."""
        if is_on == (name in self._findings):
            return []
        text, hint = FINDINGS[name]
        if is_on:
            self._findings.add(name)
        else:
            self._findings.discard(name)
        return [Finding(name, f"{detail}: {text}" if detail else text, hint, is_over=not is_on)]

    @property
    def state(self) -> Any:
        """What the instruction remembers, when that is known to the last bit; None while anything is open."""
        is_known = len(self._shadow) == 1 and self._shadow[0].is_point
        return self._shadow[0].low if is_known else None

    @property
    def findings(self) -> tuple[str, ...]:
        """Names of the findings that hold now."""
        return tuple(sorted(self._findings))


STOPPED = "plc-stopped"
DISABLED = "en-off"
ALL_ZERO = "all-zero"
BAD_VALUE = "bad-value"
TUNING = "auto-tuning"
RUN_OFF = "pid-run-off"
NO_EXECUTION = "no-execution"
STALE_PV = "stale-pv"

FINDINGS: dict[str, tuple[str, str]] = {
    STOPPED: ("the PLC is in STOP: nothing executes, nothing is judged", "put the PLC in RUN, or wait"),
    DISABLED: ("the EN contact is off: the instruction keeps its values and does not execute", ""),
    ALL_ZERO: (
        "every operand reads 0: there is no PID instruction at these addresses, or it was never initialised",
        "compare SV and PV with ISPSoft; `ahgateway profile show` lists the addresses that are read",
    ),
    BAD_VALUE: ("SV or PV is not a number: the reference holds its output", "look at the sensor and its scaling"),
    TUNING: ("the auto-tuner is at work: judging is suspended until it ends", ""),
    RUN_OFF: ("PID_RUN is FALSE: MV is held at 0", ""),
    STALE_PV: (
        "the instruction does not use the PV that stands in its register",
        "does the program copy PV somewhere else, or is the analogue input slower than CYCLE?",
    ),
    NO_EXECUTION: (
        "the block stands still although an execution would change it",
        "is the PLC in RUN, the EN contact on, CYCLE as in the profile? name `running` and `en` in the profile",
    ),
}
"""Finding to its text and what to do."""


def counts_between(before: Picture, after: Picture) -> tuple[int, int] | None:
    """Least and most executions between two pictures, where something in the PLC tells; None where only time does."""
    if after.executions is not None:
        return after.executions
    if before.count is None or after.count is None:
        return None
    executions = (after.count - before.count) % COUNTS
    return executions, executions


def is_at_changes(loop: Loop) -> bool:
    """Tell whether the PLC goes on to the next picture at the first execution that changes a word."""
    if loop.way is Way.STEPPED:
        return loop.interval_ms is None
    return loop.way is Way.RECORDED and loop.recorder is not None and loop.recorder.each is Each.CHANGE


def is_called(picture: Picture) -> bool:
    """Tell whether the program calls the instruction, as far as the picture shows."""
    return picture.running is not False and picture.enabled is not False


def is_executing(picture: Picture) -> bool:
    """Tell whether DPID or DPIDE computes, as far as the picture shows."""
    return is_called(picture) and picture.inputs.pid_run and picture.inputs.pid_mode != 1


def computes(loop: Loop, picture: Picture) -> bool:
    """Tell whether the loop's instruction, whichever it is, computes, as far as the picture shows."""
    return is_called(picture) and loop.controller.computes(picture.inputs)


def target_of(loop: Loop, picture: Picture) -> Any:
    """SV, whatever the controller calls it."""
    return getattr(picture.inputs, loop.controller.operand(loop.controller.roles.sv).attr)


def process_value_of(loop: Loop, picture: Picture) -> Any:
    """PV as the controller uses it, whatever it calls it: what it publishes of it, else the register."""
    roles = loop.controller.roles
    if roles.published_pv:
        return picture.seen[roles.published_pv]
    return getattr(picture.inputs, loop.controller.operand(roles.pvs[0]).attr)


def is_automatic(loop: Loop, picture: Picture) -> bool:
    """Tell whether the law, and no person, moves the output."""
    inputs = picture.inputs
    in_manual = getattr(inputs, "pid_man", False) or not getattr(inputs, "reg_avt", True)
    return computes(loop, picture) and not in_manual and picture.seen.get("State", AUTOMATIC) == AUTOMATIC


AUTOMATIC = 3
"""State of PID_Temp in automatic mode."""


def reference_of(loop: Loop, terms: Any) -> Any:
    """MV of the reference, whatever the controller calls it."""
    return getattr(terms, next(seen.attr for seen in loop.controller.seen if seen.name == loop.controller.roles.mv))


def output_of(loop: Loop, picture: Picture) -> Any:
    """MV, whatever the controller calls it."""
    return picture.seen[loop.controller.roles.mv]


def cycle_ns(loop: Loop, picture: Picture) -> int:
    """The configured sampling time in ns, at least 1 µs."""
    return max(1000, round(float(loop.controller.nominal_ts(picture.inputs)) * SECOND))


def verdict_now(follower: Follower) -> Verdict | None:
    """The loop's verdict as one word: DIVERGED once anything diverged, else that of the last execution."""
    if follower.counts.diverged:
        return Verdict.DIVERGED
    return follower.last.verdict if follower.last else None
