"""Identities of the AMR bridges and their set/reset strap.

| identity | test |
|---|---|
| (set - reset)/2 = H/(1 - (Ha/Hk)^2), (set + reset)/2 = b - H Ha/Hk/(1 - (Ha/Hk)^2) | bridge |
| the play operator: a turn about forgets at most its width, a cycle closes | hysteresis |
| a strong field lowers the sensitivity; only a sufficient pulse restores it | order |
| part f of the film flipped a pulse: sensitivity f/(2 - f) | flipping |
| the converter is linear between its ends and holds there | converter |
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from devices.bridge import RANGE_MG, Bridge3, BridgeParameters, Strap


def plain_bridges(draw: float = 0.0, bits: int = 14, **changes: float) -> Bridge3:
    one = BridgeParameters(**changes)
    return Bridge3((one, one, one), Strap(), lambda: draw, bits)


class TestBridge:
    def test_set_and_reset_share_field_and_offset(self) -> None:
        bridges = plain_bridges(offset_mg=30.0, hk_mg=8000.0)
        field_mg = (200.0, -150.0, 433.0)

        levels = bridges.levels_mg(field_mg, 25.0)

        for axis, across_mg in enumerate((-150.0, 200.0, 200.0)):
            h_mg, ratio = field_mg[axis], across_mg / 8000.0
            half_difference = (levels[axis] - levels[axis + 3]) / 2.0
            half_sum = (levels[axis] + levels[axis + 3]) / 2.0
            assert half_difference == pytest.approx(h_mg / (1.0 - ratio**2))
            assert half_sum == pytest.approx(30.0 - h_mg * ratio / (1.0 - ratio**2))

    def test_set_reading_alone_is_wrong_by_a_degree_and_the_difference_is_not(self) -> None:
        errors_deg = []
        for heading_deg in range(0, 360, 15):
            x_mg = 200.0 * math.cos(math.radians(heading_deg))
            y_mg = -200.0 * math.sin(math.radians(heading_deg))
            xs, ys, _, xr, yr, _ = plain_bridges().levels_mg((x_mg, y_mg, 0.0), 25.0)
            for x, y in ((xs, ys), (xs - xr, ys - yr)):
                error_deg = math.degrees(math.atan2(-y, x)) - heading_deg
                errors_deg.append(abs((error_deg + 180.0) % 360.0 - 180.0))

        assert 0.5 < max(errors_deg[0::2]) < 1.5
        assert max(errors_deg[1::2]) < 0.02

    def test_cubic_and_gain(self) -> None:
        bridges = plain_bridges(cubic_per_mg2=0.2 / 400.0**3, sensitivity=1.02)

        assert bridges.levels_mg((400.0, 0.0, 0.0), 25.0)[0] == pytest.approx(1.02 * 400.2)

    def test_temperature(self) -> None:
        bridges = plain_bridges(
            sensitivity_tempco_per_c=-0.003, offset_mg=10.0, offset_tempco_mg_per_c=0.5
        )
        levels = bridges.levels_mg((100.0, 0.0, 0.0), 35.0)

        assert (levels[0] - levels[3]) / 2.0 == pytest.approx(97.0)
        assert (levels[0] + levels[3]) / 2.0 == pytest.approx(15.0)

    @pytest.mark.parametrize(("bits", "step_mg"), [(12, 0.390625), (14, 0.09765625)])
    def test_converter_steps_and_ends(self, bits: int, step_mg: float) -> None:
        bridges = plain_bridges(bits=bits)
        top = 2 ** (bits - 1) - 1

        assert bridges.mg_per_count == step_mg
        assert bridges.read((100.0, 0.0, 0.0), +1)[0] == round(100.0 / step_mg)
        assert bridges.read((100.0, 0.0, 0.0), -1)[0] == -round(100.0 / step_mg)
        assert bridges.counts(RANGE_MG + 50.0) == top
        assert bridges.counts(-RANGE_MG - 50.0) == -top - 1

    def test_refuses_a_converter_that_no_module_has(self) -> None:
        with pytest.raises(ValueError, match="bits must be within 8 and 16"):
            plain_bridges(bits=24)


class TestHysteresis:
    def test_play_lags_by_its_half_width_and_closes(self) -> None:
        bridges = plain_bridges(hysteresis_mg=0.16)

        def read(x_mg: float) -> float:
            return bridges.levels_mg((x_mg, 0.0, 0.0), 25.0)[0]

        read(0.0)
        rising = [read(float(h)) - h for h in range(10, 210, 10)]
        falling = [read(float(h)) - h for h in range(190, -10, -10)]
        again = [read(float(h)) - h for h in range(10, 210, 10)]

        assert rising == pytest.approx([-0.16] * 20, abs=1e-4)
        assert falling == pytest.approx([0.16] * 20, abs=1e-4)
        assert again == pytest.approx(rising, abs=1e-4)

    def test_inside_the_play_nothing_moves(self) -> None:
        bridges = plain_bridges(hysteresis_mg=0.16)
        first = bridges.levels_mg((100.0, 0.0, 0.0), 25.0)[0]

        assert bridges.levels_mg((100.1, 0.0, 0.0), 25.0)[0] == pytest.approx(first)


class TestRepeatability:
    def test_is_kept_at_rest_and_redrawn_along_the_way(self) -> None:
        rng = np.random.default_rng(5)
        one = BridgeParameters(repeatability_mg=0.32)
        bridges = Bridge3((one, one, one), Strap(), lambda: float(rng.standard_normal()))
        errors = []
        for _ in range(2000):
            for x_mg in (0.0, 30.0, 60.0, 100.0):
                levels = bridges.levels_mg((x_mg, 0.0, 0.0), 25.0)
            assert bridges.levels_mg((100.0, 0.0, 0.0), 25.0) == levels
            errors.append((levels[0] - levels[3]) / 2.0 - 100.0)
        series = np.array(errors)

        assert series.std() == pytest.approx(0.32, rel=0.08)
        assert abs(np.corrcoef(series[:-1], series[1:])[0, 1]) < 0.08


class TestOrder:
    def test_strong_field_degrades_and_a_sufficient_pulse_restores(self) -> None:
        strap = Strap(minimum_ma=500.0)
        bridges = plain_bridges()
        bridges.drive(400.0)  # flips an ordered film, does not order a broken one

        def amplitude() -> float:
            levels = bridges.levels_mg((100.0, 0.0, 0.0), 25.0)
            return (levels[0] - levels[3]) / 2.0

        assert amplitude() == pytest.approx(100.0, rel=5e-3)
        bridges.levels_mg((15_000.0, 0.0, 0.0), 25.0)
        assert 30.0 < amplitude() < 60.0
        bridges.pulse(300.0)
        bridges.pulse(420.0)
        assert 30.0 < amplitude() < 60.0
        bridges.pulse(2.0 * strap.minimum_ma)
        assert amplitude() == pytest.approx(100.0, rel=5e-3)

    def test_earth_field_breaks_nothing(self) -> None:
        bridges = plain_bridges()
        bridges.levels_mg((3000.0, 0.0, 0.0), 25.0)

        assert [bridge.order for bridge in bridges.bridges] == pytest.approx([1.0] * 3)

    def test_undershoot_un_sets(self) -> None:
        clean, ringing = Strap(undershoot=0.1), Strap(undershoot=0.35)

        assert clean.ceiling(1000.0) > 0.999
        assert ringing.ceiling(1000.0) < 0.2
        assert ringing.restored(1000.0) < 0.2

    @pytest.mark.parametrize("dead", [0.0, 0.2, 0.5, 0.9])
    def test_partly_flipped_film(self, dead: float) -> None:
        bridges = plain_bridges(hk_mg=1e12)
        bridges.bridges[0].dead = dead
        flipped = Strap().flipped(1000.0) * (1.0 - dead)
        levels = bridges.levels_mg((100.0, 0.0, 0.0), 25.0)

        assert (levels[0] - levels[3]) / 2.0 == pytest.approx(100.0 * flipped / (2.0 - flipped))

    def test_partly_flipped_film_by_simulation(self) -> None:
        polarity, flipped = 1.0, 0.4
        for _ in range(60):
            polarity = polarity * (1.0 - flipped) + flipped
            after_set = polarity
            polarity = polarity * (1.0 - flipped) - flipped

        assert after_set == pytest.approx(flipped / (2.0 - flipped))
        assert polarity == pytest.approx(-after_set)

    def test_dead_strap_keeps_the_set_state(self) -> None:
        bridges = plain_bridges(offset_mg=5.0)
        bridges.bridges[2].dead = 1.0
        levels = bridges.levels_mg((0.0, 0.0, 433.0), 25.0)

        assert levels[2] == levels[5] == pytest.approx(438.0)
