"""An open skin: board frames and whole-skin frames from a port, the emulator or a recording."""

from taxel.skin.frame import SkinFrame
from taxel.skin.multi import DuplicateBoardError, MultiSkin
from taxel.skin.opening import load_recorded_hand, open_skin, open_source, open_waiting_source
from taxel.skin.skin import BoardMismatchError, Skin

__all__ = [
    "BoardMismatchError",
    "DuplicateBoardError",
    "MultiSkin",
    "Skin",
    "SkinFrame",
    "load_recorded_hand",
    "open_skin",
    "open_source",
    "open_waiting_source",
]
