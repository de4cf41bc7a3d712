"""A PLC by another hand: DPIDE by struct's rounding and a Modbus TCP server of its own; it imports nothing of ours.

    python tests/conformance/stand_in.py [sum=pi_d|p_id] [clock=nominal|ms] [gain=1.0] [good=0] [tf=0]

Prints its port, then runs until it is ended. The layout is the manual's: SV D100 … BIAS D124, I_MV D126…145, MV D200,
PID_RUN M1, PID_MAN M2, MOUT_AUTO M3, PID_EQ M4, PID_DE M5, PID_DIR M6. Kc acts as `gain` times its register from
the question number `good` on.
"""

from __future__ import annotations

import asyncio
import random
import struct
import sys
import time
from typing import Any

CYCLE_MS = 100
SCAN_S = 0.006
LATE_MS_MAX = 30
"""More is not carried: two executions are never nearer to each other than a scan of this length makes them."""
SV_EVERY = 15
"""Executions between two steps of SV."""

REALS = {100: 50.0, 102: 20.0, 108: 1.37, 110: 0.213, 112: 0.31, 118: 100.0, 120: 0.0, 122: 0.0, 124: -2.3}


def f32(value: float) -> float:
    """Round to binary32, as each operation of the PLC does."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


class Plc:
    """Registers, bits, one DPIDE and a process of first order."""

    def __init__(self, options: dict[str, str]) -> None:
        self.is_measured = options.get("clock", "nominal") == "ms"
        self.is_alternative = options.get("sum", "pi_d") == "p_id"
        self.gain = float(options.get("gain", 1.0))
        self.good = int(options.get("good", 0))
        self.chance = random.Random(7)
        self.words = [0] * 400
        self.bits = [0] * 40
        self.executions = 0
        self.asked = 0
        self.last: tuple[float, float, float] | None = None
        self.level = 20.0
        for number in range(126, 146):
            self.words[number] = self.chance.randrange(65536)
        for number, value in (REALS | {114: float(options.get("tf", 0.0)), 126: 0.0}).items():
            self.put(number, value)
        self.words[106] = CYCLE_MS
        self.bits[1] = self.bits[6] = 1

    def put(self, number: int, value: float) -> None:
        self.words[number : number + 2] = struct.unpack("<HH", struct.pack("<f", value))

    def get(self, number: int) -> float:
        return float(struct.unpack("<f", struct.pack("<HH", *self.words[number : number + 2]))[0])

    def execute(self, interval_ms: int) -> None:
        """One execution in automatic: E = SV - PV, independent form, D of E behind a backward filter."""
        kc, ki, kd, tf = (self.get(number) for number in (108, 110, 112, 114))
        self.executions += 1
        if self.asked >= self.good:
            kc = f32(kc * self.gain)
        ts = f32((interval_ms if self.is_measured else self.words[106]) / 1000.0)
        pv = self.get(102)
        e = f32(self.get(100) - pv)
        e1, _, d1 = self.last or (e, pv, 0.0)
        p = f32(kc * e)
        i = f32(self.get(126) + f32(f32(ki * e) * ts))
        slope = f32(kd * f32(e - e1))
        d = f32(f32(f32(tf * d1) + slope) / f32(tf + ts)) if tf > 0 else f32(slope / ts)
        raw = f32(p + f32(i + d)) if self.is_alternative else f32(f32(p + i) + d)
        raw = f32(raw + self.get(124))
        mv = min(max(raw, self.get(120)), self.get(118))
        if mv == raw:
            self.put(126, i)
        self.put(128, e)
        self.put(138, pv)
        self.put(200, mv)
        self.last = (e, pv, d)

    def answer(self, asked: bytes) -> bytes:
        """The PDU for a PDU: function 1 and 3, an exception for all else."""
        self.asked += 1
        function, first, count = struct.unpack(">BHH", asked[:5])
        if function == 3 and first + count <= len(self.words):
            return struct.pack(f">BB{count}H", 3, 2 * count, *self.words[first : first + count])
        if function == 1 and first + count <= len(self.bits):
            packed = sum(bit << place for place, bit in enumerate(self.bits[first : first + count]))
            size = (count + 7) // 8
            return bytes([1, size]) + packed.to_bytes(size, "little")
        return bytes([function | 0x80, 2 if function in (1, 3) else 1])

    async def scan(self) -> None:
        """Scan for ever: move the process, execute when CYCLE has elapsed, carry the excess of a late scan."""
        began = time.monotonic()
        elapsed_ms, since_ms, seen_ms, before = CYCLE_MS, CYCLE_MS, 0, began
        while True:
            await asyncio.sleep(SCAN_S * self.chance.uniform(0.7, 1.3))
            now = time.monotonic()
            moved_ms = int((now - began) * 1000) - seen_ms
            seen_ms += moved_ms
            self.level += (self.get(200) * 1.1 + 10.0 - self.level) * (now - before) / 3.0
            before = now
            self.put(102, f32(round((self.level + self.chance.gauss(0, 0.03)) * 184.32) / 184.32))
            elapsed_ms, since_ms = elapsed_ms + moved_ms, since_ms + moved_ms
            if elapsed_ms >= CYCLE_MS:
                self.execute(since_ms)
                since_ms, elapsed_ms = 0, min(elapsed_ms - CYCLE_MS, LATE_MS_MAX)
                self.put(100, 62.0 if self.executions // SV_EVERY % 2 else 50.0)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                transaction, _, length, unit = struct.unpack(">HHHB", await reader.readexactly(7))
                reply = self.answer(await reader.readexactly(length - 1))
                writer.write(struct.pack(">HHHB", transaction, 0, len(reply) + 1, unit) + reply)
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()


async def main() -> None:
    plc: Any = Plc(dict(option.split("=") for option in sys.argv[1:]))
    server = await asyncio.start_server(plc.serve, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)  # noqa: T201
    await plc.scan()


if __name__ == "__main__":
    asyncio.run(main())
