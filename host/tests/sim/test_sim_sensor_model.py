"""Forces become raw counts by the form of the dataset's sensor model, with noise that a seed repeats."""

import pickle

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.sim.sensor_model import SensorModelError, SimSensor

HAND = load_hand("allegro")


def counts(sensor, force, seed=1):
    return sensor.raw_counts(HAND, force, np.random.default_rng(seed))


def at_rest(frames):
    return np.zeros((frames, HAND.n_taxels))


def test_the_signal_saturates_with_half_of_it_at_the_half_force():
    sensor = SimSensor(full_scale_drop_counts=800.0, half_force_n=2.0)
    assert sensor.predict_signal([0.0, 2.0, 1e9]).tolist() == pytest.approx([0.0, 400.0, 800.0])
    assert sensor.predict_signal(sensor.force_for(150.0)) == pytest.approx(150.0)
    assert sensor.force_for(800.0) == np.inf


def test_without_noise_counts_are_the_rounded_formula():
    sensor = SimSensor(2000.0, 700.0, 1.5, noise_counts=0.0)
    force = np.random.default_rng(2).exponential(1.0, (4, HAND.n_taxels))
    found = counts(sensor, force)
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, np.rint(2000.0 - 700.0 * force / (force + 1.5)))


def test_white_noise_has_its_deviation_and_shares_nothing():
    seed = 3
    noise = counts(SimSensor(noise_counts=4.0), at_rest(300), seed) - SimSensor().baseline_counts
    assert noise.std() == pytest.approx(np.hypot(4.0, 12**-0.5), rel=0.01), f"seed {seed}"
    assert np.abs(noise.mean(axis=1)).max() < 5 * 4.0 / np.sqrt(HAND.n_taxels), f"seed {seed}"


def test_line_noise_is_common_to_an_rx_line_of_one_board_in_one_frame():
    seed = 4
    noise = counts(SimSensor(noise_counts=0.0, noise_line_counts=10.0), at_rest(400), seed).astype(float)
    line = HAND.board_index * 256 + HAND.rx
    first = {}
    for taxel, own in enumerate(line.tolist()):
        np.testing.assert_array_equal(noise[:, taxel], noise[:, first.setdefault(own, taxel)])
    drawn = noise[:, sorted(first.values())]
    assert drawn.std() == pytest.approx(10.0, rel=0.02), f"seed {seed}"
    between = np.corrcoef(drawn.T) - np.eye(drawn.shape[1])
    assert np.abs(between).max() < 0.3, f"seed {seed}"


def test_the_same_seed_gives_the_same_counts():
    sensor = SimSensor(noise_line_counts=3.0)
    assert counts(sensor, at_rest(3), 5).tobytes() == counts(sensor, at_rest(3), 5).tobytes()
    assert counts(sensor, at_rest(3), 5).tobytes() != counts(sensor, at_rest(3), 6).tobytes()


def test_counts_stay_within_sixteen_bits():
    force = np.full((1, HAND.n_taxels), 1e6)
    assert (counts(SimSensor(100.0, 700.0, 1.0), force) == 0).all()
    assert (counts(SimSensor(65535.0, noise_counts=1e4), at_rest(1)) <= 65535).all()


def test_its_numbers_go_into_the_dataset_by_the_formats_names():
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
def test_a_number_out_of_range_is_refused_in_one_line(field, value):
    with pytest.raises(SensorModelError) as caught:
        SimSensor(**{field: value})
    assert str(caught.value).startswith(f"sensor model: {field}: expected ")
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_forces_that_are_none_are_refused():
    for force in (np.zeros(HAND.n_taxels), -np.ones((1, HAND.n_taxels)), np.full((1, HAND.n_taxels), np.nan)):
        with pytest.raises(ValueError, match="force_n"):
            counts(SimSensor(), force)
