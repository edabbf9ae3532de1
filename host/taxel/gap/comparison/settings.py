"""Settings of the comparison: its decision constants, with their sources."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ComparisonSettings:
    """Settings of a comparison.

    Attributes:
        dimensions: effective number of independent features of one board in one condition, by family of features:
            signal, noise, missing frames, onset, drift. The features of a block are correlated (one contact, a few
            time bins). Chosen; larger numbers make the weights of sets sharper, for which the calibration compensates.
        resolution_counts: standard deviation, by family, below which differences are not resolved: rounding of counts
            (signal), the error of an estimated standard deviation (noise), a frame period (missing frames, onset).
        prior_odds: prior odds of each effect. Chosen: one in ten means that about one of twelve effects is present.
        local_odds: odds of a form with values for each board, object or taxel, relative to a form for the whole hand.
            Chosen: a form for the whole hand is preferred if both predict equally well.
        usual_deviation: deviation of a parameter from its prior mean, in prior standard deviations, up to which the
            parameter has no penalty. Beyond it, the log density of a set decreases by half the excess of the squared
            deviation (normal prior). Two standard deviations contain 95 % of a normal distribution.
        smallest_model_error: lower limit of the relative error of a simulated signal. Chosen: no simulator of a soft
            contact is assumed to be more accurate than one per cent.
        loaded_share: share of the largest mean square signal of a board in a condition, above which a board in a
            condition is treated as loaded (chosen).
        candidates: number of sets that are fitted in full in the first iteration and in each further iteration.
        coarse_iterations, fit_iterations: iterations of the fits that select the candidates, and of the full fits.
        largest_set: number of effects in the largest set.
        bootstrap_samples: number of resamples of the conditions.
    """

    dimensions: tuple[float, ...] = (4.0, 2.0, 1.0, 2.0, 1.0)
    resolution_counts: tuple[float, ...] = (1.0, 0.55, 2.0, 3.0, 0.7)
    prior_odds: float = 0.1
    local_odds: float = 0.1
    usual_deviation: float = 2.0
    smallest_model_error: float = 0.01
    loaded_share: float = 1e-3
    candidates: tuple[int, int] = (8, 4)
    coarse_iterations: int = 4
    fit_iterations: int = 8
    largest_set: int = 4
    bootstrap_samples: int = 400


DEFAULT_SETTINGS = ComparisonSettings()
