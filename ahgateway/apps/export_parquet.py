"""One loop of a recording as Parquet: typed columns, REALs bit for bit, units in each field's metadata."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ahgateway.apps.export import VERDICT, about
from ahgateway.codec.station import Loop
from ahgateway.core.operands import Kind
from ahgateway.recording.reader import Recording
from ahgateway.recording.values import Field, Part, fields, parts

TYPES = {Kind.BOOL: pa.bool_(), Kind.REAL: pa.float32(), Kind.DINT: pa.int32(), Kind.INT: pa.int16()}


def write_parquet(recording: Recording, loop: Loop, path: Path) -> None:
    """Write one loop; about a minute of rows in each row group."""
    columns = fields(loop)
    schema = pa.schema(
        [
            pa.field("time", pa.timestamp("ns", tz="UTC")),
            pa.field("tick", pa.int64()),
            pa.field("running", pa.bool_()),
            *(
                pa.field(each.name, _type(each), metadata={"unit": each.unit} if each.unit else None)
                for each in columns
            ),
            *(pa.field(name, pa.string()) for name in VERDICT),
        ],
        metadata=about(recording, loop),
    )
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for part in parts(recording, loop):
            writer.write_table(pa.table(_columns(part, columns), schema=schema))


def _type(field: Field) -> Any:
    return pa.list_(pa.uint16(), field.length) if field.kind is Kind.BLOCK else TYPES[field.kind]


def _columns(part: Part, columns: list[Field]) -> list[Any]:
    found: list[Any] = [
        pa.array(part.utc_ns, pa.timestamp("ns", tz="UTC")),
        pa.array(part.ticks),
        pa.array(part.running, pa.bool_()),
    ]
    for field in columns:
        values = part.values[field.name]
        if field.kind is Kind.BLOCK:
            flat = pa.array(np.ascontiguousarray(values).ravel(), pa.uint16())
            found.append(pa.FixedSizeListArray.from_arrays(flat, field.length))
        else:
            found.append(pa.array(values, TYPES[field.kind]))
    found += [pa.array([each.get(key) if each else None for each in part.verdicts], pa.string()) for key in VERDICT]
    return found
