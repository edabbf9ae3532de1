"""Every decision constant of the comparison, with its source."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ComparisonSettings:
    """Settings of a comparison.

    Attributes:
        dimensions: effective number of independent features in one block (condition, board), by family of features:
            signal, noise, missing frames, onset, drift. The features of a block vary together (one contact, a few bins
            of time), so that a block counts as so many. Chosen; larger numbers make the weights of sets sharper, which
            the calibration compensates.
        resolution_counts: standard deviation, by family, below which differences are not resolved: rounding of counts
            (signal), the error of an estimated standard deviation (noise), a frame period (missing frames, onset).
        prior_odds: odds of each effect before the comparison. One in ten: of twelve effects, about one is present.
        local_odds: odds of a form with values for each board, object or taxel, relative to a form for the whole hand.
            Chosen: a form for the whole hand is preferred if both predict equally well.
        usual_deviation: prior standard deviations up to which a parameter costs nothing. A parameter beyond them lowers
            the log density of a set by half the excess of its squared deviation (a normal prior); two standard
            deviations contain 95 % of the parameters that a prior describes.
        smallest_model_error: smallest relative error of a simulated signal that is assumed. One per cent: no simulator
            of a soft contact is closer to a real one.
        loaded_share: share of the largest mean square signal of a block from which a block counts as loaded.
        candidates: number of effects that are fitted in full in the first step and in each further step.
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
    candidates: tuple[int, int] = (6, 4)
    coarse_iterations: int = 4
    fit_iterations: int = 8
    largest_set: int = 4
    bootstrap_samples: int = 400


DEFAULT_SETTINGS = ComparisonSettings()
