"""A recording as MCAP: one channel per loop, JSON messages with a JSON schema, as Foxglove and PlotJuggler read them.

JSON has no NaN: a REAL that is no finite number becomes the text NaN, Infinity or -Infinity.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from ahgateway.apps.export import VERDICT, about
from ahgateway.apps.report import number
from ahgateway.codec.station import Loop
from ahgateway.core.operands import Kind
from ahgateway.recording.reader import Recording
from ahgateway.recording.values import Field, Part, fields, parts

JSON_TYPES = {Kind.BOOL: "boolean", Kind.REAL: "number", Kind.DINT: "integer", Kind.INT: "integer"}


def write_mcap(recording: Recording, loops: list[Loop], path: Path) -> None:
    """Write all loops into one file; messages stand loop by loop, readers sort them by time."""
    with path.open("wb") as handle:
        writer = Writer(handle)
        writer.start(profile="", library="ahgateway")
        for loop in loops:
            columns = fields(loop)
            schema = writer.register_schema(loop.controller.name, "jsonschema", _schema(columns))
            channel = writer.register_channel(f"/{loop.name}", "json", schema, about(recording, loop))
            for part in parts(recording, loop):
                _messages(writer, channel, part, columns)
        writer.finish()  # type: ignore[no-untyped-call]


def _messages(writer: Writer, channel: int, part: Part, columns: list[Field]) -> None:
    for at, (tick, utc_ns) in enumerate(zip(part.ticks.tolist(), part.utc_ns.tolist(), strict=True)):
        found: dict[str, Any] = {"tick": tick, "running": part.running[at]}
        for field in columns:
            value = part.values[field.name][at]
            found[field.name] = number(value) if field.kind is Kind.REAL else value.tolist()
        verdict = part.verdicts[at]
        found |= {key: verdict.get(key) if verdict else None for key in VERDICT}
        data = json.dumps(found, ensure_ascii=False).encode("utf-8")
        writer.add_message(channel, log_time=utc_ns, publish_time=utc_ns, sequence=tick & 0xFFFFFFFF, data=data)


def _schema(columns: list[Field]) -> bytes:
    properties: dict[str, Any] = {"tick": {"type": "integer"}, "running": {"type": ["boolean", "null"]}}
    for field in columns:
        if field.kind is Kind.BLOCK:
            properties[field.name] = {"type": "array", "items": {"type": "integer"}}
        else:
            properties[field.name] = {"type": JSON_TYPES[field.kind], "description": field.unit}
    properties |= {key: {"type": ["string", "null"]} for key in VERDICT}
    return json.dumps({"type": "object", "properties": properties}, ensure_ascii=False).encode("utf-8")
