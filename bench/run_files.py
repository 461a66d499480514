"""The files that a run is held against: procedure, limits and station, checked together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.errors import ConfigError
from bench.limit_set import load_limits
from bench.plan import plan_of
from bench.procedure_loader import load_procedure, procedure_path
from bench.station import check_model_gate, load_station

if TYPE_CHECKING:
    from pathlib import Path

    from bench.limit_set import LimitSet
    from bench.plan import Plan
    from bench.procedure import Procedure
    from bench.station import Station


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFiles:
    """Procedure, limits and station of a run, and the plan that follows."""

    procedure: Procedure
    limits: LimitSet
    station: Station
    plan: Plan


def load_run_files(
    procedure: str, *, site: Path | None = None, limits: Path | None = None
) -> RunFiles:
    """Return the files of a run, as `run` and `plan` use them alike.

    Parameters
    ----------
    procedure : str
        Name of a shipped procedure or path of one.
    site, limits : Path or None
        Files in the place of those that the procedure names.

    Raises
    ------
    ConfigError
        If a file cannot be used, a limit is missing, the station is not the World Magnetic
        Model's, or a pose cannot be reached.
    """
    loaded = load_procedure(procedure)
    beside = procedure_path(procedure).parent
    chosen = load_limits(str(limits)) if limits else load_limits(loaded.limits, beside=beside)
    station = load_station(str(site)) if site else load_station(loaded.station, beside=beside)
    _check_site(station)
    chosen.require(loaded.measured())
    plan = plan_of(loaded, with_reference=station.reference is not None)
    return RunFiles(procedure=loaded, limits=chosen, station=station, plan=plan)


def _check_site(station: Station) -> None:
    """Hold the station's field against the World Magnetic Model, where it names its place."""
    gate = station.model_gate
    if gate is None:
        return
    from bench.calibration.geomagnetic import decimal_year, earth_field

    try:
        year = decimal_year(gate.date)
        model = earth_field(gate.latitude, gate.longitude, gate.altitude / 1000.0, year)
    except ValueError as error:
        message = f"{station.path}: model_gate cannot be used: {error}"
        raise ConfigError(message) from error
    check_model_gate(station, model.horizontal_mg, model.dip_deg)
