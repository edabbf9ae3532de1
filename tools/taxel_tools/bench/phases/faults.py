"""Phase `faults`: list of the faults of the board."""

from taxel_tools.bench.analysis.merging import merge_faults
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options


class Faults:
    """Phase that merges the faults which the other phases have detected, so that each fault is reported once."""

    name = "faults"
    title = "Named faults"
    is_automatic = True
    limit_names = frozenset[str]()

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return why faults cannot be reported: no other phase has measured the board; "" if one has.

        Without this requirement, a test without measurements would pass.
        """
        return "" if board.was_measured else "no other phase has run"

    def check_options(self, options: Options) -> None:
        """Check nothing, as this phase has no options."""

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Merge the faults that other phases have detected, and report them as findings."""
        options.refuse_unknown_keys()
        evidence = board.evidence
        merged = merge_faults(board.kind, evidence.at_rest, evidence.response)
        for fault in sorted((*merged, *evidence.board), key=lambda fault: -fault.severity):
            log.add_finding(fault.name, fault.place, fault.text, fault.severity)
        if evidence.response is None:
            log.add_note(
                "no taxel was indented: dead taxels, low gain and swapped lines of equal length are not detectable"
            )
