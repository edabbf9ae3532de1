"""Hand description: boards, their I2C addresses, and the TX x RX crossings that are taxels.

>>> hand = load_hand("original")
>>> hand.n_taxels, len(hand.boards)
(1037, 17)
>>> hand.get_slice(0x09)
slice(65, 95, None)
"""

from taxel.hand.boards import Board, BoardKind
from taxel.hand.description import Hand
from taxel.hand.errors import UnknownBoardError
from taxel.hand.loading import list_packaged_hands, load_hand
from taxel.hand.schema import HandDescriptionError

__all__ = [
    "Board",
    "BoardKind",
    "Hand",
    "HandDescriptionError",
    "UnknownBoardError",
    "list_packaged_hands",
    "load_hand",
]
