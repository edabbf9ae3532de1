"""Each noise figure (white, total, drift, common mode) measures its part of the noise and ignores the other parts."""

import numpy as np
import pytest

from taxel.signal import measure_noise, snr, snr_db

FRAMES, TAXELS, BASELINE_COUNTS = 4000, 24, 30_000
LINES = np.repeat([7, 3, 5], 8)  # number of the line of each taxel


@pytest.fixture(params=[2, 71_828], ids=lambda seed: f"seed{seed}")
def rng(request):
    """Random generator of each seed."""
    print(f"seed {request.param}")
    return np.random.default_rng(request.param)


def make_white_noise(rng, sigma):
    """Make values f64[FRAMES, TAXELS]: the baseline with white noise of `sigma` counts."""
    return BASELINE_COUNTS + sigma * rng.standard_normal((FRAMES, TAXELS))


def to_counts(values):
    return np.rint(values).astype(np.uint16)


@pytest.mark.parametrize("sigma", [1.0, 2.5, 7.0, 28.0])
def test_white_and_total_noise_are_correct_down_to_one_count(rng, sigma):
    report = measure_noise(to_counts(make_white_noise(rng, sigma)))
    sigma_with_rounding = (sigma**2 + 1 / 12) ** 0.5  # rounding to whole counts adds the variance 1/12
    assert report.white_sigma == pytest.approx(sigma_with_rounding, rel=0.1)
    assert report.white_sigma.mean() == pytest.approx(sigma_with_rounding, rel=0.05 if sigma < 2 else 0.02)
    assert report.total_std == pytest.approx(sigma_with_rounding, rel=0.05)


def test_drift_increases_the_total_noise_but_not_the_white_noise(rng):
    drift = np.linspace(0, 400, FRAMES)[:, None]
    report = measure_noise(to_counts(make_white_noise(rng, 10.0) + drift))
    assert report.white_sigma == pytest.approx(10.0, rel=0.1)
    # A linear drift over 400 counts has the variance of a uniform distribution, 400^2 / 12.
    assert report.total_std == pytest.approx((10.0**2 + 400**2 / 12) ** 0.5, rel=0.05)
    assert report.drift_slope == pytest.approx(400 / (FRAMES - 1), rel=0.02)


def test_rare_impulses_do_not_increase_the_white_noise(rng):
    values = make_white_noise(rng, 10.0)
    values[rng.random(values.shape) < 0.01] -= 256
    report = measure_noise(to_counts(values))
    assert report.white_sigma == pytest.approx(10.0, rel=0.1)
    assert (report.total_std > 20).all()  # expected: sqrt(10^2 + 0.01 * 256^2) = 27 counts


def test_the_drift_slope_is_exact_without_noise():
    raw = (np.arange(50)[:, None] * [3, 0] + 1000).astype(np.uint16)
    report = measure_noise(raw)
    assert report.drift_slope == pytest.approx([3.0, 0.0], abs=1e-12)
    assert report.count.tolist() == [50, 50]


def test_constant_counts_have_no_noise():
    report = measure_noise(np.full((10, 2), 1234, np.uint16), line_of=[0, 0])
    assert report.white_sigma.tolist() == report.total_std.tolist() == [0.0, 0.0]
    assert report.common_mode_sigma.tolist() == [0.0]


def test_common_mode_noise_is_attributed_to_its_line(rng):
    values = make_white_noise(rng, 6.0)
    values[:, LINES == 3] += 12.0 * rng.standard_normal((FRAMES, 1))
    report = measure_noise(to_counts(values), line_of=LINES)
    assert report.lines.tolist() == [3, 5, 7]
    assert report.common_mode_sigma[0] == pytest.approx(12.0, rel=0.08)
    assert (report.common_mode_sigma[1:] < 1.0).all()
    assert report.white_sigma[LINES == 3] == pytest.approx((6.0**2 + 12.0**2) ** 0.5, rel=0.1)


def test_the_common_mode_of_two_equal_taxels_is_their_standard_deviation_about_a_line():
    raw = np.repeat([[101], [100], [100], [101]], 2, axis=1).astype(np.uint16)
    # Squared residuals about the level line: 4 * 0.5**2 = 1, over 4 - 2 degrees of freedom.
    assert measure_noise(raw, line_of=[0, 0]).common_mode_sigma == pytest.approx([0.5**0.5])


def test_a_common_drift_is_not_common_mode_noise(rng):
    drift = np.linspace(0, 500, FRAMES)[:, None]
    report = measure_noise(to_counts(make_white_noise(rng, 6.0) + drift), line_of=LINES)
    assert (report.common_mode_sigma < 1.0).all()


def test_missing_samples_hardly_change_the_noise_figures(rng):
    values = make_white_noise(rng, 10.0) + np.linspace(0, 100, FRAMES)[:, None]
    values[:, LINES == 5] += 8.0 * rng.standard_normal((FRAMES, 1))
    raw = to_counts(values)
    valid = rng.random(raw.shape) > 0.05
    complete = measure_noise(raw, LINES)
    incomplete = measure_noise(np.where(valid, raw, 0), LINES, valid)
    assert incomplete.white_sigma == pytest.approx(complete.white_sigma, rel=0.06)
    assert incomplete.total_std == pytest.approx(complete.total_std, rel=0.03)
    assert incomplete.drift_slope == pytest.approx(complete.drift_slope, rel=0.06)
    assert incomplete.common_mode_sigma[1] == pytest.approx(complete.common_mode_sigma[1], rel=0.05)
    assert incomplete.count.tolist() == valid.sum(axis=0).tolist()


def test_the_noise_of_a_taxel_with_too_few_samples_is_nan():
    raw = np.array([[5, 5], [6, 9], [5, 5], [6, 9]], np.uint16)
    valid = np.ones((4, 2), np.bool_)
    valid[1:3, 0] = False
    report = measure_noise(raw, line_of=[0, 1], valid=valid)
    for figure in (report.white_sigma, report.total_std, report.drift_slope):
        assert np.isnan(figure).tolist() == [True, False]
    assert np.isnan(report.common_mode_sigma).all()


def test_snr_is_the_signal_divided_by_the_noise():
    assert float(snr(300.0, 15.0)) == 20.0
    assert float(snr_db(300.0, 30.0)) == pytest.approx(20.0)
    assert snr([300.0, np.nan], [15.0, 15.0])[0] == 20.0
    assert np.isnan(snr_db([np.nan], 15.0)).all()


def test_snr_of_a_signal_of_zero_or_below_is_minus_infinity_decibels():
    assert snr_db([0.0, -5.0], 10.0).tolist() == [-np.inf, -np.inf]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: measure_noise(np.zeros((2, 3), np.uint16)), "at least 3 frames"),
        (lambda: measure_noise(np.zeros(9, np.uint16)), "raw_counts"),
        (lambda: measure_noise(np.zeros((9, 3), np.uint16), line_of=[0, 1]), "line_of"),
        (lambda: measure_noise(np.zeros((9, 3), np.uint16), line_of=[0.0, 1.0, 2.0]), "line_of"),
        (lambda: measure_noise(np.zeros((9, 3), np.uint16), valid=[1] * 9), "valid"),
        (lambda: snr(300.0, 0.0), "noise_sigma"),
        (lambda: snr_db(300.0, [-1.0, 2.0]), "noise_sigma"),
        (lambda: snr(300.0, np.inf), "noise_sigma"),
    ],
)
def test_an_invalid_input_raises_a_one_line_error(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
