"""An open skin: board frames and whole-skin frames from a port, the emulator or a recording."""

from taxel.skin.opening import open_skin, open_source, recorded_hand
from taxel.skin.skin import BoardMismatchError, Skin, SkinFrame

__all__ = ["BoardMismatchError", "Skin", "SkinFrame", "open_skin", "open_source", "recorded_hand"]
