"""Options that several commands share, in python-can's words for the bus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Interface = Annotated[
    str | None,
    typer.Option(
        "--interface",
        "-i",
        help="python-can interface: lockstep (default, virtual devices in this process), "
        "udp_multicast, socketcan, slcan, pcan, kvaser, vector, ...",
    ),
]
Channel = Annotated[
    str | None,
    typer.Option(
        "--channel", "-c", help="Channel of the interface; names a bus with other devices on it."
    ),
]
Bitrate = Annotated[int, typer.Option("--bitrate", "-b", min=10_000, max=1_000_000, help="Bit/s.")]
RigInterface = Annotated[
    str | None, typer.Option(help="Interface of the rig, where it has a bus of its own.")
]
RigChannel = Annotated[
    str | None, typer.Option(help="Channel of the rig, where it has a bus of its own.")
]
Serial = Annotated[
    str | None, typer.Option("--serial", help="Serial number scanned from the unit.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the virtual devices.")]
Part = Annotated[
    str,
    typer.Option("--part", help="Part number of the virtual unit: CB-AMR3 (three axes), CB-AMR2."),
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault", help="Inject NAME[=strength][@tick] into the virtual devices; repeatable."
    ),
]
Nvm = Annotated[
    Path | None, typer.Option("--nvm", help="File that keeps the virtual module's coefficients.")
]
Replay = Annotated[
    Path | None,
    typer.Option("--replay", help="Feed the virtual module from a recording of `import`."),
]
Site = Annotated[
    Path | None, typer.Option("--site", help="Station file instead of the default one.")
]
Limits = Annotated[
    Path | None, typer.Option("--limits", help="Limits file instead of the procedure's.")
]
Realtime = Annotated[
    bool, typer.Option("--realtime", help="Hold the simulated clock to the wall clock.")
]
NoInput = Annotated[bool, typer.Option("--no-input", help="Never ask; a prompt is an error.")]
Dashboard = Annotated[
    bool, typer.Option("--dashboard/--no-dashboard", help="Write run.rrd at the end.")
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
Out = Annotated[Path, typer.Option("--out", help="Folder for the records of runs.")]
FieldUnit = Annotated[
    str | None, typer.Option("--unit", help="Unit of the magnetometer: G, mG, uT, nT or counts.")
]
