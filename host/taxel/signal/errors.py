"""What can be wrong with a baseline."""

from taxel.errors import TaxelError

TAXELS_NAMED = 5  # in an error message


class TooFewSamplesError(TaxelError, ValueError):
    """A taxel has fewer valid samples than its baseline needs; carries `taxel`, `needed` and `found`."""

    def __init__(self, taxel: int, needed: int, found: int) -> None:
        super().__init__(
            f"baseline: taxel {taxel} has {found} valid samples, needs {needed}: "
            "record for longer, or look for missing frames"
        )
        self.taxel, self.needed, self.found = taxel, needed, found


class DisturbedBaselineError(TaxelError, ValueError):
    """Taxels were touched while the baseline was taken; carries `taxels`, their indices."""

    def __init__(self, taxels: list[int], n_taxels: int) -> None:
        named = ", ".join(str(taxel) for taxel in taxels[:TAXELS_NAMED])
        more = ", ..." if len(taxels) > TAXELS_NAMED else ""
        super().__init__(
            f"baseline disturbed on {len(taxels)} of {n_taxels} taxels ({named}{more}): "
            "lift everything off the skin and take the baseline again"
        )
        self.taxels = taxels
