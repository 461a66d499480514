"""The locked sets name versions and hashes, and neither addresses nor anyone's machine."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LOCKS = ("requirements.txt", "requirements-dev.txt")
PIN = re.compile(r"^([a-z0-9][a-z0-9._-]*)==(\S+)( ; [^\\]+)? \\$")
HASH = re.compile(r"^ {4}--hash=sha256:[0-9a-f]{64}( \\)?$")


def normalised(requirement: str) -> str:
    name = re.split(r"[\s\[<>=!~;]", requirement.strip(), maxsplit=1)[0]
    return re.sub(r"[-_.]+", "-", name).lower()


def locked(name: str) -> set[str]:
    lines = (ROOT / name).read_text().splitlines()
    return {match[1] for line in lines if (match := PIN.match(line))}


def wanted(name: str) -> set[str]:
    lines = (ROOT / name).read_text().splitlines()
    return {normalised(line) for line in lines if line and line[0] not in "#-"}


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_holds_pins_with_hashes_and_nothing_else(name: str) -> None:
    strange = [
        line
        for line in (ROOT / name).read_text().splitlines()
        if not (PIN.match(line) or HASH.match(line))
    ]

    assert strange == []


@pytest.mark.parametrize("name", LOCKS)
def test_each_pin_has_a_hash(name: str) -> None:
    lines = (ROOT / name).read_text().splitlines()

    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if PIN.match(line):
            assert HASH.match(following), line


def test_all_that_is_wanted_is_locked() -> None:
    assert wanted("requirements.in") <= locked("requirements.txt")
    assert wanted("requirements-dev.in") <= locked("requirements-dev.txt")


def test_all_that_the_project_declares_is_locked_at_run_time() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

    assert {normalised(text) for text in project["dependencies"]} <= locked("requirements.txt")
    assert {"hatchling", "editables"} <= locked("requirements.txt")
