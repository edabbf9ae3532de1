"""Separation of noise into components, and noise faults."""

import numpy as np
import pytest

from host.tests.bench.synthetic_boards import KINDS
from taxel_tools.bench.analysis.noise import NoiseParts, separate_noise
from taxel_tools.bench.analysis.noise_faults import find_noise_faults

RATE_HZ = 60.0
FRAMES = 780
SCAN_S = 0.016
LIMITS = {
    "white": 8.0,
    "tx": 5.0,
    "rx": 5.0,
    "board": 5.0,
    "pink": 8.0,
    "pink_board": 6.0,
    "wander": 6.0,
    "impulse": 25.0,
}
KIND = KINDS["back_of_hand"]


def sample_pink_noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Sample 1/f noise with a standard deviation of 1 between 0.06 and 8 Hz."""
    frames = 8 * shape[0]
    frequency = np.fft.rfftfreq(frames, 1.0 / RATE_HZ)[1:, None]
    density = 1.0 / np.log(8.0 / 0.06) / frequency
    lines = rng.standard_normal((len(frequency), *shape[1:], 2)) @ np.array([1.0, 1.0j])
    lines *= np.sqrt(density * RATE_HZ * frames / 4.0)
    return np.fft.irfft(np.concatenate((np.zeros((1, *shape[1:])), lines)), frames, axis=0)[: shape[0]]


def sample_record(rng: np.random.Generator, kind=KIND, frames: int = FRAMES, **counts: float) -> np.ndarray:
    """Sample raw counts u16[frames, taxels] of an untouched board with these noise components, in counts."""
    taxels = kind.taxel_count
    raw_counts = (
        2400.0 + 100.0 * rng.standard_normal(taxels) + counts.get("white", 0.0) * rng.standard_normal((frames, taxels))
    )
    raw_counts += counts.get("tx", 0.0) * rng.standard_normal((frames, kind.tx_count))[:, kind.tx]
    raw_counts += counts.get("rx", 0.0) * rng.standard_normal((frames, kind.rx_count))[:, kind.rx]
    raw_counts += counts.get("board", 0.0) * rng.standard_normal((frames, 1))
    raw_counts += counts.get("pink", 0.0) * sample_pink_noise(rng, (frames, taxels))
    raw_counts += counts.get("pink_board", 0.0) * sample_pink_noise(rng, (frames, 1))
    raw_counts += counts.get("walk", 0.0) * np.cumsum(rng.standard_normal((frames, 1)), axis=0)
    width = round(0.005 / SCAN_S * taxels)
    for frame in rng.choice(frames, 40, replace=False) if "impulse" in counts else ():
        start = rng.integers(0, taxels - width)
        raw_counts[frame, start : start + width] += counts["impulse"] * rng.choice([-1.0, 1.0])
    return raw_counts.round().astype(np.uint16)


def separate_components(counts: np.ndarray, kind=KIND) -> NoiseParts:
    return separate_noise(kind, counts, RATE_HZ, SCAN_S)


@pytest.mark.parametrize("seed", range(3))
def test_each_white_component_is_recovered(seed):
    components = separate_components(sample_record(np.random.default_rng(seed), white=4.0, tx=3.0, rx=6.0, board=5.0))
    assert components.white == pytest.approx(np.hypot(4.0, 0.29), rel=0.03)  # Rounding adds 1/sqrt(12).
    assert components.tx == pytest.approx(3.0, rel=0.1)
    assert components.rx == pytest.approx(6.0, rel=0.1)
    assert components.board == pytest.approx(5.0, rel=0.15)
    # The white noise of a single taxel contains all four components, whose variances add up.
    assert np.median(components.white_by_taxel) == pytest.approx(np.sqrt(16 + 9 + 36 + 25), rel=0.1)
    assert (components.impulse, components.impulses_per_s) == (0.0, 0.0)


@pytest.mark.parametrize("kind", ["medial_front", "palm"])
def test_strong_white_noise_leaks_little_into_other_components(kind):
    rng = np.random.default_rng(1)
    components = separate_components(sample_record(rng, KINDS[kind], white=20.0), KINDS[kind])
    assert components.white == pytest.approx(20.0, rel=0.03)
    assert max(components.tx, components.rx, components.board) < 3.0


@pytest.mark.parametrize("seed", range(3))
def test_1_f_noise_is_recovered_and_separated_from_white_noise(seed):
    components = separate_components(sample_record(np.random.default_rng(seed), white=4.0, pink=10.0))
    assert components.pink == pytest.approx(10.0, rel=0.15)
    assert components.white < 7.5  # 1/f noise extends above the lower limit of the white band.
    assert components.pink_board < 2.0


def test_1_f_noise_shared_by_the_board_is_recovered():
    estimates = [
        separate_components(sample_record(np.random.default_rng(seed), white=4.0, pink_board=15.0)).pink_board
        for seed in range(8)
    ]
    assert np.mean(estimates) == pytest.approx(15.0, rel=0.25)


@pytest.mark.parametrize("seed", range(3))
def test_impulses_are_found_and_excluded_from_other_components(seed):
    components = separate_components(sample_record(np.random.default_rng(seed), white=4.0, impulse=60.0))
    assert components.impulse == pytest.approx(60.0, rel=0.2)
    assert components.impulses_per_s == pytest.approx(40 / (FRAMES / RATE_HZ), rel=0.1)  # 40 impulses in the record
    assert components.white == pytest.approx(4.0, rel=0.05)


def test_changes_of_a_random_walk_grow_faster_with_the_lag_than_1_f_noise():
    """`mean_change_exponent`: exponent of the growth of the squared change with the lag. Drift has more than 0.6.

    The steps of the random walk, one per frame, have a standard deviation of 3 counts.
    """
    drift = separate_components(sample_record(np.random.default_rng(1), white=4.0, walk=3.0))
    steps = 0.25 * RATE_HZ  # `mean_change` is the change within 0.25 s
    assert drift.mean_change == pytest.approx(3.0 * np.sqrt(steps), rel=0.3)
    assert drift.mean_change_exponent > 0.6
    pink_noise = separate_components(sample_record(np.random.default_rng(1), white=4.0, pink_board=15.0))
    assert pink_noise.mean_change_exponent < 0.6


def test_the_spectrum_integrates_to_the_variance():
    components = separate_components(sample_record(np.random.default_rng(1), white=6.0))
    assert components.spectrum.mean() * RATE_HZ / 2.0 == pytest.approx(36.0, rel=0.05)
    assert components.frequency_hz[-1] == pytest.approx(RATE_HZ / 2.0)


def test_a_constant_record_has_no_noise():
    components = separate_components(np.full((100, KIND.taxel_count), 2400, np.uint16))
    assert max(components.white, components.tx, components.pink, components.mean_change, components.impulse) < 1e-4


def test_too_few_frames_are_refused():
    with pytest.raises(ValueError, match="expected at least 32 frames, found 31"):
        separate_components(sample_record(np.random.default_rng(1), frames=31))


@pytest.mark.parametrize("rate_hz", [6.0, 12.0])
def test_components_are_recovered_at_low_frame_rates(rate_hz):
    rng = np.random.default_rng(1)
    components = separate_noise(KIND, sample_record(rng, frames=80, white=4.0, rx=3.0), rate_hz, scan_s=0.1)
    assert components.white == pytest.approx(4.0, rel=0.1)
    assert components.rx == pytest.approx(3.0, rel=0.35)


@pytest.mark.parametrize("factor", [1.5, 10.0])
@pytest.mark.parametrize(
    ("component", "limit", "name"),
    [
        ("white", "white", "white noise"),
        ("tx", "tx", "TX line noise"),
        ("rx", "rx", "RX line noise"),
        ("board", "board", "board noise"),
        ("pink", "pink", "1/f noise"),
        ("impulse", "impulse", "impulses"),
    ],
)
def test_only_the_component_beyond_its_limit_is_reported(component, limit, name, factor):
    counts = sample_record(np.random.default_rng(1), **{"white": 4.0, component: factor * LIMITS[limit]})
    (fault,) = find_noise_faults(separate_components(counts), LIMITS)
    assert (fault.name, fault.place) == (name, "board")
    assert fault.severity == pytest.approx(factor, rel=0.3)


def test_a_random_walk_is_reported_as_drift():
    (fault,) = find_noise_faults(
        separate_components(sample_record(np.random.default_rng(1), white=4.0, walk=4.0)), LIMITS
    )
    assert fault.name == "drift"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["medial_front", "back_of_hand"])
def test_a_quiet_board_has_no_noise_fault(kind, seed):
    rng = np.random.default_rng(seed)
    counts = sample_record(rng, KINDS[kind], white=5.0, tx=2.0, rx=2.0, board=2.0, pink=3.0)
    assert find_noise_faults(separate_components(counts, KINDS[kind]), LIMITS) == []


def test_only_components_with_a_limit_are_reported():
    components = separate_components(sample_record(np.random.default_rng(1), white=40.0))
    assert find_noise_faults(components, {"board": 5.0}) == []
