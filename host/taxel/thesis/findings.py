"""The qualitative statements of section 5.6 of the thesis and of its conclusion as findings with a test each.

A test is the statement itself, as an inequality between entries of the tables; no threshold is fitted. Two words need
a convention: "significantly", "much" is a factor of at least `SIGNIFICANT`, and "the majority" is more than half.
`statements` contains the statements, `finding_tests` and `real_to_sim_tests` the tests.

The same test is applied to the printed tables. An object for which the printed tables contradict the statement is
shown, but not counted; a finding that they contradict for every object is not counted at all. Without printed numbers,
every object is counted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.shape_counts import ShapeCount
from taxel.thesis.statement import Evidence, Outcome, Statement
from taxel.thesis.statements import STATEMENTS


@dataclass(frozen=True)
class Finding:
    """A statement of the thesis, tested on reproduced results.

    number: position in `STATEMENTS`, from 1. numbers: number that the test returns, by printed name of the object.
    holds: whether the statement holds, by object. printed, printed_holds: the same for the printed tables; empty
    without printed numbers.
    """

    number: int
    statement: Statement
    numbers: dict[str, float]
    holds: dict[str, bool]
    printed: dict[str, float] = field(default_factory=dict)
    printed_holds: dict[str, bool] = field(default_factory=dict)

    @property
    def counted(self) -> tuple[str, ...]:
        """Objects that are counted: those for which the printed tables do not contradict the statement."""
        return tuple(name for name in self.numbers if self.printed_holds.get(name, True))

    @property
    def is_counted(self) -> bool:
        """Whether the finding is counted: the printed tables do not contradict it for every object."""
        return bool(self.counted)

    @property
    def is_reproduced(self) -> bool:
        """Whether the finding is counted and holds for every counted object."""
        return self.is_counted and all(self.holds[name] for name in self.counted)

    @property
    def failed(self) -> tuple[str, ...]:
        """Counted objects for which the finding does not hold."""
        return tuple(name for name in self.counted if not self.holds[name])

    @property
    def reason(self) -> str:
        """One-line reason why the finding is not reproduced or not counted; empty for a reproduced finding."""
        if not self.is_counted:
            return "the thesis's own tables contradict the sentence for every object"
        unit = "" if self.statement.unit == "1" else f" {self.statement.unit}"
        parts = []
        for name in self.failed:
            printed = f", thesis {self.printed[name]:.3g}{unit}" if name in self.printed else ""
            parts.append(f"{name}: {self.numbers[name]:.3g}{unit}{printed}")
        return f"fails for {'; '.join(parts)}" if parts else ""

    def to_json(self) -> dict[str, Any]:
        """Convert the finding to JSON values."""
        return {
            "number": self.number,
            "key": self.statement.key,
            "says": self.statement.text,
            "source": self.statement.source,
            "test": self.statement.criterion,
            "unit": self.statement.unit,
            "numbers": self.numbers,
            "thesis": self.printed,
            "holds": self.holds,
            "counted_objects": self.counted,
            "counted": self.is_counted,
            "reproduced": self.is_reproduced,
            "reason": self.reason,
        }


def evaluate_findings(results: Sequence[ObjectResult], shapes: Sequence[ShapeCount] = ()) -> list[Finding]:
    """Test all statements on the results; a statement whose necessary results are missing is left out.

    results: results of the objects, in the order of the thesis. shapes: numbers of identified shapes.
    """
    evidence = Evidence(tuple(results), tuple(shapes))
    printed = Evidence(build_printed_results())
    findings = []
    for number, statement in enumerate(STATEMENTS, 1):
        outcomes, printed_outcomes = statement.test(evidence), statement.test(printed)
        if outcomes is None:
            continue
        numbers, holds = _split_outcomes(outcomes)
        findings.append(Finding(number, statement, numbers, holds, *_split_outcomes(printed_outcomes or {})))
    return findings


def _split_outcomes(outcomes: Mapping[str, Outcome]) -> tuple[dict[str, float], dict[str, bool]]:
    """Split the outcomes of a test into the numbers by object, and whether the statement holds by object."""
    numbers = {name: float(number) for name, (number, _) in outcomes.items()}
    return numbers, {name: bool(holds) for name, (_, holds) in outcomes.items()}


def count_reproduced(findings: Sequence[Finding]) -> tuple[int, int]:
    """Return the number of reproduced findings and the number of counted findings, in this order."""
    return sum(finding.is_reproduced for finding in findings), sum(finding.is_counted for finding in findings)
