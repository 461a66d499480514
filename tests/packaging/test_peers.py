"""The peers: pinned, kept out of our own processes, and judged by a fair measure of heading."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.grid_error import grid_field
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = ROOT / "benchmarks"
PINS = sorted((BENCHMARKS / "peers").glob("*.txt"))
WORKER = BENCHMARKS / "peers" / "worker.py"
MODULES = {"mag_cal", "magcal", "magcc", "magyc"}
VERSIONS = {"mag_cal": "1.4.1", "magcal": "1.0.1", "magcc": "0.1.1", "magyc": "1.0.0"}
PIN = re.compile(r"^([a-z0-9][a-z0-9._-]*)==(\S+)( ; [^\\]+)? \\$")
HASH = re.compile(r"^ {4}--hash=sha256:[0-9a-f]{64}( \\)?$")


@pytest.fixture(scope="module")
def peers() -> Iterator[SimpleNamespace]:
    """Return the benchmark's own modules, which stand beside it and in no package."""
    names = ("peers", "peer_cells", "peer_errors", "peer_processes", "estimators")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield SimpleNamespace(**{name: importlib.import_module(name) for name in names})


@pytest.fixture(scope="module")
def unit(peers: SimpleNamespace) -> Any:
    return peers.estimators.drawn_unit(np.random.default_rng(3))


# ---- pins and processes ----------------------------------------------------------------------


def test_there_is_a_file_of_pins_for_each_package(peers: SimpleNamespace) -> None:
    packages = [peer for peer in peers.peer_processes.PEERS if peer.distribution]

    assert {path.stem for path in PINS} == MODULES == {peer.name for peer in packages}
    assert {peer.name: peer.version for peer in packages} == VERSIONS


@pytest.mark.parametrize("path", PINS, ids=lambda path: path.stem)
def test_a_file_holds_pins_with_hashes_and_nothing_else(path: Path) -> None:
    lines = path.read_text().splitlines()

    assert [line for line in lines if not (PIN.match(line) or HASH.match(line))] == []
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if PIN.match(line):
            assert HASH.match(following), line


def imported(path: Path) -> set[str]:
    """Return the top names that a module imports, by statement or by a constant name."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module or "")
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = ast.unparse(node.func)
            if called.endswith(("import_module", "__import__")):
                names.add(str(node.args[0].value))
    return {name.partition(".")[0] for name in names}


def test_nothing_of_ours_imports_a_peer_but_the_worker_in_the_peers_own_python() -> None:
    rooms = ("protocols", "devices", "bench", "dashboards", "benchmarks", "tests")
    files = [path for room in rooms for path in (ROOT / room).rglob("*.py")]

    assert len(files) > 100
    assert [path for path in files if path != WORKER and imported(path) & MODULES] == []
    assert imported(WORKER) >= MODULES
    assert not imported(WORKER) & {"bench", "protocols", "devices", "dashboards"}


def test_no_peer_is_among_what_the_project_installs() -> None:
    declared = (ROOT / "pyproject.toml").read_text()
    declared += "".join(path.read_text() for path in ROOT.glob("requirements*"))

    for name in ("mag-cal", "mag_cal", "magcal", "magcc", "magyc"):
        assert name not in declared


def test_a_peer_whose_environment_is_missing_says_so(
    peers: SimpleNamespace, tmp_path: Path
) -> None:
    readings = {"sets": []}

    reason = peers.peer_processes.fitted_by(
        peers.peer_processes.PEERS[0], readings, folder=tmp_path
    )

    assert "does not start" in reason


def test_the_worker_gives_coefficients_and_marks_units_that_have_none(
    peers: SimpleNamespace, unit: Any
) -> None:
    turned = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    field_mg = np.stack([turned * [400.0, 500.0, 600.0] + [30.0, -20.0, 10.0], np.ones((6, 3))])
    min_max = next(peer for peer in peers.peer_processes.PEERS if not peer.distribution)
    readings = SimpleNamespace(field_mg=field_mg)
    one = peers.peer_cells.one_set("one", readings, 0.5, passes=2, limit_s=np.inf)

    found = peers.peer_processes.fitted_by(
        min_max, {"sets": ["one"], "station_mg": np.array([211.0, 0.0, 453.0]), **one}
    )
    outcome = peers.peer_errors.peer_outcome(unit, found, "one")

    assert found["one_offset_mg"][0] == pytest.approx([30.0, -20.0, 10.0])
    assert found["one_matrix"][0] == pytest.approx(np.diag([1 / 400, 1 / 500, 1 / 600]))
    assert outcome.nothing.tolist() == [False, True]
    assert len(found["one_seconds"]) == 2


# ---- the measure -----------------------------------------------------------------------------


def rotation(axis: list[float], angle_deg: float) -> Any:
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle_rad = np.deg2rad(angle_deg)
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


def rms_deg(peers: SimpleNamespace, unit: Any, matrix: Any, offset_mg: Any, removed: bool) -> float:
    errors = peers.peer_errors
    corrected = errors.corrected_on_grid(
        unit, matrix[None], offset_mg[None], rotation_removed=removed
    )
    force_g = -ned_from_body(*errors.grid_deg().T)[:, 2]
    return float(errors.heading_rms_deg(corrected, force_g)[0])


@pytest.mark.parametrize("angle_deg", [0.5, 30.0, 170.0])
def test_a_known_rotation_is_removed_whatever_its_scale(
    peers: SimpleNamespace, unit: Any, angle_deg: float
) -> None:
    turned = 0.02 * rotation([0.3, -0.5, 1.0], angle_deg) @ np.linalg.inv(unit.gain)

    assert rms_deg(peers, unit, turned, unit.offset_mg, removed=True) < 1e-9
    assert rms_deg(peers, unit, turned, unit.offset_mg, removed=False) > 0.5 * angle_deg


def test_a_mirror_image_is_no_rotation_and_stays(peers: SimpleNamespace, unit: Any) -> None:
    mirrored = -np.linalg.inv(unit.gain)

    assert rms_deg(peers, unit, mirrored, unit.offset_mg, removed=True) > 45.0


def test_hard_iron_left_over_costs_what_its_derivative_says(
    peers: SimpleNamespace, unit: Any
) -> None:
    left_mg = np.array([0.3, -0.2, 0.1])
    axes = ned_from_body(*peers.peer_errors.grid_deg().T)
    sine = np.sin(np.deg2rad(peers.estimators.DIP_DEG))
    gradient = grid_field(axes, np.asarray(peers.estimators.STRENGTH_MG), np.asarray(sine))[1]
    wanted_deg = float(np.sqrt(((gradient @ left_mg) ** 2).mean()))
    matrix = np.linalg.inv(unit.gain)

    found_deg = rms_deg(peers, unit, matrix, unit.offset_mg - unit.gain @ left_mg, removed=True)

    assert found_deg == pytest.approx(wanted_deg, rel=0.01)


def cell_of(peers: SimpleNamespace, **errors_deg: list[float]) -> Any:
    outcomes = {
        name: peers.peer_errors.Outcome(
            rms_deg=np.array(values), refused=np.zeros(len(values), dtype=bool), seconds=1e-3
        )
        for name, values in errors_deg.items()
    }
    bound = SimpleNamespace(rms_deg=np.array(0.5), worst_deg=np.array(1.0))
    return peers.peer_cells.Cell(
        key=peers.peer_cells.CellKey(180.0, 36, 0.001),
        readings=None,
        bounds={"ellipsoid": bound},
        outcomes=outcomes,
    )


def test_estimators_are_compared_on_the_trials_that_both_have_fitted(
    peers: SimpleNamespace,
) -> None:
    cell = cell_of(peers, ellipsoid=[0.6, 9.0, 0.8, 7.0], magcc=[0.3, np.nan, 0.4])

    assert cell.loss("magcc") == pytest.approx(2.0)
    assert cell.ratio("magcc") == pytest.approx(np.sqrt(0.125) / 0.5)


def test_wrong_is_what_is_far_off_with_a_result(peers: SimpleNamespace) -> None:
    cell = cell_of(peers, magcc=[0.4, 1.9, 2.1, np.nan], ellipsoid=[0.1])

    assert cell.wrong("magcc", bounds=3.0) == 0.25
    assert cell.wrong("magcc", bounds=5.0) == 0.0


def test_a_trial_that_only_one_of_the_two_ellipsoids_refuses_is_counted(
    peers: SimpleNamespace,
) -> None:
    cell = cell_of(peers, ellipsoid=[0.5] * 4, coefficients=[0.5] * 4, mag_cal=[0.5] * 4)
    assert peers.peers._alike([cell]).met is True

    cell.outcomes["coefficients"].refused[2] = True

    assert peers.peers._alike([cell]).figure == 0.25
    assert peers.peers._alike([cell]).met is False


def test_coefficients_that_are_worse_than_a_peers_are_not_met(peers: SimpleNamespace) -> None:
    cell = cell_of(peers, ellipsoid=[0.5, 0.5], coefficients=[0.6, 0.6], mag_cal=[0.5, 0.5])

    loss = peers.peers._accuracy([cell])[0]

    assert loss.met is False
    assert loss.figure == pytest.approx(1.2)
    assert loss.where.startswith("coefficients, mag_cal")


def test_a_missing_peer_is_not_measured_and_a_slow_product_is_not_met(
    peers: SimpleNamespace,
) -> None:
    module = peers.peers
    cell = cell_of(peers, ellipsoid=[0.5, 0.5], mag_cal=[0.5, 0.5])
    seconds = importlib.import_module("peer_times").Seconds
    times = dict.fromkeys(("coefficients", "ellipsoid", "truth_linear"), seconds(1e-3, 1e-4))
    times["mag_cal"] = seconds(3e-4, 3e-4)

    verdicts = module.verdicts_of([cell], {cell.key: times})

    assert [verdict.met for verdict in verdicts[:3]] == [True, True, False]
    assert verdicts[2].figure == pytest.approx(1e-3 / 3e-4)
    assert {verdict.met for verdict in verdicts if "magcc" in verdict.asked} == {None}
    assert module.enough(["mag_cal", "magcal", "magyc"])
    assert not module.enough(["mag_cal", "magcc", "magyc", "min_max"])
