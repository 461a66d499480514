from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import pytest

from bench import software
from bench.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def owners(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, list[str]]]:
    found: dict[str, list[str]] = {"bench": ["compass-bench"]}
    monkeypatch.setattr(software.importlib.metadata, "packages_distributions", lambda: found)
    software.shared_names.cache_clear()
    yield found
    software.shared_names.cache_clear()


def test_names_of_our_own_are_no_obstacle(owners: dict[str, list[str]]) -> None:
    assert software.shared_names() == {}
    software.require_own_names()


def test_name_that_another_distribution_installs_is_refused(owners: dict[str, list[str]]) -> None:
    owners["devices"] = ["compass-bench", "other"]

    with pytest.raises(ConfigError, match="package devices .* compass-bench and other install it"):
        software.require_own_names()


def test_files_are_copied_and_named_by_their_hash(tmp_path: Path) -> None:
    source = tmp_path / "my limits.yaml"
    source.write_text("id: x\n")

    hashes = software.config_files({"limits": source}, tmp_path / "config")

    assert hashes == {"limits_sha256": hashlib.sha256(b"id: x\n").hexdigest()}
    assert (tmp_path / "config" / "limits.yaml").read_text() == "id: x\n"


def test_hash_of_the_code_stays_while_the_code_does() -> None:
    assert software.code_sha256() == software.code_sha256()


def test_section_names_every_package_with_its_version() -> None:
    section = software.software_section()

    assert set(section["packages"]) == set(software.PACKAGES)  # type: ignore[call-overload]
    assert len(str(section["sha256"])) == 64
