"""Errors of the baseline."""

from taxel.errors import TaxelError

LISTED_TAXELS = 5  # in an error message


class TooFewSamplesError(TaxelError, ValueError):
    """Error: a taxel has fewer valid samples than its baseline requires. Attributes: taxel, needed, found."""

    def __init__(self, taxel: int, needed: int, found: int) -> None:
        """Create the error for a baseline with too few samples.

        taxel: index of the first such taxel. needed, found: required and existing number of valid samples.
        """
        super().__init__(
            f"baseline: taxel {taxel}: expected {needed} valid samples, found {found}; "
            "record for longer, or check for missing frames"
        )
        self.taxel, self.needed, self.found = taxel, needed, found


class DisturbedBaselineError(TaxelError, ValueError):
    """Error: taxels were touched while the baseline was taken. Attributes: taxels (their indices)."""

    def __init__(self, taxels: list[int], n_taxels: int) -> None:
        """Create the error of a touch during the baseline.

        taxels: indices of the touched taxels. n_taxels: number of taxels of the skin.
        """
        listed = ", ".join(str(taxel) for taxel in taxels[:LISTED_TAXELS])
        more = ", ..." if len(taxels) > LISTED_TAXELS else ""
        super().__init__(
            f"baseline disturbed on {len(taxels)} of {n_taxels} taxels ({listed}{more}); "
            "remove all objects from the skin and repeat the baseline"
        )
        self.taxels = taxels
