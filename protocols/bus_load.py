"""How full a bus is, from the frames that it carries (bit counts: `protocols.frame`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from protocols.frame import frame_bits

if TYPE_CHECKING:
    from collections.abc import Mapping


def bus_load_percent(
    frames_per_s: Mapping[int, tuple[int, float]], bitrate: int, *, worst: bool = False
) -> float:
    """Return the load of a bus in percent; more than 100 cannot be carried.

    Parameters
    ----------
    frames_per_s : mapping
        Identifier to (length in bytes, frames per second).
    bitrate : int
        Bit rate in bit/s.
    worst : bool
        Count every stuff bit that ISO 11898-1 can require.

    Raises
    ------
    ValueError
        If the bit rate is not positive.

    Examples
    --------
    One module and the rig in lock-step at 100 Hz:

    >>> round(bus_load_percent({0x98FF1080: (8, 100.0), 0x181: (6, 100.0)}, 500_000), 2)
    4.52
    """
    if bitrate <= 0:
        sentence = f"bitrate must be positive; instead received {bitrate} bit/s"
        raise ValueError(sentence)
    bits_per_s = sum(
        frame_bits(can_id, length, worst=worst) * rate_hz
        for can_id, (length, rate_hz) in frames_per_s.items()
    )
    return 100.0 * bits_per_s / bitrate
