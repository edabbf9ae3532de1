"""What prefix codes would take in place of the range coder, for a known scale and mean: bits a count.

python tools/compact/prefix_codes.py

Rice: the best parameter, zigzag residual to the rounded mean. Huffman: the best code for that scale, residual to the
rounded mean, so that its tables do not depend on the mean's fraction. Both without their classes' own losses.
"""

import heapq
import math

import numpy as np
from ideal import noise_entropy
from numpy.typing import NDArray
from scipy.special import ndtr

SIGMAS = (0.3, 1.5, 4.0, 10.0, 28.0)
PHASES = 64


def residuals(sigma: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Residuals to the rounded mean, and their shares over a uniform fraction of the mean."""
    reach = math.ceil(10 * sigma) + 2
    k = np.arange(-reach, reach + 1)
    mean = (np.arange(PHASES)[None, :] + 0.5) / PHASES - 0.5
    share = ndtr((k[:, None] + 0.5 - mean) / sigma) - ndtr((k[:, None] - 0.5 - mean) / sigma)
    return k, share.mean(axis=1)


def rice(sigma: float) -> float:
    """Bits of the best Rice code."""
    k, share = residuals(sigma)
    zigzag = np.where(k >= 0, 2 * k, -2 * k - 1)
    return min(float((share * ((zigzag >> low) + 1 + low)).sum()) for low in range(8))


def huffman(sigma: float) -> float:
    """Bits of the Huffman code."""
    heap = [float(share) for share in residuals(sigma)[1] if share > 1e-12]
    heapq.heapify(heap)
    bits = 0.0
    while len(heap) > 1:
        pair = heapq.heappop(heap) + heapq.heappop(heap)
        bits += pair
        heapq.heappush(heap, pair)
    return bits


def main() -> None:
    """Print the table."""
    print("noise, counts   entropy     Rice  Huffman")
    for sigma in SIGMAS:
        print(f"{sigma:<14g} {noise_entropy(sigma):8.3f} {rice(sigma):8.3f} {huffman(sigma):8.3f}")


if __name__ == "__main__":
    main()
