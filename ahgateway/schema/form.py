"""What every table of a file is: strict, closed, and not changed after reading."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Form(BaseModel):
    """A table: no key beyond its own, no conversion of types, nothing changed after reading."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)
