from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BenchNotReady, ConfigError
from bench.module import FRAME_NAMES, Cycle
from bench.sample_file import SampleFile, column_names, read_metadata, read_samples
from bench.sample_log import BLOCK_ROWS, SampleLog
from bench.samples import COMPLETE, MOVING, SAMPLE, readings_of
from protocols import compass
from protocols.e2e import E2eSender


class FakeBus:
    mode = "lockstep"
    tick_count = 0
    start_ns = 1_000


class FakeModule:
    """What a SampleLog needs of a module."""

    def __init__(self) -> None:
        self.bus = FakeBus()
        self.mag_mg_per_count = compass.MAG_MG_PER_COUNT
        self.accel_g_per_count = compass.ACCEL_G_PER_COUNT
        self.status = compass.Status(21.25, 5.0, 6, 1, 0)
        self.listeners = []

    def add_listener(self, listener) -> None:
        self.listeners.append(listener)

    def send(self, cycle: Cycle) -> None:
        self.bus.tick_count += 1
        for listener in self.listeners:
            listener(cycle)


class FakeRig:
    counts = (123_456, -29_999, 7)
    counts_per_deg = 1000.0


def cycle_of(number: int, *, complete: int = COMPLETE, pitch_deg: float = -12.5) -> Cycle:
    sender = E2eSender(1)
    counts = [compass.pack_counts(sender, number & 15, number, -number, 32767) for _ in range(3)]
    heading = compass.pack_heading(sender, number & 15, 359.5, pitch_deg, -170.025, 3)
    frames = [*counts, heading]
    frames = [data if complete & 1 << slot else bytes(8) for slot, data in enumerate(frames)]
    assert len(frames) == len(FRAME_NAMES)
    return Cycle(1_000 + number * 10_000_000, number & 15, complete, *frames)


@pytest.fixture
def module() -> FakeModule:
    return FakeModule()


def test_given_a_cycle_then_the_row_holds_every_value_in_physical_units(tmp_path, module):
    with SampleLog(tmp_path / "s.parquet", module, FakeRig()) as log:
        log.begin_dwell(4)
        module.send(cycle_of(100))
        rows = log.end_dwell()

    (row,) = rows
    assert row["t_s"] == pytest.approx(1.0)
    assert (row["tick"], row["position"], row["group"]) == (1, 4, 100 & 15)
    assert (row["complete"], row["flags"], row["quality"]) == (COMPLETE, 6, 3)
    scale = compass.MAG_MG_PER_COUNT
    assert row["set_mg"].tolist() == [100 * scale, -100 * scale, 32767 * scale]
    assert row["accel_g"][2] == 32767 * compass.ACCEL_G_PER_COUNT
    assert row["heading_deg"] == pytest.approx(359.5, abs=0.003)
    assert row["pitch_deg"] == pytest.approx(-12.5)
    assert row["roll_deg"] == pytest.approx(-170.025)
    assert (row["rig_azimuth_deg"], row["rig_pitch_deg"]) == (123.456, -29.999)
    assert row["temperature_c"] == 21.25


def test_given_missing_frames_then_their_values_are_not_a_number_and_the_bits_say_so(module):
    log = SampleLog(None, module)
    log.begin_dwell(0)
    module.send(cycle_of(1, complete=0b0101))
    (row,) = log.end_dwell()

    assert row["complete"] == 0b0101
    assert np.isfinite(row["set_mg"]).all()
    assert np.isnan(row["reset_mg"]).all()
    assert np.isfinite(row["accel_g"]).all()
    assert np.isnan([row["heading_deg"], row["roll_deg"], row["rig_azimuth_deg"]]).all()


def test_given_many_rows_then_the_file_gives_them_back_exactly_and_memory_is_bounded(
    tmp_path, module
):
    blocks = []
    path = tmp_path / "s.parquet"
    log = SampleLog(path, module, FakeRig(), metadata={"serial": "SN0001"})
    log.add_sink(blocks.append)
    count = 2 * BLOCK_ROWS + 17
    for number in range(count):
        if number % 1000 == 0:
            log.begin_dwell(number // 1000)
        if number % 1000 == 50:
            log.end_dwell()
        module.send(cycle_of(number % 30_000, complete=COMPLETE if number % 7 else 0b0110))
        assert len(log._block) < BLOCK_ROWS
    log.close()
    log.close()

    samples = read_samples(path)
    assert samples.dtype == SAMPLE
    assert len(samples) == log.rows == count
    assert samples.tobytes() == np.concatenate(blocks).tobytes()
    assert (samples["position"] != MOVING).sum() == 9 * 50 - 0
    assert read_metadata(path)["serial"] == "SN0001"


def test_given_other_scales_after_identification_then_only_later_rows_use_them(module, tmp_path):
    with SampleLog(tmp_path / "s.parquet", module) as log:
        module.send(cycle_of(10))
        module.mag_mg_per_count = 0.5
        module.send(cycle_of(10))
        log.begin_dwell(1)
        module.send(cycle_of(10))
        assert log.end_dwell()["set_mg"][0, 0] == 5.0

    samples = read_samples(tmp_path / "s.parquet")
    assert samples["set_mg"][:, 0].tolist() == [10 * compass.MAG_MG_PER_COUNT, 5.0, 5.0]


def test_given_two_dwells_then_readings_of_the_file_are_those_of_the_dwells(tmp_path, module):
    kept = []
    with SampleLog(tmp_path / "s.parquet", module, FakeRig()) as log:
        for position in range(2):
            module.send(cycle_of(3))
            log.begin_dwell(position)
            for number in range(20):
                module.send(cycle_of(number + 100 * position))
            kept.append(readings_of(log.end_dwell())[0])

    readings = readings_of(read_samples(tmp_path / "s.parquet"))
    assert readings.tobytes() == np.array(kept, dtype=readings.dtype).tobytes()


def test_every_field_of_a_sample_has_its_flat_column():
    names = column_names()

    assert len(names) == sum(
        SAMPLE[name].shape[0] if SAMPLE[name].shape else 1 for name in SAMPLE.names
    )
    assert names["accel_z_g"] == ("accel_g", 2)


def test_given_a_file_that_is_none_or_lacks_columns_then_config_error(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        read_samples(tmp_path / "none.parquet")
    (tmp_path / "text.parquet").write_text("no parquet")
    with pytest.raises(ConfigError, match="cannot be read"):
        read_samples(tmp_path / "text.parquet")


def test_given_a_table_of_something_else_then_config_error_names_a_column(tmp_path):
    import pyarrow as pa
    from pyarrow.parquet import write_table

    write_table(pa.table({"tick": [1]}), tmp_path / "other.parquet")
    with pytest.raises(ConfigError, match="must have the column accel_x_g"):
        read_samples(tmp_path / "other.parquet")


def test_given_no_such_folder_then_one_sentence(tmp_path):
    with pytest.raises(BenchNotReady, match="cannot be written"):
        SampleFile(tmp_path / "nowhere" / "s.parquet", {})


def test_on_the_virtual_station_every_tick_has_a_complete_row_with_the_rigs_angle(
    station, tmp_path
):
    station.module.wait_ready()
    station.rig.connect()
    with SampleLog(tmp_path / "s.parquet", station.module, station.rig) as log:
        log.begin_dwell(0)
        station.bus.run_for(0.5)
        rows = log.end_dwell()

    assert len(rows) == 50
    assert set(rows["complete"]) == {COMPLETE}
    assert np.diff(rows["tick"]).tolist() == [1] * 49
    assert np.isfinite(rows["rig_roll_deg"]).all()
    assert np.linalg.norm(rows["accel_g"], axis=1) == pytest.approx(1.0, abs=0.1)
