"""Procedures by name or path, and the JSON Schema that editors complete them by."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from bench.limit_set import LimitsFile
from bench.procedure import Procedure
from bench.shipped import find_file, shipped_names
from bench.station_file import StationFile
from bench.typed_yaml import FileModel, load_model

_MODELS: Final[dict[str, type[FileModel]]] = {
    "procedure": Procedure,
    "limits": LimitsFile,
    "station": StationFile,
}
_FOLDERS = {"procedure": "procedures", "limits": "limits", "station": "stations"}


def procedure_names() -> list[str]:
    """Return the names of the shipped procedures."""
    return shipped_names("procedures")


def procedure_path(name: str) -> Path:
    """Return the file of a procedure.

    Raises
    ------
    ConfigError
        If there is none; the sentence suggests the nearest name.
    """
    return find_file("procedures", name)


def load_procedure(name: str) -> Procedure:
    """Return a shipped procedure (by name) or any file's (by path).

    Raises
    ------
    ConfigError
        One sentence with file, line and column if it cannot be used.
    """
    return load_model(procedure_path(name), Procedure)


def schema_names() -> list[str]:
    """Return the kinds of file that have a schema."""
    return list(_MODELS)


def schema_text(kind: str = "procedure") -> str:
    """Return the JSON Schema as the shipped ``<kind>.schema.json`` has it."""
    return json.dumps(json_schema(kind), indent=1, sort_keys=True) + "\n"


def json_schema(kind: str = "procedure") -> dict[str, Any]:
    """Return the JSON Schema of a kind of file: procedure, limits or station."""
    schema = _MODELS[kind].model_json_schema()
    return {"$schema": "http://json-schema.org/draft-07/schema#", **schema}


def write_schemas() -> None:
    """Write the schema of each kind of file beside the shipped ones."""
    for kind in _MODELS:
        folder = Path(__file__).parent / _FOLDERS[kind]
        (folder / f"{kind}.schema.json").write_text(schema_text(kind), encoding="utf-8")


if __name__ == "__main__":
    write_schemas()
