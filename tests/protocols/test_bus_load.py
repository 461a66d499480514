"""Loads of the buses that the bench can be put on, added up by hand."""

from __future__ import annotations

import pytest

from protocols import canopen, compass
from protocols.bus_load import bus_load_percent
from protocols.sync import SYNC_ID


def traffic(modules: int, rate_hz: float) -> dict[int, tuple[int, float]]:
    """Return what rig and modules send: four protected frames, status and direction each."""
    frames = {SYNC_ID: (1, 100.0)}
    frames |= {canopen.tpdo1_id(node): (6, 100.0) for node in canopen.AXIS_NODES}
    for source in range(0x80, 0x80 + modules):
        frames[compass.mag_set_id(source)] = (8, rate_hz)
        frames[compass.mag_reset_id(source)] = (8, rate_hz)
        frames[compass.acceleration_id(source)] = (8, rate_hz)
        frames[compass.heading_id(source)] = (8, rate_hz)
        frames[compass.status_id(source)] = (8, 10.0)
        frames[compass.vehicle_direction_id(source)] = (8, 10.0)
    return frames


def test_one_module_at_100_hz_takes_a_fifth_of_the_bus() -> None:
    bits_per_s = 100 * (55 + 3 * 95 + 4 * 131) + 2 * 10 * 131

    assert bus_load_percent(traffic(1, 100.0), 500_000) == pytest.approx(bits_per_s / 5000)


def test_worst_case_stuffing_is_counted() -> None:
    bits_per_s = 100 * (65 + 3 * 115 + 4 * 160) + 2 * 10 * 160

    load = bus_load_percent(traffic(1, 100.0), 500_000, worst=True)

    assert load == pytest.approx(bits_per_s / 5000)


def test_sixteen_modules_fit_at_20_hz_and_not_at_100_hz() -> None:
    assert bus_load_percent(traffic(16, 20.0), 500_000, worst=True) < 70.0
    assert bus_load_percent(traffic(16, 100.0), 500_000) > 100.0


def test_a_silent_bus_has_no_load() -> None:
    assert bus_load_percent({}, 500_000) == 0.0


@pytest.mark.parametrize("bitrate", [0, -1])
def test_a_bitrate_that_is_not_positive_is_refused(bitrate: int) -> None:
    with pytest.raises(ValueError, match="bitrate must be positive; instead received"):
        bus_load_percent({}, bitrate)
