"""tools/compact/entropy.py: bytes of compact frames that the emulated boards send, compared with the entropy."""

import importlib
import sys
from pathlib import Path

from taxel.hand import load_hand

FOLDER = str(Path(__file__).resolve().parents[3] / "tools" / "compact")
sys.path.insert(0, FOLDER)
try:
    entropy = importlib.import_module("entropy")
    ideal = importlib.import_module("ideal")
finally:
    sys.path.remove(FOLDER)

SIGMA = 4.0
"""Standard deviation of the noise, counts."""

ENTROPY_RATIO_MAX = 1.1
"""Largest ratio of coded bits to entropy, from the requirement of docs/benchmarks.md."""


COMPLETE_SHARE = 0.5
"""Smallest share of poll cycles with a frame of every board: a poll before the end of a scan gives no frame."""


def test_poll_cycles_of_the_original_hand_are_decoded_and_a_frame_takes_little_more_than_its_entropy() -> None:
    hand = load_hand("original")
    tally = entropy.measure(hand, SIGMA, 0.5, has_contacts=False)
    assert tally.cycles == round(0.5 * entropy.RATE_HZ)
    assert len(tally.counts) > COMPLETE_SHARE * tally.cycles
    bits_per_taxel = 8.0 * (tally.coded + tally.packed) / (tally.cycles * hand.n_taxels)
    assert 1.0 <= bits_per_taxel / ideal.compute_noise_entropy(SIGMA) < ENTROPY_RATIO_MAX
