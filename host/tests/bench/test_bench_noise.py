"""Noise taken apart: each part recovered, and the right one named."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.bench.synthetic_boards import KINDS
from taxel_tools.bench.analysis.noise import NoiseParts, noise_parts
from taxel_tools.bench.analysis.noise_names import noise_faults

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


def pink(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """1/f noise with a standard deviation of 1 between 0.06 and 8 Hz."""
    frames = 8 * shape[0]
    frequency = np.fft.rfftfreq(frames, 1.0 / RATE_HZ)[1:, None]
    density = 1.0 / np.log(8.0 / 0.06) / frequency
    lines = rng.standard_normal((len(frequency), *shape[1:], 2)) @ np.array([1.0, 1.0j])
    lines *= np.sqrt(density * RATE_HZ * frames / 4.0)
    return np.fft.irfft(np.concatenate((np.zeros((1, *shape[1:])), lines)), frames, axis=0)[: shape[0]]


def record(rng: np.random.Generator, kind=KIND, frames: int = FRAMES, **counts: float) -> np.ndarray:
    """u16[frames, taxels]: an untouched board with these parts of noise, counts."""
    taxels = kind.taxel_count
    signal = (
        2400.0 + 100.0 * rng.standard_normal(taxels) + counts.get("white", 0.0) * rng.standard_normal((frames, taxels))
    )
    signal += counts.get("tx", 0.0) * rng.standard_normal((frames, kind.tx_count))[:, kind.tx]
    signal += counts.get("rx", 0.0) * rng.standard_normal((frames, kind.rx_count))[:, kind.rx]
    signal += counts.get("board", 0.0) * rng.standard_normal((frames, 1))
    signal += counts.get("pink", 0.0) * pink(rng, (frames, taxels))
    signal += counts.get("pink_board", 0.0) * pink(rng, (frames, 1))
    signal += counts.get("walk", 0.0) * np.cumsum(rng.standard_normal((frames, 1)), axis=0)
    width = round(0.005 / SCAN_S * taxels)
    for frame in rng.choice(frames, 40, replace=False) if "impulse" in counts else ():
        start = rng.integers(0, taxels - width)
        signal[frame, start : start + width] += counts["impulse"] * rng.choice([-1.0, 1.0])
    return signal.round().astype(np.uint16)


def parts_of(counts: np.ndarray, kind=KIND) -> NoiseParts:
    return noise_parts(kind, counts, RATE_HZ, SCAN_S)


@pytest.mark.parametrize("seed", range(3))
def test_each_white_part_is_recovered(seed):
    parts = parts_of(record(np.random.default_rng(seed), white=4.0, tx=3.0, rx=6.0, board=5.0))
    assert parts.white == pytest.approx(np.hypot(4.0, 0.29), rel=0.03)  # rounding adds 1/sqrt(12)
    assert parts.tx == pytest.approx(3.0, rel=0.1)
    assert parts.rx == pytest.approx(6.0, rel=0.1)
    assert parts.board == pytest.approx(5.0, rel=0.15)
    assert np.median(parts.white_by_taxel) == pytest.approx(np.sqrt(16 + 9 + 36 + 25), rel=0.1)
    assert (parts.impulse, parts.impulses_per_s) == (0.0, 0.0)


@pytest.mark.parametrize("kind", ["medial_front", "palm"])
def test_quiet_parts_stay_small_beside_a_loud_one(kind):
    rng = np.random.default_rng(1)
    parts = parts_of(record(rng, KINDS[kind], white=20.0), KINDS[kind])
    assert parts.white == pytest.approx(20.0, rel=0.03)
    assert max(parts.tx, parts.rx, parts.board) < 3.0


@pytest.mark.parametrize("seed", range(3))
def test_slow_noise_is_recovered_and_told_from_white(seed):
    parts = parts_of(record(np.random.default_rng(seed), white=4.0, pink=10.0))
    assert parts.pink == pytest.approx(10.0, rel=0.15)
    assert parts.white < 7.5  # 1/f noise goes on above the band in which white noise is read
    assert parts.pink_board < 2.0


def test_slow_noise_of_the_whole_board_is_recovered():
    found = [parts_of(record(np.random.default_rng(seed), white=4.0, pink_board=15.0)).pink_board for seed in range(8)]
    assert np.mean(found) == pytest.approx(15.0, rel=0.25)


@pytest.mark.parametrize("seed", range(3))
def test_impulses_are_found_and_do_not_count_as_other_noise(seed):
    parts = parts_of(record(np.random.default_rng(seed), white=4.0, impulse=60.0))
    assert parts.impulse == pytest.approx(60.0, rel=0.2)
    assert parts.impulses_per_s == pytest.approx(40 / (FRAMES / RATE_HZ), rel=0.1)
    assert parts.white == pytest.approx(4.0, rel=0.05)


def test_a_walk_grows_with_the_lag_and_noise_does_not():
    walk = parts_of(record(np.random.default_rng(1), white=4.0, walk=3.0))
    assert walk.wander == pytest.approx(3.0 * np.sqrt(0.25 * RATE_HZ), rel=0.3)
    assert walk.wander_exponent > 0.6
    slow = parts_of(record(np.random.default_rng(1), white=4.0, pink_board=15.0))
    assert slow.wander_exponent < 0.6


def test_the_spectrum_is_that_of_the_noise():
    parts = parts_of(record(np.random.default_rng(1), white=6.0))
    assert parts.spectrum.mean() * RATE_HZ / 2.0 == pytest.approx(36.0, rel=0.05)
    assert parts.frequency_hz[-1] == pytest.approx(RATE_HZ / 2.0)


def test_a_constant_record_has_no_noise():
    parts = parts_of(np.full((100, KIND.taxel_count), 2400, np.uint16))
    assert max(parts.white, parts.tx, parts.pink, parts.wander, parts.impulse) < 1e-4


def test_too_few_frames_are_refused():
    with pytest.raises(ValueError, match="expected at least 32 frames, found 31"):
        parts_of(record(np.random.default_rng(1), frames=31))


@pytest.mark.parametrize("rate_hz", [6.0, 12.0])
def test_slow_boards_have_noise_too(rate_hz):
    rng = np.random.default_rng(1)
    parts = noise_parts(KIND, record(rng, frames=80, white=4.0, rx=3.0), rate_hz, 0.1)
    assert parts.white == pytest.approx(4.0, rel=0.1)
    assert parts.rx == pytest.approx(3.0, rel=0.35)


@pytest.mark.parametrize("times", [1.5, 10.0])
@pytest.mark.parametrize(
    ("part", "limit", "name"),
    [
        ("white", "white", "white noise"),
        ("tx", "tx", "TX line noise"),
        ("rx", "rx", "RX line noise"),
        ("board", "board", "board noise"),
        ("pink", "pink", "1/f noise"),
        ("impulse", "impulse", "impulses"),
    ],
)
def test_the_part_beyond_its_limit_is_named_and_no_other(part, limit, name, times):
    counts = record(np.random.default_rng(1), **{"white": 4.0, part: times * LIMITS[limit]})
    (fault,) = noise_faults(parts_of(counts), LIMITS)
    assert (fault.name, fault.place) == (name, "board")
    assert fault.severity == pytest.approx(times, rel=0.3)


def test_a_walk_is_called_drift():
    (fault,) = noise_faults(parts_of(record(np.random.default_rng(1), white=4.0, walk=4.0)), LIMITS)
    assert fault.name == "drift"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["medial_front", "back_of_hand"])
def test_nothing_is_named_on_a_quiet_board(kind, seed):
    rng = np.random.default_rng(seed)
    counts = record(rng, KINDS[kind], white=5.0, tx=2.0, rx=2.0, board=2.0, pink=3.0)
    assert noise_faults(parts_of(counts, KINDS[kind]), LIMITS) == []


def test_only_what_the_plan_limits_is_named():
    parts = parts_of(record(np.random.default_rng(1), white=40.0))
    assert noise_faults(parts, {"board": 5.0}) == []
