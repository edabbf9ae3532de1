"""Mixing matrices of the boards: entry (i, j) is the share of the signal of taxel i that taxel j of the board gains."""

from __future__ import annotations

import numpy as np

from taxel.types import FloatArray, IndexArray


def build_crosstalk_matrix(tx: IndexArray, rx: IndexArray, fractions: FloatArray, own_ratio: float = 0.0) -> FloatArray:
    """Build the matrix f64[m, m] of crosstalk over the electrodes of one board with m taxels.

    Its diagonal contains the taxel's own signal. tx, rx: TX line and RX line of each taxel. fractions: two or four
    numbers: fractions of the mean signal of the other taxels on the TX line and on the RX line, and fractions of the
    signals at the same position of the neighbouring TX lines and RX lines. own_ratio: relative change of a taxel's own
    signal, divided by the sum of the absolute fractions.
    """
    distances = [np.abs(line[:, None] - line) for line in (tx, rx)]
    other = ~np.eye(len(tx), dtype=bool)
    matrix = np.eye(len(tx)) * (1.0 + own_ratio * float(np.abs(fractions).sum()))
    for distance, fraction in zip(distances, fractions[:2], strict=True):
        on_line = ((distance == 0) & other).astype(np.float64)
        matrix += fraction * on_line / np.maximum(on_line.sum(axis=0), 1.0)
    for axis, fraction in enumerate(fractions[2:]):
        matrix += fraction * ((distances[axis] == 1) & (distances[1 - axis] == 0))
    return matrix


def build_shorts_matrix(
    tx: IndexArray, rx: IndexArray, remaining: FloatArray, shorts: list[tuple[str, int, float]]
) -> FloatArray:
    """Build the matrix f64[m, m] of dead taxels and shorted lines of one board with m taxels.

    tx, rx: TX line and RX line of each taxel. remaining: f64[m], remaining share of the signal of each taxel. shorts:
    for each pair of shorted lines the axis "tx" or "rx", the index of the first line (the other is the next line), and
    the share of the sum of both signals that each taxel of these lines measures.
    """
    matrix = np.diag(remaining)
    for axis, index, share in shorts:
        along, across = (tx, rx) if axis == "tx" else (rx, tx)
        for crossing in np.intersect1d(across[along == index], across[along == index + 1]).tolist():
            pair = [int(np.flatnonzero((along == line) & (across == crossing))[0]) for line in (index, index + 1)]
            matrix[:, pair] = 0.0
            matrix[np.ix_(pair, pair)] = share
    return matrix


def compute_grid_kernel(tx: IndexArray, rx: IndexArray, matrix: FloatArray) -> FloatArray:
    """Compute the kernel f64[2 R - 1, 2 C - 1] that approximates a matrix on a grid of R TX lines and C RX lines.

    tx, rx: TX line and RX line of each of the m taxels. matrix: f64[m, m]. Each entry is the mean of the matrix over
    all pairs of taxels with the same distance in lines. The kernel is that of a cross-correlation: entry
    (R - 1 + i, C - 1 + j) is the share that a taxel gains from the taxel whose TX line is larger by i and whose RX line
    is larger by j.
    """
    rows, columns = int(np.ptp(tx)) + 1, int(np.ptp(rx)) + 1
    i, j = tx[:, None] - tx + rows - 1, rx[:, None] - rx + columns - 1
    total, count = np.zeros((2, 2 * rows - 1, 2 * columns - 1))
    np.add.at(total, (i, j), matrix)
    np.add.at(count, (i, j), 1.0)
    return np.asarray(total / np.maximum(count, 1.0))
