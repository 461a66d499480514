"""What the report's sections on the methods and on the order of compensation show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.calibration.ranking import RAW
from bench.record.method_charts import (
    error_dots,
    error_scale,
    method_panel,
    order_dots,
    panel_top_deg,
)
from bench.record.method_study import (
    ORDER_REASON,
    method_rows,
    method_words,
    no_model,
    order_rows,
)
from bench.record.recorded_fits import written_method

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bench.record.swing import Swing


def method_section(
    swing: Swing, record: Mapping[str, Any], limits_deg: Mapping[str, float]
) -> dict[str, Any]:
    """Return the names that the template uses, with their rows and drawings.

    Parameters
    ----------
    limits_deg : mapping
        Limits of the largest heading error under "level" and "tilted", where there are such.
    """
    rows = method_rows(record)
    study = record.get("study") or {}
    orders = order_rows(record)
    return {
        "methods": [(row, error_dots(row, limits_deg)) for row in rows],
        "level": any(row.level_max_deg is not None for row in rows),
        "tilted": any(row.tilt_max_deg is not None for row in rows),
        "limits_deg": limits_deg,
        "expected": any(row.expected for row in rows),
        "noise_deg": (study.get("expected_noise") or {}),
        "no_model": no_model(record),
        "scale": error_scale(),
        "panels": _panels(swing, limits_deg.get("level"), written_method(record)) if rows else [],
        "orders": [(row, order_dots(row)) for row in orders],
        "order_names": [effect.name for effect in orders[0].effects] if orders else [],
        "order_reason": ORDER_REASON,
    }


def _panels(swing: Swing, limit_deg: float | None, written: str | None) -> list[dict[str, Any]]:
    """Return one chart a method, all on one scale."""
    top_deg = panel_top_deg([point for points in swing.methods.values() for point in points])
    raw = swing.methods.get(RAW, [])
    return [
        {
            "name": method_words(method),
            "written": method == written,
            "chart": method_panel(
                points,
                [] if method == RAW else raw,
                swing.expected.get(method, []),
                top_deg=top_deg,
                limit_deg=limit_deg,
                title=f"Heading error of {method_words(method)}, level",
            ),
        }
        for method, points in swing.methods.items()
    ]
