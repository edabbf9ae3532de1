"""A force on one taxel activates this taxel and no other taxel."""

import numpy as np
import pytest

from hil_tests.harness.frame_checks import get_address, read_frames
from hil_tests.harness.rig import Rig
from taxel.skin import Skin

pytestmark = pytest.mark.needs("stimulus")
ACTIVE_COUNTS = 150
"""Signal above which a taxel is active, counts below the baseline."""
FORCE_N = 5.0
BOARD_INDICES_AND_TAXELS = ((0, 10), (5, 3), (9, 20), (16, 7))


def measure_mean_counts(rig: Rig, skin: Skin, address: int, seconds: float) -> np.ndarray:
    """Measure the mean raw count of each taxel of the board at `address`, over `seconds`."""
    frames = [frame.raw_counts for frame in read_frames(rig, skin, seconds) if frame.address == address]
    return np.mean(frames, axis=0)


@pytest.mark.parametrize(("index", "taxel"), BOARD_INDICES_AND_TAXELS)
def test_only_the_pressed_taxel_is_active_and_only_until_its_release(
    rig: Rig, skin: Skin, index: int, taxel: int
) -> None:
    address = get_address(rig.hand, index)
    baseline = measure_mean_counts(rig, skin, address, 1.0)
    rig.stimulus.press(address, taxel, FORCE_N)
    read_frames(rig, skin, 0.3)
    signal = baseline - measure_mean_counts(rig, skin, address, 0.5)  # contact lowers the raw count
    assert np.flatnonzero(signal > ACTIVE_COUNTS).tolist() == [taxel]
    rig.stimulus.release()
    read_frames(rig, skin, 0.3)
    assert np.abs(baseline - measure_mean_counts(rig, skin, address, 0.5)).max() < ACTIVE_COUNTS / 2


def test_raw_count_decreases_with_force(rig: Rig, skin: Skin) -> None:
    address, taxel = get_address(rig.hand, 4), 6
    counts = []
    for force_n in (0.5, 2.0, 8.0, 30.0):
        rig.stimulus.press(address, taxel, force_n)
        read_frames(rig, skin, 0.3)
        counts.append(measure_mean_counts(rig, skin, address, 0.3)[taxel])
    assert (np.diff(counts) < -20).all()  # each larger force lowers the mean by more than 20 counts
    rig.stimulus.release()
