"""What software measured and judged, and copies of the files that it used."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
from pathlib import Path
from typing import TYPE_CHECKING, Final

from bench.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

PACKAGES: Final = ("python-can", "numpy", "scipy", "canopen", "can-isotp", "udsoncan", "rerun-sdk")
OWN_NAMES: Final = ("bench", "devices", "protocols", "dashboards")
_FOLDERS: Final = ("bench", "protocols")


@functools.cache
def shared_names() -> dict[str, list[str]]:
    """Return those of our package names that another distribution installs too, with all owners.

    An editable installation owns no names, and so shares none.
    """
    owners = importlib.metadata.packages_distributions()
    return {name: owners[name] for name in OWN_NAMES if len(set(owners.get(name, []))) > 1}


def require_own_names() -> None:
    """Refuse to test units with code that may be another distribution's (docs/decisions/0001).

    Raises
    ------
    ConfigError
        If a package name is shared.
    """
    for name, owners in shared_names().items():
        message = (
            f"package {name} must be compass-bench's alone; instead {' and '.join(owners)} install "
            "it: install compass-bench into an environment of its own"
        )
        raise ConfigError(message)


def software_section() -> dict[str, object]:
    """Return version, Python, packages and a hash of the bench's own code, for the record."""
    try:
        version = importlib.metadata.version("compass-bench")
    except importlib.metadata.PackageNotFoundError:
        version = "not installed"
    return {
        "version": version,
        "python": platform.python_version(),
        "packages": {name: importlib.metadata.version(name) for name in PACKAGES},
        "sha256": code_sha256(),
    }


def code_sha256() -> str:
    """Return the SHA-256 over all files of bench and protocols, in order of their paths."""
    digest = hashlib.sha256()
    root = Path(__file__).parent.parent
    for folder in _FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(root).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def config_files(files: Mapping[str, Path], folder: Path) -> dict[str, str]:
    """Copy files into the run's folder and return ``<name>_sha256`` of each."""
    folder.mkdir(exist_ok=True)
    hashes = {}
    for name, path in files.items():
        content = path.read_bytes()
        (folder / f"{name}{path.suffix}").write_bytes(content)
        hashes[f"{name}_sha256"] = hashlib.sha256(content).hexdigest()
    return hashes
