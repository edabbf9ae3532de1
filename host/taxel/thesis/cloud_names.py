"""Names of the clouds of an object: untreated, and after each step of the treatment of the thesis."""

from typing import Final

REAL: Final = "real"
SIM: Final = "sim"
FILTERED: Final = "real, force filter"
CLEANED: Final = "real, force and SOR filters"
SPREAD: Final = "sim, contact propagation"
