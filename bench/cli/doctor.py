"""`compass-bench doctor`: whether this machine and this installation are fit to test units."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json as json_module
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import typer

from bench.errors import BenchError
from bench.software import OWN_NAMES, shared_names
from protocols.errors import ProtocolError

_PACKAGES: Final = ("python-can", "numpy", "scipy", "rerun-sdk", "canopen", "can-isotp", "udsoncan")
_FREE_BYTES: Final = 500_000_000


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was looked at."""

    name: str
    ok: bool
    found: str
    required: str
    fix: str = ""
    needed: bool = True


def examine(*, json: bool) -> int:
    """Print every check; return 1 if one that is needed failed."""
    checks = [_made(check) for check in _CHECKS]
    if json:
        typer.echo(json_module.dumps([asdict(check) for check in checks], indent=2))
    else:
        for check in checks:
            mark = "ok  " if check.ok else ("FAIL" if check.needed else "note")
            typer.echo(f"{mark} {check.name:<18} {check.found}")
            if not check.ok:
                typer.echo(f"     needs {check.required}; {check.fix}")
    return int(any(not check.ok and check.needed for check in checks))


def _made(check: Callable[[], Check]) -> Check:
    """Return a check; one that cannot be made has failed and says why."""
    try:
        return check()
    except (BenchError, ProtocolError, ImportError) as error:
        name = check.__name__.strip("_").replace("_", " ")
        return Check(
            name,
            ok=False,
            found=str(error),
            required="to be examined",
            fix="reinstall compass-bench",
        )


def _python() -> Check:
    found = ".".join(map(str, sys.version_info[:3]))
    return Check(
        "python", sys.version_info >= (3, 11), found, "3.11 or newer", "install a newer Python"
    )


def _packages() -> Check:
    missing = []
    versions = []
    for name in _PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    found = f"missing: {', '.join(missing)}" if missing else ", ".join(versions)
    return Check(
        "packages", not missing, found, ", ".join(_PACKAGES), "run `make run` or install the wheel"
    )


def _names() -> Check:
    shared = shared_names()
    found = f"shared: {shared}" if shared else f"each of {', '.join(OWN_NAMES)} is ours"
    fix = "install compass-bench into an environment of its own"
    return Check("package names", not shared, found, "one owner for each", fix)


def _procedures() -> Check:
    from bench.procedure_loader import load_procedure, procedure_names

    names = procedure_names()
    for name in names:
        load_procedure(name)
    return Check("procedures", bool(names), ", ".join(names), "all load", "reinstall compass-bench")


def _socketcan() -> Check:
    classes = Path("/sys/class/net")
    names = sorted(
        entry.name
        for entry in (classes.iterdir() if classes.exists() else ())
        if (entry / "type").exists() and (entry / "type").read_text().strip() == "280"
    )
    found = ", ".join(names) or "none: only virtual buses and adapters with drivers of their own"
    fix = (
        "for real SocketCAN: `modprobe vcan && ip link add vcan0 type vcan && ip link set vcan0 up`"
    )
    return Check("socketcan", bool(names), found, "a CAN network interface", fix, needed=False)


def _bus() -> Check:
    from bench.cli.loopback import answer_of_virtual_module

    serial = "SN0001"
    answer = answer_of_virtual_module(serial)
    return Check(
        "bus",
        answer == serial,
        f"virtual module answered {answer!r} over UDS",
        serial,
        "reinstall compass-bench",
    )


def _disk() -> Check:
    free = shutil.disk_usage(Path.cwd()).free
    ok = free > _FREE_BYTES and os.access(Path.cwd(), os.W_OK)
    fix = "name another folder with --out"
    return Check(
        "disk", ok, f"{free / 1e9:.1f} GB free in {Path.cwd().name}", "0.5 GB, writable", fix
    )


def _viewer() -> Check:
    found = importlib.util.find_spec("rerun_cli") is not None
    text = "rerun viewer is installed" if found else "no rerun viewer"
    return Check(
        "viewer", found, text, "rerun-sdk", "install rerun-sdk to open recordings", needed=False
    )


_CHECKS: Final[tuple[Callable[[], Check], ...]] = (
    _python,
    _packages,
    _names,
    _procedures,
    _bus,
    _socketcan,
    _disk,
    _viewer,
)
