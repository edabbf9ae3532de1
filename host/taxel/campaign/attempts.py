"""Repetition of failed grasps: a grasp that fails by chance is performed again with another random sample."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from taxel.campaign.failure import Failure
from taxel.types import FloatArray

MAX_ATTEMPTS: Final = 3
"""Largest number of attempts of a grasp (chosen). A failure with the probability p in each attempt remains with p^3:
1 % for p = 0.2. More attempts lengthen a campaign and select rare samples of an approach that usually fails.
"""

_Motion = TypeVar("_Motion")


@dataclass(frozen=True, eq=False)
class Attempt(Generic[_Motion]):
    """The attempt of a grasp that a campaign keeps.

    motion: motion of hand and object in this attempt. attempts: number of attempts that were performed. failure: kind
    of this attempt's failure; None if this attempt succeeded.
    """

    motion: _Motion
    attempts: int
    failure: Failure | None


def perform_attempts(
    perform: Callable[[FloatArray], _Motion],
    find_failure: Callable[[_Motion], Failure | None],
    sample: Callable[[int], FloatArray],
    max_attempts: int = MAX_ATTEMPTS,
) -> Attempt[_Motion]:
    """Perform a grasp until an attempt succeeds, and return this attempt.

    perform: simulates the grasp for unit samples f64[7] of the variation. find_failure: returns the failure of a
    motion, or None. sample: returns the unit samples of attempt 0, 1 ... If all attempts fail, the result is the first
    attempt with its failure: its motion is the motion of a campaign without repetition.

    Before the second attempt, the grasp is performed without variation (all samples 0). If it fails without variation,
    the planned pose itself is the reason, and a success would only be a lucky sample. The result is then the first
    attempt, and there are no further attempts.
    """
    first_sample = sample(0)
    first = perform(first_sample)
    failure = find_failure(first)
    if failure is None or max_attempts < 2 or find_failure(perform(0.0 * first_sample)) is not None:
        return Attempt(first, 1, failure)
    for attempt in range(1, max_attempts):
        motion = perform(sample(attempt))
        if find_failure(motion) is None:
            return Attempt(motion, attempt + 1, None)
    return Attempt(first, max_attempts, failure)
