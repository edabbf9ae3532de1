"""Rate of the emulated original hub: the table of tools/original/rate.py and its copy in the emulator's page."""

import importlib
import sys
from pathlib import Path

import pytest

from taxel.hand import load_hand

FOLDER = str(Path(__file__).resolve().parents[3] / "tools" / "original")
sys.path.insert(0, FOLDER)
try:
    rate = importlib.import_module("rate")
finally:
    sys.path.remove(FOLDER)


@pytest.fixture(scope="module")
def measurements():
    """Measurement of each configuration, by name."""
    return {row.name.strip("*"): rate.measure(load_hand(row.hand), row) for row in rate.list_configurations()}


def test_the_first_generation_runs_at_8_to_9_hz(measurements):
    first = measurements["first generation, 22 boards"]
    assert 8.0 < first.rate_hz < 9.0
    assert first.wire_bytes == pytest.approx(624)  # 2 bytes for each of 224 taxels, 8 more for each of 22 boards
    # The UART driver sends 8 bytes at every second tick of 0.5 ms, since 8 bytes take 0.7 ms: 624 bytes take 78 ms.
    assert first.wire + first.pacing == pytest.approx(78.0, abs=0.5)
    # The I2C transfers with 22 boards, in ms per cycle; the table of firmware/emulator/README.md states 46.9 ms.
    assert first.call + first.read == pytest.approx(47.0, abs=0.5)


def test_15_boards_with_the_settings_of_the_thesis_run_within_1_percent_of_the_limit_of_the_uart(measurements):
    thesis = measurements["also a ring of 256 bytes (settings of the thesis)"]
    # The limit of the UART: 11,520 bytes per second at 115,200 baud, divided by the 1930 bytes of 15 messages.
    assert pytest.approx(5.97, abs=0.005) == rate.THESIS_RATE_HZ
    assert thesis.rate_hz == pytest.approx(rate.THESIS_RATE_HZ, rel=0.01)
    assert thesis.wire_share > 0.999


def test_each_of_delay_pacing_and_ring_lowers_the_rate(measurements):
    names = ["15 boards of the thesis, same firmware", "without pacing", "without delay and pacing"]
    rates = [measurements[name].rate_hz for name in names]
    assert rates == sorted(rates)  # the rate increases without the pacing, and again without the delay
    # Only the small ring of the UART driver is left; with the ring of the thesis, the rate is within 1 % of the limit.
    assert rates[-1] < 0.9 * rate.THESIS_RATE_HZ


def test_the_times_of_a_cycle_add_up(measurements):
    for m in measurements.values():
        assert m.call + m.read + m.retry + m.blocked + m.delay == pytest.approx(m.cycle, rel=1e-6)


def test_the_page_of_the_emulator_contains_the_measured_table(measurements):
    rows = [(row, measurements[row.name.strip("*")]) for row in rate.list_configurations()]
    assert rate.format_table(rows) in rate.README.read_text()
