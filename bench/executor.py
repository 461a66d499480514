"""Runs a procedure: steps in order, safe state always, record always closed, then the verdict.

One thread does all of it. A step that raises ends the procedure; a missed limit ends it only
where the step says so. Whatever happens, the promised actions (park the rig, restore the
coefficients) run, files are closed, and the record gets its verdict.
"""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import verdict_of
from bench.errors import (
    Aborted,
    BenchError,
    BusFault,
    FieldChanged,
    ModuleRefused,
    ModuleSilent,
    ReferenceSilent,
    RigFault,
)
from bench.plan import plan_of
from bench.safe_state import SafeState
from bench.signals import SignalWatch
from protocols.errors import ProtocolError

if TYPE_CHECKING:
    from bench.acceptance.measurement import Measurement
    from bench.acceptance.verdict import Verdict
    from bench.procedure import Procedure
    from bench.run_context import RunContext
    from bench.steps.step import Step

_log = logging.getLogger(f"compassbench.{__name__}")

SIGINT_NUMBER: Final = 2
FAULT_NAMES: Final[dict[type[Exception], str]] = {
    ModuleSilent: "module_silent",
    ModuleRefused: "module_refused",
    RigFault: "rig_fault",
    BusFault: "bus_fault",
    ReferenceSilent: "reference_silent",
    FieldChanged: "field_changed",
}
OTHER_FAULT: Final = "bench_fault"
"""What stands as the first failure of a run that ended by an error before any measurement did."""


class _Stopped(Exception):  # noqa: N818  (ends the procedure, is no error)
    """A critical limit was missed: nothing more is done to this unit."""


def execute(procedure: Procedure, context: RunContext) -> Verdict:
    """Run a procedure on one unit, bring everything into its safe state, close the record.

    Parameters
    ----------
    procedure : Procedure
    context : RunContext
        Instruments, rules, recorder; its `finish` actions close the files of the run.

    Returns
    -------
    Verdict
        As it stands in the record. An error of the bench is an outcome, not an exception.

    Raises
    ------
    ConfigError
        Before anything is done, if a measurement has no limits.
    BenchNotReady
        If the record cannot be closed.
    """
    context.limits.require(procedure.measured())
    run = _Run(procedure, context)
    with SignalWatch(context.bus.cancel) as watch:
        safe_state = SafeState(context.bus.cancel, context.recorder)
        context.on_exit = safe_state.promise
        context.run_step = run.run_step
        error, aborted = run.steps()
        failures = safe_state.keep()
        watch.deafen()
        signal_number = context.bus.cancel.signal_number
        if signal_number is not None and error is None:
            aborted = str(Aborted(signal_number))
        failures += run.finish()
        if error is None and failures:
            error = "; ".join(failures)
        required = set(procedure.measured()) - context.not_available
        verdict = verdict_of(context.measurements, error=error, aborted=aborted, required=required)
        if verdict.first_failure is None:
            verdict = replace(verdict, first_failure=context.fault_name)
        if verdict.outcome is Outcome.PASS and procedure.on_pass:
            verdict = replace(verdict, next_action=procedure.on_pass)
        context.recorder.close(verdict)
    return context.recorder.verdict or verdict


class _Run:
    """The steps of one run and their attempts."""

    def __init__(self, procedure: Procedure, context: RunContext) -> None:
        self._procedure = procedure
        self._context = context
        self._attempts: Counter[str] = Counter()
        self._step_name = ""
        self._suffix = ""

    def steps(self) -> tuple[str | None, str | None]:
        """Run all steps; return the sentences of an error and of an abort, or None."""
        context = self._context
        try:
            context.started_s = context.bus.now_s
            plan = plan_of(self._procedure, with_reference=context.reference is not None)
            context.expected_s = plan.duration_s
            context.record_station()
            for step in self._procedure.steps:
                self.run_step(step)
            context.completed = True
        except _Stopped as stop:
            context.event("stopped", reason=str(stop))
        except Aborted as fault:
            context.event("aborted", signal=fault.signal_number)
            return None, str(fault)
        except KeyboardInterrupt:
            context.event("aborted", signal=SIGINT_NUMBER)
            return None, str(Aborted(SIGINT_NUMBER))
        except (BenchError, ProtocolError) as fault:
            context.fault_name = FAULT_NAMES.get(type(fault), OTHER_FAULT)
            context.event("error", error=type(fault).__name__, message=str(fault))
            return str(fault), None
        except (Exception, SystemExit) as fault:  # whatever ends a step, the rig is parked
            _log.exception("step %s failed", self._step_name)
            context.fault_name = OTHER_FAULT
            context.event("error", error=type(fault).__name__, message=str(fault))
            return f"step {self._step_name} failed: {type(fault).__name__}: {fault}", None
        return None, None

    def run_step(self, step: Step, suffix: str = "") -> None:
        """Run one step until it passes or its attempts are used up.

        The suffix, a round's number, also stands behind the names of the steps inside it: a
        round that ran later must not take the place of one that was missed.

        Raises
        ------
        _Stopped
            If a limit was missed and the step's `on_miss` is stop.
        """
        outer, self._suffix = self._suffix, self._suffix + suffix
        name = step.name + self._suffix
        try:
            missed = self._attempts_of(step, name)
        finally:
            self._suffix = outer
        if missed is not None and step.on_miss == "stop":
            message = f"{missed.name} was missed in step {name}"
            raise _Stopped(message)

    def _attempts_of(self, step: Step, name: str) -> Measurement | None:
        """Run a step until it passes or its attempts are used up; return what was missed."""
        missed = None
        for left in reversed(range(step.attempts)):
            missed = self._attempt(step, name, last=left == 0)
            if missed is None:
                break
        return missed

    def _attempt(self, step: Step, name: str, *, last: bool) -> Measurement | None:
        """Run a step once and return its first missed measurement, or None."""
        context = self._context
        self._attempts[name] += 1
        outer = context.step_name, context.attempt
        context.step_name, context.attempt = name, self._attempts[name]
        self._step_name = name
        begun = context.mark()
        context.recorder.step_started(name, step.kind, context.attempt)
        context.progress.step_started(context.state)
        outcome, message = Outcome.ERROR, ""
        try:
            step.run(context)
            context.bus.check_links()
            outcome = context.outcome_since(begun)
        except _Stopped:
            outcome = context.outcome_since(begun)
            raise
        except Aborted as fault:
            outcome, message = Outcome.ABORTED, str(fault)
            raise
        except BaseException as fault:
            message = str(fault)
            raise
        finally:
            context.recorder.step_ended(name, outcome, message)
            context.progress.step_ended(context.state, outcome)
            context.step_name, context.attempt = outer
        missed = context.first_missed_since(begun)
        if missed is not None and not last:
            context.forget_positions(begun)
        return missed

    def finish(self) -> list[str]:
        """Write the bus's section and close the files of the run; return what failed."""
        failures: list[str] = []
        context = self._context
        own = (
            ("record the bus", context.record_bus),
            ("record the field watch", context.record_field_watch),
        )
        for name, action in (*own, *context.finish):
            try:
                action()
            except BenchError as fault:
                failures.append(f"could not {name}: {fault}")
            except Exception as fault:  # every file is closed, whatever happens to another
                _log.exception("could not %s", name)
                failures.append(f"could not {name}: {fault}")
        return failures
