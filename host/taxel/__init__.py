"""taxel: the host side of a mutual-capacitance tactile skin.

>>> import taxel
>>> with taxel.open("emulator:?speed=max&duration_s=10") as skin:
...     baseline = skin.take_baseline()
...     activation = taxel.Activation(baseline.mean)
...     scan = next(skin.scans())
...     int(activation(scan.raw_counts, scan.valid).active.sum())
0
"""

from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.signal import Activation, Baseline
from taxel.skin import Skin, SkinFrame
from taxel.skin import open_skin as open
from taxel.stream import TaxelFrame

__all__ = [
    "Activation",
    "Baseline",
    "Hand",
    "Skin",
    "SkinFrame",
    "TaxelError",
    "TaxelFrame",
    "load_hand",
    "open",
]
