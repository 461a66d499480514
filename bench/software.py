"""What software measured and judged, and copies of the files that it used."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping

PACKAGES: Final = ("python-can", "numpy", "scipy", "canopen", "can-isotp", "udsoncan", "rerun-sdk")
_FOLDERS: Final = ("bench", "protocols")


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
