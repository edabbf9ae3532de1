"""Bits per count of prefix codes in place of the range coder, for a known scale and mean.

python tools/compact/prefix_codes.py

Rice: the best parameter for the zigzag residual from the rounded mean. Huffman: the best code of this scale for the
residual from the rounded mean, so that its tables do not depend on the fraction of the mean. The costs of transmitting
parameters and tables are not included.
"""

import heapq
import math

import numpy as np
from ideal import compute_noise_entropy
from numpy.typing import NDArray
from scipy.special import ndtr

SIGMAS = (0.3, 1.5, 4.0, 10.0, 28.0)
PHASES = 64


def compute_residuals(sigma: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Compute the residuals of rounded normal noise from its rounded mean, and their probabilities.

    The probabilities are averaged over `PHASES` positions of the mean between two counts. Residuals beyond 10 sigma are
    neglected. sigma: standard deviation in counts. Returns residuals i64[k] and probabilities f64[k].
    """
    reach = math.ceil(10 * sigma) + 2
    k = np.arange(-reach, reach + 1)
    mean = (np.arange(PHASES)[None, :] + 0.5) / PHASES - 0.5
    share = ndtr((k[:, None] + 0.5 - mean) / sigma) - ndtr((k[:, None] - 0.5 - mean) / sigma)
    return k, share.mean(axis=1)


def compute_rice_bits(sigma: float) -> float:
    """Compute the bits per count of the best Rice code for normal noise. sigma: standard deviation in counts.

    A Rice code sends the lowest `low` bits (0 to 7) of the residual, mapped to 0, 1, 2 ..., and the others in unary.
    """
    k, share = compute_residuals(sigma)
    zigzag = np.where(k >= 0, 2 * k, -2 * k - 1)
    return min(float((share * ((zigzag >> low) + 1 + low)).sum()) for low in range(8))


def compute_huffman_bits(sigma: float) -> float:
    """Compute the bits per count of the Huffman code for normal noise. sigma: standard deviation in counts.

    Each merge of two nodes adds one bit to all symbols below it, so the mean length is the sum of the merged
    probabilities. Residuals with a probability below 1e-12 are neglected.
    """
    heap = [float(share) for share in compute_residuals(sigma)[1] if share > 1e-12]
    heapq.heapify(heap)
    bits = 0.0
    while len(heap) > 1:
        pair = heapq.heappop(heap) + heapq.heappop(heap)
        bits += pair
        heapq.heappush(heap, pair)
    return bits


def main() -> None:
    """Print the bits per count of Rice and Huffman codes for several noise levels."""
    print("noise, counts   entropy     Rice  Huffman")
    for sigma in SIGMAS:
        bits = (compute_noise_entropy(sigma), compute_rice_bits(sigma), compute_huffman_bits(sigma))
        print(f"{sigma:<14g} " + " ".join(f"{value:8.3f}" for value in bits))


if __name__ == "__main__":
    main()
