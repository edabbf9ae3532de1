"""Capacitance and current source from the counts of a known capacitor with increasing currents.

During a conversion the current source is on for count = period 2 C V f / I sample clocks, I = code x step
(`firmware/boards/psoc4200/front_end.c`). The product of count and code is therefore constant.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from typing import Final

PERIOD: Final = 4000
"""Sample clocks of a conversion of the bring-up image."""
TX_HZ: Final = 300e3
IDAC_STEP_A: Final = 1.2e-6
LARGEST_USABLE: Final = 0.95
"""Share of the period above which the current source does not balance the charge."""
COUNT_ERROR: Final = 2.0
"""Standard error of a count, for the comparison with the law: rounding and noise of the converter."""
SMALLEST_LARGEST: Final = 5.0 * COUNT_ERROR
"""Largest count of a converter that counts only noise: a count beyond it has a probability of 3e-7 without a signal."""
LAW_DEVIATIONS: Final = 4.0
"""Deviation in standard errors above which the law is rejected; 15 correct counts exceed it once in 1,000 tests."""


@dataclass(frozen=True)
class CapacitorResult:
    """Result of one variant of the circuit.

    capacitance_pf: computed with the assumed step of the current source. follows_law: whether count and code are
    inversely proportional. usable: number of counts that are neither 0 nor saturated.
    """

    capacitance_pf: float
    follows_law: bool
    usable: int

    def compute_step_ua(self, known_pf: float) -> float:
        """Compute the step of the current source in microamperes from the known capacitance."""
        return known_pf / self.capacitance_pf * IDAC_STEP_A * 1e6


def evaluate_counts(counts: Mapping[int, int], supply_v: float = 3.3) -> CapacitorResult | None:
    """Evaluate the counts of a known capacitor by code of the current source.

    The current is proportional to the code, so the product of count and code is constant for a correct converter.
    Returns None if all counts are 0 or saturated, or no larger than noise. supply_v: supply voltage of the board, which
    is the voltage of the sense clock.
    """
    usable = {code: count for code, count in counts.items() if 0 < count < LARGEST_USABLE * PERIOD}
    if not usable or max(usable.values()) < SMALLEST_LARGEST:
        return None
    constant = median(code * count for code, count in usable.items())
    # Two errors add up: COUNT_ERROR of the count itself, and the error of the predicted count constant / code. The
    # relative error of the constant is at least that of the largest count, COUNT_ERROR / largest.
    largest = max(usable.values())
    follows = all(
        abs(count - constant / code) <= LAW_DEVIATIONS * COUNT_ERROR * (1.0 + count / largest)
        for code, count in usable.items()
    )
    # Solved for C: count = PERIOD 2 C V f / I with I = code x step, so constant = count x code = PERIOD 2 C V f / step.
    capacitance = constant * IDAC_STEP_A / (2.0 * supply_v * TX_HZ * PERIOD)
    return CapacitorResult(capacitance * 1e12, follows, len(usable))
