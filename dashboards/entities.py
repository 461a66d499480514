"""Entity paths, timelines, colours and sizes of the recording: one place for all dashboards."""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int] | tuple[int, int, int, int]
"""Red, green, blue and, where it is not opaque, alpha; each 0 to 255."""

APPLICATION_ID: Final = "compass_bench"

SIM_TIME: Final = "sim_time"
TICK: Final = "tick"
POSITION: Final = "position"
TIMELINES: Final = (SIM_TIME, TICK, POSITION)

WORLD: Final = "world"
NED: Final = "world/ned"
BASE: Final = "world/ned/base"
TABLE: Final = "world/ned/azimuth"
PITCH_FRAME: Final = "world/ned/azimuth/pitch"
ROLL_FRAME: Final = "world/ned/azimuth/pitch/roll"
MODULE: Final = "world/ned/azimuth/pitch/roll/module"
MODULE_FIELD: Final = "world/ned/azimuth/pitch/roll/field_raw"
MODULE_FIELD_CORRECTED: Final = "world/ned/azimuth/pitch/roll/field_compensated"
SITE_FIELD: Final = "world/ned/field"

HEADING: Final = "heading_deg"
ERROR: Final = "heading_error_deg"
RAW_ERROR: Final = "raw_heading_error_deg"
FIELD: Final = "magnetometer_mg"
PLANE: Final = "magnetometer_mg/xy"
SPACE: Final = "magnetometer_mg/xyz"
METHODS: Final = "methods"
Z_ESTIMATED: Final = "field/z_estimated"
Z_MEASURED: Final = "field/z_measured"
Z_DIFFERENCE: Final = "field/z_difference"
RIG: Final = "rig"
PROCEDURE: Final = "procedure"
CAN: Final = "can"
ACCEPTANCE: Final = "acceptance"
CERTAINTY: Final = "certainty"

RED: Final = (231, 76, 60)
GREEN: Final = (46, 204, 113)
BLUE: Final = (52, 152, 219)
VIOLET: Final = (155, 89, 182)
WHITE: Final = (236, 240, 241)
GREY: Final = (140, 148, 160)
AMBER: Final = (241, 196, 15)
DARK: Final = (18, 20, 24)
LINE: Final = (70, 76, 86)

STEP_COLOURS: Final = (
    0x3498DBFF,
    0x9B59B6FF,
    0xE67E22FF,
    0x1ABC9CFF,
    0x34495EFF,
    0xC0392BFF,
    0x2980B9FF,
    0x8E44ADFF,
    0xD35400FF,
    0x16A085FF,
    0x7F8C8DFF,
    0x27AE60FF,
)

METHOD_COLOURS: Final[dict[str, Colour]] = {
    "raw": RED,
    "set_reset": (240, 128, 180),
    "min_max": (230, 126, 34),
    "four_position": AMBER,
    "soft_iron": (220, 200, 120),
    "three_headings": (26, 188, 156),
    "ellipsoid": BLUE,
    "tilt_aided": (120, 200, 240),
    "accelerometer": GREY,
    "two_axis": VIOLET,
    "two_axis_aided": (200, 150, 220),
    "truth_aided": GREEN,
}
