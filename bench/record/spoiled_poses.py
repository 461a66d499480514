"""Which positions of a recorded run are used: those that the field did not spoil."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


def unused_positions(record: Mapping[str, Any]) -> set[int]:
    """Return the positions of spoiled dwells and of sentinel poses; none in an older record."""
    watch = record.get("field_watch") or {}
    entries = [*watch.get("spoiled", []), *watch.get("sentinels", [])]
    return {int(entry["position"]) for entry in entries}


def used_in_order(positions: Iterable[int], record: Mapping[str, Any]) -> list[int]:
    """Return the used ones of some positions, in the order in which they were planned.

    A repetition stands where the pose that it replaces stood, though it was made later.

    >>> spoiled = [{"position": 1, "repeated_as": 3}, {"position": 3, "repeated_as": 4}]
    >>> used_in_order([0, 1, 2, 3, 4], {"field_watch": {"spoiled": spoiled}})
    [0, 4, 2]
    """
    unused = unused_positions(record)
    spoiled = (record.get("field_watch") or {}).get("spoiled", [])
    place: dict[int, int] = {}
    for entry in spoiled:
        again, position = entry["repeated_as"], int(entry["position"])
        if again is not None:
            place[int(again)] = place.get(position, position)
    used = [position for position in positions if position not in unused]
    return sorted(used, key=lambda position: (place.get(position, position), position))
