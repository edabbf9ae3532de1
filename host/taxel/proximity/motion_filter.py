"""Recursive Bayesian estimation of distance and approach speed on a grid, jointly with shape and kind of the target."""

import numpy as np

from taxel.proximity.motion_grid import ARRIVAL_TIME_S, CENTRES_M, SPEEDS_M_S, Transition, compute_speed_widths
from taxel.types import FloatArray, IntArray

NEGLIGIBLE_SHARE = 1e-3
"""Templates whose probability is below this share of the largest probability are left out. The mixing of shapes
redistributes 3e-4 per frame to each of some 300 templates; a template below the limit has hardly more than this share,
and a smaller likelihood than the others. The time per frame decreases by a factor of 3 to 10."""

RETURN_MARGIN = 3.0
"""Excess of the log-likelihood of a left-out template over that of the best kept template at which all templates are
used again. With a smaller excess, mixing would give a returned template at most a few percent (3e-4 exp(3)). If
templates never returned, a target whose shape was first mistaken would contradict all kept templates and be taken for a
contact."""

NO_TARGET = 1e-6
"""Probability of a target without contact below which the estimated shape is discarded."""

RESUME_PROBABILITY_S = 2.0
"""Rate at which a contact ends, per second."""


class MotionFilter:
    """Probabilities of the state of a target in front of one board.

    `present`: f32[V, K, G], probabilities of a target that does not touch, by V approach speeds, K templates (shape and
    kind of target) and G distances; `far`, `contact`: probabilities of no target in range, and of a contact. All of
    them add up to 1. `template`: i64[K], index of each kept template on the first axis of the likelihoods.
    """

    def __init__(self, prior: FloatArray) -> None:
        """Start without a target. prior: prior weight of each template, f64[all templates]."""
        self.reset(prior)

    def reset(self, prior: FloatArray) -> None:
        """Return to the state without a target. prior: prior weight of each template, f64[all templates]."""
        self._prior = (prior / prior.sum()).astype(np.float32)
        self.template: IntArray = np.arange(len(prior))
        self.present = np.zeros((len(SPEEDS_M_S), len(prior), len(CENTRES_M)), dtype=np.float32)
        self.far, self.contact = 1.0, 0.0

    def forget_shape(self) -> None:
        """Keep the probabilities of distance and speed, and set those of the templates to the prior."""
        motion = self.present.sum(axis=1)
        self.template = np.arange(len(self._prior))
        self.present = motion[:, None, :] * self._prior[None, :, None]

    def predict(self, transition: Transition) -> None:
        """Advance the probabilities by the time interval of `transition`, without a measurement.

        A present target changes its distance and speed. It can touch the skin (`contact`), or leave the range or
        disappear sideways (`far`). A new target can arrive, and a contact can end.
        """
        motion = self.present.sum(axis=1)
        touched = float((motion * transition.contact).sum())
        departed = float((motion * transition.far).sum())
        moved = np.matmul(self.present, transition.shift)
        flat = moved.reshape(len(SPEEDS_M_S), -1)
        present = (transition.speed.T @ flat).reshape(moved.shape)
        leaving, arriving = transition.leaving_share, transition.arrival_share
        disappeared = float(present.sum()) * leaving
        # `arriving` times the mean arrival time is approximately the interval in seconds.
        released = self.contact * min(1.0, RESUME_PROBABILITY_S * arriving * ARRIVAL_TIME_S)
        arrived = self.far * arriving
        present *= 1.0 - leaving
        prior = self._prior[self.template]
        prior = prior / prior.sum()
        mixed = transition.shape_share * present.sum(axis=1)
        present *= 1.0 - transition.shape_share
        present += mixed[:, None, :] * prior[None, :, None]
        present += arrived * transition.arrival[:, None, :] * prior[None, :, None]
        present += released * _RELEASE[:, None, :] * prior[None, :, None]
        self.present = present
        self.contact += touched - released
        self.far += departed + disappeared - arrived

    def update(self, log_likelihood: FloatArray, log_absent: float, log_contact: float) -> None:
        """Multiply the probabilities by the likelihoods of a frame and normalise them.

        log_likelihood: f64[all templates, G]. log_absent, log_contact: log-likelihoods of no target and of a contact.
        Improbable templates are left out afterwards; all templates are used again if a left-out template fits clearly
        better. If all states are impossible, the filter restarts without a target.
        """
        kept = log_likelihood[self.template]
        if len(self.template) < len(self._prior) and self._exclude_better(log_likelihood):
            self._use_all_templates()
            kept = log_likelihood
        largest = max(float(kept.max()), log_absent, log_contact)
        self.present *= np.exp(kept - largest).astype(np.float32)
        self.far *= float(np.exp(log_absent - largest))
        self.contact *= float(np.exp(log_contact - largest))
        total = float(self.present.sum()) + self.far + self.contact
        if not total > 1e-30:  # all states are impossible
            self.reset(self._prior)
            return
        self.present /= total
        self.far /= total
        self.contact /= total
        self._prune_templates()

    def _exclude_better(self, log_likelihood: FloatArray) -> bool:
        """Whether a left-out template fits a frame better than all kept templates by more than `RETURN_MARGIN`.

        log_likelihood: f64[all templates, G]. The likelihoods are weighted with the present probabilities of the
        distances.
        """
        motion = np.log(self.present.sum(axis=(0, 1)) + 1e-30)
        best = (log_likelihood + motion).max(axis=1)
        return bool(best.max() > best[self.template].max() + RETURN_MARGIN)

    def _use_all_templates(self) -> None:
        """Use all templates again, also those that were left out.

        The share `NEGLIGIBLE_SHARE` of the probability is distributed over all templates by the prior; the templates in
        use keep the rest.
        """
        present = NEGLIGIBLE_SHARE * self.present.sum(axis=1)[:, None, :] * self._prior[None, :, None]
        present[:, self.template] += (1.0 - NEGLIGIBLE_SHARE) * self.present
        self.present = present
        self.template = np.arange(len(self._prior))

    def _prune_templates(self) -> None:
        """Leave out templates with negligible probability if a target is present; use all templates again if none is.

        Templates are left out only if at least a fifth of them is negligible, because the arrays are copied.
        """
        weight = self.present.sum(axis=(0, 2))
        if float(weight.sum()) < NO_TARGET:
            if len(self.template) < len(self._prior):
                self.forget_shape()
            return
        kept = weight > NEGLIGIBLE_SHARE * weight.max()
        if self.far < 0.5 and kept.sum() < 0.8 * len(kept):
            self.present = np.ascontiguousarray(self.present[:, kept])
            self.template = self.template[kept]

    @property
    def motion(self) -> FloatArray:
        """Joint probabilities f64[V, G] of speed and distance of a target that does not touch."""
        return np.asarray(self.present.sum(axis=1), dtype=np.float64)


def _compute_release() -> FloatArray:
    """Compute the distribution of speed and distance of a target after a contact, f32[V, G].

    The target is uniformly distributed over the bins within 2 mm, at rest or withdrawing.
    """
    mass = np.outer(compute_speed_widths() * (SPEEDS_M_S <= 0), CENTRES_M < 2e-3)
    return np.asarray(mass / mass.sum(), dtype=np.float32)


_RELEASE = _compute_release()
