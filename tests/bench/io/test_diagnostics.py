from __future__ import annotations

import dataclasses

import pytest

from bench.errors import Aborted, ConfigError, ModuleRefused, ModuleSilent
from protocols import uds
from protocols.frame import EXTENDED
from protocols.uds import DEFAULT_COEFFICIENTS


@pytest.fixture
def diagnostics(station):
    station.module.wait_ready()
    return station.module.diagnostics


NEW = dataclasses.replace(
    DEFAULT_COEFFICIENTS, version=7, mag_offset_mg=(1.1, -2.2, 3.3), accel_offset_g=(0.01, 0.0, 0.1)
)


def test_reading_a_long_identifier_gives_its_bytes(diagnostics):
    assert diagnostics.read_did(uds.DID_SERIAL) == b"SN0001"
    assert len(diagnostics.read_did(uds.DID_COEFFICIENTS)) == uds.PLAIN_BANK_LENGTH
    assert diagnostics.read_coefficients() == DEFAULT_COEFFICIENTS


def test_given_an_unknown_identifier_then_refused_with_the_response_code(diagnostics):
    with pytest.raises(ModuleRefused, match="reading 1234h: RequestOutOfRange") as error:
        diagnostics.read_did(0x1234)
    assert error.value.code == 0x31


def test_given_a_locked_module_then_writing_is_refused_until_unlocked(diagnostics):
    diagnostics.extended_session()
    with pytest.raises(ModuleRefused) as error:
        diagnostics.write_did(uds.DID_SAMPLE_PERIOD, b"\x02")
    assert error.value.code == 0x33

    diagnostics.unlock()
    diagnostics.unlock()
    diagnostics.write_did(uds.DID_SAMPLE_PERIOD, b"\x02")
    assert diagnostics.read_did(uds.DID_SAMPLE_PERIOD) == b"\x02"


def test_given_a_longer_sample_period_then_fewer_cycles_come_and_the_module_is_not_silent(
    diagnostics, station
):
    diagnostics.set_sample_period(5)
    before = station.module.cycles
    station.bus.run_for(1.0)

    assert station.module.cycles - before == pytest.approx(20, abs=1)
    assert station.module.incomplete == 0


def test_given_a_long_wait_then_the_session_is_kept_alive_from_the_tick(diagnostics, station):
    diagnostics.unlock()
    station.bus.run_for(12.0)
    diagnostics.write_did(uds.DID_SAMPLE_PERIOD, b"\x01")
    diagnostics.default_session()
    with pytest.raises(ModuleRefused) as error:
        diagnostics.write_did(uds.DID_SAMPLE_PERIOD, b"\x01")
    assert error.value.code == 0x7F


def test_the_self_test_announces_itself_and_passes(diagnostics, station):
    start_s = station.bus.now_s
    assert diagnostics.self_test() == b"\x00"
    assert station.bus.now_s - start_s > 0.2


def test_trouble_codes_are_read_and_cleared(diagnostics):
    assert diagnostics.read_dtcs() == []
    diagnostics.unlock()
    diagnostics.write_did(uds.DID_SET_RESET, (10).to_bytes(2, "big") + b"\x01")
    assert [code for code, _ in diagnostics.read_dtcs()] == [uds.DTC_STRAP]
    diagnostics.clear_dtcs()
    assert diagnostics.read_dtcs() == []


def test_temperature_pulse_and_presence_are_answered(diagnostics):
    diagnostics.tester_present()
    diagnostics.set_reset_pulse(1000)
    assert 10.0 < diagnostics.read_temperature_c() < 40.0


def test_given_a_module_that_does_not_answer_then_silent_within_simulated_time(bus, echo):
    from bench.module import Module

    diagnostics = Module(bus).diagnostics
    with pytest.raises(ModuleSilent, match="module 0x80 does not answer reading F18Ch"):
        diagnostics.read_did(uds.DID_SERIAL)
    assert bus.now_s == pytest.approx(0.2)
    assert sum(f.can_id == EXTENDED | 0x18DA80F1 for f in echo.heard) == 1


def test_requests_are_padded_to_eight_bytes(bus, echo):
    from bench.module import Module

    with pytest.raises(ModuleSilent):
        Module(bus).diagnostics.tester_present()
    (request,) = [f.data for f in echo.heard if f.can_id == EXTENDED | 0x18DA80F1]
    assert request == bytes.fromhex("023E00CCCCCCCCCC")


def test_given_a_receiver_without_flow_control_then_the_write_breaks_off_after_n_bs(bus, echo):
    from bench.isotp_channel import IsoTpChannel

    channel = IsoTpChannel(bus, 0x80)
    channel.send(bytes(100))
    with pytest.raises(ModuleSilent, match="broke off a diagnostic message"):
        channel.receive(0.1)
    assert bus.now_s == pytest.approx(1.0, abs=0.03)
    assert channel.idle
    channel.close()


def test_given_a_sender_that_stops_in_the_middle_then_n_cr_ends_it(bus, echo):
    from bench.isotp_channel import IsoTpChannel
    from protocols.uds import physical_response_id

    first = bytes.fromhex("1020010203040506")
    echo.says = lambda tick: [(physical_response_id(0x80), first)] if tick == 2 else []
    channel = IsoTpChannel(bus, 0x80)
    with pytest.raises(ModuleSilent, match="broke off"):
        channel.receive(0.1)
    assert bus.now_s == pytest.approx(1.03, abs=0.03)


def test_given_new_coefficients_when_written_then_in_use_after_the_reset(diagnostics, station):
    boots = station.module.status.boots
    write = diagnostics.write_coefficients(NEW)

    assert write.read_back_equal
    assert write.before == DEFAULT_COEFFICIENTS
    assert write.read_back.version == 7
    assert write.read_back.mag_offset_mg == pytest.approx(NEW.mag_offset_mg)
    assert station.module.status.boots == boots + 1
    assert diagnostics.write_coefficients(dataclasses.replace(NEW, version=8)).before.version == 7


@pytest.mark.parametrize(
    ("extended_dip_deg", "horizontal_mg"), [(48.72, 302.0), (-12.5, 1.0), (0.0, 400.0)]
)
def test_dip_and_horizontal_field_of_two_axes_are_written_and_compared(
    make_station, extended_dip_deg, horizontal_mg
):
    station = make_station(part="CB-AMR2")
    station.module.wait_ready()
    new = dataclasses.replace(NEW, extended_dip_deg=extended_dip_deg, horizontal_mg=horizontal_mg)
    write = station.module.diagnostics.write_coefficients(new)

    assert write.read_back_equal
    assert write.read_back.extended_dip_deg == pytest.approx(extended_dip_deg, rel=1e-6)
    assert write.read_back.horizontal_mg == horizontal_mg
    for wrong in ({"extended_dip_deg": 0.5}, {"horizontal_mg": 2.0}):
        held = dataclasses.replace(write.read_back, **wrong)
        assert not dataclasses.replace(write, read_back=held).read_back_equal


@pytest.mark.parametrize(
    "wrong",
    [
        {"extended_dip_deg": 90.0, "horizontal_mg": 250.0},
        {"extended_dip_deg": float("nan"), "horizontal_mg": 250.0},
        {"extended_dip_deg": 60.0},
        {"mag_offset_mg": (float("inf"), 0.0, 0.0)},
    ],
)
def test_coefficients_that_no_module_can_hold_are_refused_before_anything_is_sent(
    diagnostics, station, wrong
):
    ticks = station.bus.tick_count
    with pytest.raises(ConfigError, match="coefficients must be sound to be written; instead: "):
        diagnostics.write_coefficients(dataclasses.replace(NEW, **wrong))
    assert station.bus.tick_count == ticks


def test_given_a_module_that_loses_the_write_then_the_result_says_so(make_station):
    station = make_station(faults=("lost_write",))
    station.module.wait_ready()
    write = station.module.diagnostics.write_coefficients(NEW)

    assert not write.read_back_equal
    assert write.read_back == DEFAULT_COEFFICIENTS


def test_given_an_abort_at_any_tick_of_the_write_then_the_old_coefficients_are_in_use(
    make_station,
):
    whole = make_station()
    whole.module.wait_ready()
    start = whole.bus.tick_count
    whole.module.diagnostics.write_coefficients(NEW)
    ticks = whole.bus.tick_count - start

    for after in range(1, ticks, 3):
        station = make_station()
        station.module.wait_ready()
        stop_at = start + after

        def cancel(station=station, stop_at=stop_at) -> None:
            if station.bus.tick_count == stop_at:
                station.bus.cancel.request(2)

        station.bus.add_hook(cancel)
        with pytest.raises(Aborted):
            station.module.diagnostics.write_coefficients(NEW)
        with station.bus.cancel.shielded():
            assert station.module.diagnostics.read_coefficients() == DEFAULT_COEFFICIENTS
            with pytest.raises(ModuleRefused):
                station.module.diagnostics.read_did(uds.DID_COEFFICIENTS_STAGED)


def test_given_a_module_that_dies_during_the_write_then_silent_and_no_endless_wait(make_station):
    station = make_station(faults=("module_silent@40",))
    station.module.wait_ready()
    with pytest.raises(ModuleSilent):
        station.module.diagnostics.write_coefficients(NEW)
    assert station.bus.now_s < 10.0
