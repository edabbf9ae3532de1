"""A person with a force probe."""

from taxel.hand import Hand


class OperatorStimulus:
    """Says what to press and waits for the Return key. Run pytest with -s, or it cannot ask."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand

    def press(self, address: int, taxel: int, force_n: float) -> None:
        board = self._hand.get_board(address)
        input(f"press taxel {taxel} of {board.name} (0x{address:02X}) with {force_n:g} N, hold it, then Return: ")

    def release(self) -> None:
        input("let go of everything, then Return: ")
