"""Bases of what stands in record.json: numbers are finite, and a section is closed or open."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class StrictSection(BaseModel):
    """A section or entry with no keys but its own."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)


class OpenSection(BaseModel):
    """A section to which a bench may add its own entries."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
