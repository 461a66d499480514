"""`schema` and `faults`: what a user may write, from the product itself."""

from __future__ import annotations

import json as json_module
from dataclasses import asdict

import typer

from bench.procedure_loader import json_schema
from devices.faults import FAULTS


def print_schema() -> int:
    """Print the JSON Schema of procedure files."""
    typer.echo(json_module.dumps(json_schema("procedure"), indent=2))
    return 0


def print_faults(*, json: bool) -> int:
    """Print name, kind and effect of every fault."""
    if json:
        typer.echo(json_module.dumps([asdict(fault) for fault in FAULTS.values()], indent=2))
        return 0
    for fault in FAULTS.values():
        typer.echo(f"{fault.name:<24} {fault.kind:<12} {fault.breaks}")
    return 0
