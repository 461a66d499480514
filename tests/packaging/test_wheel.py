"""What is shipped: the wheel holds the four packages whole and works where the sources are not."""

from __future__ import annotations

import configparser
import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("bench", "dashboards", "devices", "protocols")
DATA_SUFFIXES = {".yaml", ".eds", ".dbc", ".j2"}

pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]


def execute(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command apart from this process' Python settings; fail with its output."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "PYTEST"))}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )
    assert done.returncode == 0, f"{command} exited {done.returncode}:\n{done.stdout}{done.stderr}"
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    execute(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of scripts of a fresh environment, outside the project, with the wheel.

    The wheel is installed there; what it depends on is borrowed from the running environment.
    .ci/packaging does the same with a full installation of the locked set.
    """
    home = tmp_path_factory.mktemp("fresh")
    venv.create(home / "env", with_pip=False)
    scripts = home / "env" / "bin"
    pip = ("-m", "pip", "--disable-pip-version-check", "--python", scripts / "python")
    execute(sys.executable, *pip, "install", "--no-deps", "--no-index", "--quiet", wheel, cwd=home)
    (site,) = (home / "env" / "lib").glob("python*/site-packages")
    (site / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return scripts


def test_the_wheel_holds_the_four_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.partition("/")[0] for name in archive.namelist()}

    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)


def test_the_wheel_holds_every_file_of_the_packages(wheel: Path) -> None:
    tree = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc"
    }
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}

    assert held == tree
    assert {Path(name).suffix for name in held} >= DATA_SUFFIXES


def test_every_folder_with_code_is_a_package() -> None:
    folders = {path.parent for package in PACKAGES for path in (ROOT / package).rglob("*.py")}

    assert [str(folder) for folder in folders if not (folder / "__init__.py").exists()] == []


def test_the_wheel_names_command_plugin_and_that_it_is_private(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (entries,) = (name for name in names if name.endswith("entry_points.txt"))
        (metadata,) = (name for name in names if name.endswith("/METADATA"))
        points = configparser.ConfigParser()
        points.read_string(archive.read(entries).decode())
        said = Parser().parsestr(archive.read(metadata).decode())

    assert points["console_scripts"]["compass-bench"] == "bench.cli.main:main"
    assert points["can.interface"]["lockstep"] == "protocols.lockstep:LockstepBus"
    assert "Private :: Do Not Upload" in said.get_all("Classifier", [])
    assert said["Requires-Python"] == ">=3.11"


def test_the_installed_packages_are_the_wheels(installed: Path) -> None:
    code = f"import {', '.join(PACKAGES)}; print(*[p.__file__ for p in ({', '.join(PACKAGES)})])"

    done = execute(installed / "python", "-P", "-c", code, cwd=installed.parent)

    assert all(Path(file).is_relative_to(installed.parent) for file in done.stdout.split())


def test_the_installed_command_answers_and_runs(installed: Path, tmp_path: Path) -> None:
    command = installed / "compass-bench"

    assert "Usage" in execute(command, "--help", cwd=tmp_path).stdout
    execute(command, "run", "set_reset", "--serial", "SN0001", "--out", "runs", cwd=tmp_path)

    record = json.loads((tmp_path / "runs" / "latest" / "record.json").read_text())
    assert record["verdict"]["outcome"] == "PASS"
    assert (tmp_path / "runs" / "latest" / "report.html").stat().st_size > 0
