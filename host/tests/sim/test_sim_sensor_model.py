"""The sensor model of a simulated dataset: raw counts of forces, and noise determined by a seed."""

import pickle

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.sim.sensor_model import SensorModelError, SimSensor

HAND = load_hand("allegro")


def sample_counts(sensor, force, seed=1):
    """Sample raw counts u16[T, n] of a sensor under forces in N, with noise from `seed`."""
    return sensor.raw_counts(HAND, force, np.random.default_rng(seed))


def make_zero_forces(frames):
    return np.zeros((frames, HAND.n_taxels))


def test_the_signal_has_half_its_full_scale_at_the_half_force_and_saturates():
    sensor = SimSensor(full_scale_drop_counts=800.0, half_force_n=2.0)
    assert sensor.predict_signal([0.0, 2.0, 1e9]).tolist() == pytest.approx([0.0, 400.0, 800.0])


def test_without_noise_counts_are_the_rounded_formula():
    sensor = SimSensor(2000.0, 700.0, 1.5, noise_counts=0.0)
    force = np.random.default_rng(2).exponential(1.0, (4, HAND.n_taxels))
    counts = sample_counts(sensor, force)
    assert counts.dtype == np.uint16
    np.testing.assert_array_equal(counts, np.rint(2000.0 - 700.0 * force / (force + 1.5)))


def test_white_noise_has_the_given_standard_deviation_and_no_common_part():
    seed = 3
    noise = sample_counts(SimSensor(noise_counts=4.0), make_zero_forces(300), seed) - SimSensor().baseline_counts
    rounding_std = 12**-0.5
    assert noise.std() == pytest.approx(np.hypot(4.0, rounding_std), rel=0.01), f"seed {seed}"
    assert np.abs(noise.mean(axis=1)).max() < 5 * 4.0 / np.sqrt(HAND.n_taxels), f"seed {seed}"


def test_line_noise_is_equal_on_an_rx_line_and_independent_between_lines():
    seed = 4
    noise = sample_counts(SimSensor(noise_counts=0.0, noise_line_counts=10.0), make_zero_forces(400), seed).astype(
        float
    )
    line = HAND.board_index * 256 + HAND.rx  # unique for board and RX line
    first_taxel_of_line = {}
    for taxel, line_id in enumerate(line.tolist()):
        np.testing.assert_array_equal(noise[:, taxel], noise[:, first_taxel_of_line.setdefault(line_id, taxel)])
    line_noise = noise[:, sorted(first_taxel_of_line.values())]
    assert line_noise.std() == pytest.approx(10.0, rel=0.02), f"seed {seed}"
    correlation_between_lines = np.corrcoef(line_noise.T) - np.eye(line_noise.shape[1])
    assert np.abs(correlation_between_lines).max() < 0.3, f"seed {seed}"


def test_the_same_seed_gives_the_same_counts_and_another_seed_differs():
    sensor = SimSensor(noise_line_counts=3.0)
    assert (
        sample_counts(sensor, make_zero_forces(3), 5).tobytes()
        == sample_counts(sensor, make_zero_forces(3), 5).tobytes()
    )
    assert (
        sample_counts(sensor, make_zero_forces(3), 5).tobytes()
        != sample_counts(sensor, make_zero_forces(3), 6).tobytes()
    )


def test_counts_are_clipped_to_16_bits():
    large_force = np.full((1, HAND.n_taxels), 1e6)
    below_zero = SimSensor(baseline_counts=100.0, full_scale_drop_counts=700.0, half_force_n=1.0)
    assert (sample_counts(below_zero, large_force) == 0).all()
    above_maximum = sample_counts(SimSensor(baseline_counts=65535.0, noise_counts=1e4), make_zero_forces(1))
    assert (above_maximum == 65535).mean() > 0.3  # half of the noise is positive


def test_attributes_have_the_names_of_the_dataset_format():
    assert SimSensor(2000.0, 700.0, 1.5, 4.0, 1.0).attributes() == {
        "baseline_counts": 2000.0,
        "full_scale_drop_counts": 700.0,
        "half_force_n": 1.5,
        "noise_counts": 4.0,
        "noise_line_counts": 1.0,
    }


@pytest.mark.parametrize(
    ("field", "value"),
    [("half_force_n", 0.0), ("full_scale_drop_counts", -1.0), ("noise_counts", -1.0), ("baseline_counts", 70000.0)],
)
def test_a_parameter_out_of_range_gives_one_error_line(field, value):
    with pytest.raises(SensorModelError) as caught:
        SimSensor(**{field: value})
    assert str(caught.value).startswith(f"sensor model: {field}: expected ")
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_negative_nan_or_one_dimensional_forces_are_refused():
    for force in (np.zeros(HAND.n_taxels), -np.ones((1, HAND.n_taxels)), np.full((1, HAND.n_taxels), np.nan)):
        with pytest.raises(ValueError, match="force_n"):
            sample_counts(SimSensor(), force)
