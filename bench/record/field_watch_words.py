"""What the report says of the field through the run: who watched it, which poses it spoiled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Mapping

SOURCES: Final = {
    "reference": "the reference magnetometer",
    "sentinel": "sentinel poses of the module itself",
}


def field_watch(record: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return source, one sentence and the spoiled dwells; None where nothing watched the field."""
    watch = record.get("field_watch") or {}
    source = SOURCES.get(watch.get("source", ""))
    if source is None:
        return None
    spoiled = [
        {**entry, "noticed_by": SOURCES.get(entry["source"], entry["source"])}
        for entry in watch.get("spoiled") or []
    ]
    return {"source": f"watched by {source}", "words": _words(watch, spoiled), "spoiled": spoiled}


def _words(watch: Mapping[str, Any], spoiled: list[dict[str, Any]]) -> str:
    drift_mg = watch.get("drift_mg")
    drift = "" if drift_mg is None else f"From start to end the field drifted by {drift_mg:.2g} mG."
    if not spoiled:
        return f"The field spoiled no pose. {drift}".strip()
    repeated = sum(entry["repeated_as"] is not None for entry in spoiled)
    poses = "1 pose" if len(spoiled) == 1 else f"{len(spoiled)} poses"
    done = "repeated" if repeated == len(spoiled) else f"{repeated} of them repeated"
    return f"The field changed at {poses}; {done}, and the spoiled readings are not used. {drift}"
