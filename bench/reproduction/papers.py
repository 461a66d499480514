"""The papers that can be reproduced, by their keys on the command line."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final, cast

from bench.errors import ConfigError

if TYPE_CHECKING:
    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

PAPERS: Final = ("cho_park", "skula", "caruso", "konvalin")
"""Keys, in the order of the page; each is the name of a module beside this one."""


def require_paper(paper: str) -> str:
    """Return the key of a paper.

    Raises
    ------
    ConfigError
        If there is no such paper.
    """
    if paper not in PAPERS:
        message = f"paper must be one of {', '.join(PAPERS)}; instead received {paper}"
        raise ConfigError(message)
    return paper


def reproduce(paper: str, open_laboratory: OpenLaboratory) -> Reproduction:
    """Make a paper's numbers and figures anew on stations that `open_laboratory` builds.

    Raises
    ------
    ConfigError
        If there is no such paper.
    """
    module = import_module(f"bench.reproduction.{require_paper(paper)}")
    return cast("Reproduction", module.reproduce(open_laboratory))
