"""Layouts of published recordings, by name: `import --preset NAME`."""

from __future__ import annotations

import difflib
from types import MappingProxyType
from typing import Final

from bench.errors import ConfigError
from bench.recording_import import ImportOptions

PRESETS: Final = MappingProxyType(
    {
        # github.com/sunsided/sensor-fusion, data/set-2: HMC5883L in gauss at 75 Hz and MPU6050 in
        # g at 100 Hz, two files without headers. Z up; the accelerometer's sign is gravity's.
        "hmc5883l_sunsided": ImportOptions(
            columns=("t_s", "mx", "my", "mz"),
            accel_columns=("t_s", "ax", "ay", "az"),
            field_unit="G",
            field_axes="x,-y,-z",
            accel_axes="-x,y,z",
        ),
        # github.com/tomisuarez2/MagnetometerCalibration: QMC5883L counts at 50 Hz, of a range that
        # is not said.
        "qmc5883l_tomisuarez2": ImportOptions(skip_lines=2, field_unit="counts", rate_hz=50.0),
        # github.com/CK-Explorer/Magnetometer-and-Accelerometer-Calibration: g and gauss.
        "ckexplorer": ImportOptions(field_unit="G", accel=("ax", "ay", "az")),
        # github.com/aleksandrbazhin/ellipsoid_fit_python: counts of an unnamed magnetometer.
        "bazhin": ImportOptions(columns=("mx", "my", "mz"), field_unit="counts"),
        # github.com/dlaidig/broad (Laidig et al., BROAD, Data 6(7) 2021): every tenth row; uT,
        # m/s2, optical attitude from sensor (z up) to east-north-up.
        "broad": ImportOptions(
            field=("mx", "my", "mz_uT"),
            field_unit="uT",
            field_axes="x,-y,-z",
            accel=("ax", "ay", "az_m_s2"),
            accel_unit="m/s2",
            accel_axes="x,-y,-z",
            quaternion=("qw", "qx", "qy", "qz_opt_ENU"),
        ),
    }
)


def preset(name: str) -> ImportOptions:
    """Return the layout of this name.

    Raises
    ------
    ConfigError
        If there is none; says which is the closest.
    """
    if name in PRESETS:
        return PRESETS[name]
    close = difflib.get_close_matches(name, PRESETS, n=1)
    hint = f", did you mean {close[0]}?" if close else ""
    message = f"preset must be one of {', '.join(PRESETS)}; instead received {name!r}{hint}"
    raise ConfigError(message)
