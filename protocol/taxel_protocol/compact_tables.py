"""Constants of the coding of compact snapshots (explained in SPEC.md). The generator copies them into the C header.

A taxel's state is its expected count in 64ths, 22 bits, and the logarithm of its scale, 10 bits: the scale is
2^(level / 64 - 4) counts.
"""

COMPACT_FRACTION_BITS = 6
"""The expected count is in 64ths of a count."""

COMPACT_MEAN_MAX = (1 << 22) - 1
COMPACT_LEVEL_BITS = 10
COMPACT_LEVEL_MAX = (1 << COMPACT_LEVEL_BITS) - 1
COMPACT_LEVEL_START = 384
"""Initial level of a taxel: a scale of 4 counts."""

COMPACT_LEVEL_START_STEP = 128
"""Difference in level between the four initial scales: 4, 16, 64 and 256 counts."""

COMPACT_TOTAL_BITS = 16
"""Probabilities are multiples of 2^-16."""

COMPACT_ESCAPE = 128
"""Probability, in 2^-16, of an escape: a count too far from the prediction for the distribution."""

COMPACT_UNIT = 1024
"""Distances from the expected count are in 1024ths of the scale."""

COMPACT_REACH = 8 * COMPACT_UNIT
"""The distribution ends at 8 scales from the mean."""

COMPACT_STEP_BITS = 7
"""The cumulative distribution is a polygon with corners every 128 units, an eighth of the scale."""

COMPACT_JUMP = 6 * COMPACT_UNIT
"""A count of a key frame at least this far off replaces the predicted count at once and leaves the scale unchanged."""

COMPACT_CLIP = 4 * COMPACT_UNIT
"""Larger deviations are clipped to this value in the update of the scale."""

COMPACT_COARSE_OCTAVE = 8
"""From this octave of the scale on (16 counts), the low bits of a count are sent uncoded."""

COMPACT_MULTIPLIERS = (256, 235, 215, 197, 181, 166, 152, 140)
"""256 / 2^(j / 8), rounded: eight steps per octave."""

COMPACT_GAINS = (128, 85, 64, 51, 42, 36, 32, 28, 25, 23, 21, 19, 18, 17, 16)
"""256 / (n + 1) for the n-th key frame since the last packed one, n = 1 to 15: first an arithmetic mean, then an
exponentially weighted one."""

COMPACT_MEAN_DEVIATION = 1283
"""1024 sqrt(pi / 2): ratio of the scale of a normal deviate to its mean absolute value."""

COMPACT_LEVEL_STEP = 92
"""64 / ln 2: difference in level for a scale larger by a factor of e."""

COMPACT_CUMULATIVE = (
    0,
    3243,
    6435,
    9530,
    12483,
    15258,
    17824,
    20162,
    22258,
    24109,
    25718,
    27095,
    28255,
    29218,
    30005,
    30638,
    31139,
    31531,
    31832,
    32060,
    32230,
    32356,
    32447,
    32512,
    32559,
    32591,
    32614,
    32630,
    32642,
    32650,
    32656,
    32660,
    32664,
    32666,
    32669,
    32671,
    32673,
    32675,
    32676,
    32678,
    32679,
    32681,
    32682,
    32684,
    32685,
    32686,
    32688,
    32689,
    32690,
    32691,
    32692,
    32693,
    32694,
    32695,
    32696,
    32697,
    32698,
    32699,
    32699,
    32700,
    32701,
    32702,
    32703,
    32703,
    32704,
)
"""Probability of a distance from 0 to k eighths of the scale, in 2^-16: 99.5 % a normal distribution and 0.5 % a Cauchy
distribution three times as wide, both truncated at 8 scales.
"""
