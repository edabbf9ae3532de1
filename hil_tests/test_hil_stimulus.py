"""A probe on the skin is seen where it presses, and nowhere else."""

import numpy as np
import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import board_at, watch
from taxel.skin import Skin

pytestmark = pytest.mark.needs("stimulus")
ACTIVE_COUNTS = 150
FORCE_N = 5.0
PLACES = ((0, 10), (5, 3), (9, 20), (16, 7))


def mean_counts(rig: Rig, skin: Skin, address: int, seconds: float) -> np.ndarray:
    frames = [frame.raw_counts for frame in watch(rig, skin, seconds) if frame.address == address]
    return np.mean(frames, axis=0)


@pytest.mark.parametrize(("place", "taxel"), PLACES)
def test_a_pressed_taxel_drops_and_no_other(rig: Rig, skin: Skin, place: int, taxel: int) -> None:
    address = board_at(rig.hand, place)
    rest = mean_counts(rig, skin, address, 1.0)
    rig.stimulus.press(address, taxel, FORCE_N)
    watch(rig, skin, 0.3)
    signal = rest - mean_counts(rig, skin, address, 0.5)
    assert np.flatnonzero(signal > ACTIVE_COUNTS).tolist() == [taxel]
    rig.stimulus.release()
    watch(rig, skin, 0.3)
    assert np.abs(rest - mean_counts(rig, skin, address, 0.5)).max() < ACTIVE_COUNTS / 2


def test_more_force_gives_fewer_counts(rig: Rig, skin: Skin) -> None:
    address, taxel = board_at(rig.hand, 4), 6
    counts = []
    for force_n in (0.5, 2.0, 8.0, 30.0):
        rig.stimulus.press(address, taxel, force_n)
        watch(rig, skin, 0.3)
        counts.append(mean_counts(rig, skin, address, 0.3)[taxel])
    assert (np.diff(counts) < -20).all()
    rig.stimulus.release()
