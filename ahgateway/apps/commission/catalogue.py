"""Every finding that commissioning can make: code, name, what it means, what to do.

The page of findings is made of it. Codes are for ever: 1xx link, 2xx map, 3xx loop, 4xx shadow, 5xx wiring; one whose
meaning is gone is never used again.
"""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.apps.commission.checks import Step


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of finding.

    Attributes:
        code: `AHG201`.
        name: Names the offence; a check that passes has the same name.
        step: Step in which it is made.
        what: What was looked at, and what is wrong when it fails.
        why: Why it matters.
        do: What to do.
    """

    code: str
    name: str
    step: Step
    what: str
    why: str
    do: str


_ROWS = (
    ("AHG101", "no-answer", Step.LINK, "The target answers a read of the loop's registers.",
     "Nothing else can be said before something answers.",
     "Cable, address, unit, framing; the text says what was tried."),
    ("AHG102", "wrong-unit", Step.LINK, "The station number of the profile is the one that answers.",
     "A gateway may hand requests of another unit to another PLC.", "Set `unit` in the profile to the number named."),
    ("AHG103", "wrong-framing", Step.LINK, "The line speaks the framing of the profile: TCP, RTU or ASCII.",
     "Delta's factory setting is ASCII 9600 7E1, most profiles say RTU.", "Set `target` to the URI named."),
    ("AHG104", "short-requests", Step.LINK, "Requests as long as the profile says are answered.",
     "Some gateways and CPUs end at 64 or 32 words and refuse the rest.",
     "Set `words_per_request_max` in [station.pacing] to the number named."),
    ("AHG105", "slow-link", Step.LINK, "A picture of the loop takes less than a quarter of CYCLE.",
     "A slower link cannot see every execution; what is not seen is not proven.",
     "Raise the baud rate, lower the adapter's latency timer, or accept a smaller coverage."),
    ("AHG106", "busy", Step.LINK, "The PLC answers without *busy*.", "Another master may be using up its time.",
     "Look for other masters; set a pause between requests in the profile."),
    ("AHG107", "wrong-line", Step.LINK, "Baud rate, parity and data bits of the profile are those of the line.",
     "With others a line is silent, or sends what is no answer.", "Set `target` to the URI named."),
    ("AHG108", "wrong-port", Step.LINK, "The PLC answers at the serial port of the profile.",
     "Adapters change their names when they are plugged in again.",
     "Set `target` to the URI named; on Linux /dev/serial/by-id has names that stay."),
    ("AHG109", "slow-adapter", Step.LINK, "The serial adapter keeps no byte back for longer than 1 ms.",
     "A latency timer of 16 ms halves the rate of requests.",
     "`ahgateway doctor` says how to lower it; on Windows it stands in the port's advanced settings."),
    ("AHG110", "requests-in-flight", Step.LINK, "As many requests at once as the profile says are answered.",
     "What is not answered costs a time-out each time.",
     "Set `requests_in_flight_max` in [station.pacing] to the number named."),
    ("AHG111", "idle-disconnect", Step.LINK, "The PLC keeps a connection open that idles.",
     "The first request behind an idle time would be lost.",
     "Set `close_when_idle_ms` in [station.pacing] to the number named: then it is closed by us."),
    ("AHG201", "swapped-word-order", Step.MAP, "32-bit values stand low word first.",
     "Swapped, every REAL is nonsense, and a write would put nonsense there.",
     "Look for a gateway between us and the PLC that swaps words; Delta itself never does."),
    ("AHG202", "off-by-one", Step.MAP, "The operands stand at the addresses of the map, not one beside them.",
     "0-based and 1-based numbering differ by one register.", "Correct the devices, or the gateway's offset."),
    ("AHG203", "wrong-device-map", Step.MAP, "The devices stand where the profile's device map says.",
     "AH/AS and DVP put the same device at different addresses.", "Set `device_map` to the one named."),
    ("AHG204", "no-loop-there", Step.MAP, "The operands look like those of a PID instruction.",
     "Zeros or nonsense mean that another thing stands there.", "Compare SV, PV and CYCLE with ISPSoft."),
    ("AHG205", "system-flags", Step.MAP, "SM400 is on and SM401 off, as in RUN.",
     "Together they prove the map of the flags and RUN at once.", "Compare with ISPSoft; the map of SM may differ."),
    ("AHG206", "marker", Step.MAP, "A marker written to the scratch words is read back where it was written.",
     "It proves that writes land where reads look.", "Consent with --marker; the words are put back."),
    ("AHG301", "plc-stopped", Step.LOOP, "The PLC is in RUN and the EN contact on.",
     "In STOP nothing executes.", "Put the PLC in RUN; close the contact."),
    ("AHG302", "not-a-number", Step.LOOP, "Every REAL operand is a finite number.",
     "A NaN in SV or PV holds the output; elsewhere it switches a branch off.",
     "Find who writes it: usually a scaling."),
    ("AHG303", "limits-exchanged", Step.LOOP, "MV_MIN stands below MV_MAX.",
     "The PLC exchanges them silently, so that the loop works while the screen lies.", "Exchange the two."),
    ("AHG304", "negative-gain", Step.LOOP, "No gain or time is negative.",
     "The PLC takes a negative one for 0: that branch is off.", "Reverse PID_DIR instead of the sign."),
    ("AHG305", "out-of-range", Step.LOOP, "Operands lie within the range of the manual.",
     "The PLC takes the nearest legal value, another than the one shown.", "Write the value that is meant."),
    ("AHG306", "cycle-below-scan", Step.LOOP, "CYCLE is longer than a scan.",
     "It would execute once a scan, with another time than it computes with.", "Raise CYCLE."),
    ("AHG307", "dead-band", Step.LOOP, "The dead band is 0 or wider than PV's resolution.",
     "A narrower one does nothing.", "Widen it or set it to 0."),
    ("AHG308", "direction", Step.LOOP, "The error by PID_DIR, as an equation; nothing is judged here.",
     "The vendors' words forward and reverse mean opposite things in different manuals.",
     "Step 5 proves whether it fits the process."),
    ("AHG309", "overlap", Step.LOOP, "No operand stands inside I_MV of any loop, nor in part on another.",
     "The instruction overwrites what stands in its memory.", "Move one of them."),
    ("AHG310", "i-mv-dead", Step.LOOP, "The words of I_MV live while the loop integrates.",
     "Still words mean that the instruction does not execute, or works elsewhere.",
     "Is I_MV bound to the right device, is the instruction called?"),
    ("AHG311", "pv-stuck", Step.LOOP, "PV moves while MV moves.",
     "A dead sensor gives a perfect picture of a quiet process.",
     "Look at the sensor, its wiring and its scaling."),
    ("AHG312", "pv-noisy", Step.LOOP, "The noise of PV stays below 1 % of its range.",
     "D turns noise into wear of the actuator.", "Filter at the source; then Tf; then less Td_Kd."),
    ("AHG313", "pv-quantised", Step.LOOP, "The smallest step of PV stays below 0.2 % of its range.",
     "D of a staircase is a row of spikes.", "Use the full resolution of the input module."),
    ("AHG314", "program-writes", Step.LOOP, "Nobody but the instruction changes operands during the observation.",
     "What the program writes each scan, nobody else can set.", "Find the line of the program; write there instead."),
    ("AHG315", "out-of-service", Step.LOOP, "PID_RUN is on, PID_MODE 0 or 2, the loop in automatic.",
     "Out of automatic nothing of the law can be proven.", "Put the loop in automatic when that is safe."),
    ("AHG316", "outside-process-range", Step.LOOP, "SV, PV and MV lie within the ranges of the profile.",
     "Outside, either the scaling or the profile is wrong.", "Compare with the instrument."),
    ("AHG401", "diverged", Step.SHADOW, "Every execution that was seen agrees with the reference by bits.",
     "The PLC computes something else than its manual, or something else than we read.",
     "`ahgateway monitor` shows term and cause; `identify` tries the other dialects."),
    ("AHG402", "not-enough-seen", Step.SHADOW, "Enough executions could be compared to claim anything.",
     "Nothing compared is never a pass.", "Observe longer, or move SV a little within what the process allows."),
    ("AHG403", "link-lost", Step.SHADOW, "The link stayed up during the observation.",
     "What happened meanwhile is not known.", "Cable, converter, other masters."),
    ("AHG404", "restarted", Step.SHADOW, "The PLC did not restart or lose its registers meanwhile.",
     "A restart loses history, and perhaps parameters; one that keeps its registers is told by the execution that "
     "began anew, or by the program's count.", "Are the operands in a latched area? Look for a power cut."),
    ("AHG501", "pv-does-not-answer", Step.WIRING, "PV moves when MOUT moves.",
     "Output, actuator, process and sensor are not one loop.", "Follow the signal from MV to the valve and back."),
    ("AHG502", "wrong-direction", Step.WIRING, "PV moves the way that PID_DIR needs.",
     "The other way the loop runs to a limit in automatic.", "Reverse PID_DIR, not the gain."),
    ("AHG503", "envelope-left", Step.WIRING, "PV, its rate, MV and the time stayed inside the envelope.",
     "Outside, the test is a risk.", "Use a smaller step, or a wider envelope if the process allows."),
    ("AHG504", "taken-over", Step.WIRING, "Nobody else wrote to the loop during the test.",
     "An operator's hand counts more than a test.", "Talk to the operator; then again."),
    ("AHG505", "clamp-ignored", Step.WIRING, "MV obeys MV_MAX and MV_MIN moved to just around it.",
     "A limit that does not hold protects nothing.", "Is MV_MAX or MV_MIN bound to the right device?"),
    ("AHG506", "bump", Step.WIRING, "The return to automatic leaves MV where it is.",
     "A jump of the output reaches the process.",
     "PID_MODE 2, or an integral gain of 0, transfers without the MV of the moment."),
    ("AHG507", "not-written", Step.WIRING, "What was written stood there afterwards.",
     "The program overwrites it, or the PLC refused it.", "Look for the program's own write of MOUT or PID_MAN."),
    ("AHG508", "not-as-found", Step.WIRING, "Every operand is as found behind the test.",
     "What was left behind changes the loop.", "`ahgateway write PROFILE --arm LOOP --restore`."),
)  # fmt: skip

CATALOGUE: dict[str, Kind] = {row[1]: Kind(*row) for row in _ROWS}
"""Every kind by its name."""


def page() -> str:
    """Return the page of findings, in Markdown."""
    lines = [
        "# Findings",
        "",
        "What `ahgateway commission` looks at. Each check passes, fails, stays inconclusive or is skipped with a",
        "reason; its code and name are the same in all cases.",
    ]
    for step in Step:
        kinds = [kind for kind in CATALOGUE.values() if kind.step is step]
        if kinds:
            lines += ["", f"## Step {step.value}: {step.title}"]
        for kind in kinds:
            lines += ["", f"### {kind.code} {kind.name}", "", kind.what, "", f"*Why it matters.* {kind.why}", ""]
            lines += [f"*What to do.* {kind.do}"]
    return "\n".join(lines) + "\n"
