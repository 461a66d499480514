"""Ask the operator to do something and to say that it is done."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.errors import ConfigError
from bench.steps.step import Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Prompt(Step):
    """Show a sentence and wait for the operator's answer."""

    kind: Literal["prompt"]
    text: str
    """What the operator is to do."""

    def run(self, context: RunContext) -> None:
        """Ask and record the answer.

        Raises
        ------
        ConfigError
            If nobody is there to answer (no terminal, or ``--no-input``).
        """
        if context.ask is None:
            message = (
                f"step {self.name} must ask the operator {self.text!r}; instead received "
                "--no-input or no terminal: run it on a terminal, "
                "or take the prompt out of the procedure"
            )
            raise ConfigError(message)
        context.event("prompt", text=self.text, answer=context.ask(self.text))
