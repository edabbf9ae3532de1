"""An open skin: board frames and whole-skin frames from a port, the emulator or a recording."""

from taxel.skin.opening import load_recorded_hand, open_skin, open_source, open_waiting_source
from taxel.skin.skin import BoardMismatchError, Skin, SkinFrame

__all__ = [
    "BoardMismatchError",
    "Skin",
    "SkinFrame",
    "load_recorded_hand",
    "open_skin",
    "open_source",
    "open_waiting_source",
]
