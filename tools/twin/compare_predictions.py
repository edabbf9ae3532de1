"""Deviations of a healthy skin's contacts from the mean of their repeats, and from the predictions of the simulator.

    python tools/twin/compare_predictions.py HEALTHY.h5 [--hand HAND]

Prints the standard deviation of a signal in the hold phase, relative to the largest signal around the taxel, between
repeats of a condition (reference mode of `taxel twin`) and about the prediction (`--simulate`); and the ratio of the
variances of the deviations of a condition and of a contact.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.recording.grasp_dataset import GraspDataset
from taxel.twin import read_reference
from taxel.twin.simulated.set_up import simulate_reference
from taxel.twin.steps import HOLD


def main() -> int:
    """Print the comparison for one dataset; the exit status is 2 for a file that cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path, help="grasp dataset of a healthy skin")
    parser.add_argument("--hand", help="hand description (default: that of the dataset)")
    arguments = parser.parse_args()
    try:
        with GraspDataset(arguments.dataset) as data:
            hand = load_hand(arguments.hand or data.hand)
        known = read_reference(arguments.dataset)
        simulated = simulate_reference(arguments.dataset, known, hand)
    except TaxelError as error:
        print(f"compare_predictions: {error}", file=sys.stderr)
        return 2
    explained = sum(each.contacts for each in simulated.deviations.values())
    print(f"{len(known.steps)} contacts of {len(known.conditions)} conditions, {explained} explained by the simulator")
    print(f"between repeats: {np.sqrt(known.relative_variance[HOLD].mean()):.1%}")
    print(f"about the prediction: {np.sqrt(simulated.relative_variance[HOLD].mean()):.1%}")
    print(f"variance of a condition's deviation relative to a contact's: {simulated.ratio:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
