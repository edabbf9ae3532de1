"""Samples of causes of a demonstration until one is large enough."""

import numpy as np
import pytest

from taxel.blind.catalogue_causes import CATALOGUE_CAUSES
from taxel.blind.cause_types import CauseType
from taxel.blind.hidden import Cause
from taxel.blind.large_causes import LARGE_SIZE, MAX_STRENGTH, MOST_TRIALS, enlarge
from taxel.blind.world_datasets import UndescribedSettings
from taxel.campaign.session_world import check_world
from taxel.campaign.setup import Setup
from taxel.hand import load_hand


def make_cause(size: float) -> Cause:
    """Make a cause with a size in floors, which is its true parameter."""
    return Cause("noise", "noise white", (), (), {"size": size})


def get_size(cause: Cause) -> float:
    """Return the size of a cause made by `make_cause`."""
    return cause.parameters["size"]


def refuse_sample(strength: float) -> Cause:
    """Fail: no further sample is expected."""
    raise AssertionError("a further sample of a cause that is large enough")


def test_a_large_cause_is_kept():
    cause = make_cause(LARGE_SIZE)
    assert enlarge(cause, get_size, refuse_sample) is cause


def test_a_small_cause_is_sampled_again_with_a_larger_strength():
    """A cause of 1.5 floors is below `LARGE_SIZE` (2 floors); the next sample, of 2.4 floors, is large enough."""
    strengths = []

    def sample(strength: float) -> Cause:
        strengths.append(strength)
        return make_cause(2.4)

    assert get_size(enlarge(make_cause(1.5), get_size, sample)) == 2.4
    assert len(strengths) == 1
    assert 1.0 < strengths[0] <= MAX_STRENGTH


def test_the_largest_of_all_samples_is_used_if_none_is_large_enough():
    """All samples (0.3, 1.2 and 0.4 floors) are below `LARGE_SIZE`, 2 floors."""
    sizes = iter([1.2, 0.4])
    strengths = []

    def sample(strength: float) -> Cause:
        strengths.append(strength)
        return make_cause(next(sizes))

    assert get_size(enlarge(make_cause(0.3), get_size, sample)) == 1.2
    assert strengths == [MAX_STRENGTH] * (MOST_TRIALS - 1)


@pytest.mark.parametrize("cause_type", CATALOGUE_CAUSES, ids=lambda one: one.emulator_effect.replace(" ", "_"))
def test_the_emulator_accepts_every_cause_of_the_largest_strength(cause_type: CauseType):
    hand = load_hand("original")
    causes = [cause_type.sample(np.random.default_rng(seed), hand, MAX_STRENGTH) for seed in range(3)]
    for cause in causes:
        lines = tuple(line.replace(" OBJECT ", " cylinder ") for line in cause.lines)
        check_world(Setup(), UndescribedSettings(seed=1, effects=lines))
