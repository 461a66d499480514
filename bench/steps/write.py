"""Write the fitted coefficients to the module, all or nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from bench.errors import ConfigError
from bench.steps.step import OnMiss, Step
from protocols.uds import Coefficients

if TYPE_CHECKING:
    from bench.calibration.fit import Fit
    from bench.run_context import RunContext

READ_BACK_NAME = "read_back"
VERSIONS = 0x10000


class Write(Step):
    """Snapshot, write, read back, commit, reset, compare; restored unless verified later."""

    fixed_duration_s: ClassVar[float] = 2.0
    kind: Literal["write"]
    on_miss: OnMiss = "stop"

    def run(self, context: RunContext) -> None:
        """Write the judged fit and judge what the module holds after its reset.

        Raises
        ------
        ConfigError
            If no fit before this step was accepted.
        ModuleSilent, ModuleRefused
            If the module does not take part; it then keeps the coefficients that it had.
        """
        fit = context.judged_fit
        if fit is None:
            message = f"step {self.name} must come after a fit that was accepted; there is none"
            raise ConfigError(message)
        diagnostics = context.module.diagnostics
        before = diagnostics.read_coefficients()
        wanted = coefficients_of(fit, version=(before.version + 1) % VERSIONS)
        context.on_exit("restore the coefficients", context.restore_coefficients)
        result = diagnostics.write_coefficients(wanted)
        equal = result.read_back_equal
        if equal:
            context.before = context.before or result.before
            context.written, context.verified = result.written, False
        context.recorder.set(
            "coefficients",
            {
                "before": context.before or result.before,
                "written": result.written,
                "read_back_equal": equal,
            },
        )
        context.measure(READ_BACK_NAME, float(equal), note="after commit and reset")

    def measured(self) -> tuple[str, ...]:
        """Return the name of what is judged here."""
        return (READ_BACK_NAME,)


def coefficients_of(fit: Fit, *, version: int) -> Coefficients:
    """Return a fit's coefficients as the module keeps them.

    Raises
    ------
    ConfigError
        If the fit has none of the accelerometer: the heading would keep degrees of its error.
    """
    if (
        fit.offset_mg is None
        or fit.matrix is None
        or fit.accel_offset_g is None
        or fit.accel_matrix is None
    ):
        message = (
            f"method {fit.method} must give magnetometer and accelerometer to be written; "
            "it does not"
        )
        raise ConfigError(message)
    return Coefficients(
        version=version,
        mag_offset_mg=tuple(float(value) for value in fit.offset_mg),
        mag_matrix=tuple(float(value) for value in fit.matrix.ravel()),
        accel_offset_g=tuple(float(value) for value in fit.accel_offset_g),
        accel_matrix=tuple(float(value) for value in fit.accel_matrix.ravel()),
        extended_dip_deg=fit.extended_dip_deg or 0.0,
        horizontal_mg=fit.extra["horizontal_mg"] if fit.two_axis else 0.0,
        hk_mg=(0.0, 0.0, 0.0) if fit.hk_mg is None else tuple(map(float, fit.hk_mg)),
    )
