"""Peers in environments and processes of their own: made from pins, spoken to through files.

Nothing of a peer is ever imported here: its readings and results are .npz files, and
benchmarks/peers/worker.py runs in the Python of the peer's environment.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

ROOT: Final = Path(__file__).resolve().parents[1]
PINS: Final = Path(__file__).resolve().parent / "peers"
WORKER: Final = PINS / "worker.py"
ENVIRONMENTS: Final = ROOT / "build" / "peers"
INSTALL_LIMIT_S: Final = 900.0
RUN_LIMIT_S: Final = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A program to compare with.

    Attributes
    ----------
    name : str
        Of the worker's estimate, the file of pins and the environment.
    distribution : str
        Package; '' for a formula that needs none and runs in our own environment.
    call, licence : str
    """

    name: str
    distribution: str
    call: str
    licence: str

    @property
    def pins(self) -> Path:
        """File of the pinned versions."""
        return PINS / f"{self.name}.txt"

    @property
    def version(self) -> str:
        """Pinned version; '' for a formula."""
        if not self.distribution:
            return ""
        pin = re.search(rf"^{re.escape(self.distribution)}==(\S+)", self.pins.read_text(), re.M)
        if pin is None:
            message = f"{self.pins.name} must pin {self.distribution}; instead it does not"
            raise ValueError(message)
        return pin[1]


PEERS: Final = (
    Peer(
        name="mag_cal",
        distribution="circuitpython-mag-cal",
        call="Sensor().fit_ellipsoid",
        licence="MIT",
    ),
    Peer(
        name="magcal",
        distribution="magcal",
        call="MagnetometerCalibrator().ellipsoid_fit",
        licence="MIT",
    ),
    Peer(name="magcc", distribution="magcc", call="calibrate_lm", licence="GPL-3.0"),
    Peer(name="magyc", distribution="magyc", call="twostep_hsi", licence="MIT"),
    Peer(name="min_max", distribution="", call="extremes of three axes", licence=""),
)


def prepared(peer: Peer, folder: Path = ENVIRONMENTS) -> str:
    """Make the peer's environment where it is not complete; return why it cannot be, or ''."""
    if not peer.distribution:
        return ""
    home = folder / peer.name
    stamp, wanted = home / "installed", f"{sys.version}\n{_digest(peer.pins)}\n"
    if stamp.exists() and stamp.read_text() == wanted and python_of(peer, folder).exists():
        return ""
    print(f"making {home.relative_to(ROOT) if home.is_relative_to(ROOT) else home}", flush=True)
    stamp.unlink(missing_ok=True)
    base = [sys.executable, "-m", "venv", "--clear", str(home)]
    pip = [str(python_of(peer, folder)), "-m", "pip", "--disable-pip-version-check", "--no-input"]
    pip += ["install", "--quiet", "--no-deps", "--require-hashes", "--prefer-binary", "-r"]
    for command in (base, [*pip, str(peer.pins)]):
        reason = _failure(command, INSTALL_LIMIT_S)
        if reason:
            return reason
    stamp.write_text(wanted)
    return ""


def python_of(peer: Peer, folder: Path = ENVIRONMENTS) -> Path:
    """Return the Python that runs a peer."""
    return folder / peer.name / "bin" / "python" if peer.distribution else Path(sys.executable)


def fitted_by(
    peer: Peer, readings: Mapping[str, Any], folder: Path = ENVIRONMENTS
) -> dict[str, NDArray[Any]] | str:
    """Return what the worker writes for the readings, or why the peer did not run.

    Parameters
    ----------
    peer : Peer
    readings : mapping
        What worker.py reads.
    folder : Path
        Of the environments.
    """
    with TemporaryDirectory() as scratch:
        np.savez(Path(scratch) / "readings.npz", **readings)
        command = [str(python_of(peer, folder)), "-I", str(WORKER), peer.name]
        reason = _failure([*command, "readings.npz", "results.npz"], RUN_LIMIT_S, Path(scratch))
        if reason:
            return reason
        with np.load(Path(scratch) / "results.npz") as results:
            return dict(results)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _failure(command: list[str], limit_s: float, folder: Path | None = None) -> str:
    """Run a command on one core; return its last complaint where it fails."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    quiet = {"MPLBACKEND": "Agg"} | ({"MPLCONFIGDIR": str(folder)} if folder else {})
    environment = {**os.environ, **threads, **quiet}
    try:
        run = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=limit_s,
        )
    except subprocess.TimeoutExpired:
        return f"not done after {limit_s:.0f} s"
    except OSError as error:
        return f"{command[0]} does not start: {error.strerror}"
    if run.returncode == 0:
        return ""
    said = [line for line in run.stderr.splitlines() if line.strip()]
    errors = [line for line in said if line.startswith("ERROR")] or said
    return errors[-1] if errors else f"exit code {run.returncode}"
