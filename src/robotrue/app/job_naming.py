"""What every job may be given: name and note of what it leaves."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field


class Naming(BaseModel):
    """What every job may be given for what it leaves."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    name: Annotated[str | None, Field(description="Name of what the job leaves.")] = None
    note: Annotated[str, Field(description="Note on what the job leaves.")] = ""


NAMED: Final = tuple(Naming.model_fields)
"""Parameters of every job."""
