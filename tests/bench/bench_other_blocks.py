"""Soak of PID_Temp, PID_REG_CE and MELSEC PID: right blocks, meddled with at random, must convict nobody.

Run by hand: `python tests/bench/bench_other_blocks.py [seeds] [polls]`; prints one line a run, exits 1 on a conviction.
"""

from __future__ import annotations

import asyncio
import random
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from lockstep.other_world import OtherWorld

MEDDLING: dict[str, dict[str, tuple[Any, ...]]] = {
    "PID_Temp": {
        "Setpoint": (30.0, 45.5, 61.0, 80.0), "Heat_Gain": (1.0, 3.7, 6.0), "Heat_Ti": (0.0, 5.0, 12.0),
        "Heat_Td": (0.0, 1.0), "Heat_DeadZone": (0.0, 0.2), "ManualEnable": (True, False, False),
        "ManualValue": (-10.0, 33.3, 110.0), "Disturbance": (-5.0, 0.0, 4.5), "ActivateCooling": (True, False),
        "AdvancedCooling": (True, False), "Mode": (3, 3, 3, 4, 0), "ModeActivate": (True, False),
        "Reset": (True, False, False, False), "ErrorAck": (True, False), "Heat_PwmPeriode": (0.0, 0.5),
        "Heat_MinimumOnTime": (0.0, 0.2), "Heat_Cycle": (0.1, 0.5), "Heat_ControlZone": (3e38, 10.0),
        "Heat_Select": (0, 1, 2),
    },
    "PID_REG_CE": {
        "SET_POINT": (30.0, 48.5, 60.0, 80.0), "KP": (0.5, 2.2, 5.0), "TN": (0.0, 5.0, 20.0), "TV": (0.0, 0.3),
        "D_ZONE": (0.0, 0.3, 1.0), "REG_AVT": (True, True, False), "IN_OPEN_R": (True, False),
        "IN_CLOSE_R": (True, False), "PT_MIN_IMP": (0.2, 0.4), "PT_LUFT": (0.0, 0.5), "Y_OGR": (100.0, 40.0),
        "T_PERIOD": (4.0, 6.0), "ACTION": (True, False, False, False),
    },
    "MELSEC_PID": {
        "SV": (300, 471, 800), "KP": (50, 133, 300), "TI": (0, 10, 30), "TD": (0, 0, 20), "KD": (0, 20),
        "ALPHA": (0, 0, 30), "ACT": (33, 33, 33, 32, 35, 1), "S22": (1000, 800), "S20": (0, 3),
        "EN": (True, True, False),
    },
}  # fmt: skip
SHARE = 0.04


async def soak(name: str, seed: int, polls: int, *, counter: bool) -> int:
    """Follow one meddled-with block; say its counts and return how often it was convicted."""
    rng = random.Random(seed)
    ground = OtherWorld(name, seed=seed, counter=counter)
    for _ in range(polls):
        if rng.random() < SHARE:
            operand = rng.choice(sorted(MEDDLING[name]))
            value = rng.choice(MEDDLING[name][operand])
            moment = ground.plc.now_ns + rng.randrange(ground.poll_ns)
            ground.plc.at(moment, lambda plc, operand=operand, value=value: plc.write("L1", operand, value))
        await ground.poll()
    counts = ground.follower.summary()
    sys.stdout.write(
        f"{name} seed {seed} counter {counter}: {ground.plc.executed('L1')} calls, proven {counts.proven} "
        f"({counts.informative} informative), unobservable {counts.unobservable}, diverged {counts.diverged}\n"
    )
    return counts.diverged


def main() -> int:
    """Soak every block over the seeds."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    polls = int(sys.argv[2]) if len(sys.argv) > 2 else 8000
    convicted = 0
    for name in MEDDLING:
        for seed in range(seeds):
            for counter in (False, True):
                convicted += asyncio.run(soak(name, seed, polls, counter=counter))
    return 1 if convicted else 0


if __name__ == "__main__":
    sys.exit(main())
