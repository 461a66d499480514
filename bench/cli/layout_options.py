"""Options of `import`: how a foreign recording is laid out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Preset = Annotated[str | None, typer.Option(help="Known format; `list` names them.")]
Accelerometer = Annotated[
    Path | None, typer.Option("--accel", help="Second file with the accelerometer.")
]
Columns = Annotated[
    str | None, typer.Option(help="Names of the columns of a file without a header, in order.")
]
AccelColumns = Annotated[str | None, typer.Option(help="As --columns, of the file of --accel.")]
Field = Annotated[str | None, typer.Option(help="Columns of the magnetometer's x, y, z.")]
Accel = Annotated[
    str | None, typer.Option("--accel-field", help="Columns of the accelerometer's x, y, z.")
]
Quaternion = Annotated[
    str | None, typer.Option(help="Columns w, x, y, z of the rotation from the sensor to ENU.")
]
AccelUnit = Annotated[str | None, typer.Option(help="g, mg, m/s2 or counts.")]
MgPerCount = Annotated[float | None, typer.Option(min=0.0, help="Size of a count, mG.")]
GPerCount = Annotated[float | None, typer.Option(min=0.0, help="Size of a count, g.")]
FieldAxes = Annotated[
    str | None,
    typer.Option("--axes", help="The sensor's axes along forward, right, down, as x,-y,-z."),
]
AccelAxes = Annotated[str | None, typer.Option(help="As --axes, of the accelerometer.")]
Time = Annotated[str | None, typer.Option(help="Column of the time in s.")]
Rate = Annotated[
    float | None, typer.Option("--rate", min=0.001, help="Rate without a time column, Hz.")
]
SkipLines = Annotated[
    int | None, typer.Option("--skip-rows", min=0, help="Lines before the data or its header.")
]
Delimiter = Annotated[str | None, typer.Option(help="Separator; found by itself without.")]
Resample = Annotated[
    str | None, typer.Option(help="Second file onto the first: linear or nearest.")
]
