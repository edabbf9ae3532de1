"""Force probe in the hand of an operator."""

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Stimulus


class OperatorStimulus(Stimulus):
    """Prints the taxel and the force, and waits for the Return key. Needs the option `-s` of pytest."""

    def __init__(self, context: DriverContext) -> None:
        self._hand = context.hand

    def press(self, address: int, taxel: int, force_n: float) -> None:
        """Instruct a person to press a taxel with a force in N, and wait until the person confirms with Return."""
        board = self._hand.get_board(address)
        input(f"press taxel {taxel} of {board.name} (0x{address:02X}) with {force_n:g} N, hold it, then Return: ")

    def release(self) -> None:
        input("remove the probe from the skin, then Return: ")
