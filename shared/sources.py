"""What a balance of the model may lack, as the system description declares it: missing heat, a missing trace gas."""

from __future__ import annotations

from pydantic import Field

from shared.signals import Table


class Source(Table):
    """A source that the model does not have: diagnosis puts pulses on an input of the FMU to see what it would do.

    One unit of ``input`` brings ``per`` of the source: a number [unit], or the name of an estimated parameter, whose
    fitted value counts. What it brings beside that are other sources, ``less``, which are taken off again.
    """

    name: str = Field(description="in reports")
    description: str = Field("", description="as a reader sees it, for example 'missing heat'")
    unit: str = Field(min_length=1, description="of what it brings, such as W or kg/s")
    input: str = Field(description="the FMU input that carries the pulses")
    parameters: dict[str, float] = Field({}, description="FMU parameters while it does [unit of each]")
    per: float | str = Field(1.0, description="what one unit of the input brings: a number, or an estimated parameter")
    less: dict[str, float] = Field({}, description="by name of a source declared before: its amount per unit of input")

    def fault(self, inputs: list[str], parameters: list[str], before: list[str]) -> str:
        """What is wrong with it in a system with these names, as a sentence; empty if nothing is."""
        if self.input not in inputs:
            return f"sources: {self.name!r} acts on {self.input!r}, which is not an input"
        if isinstance(self.per, str) and self.per not in parameters:
            return f"sources: {self.name!r} is measured per {self.per!r}, which is not an estimated parameter"
        if self.per == 0:
            return f"sources: {self.name!r} has per = 0; expected what one unit of {self.input!r} brings"
        if self.name in before:
            return f"sources: {self.name!r} is declared twice"
        for name in self.less:
            if name not in before:
                return f"sources: {self.name!r} is less {name!r}, which is no source that is declared before it"
        return ""
