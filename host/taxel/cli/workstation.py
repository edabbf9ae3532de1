"""Open the devices of a physical campaign: arm, hand and skin, by their URLs."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from taxel.campaign.planned_motion import Workstation
from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.hand.allegro import AllegroHand, open_bus
from taxel.hand.arm import UPRIGHT_RAD, SimulatedArm, Ur5eArm
from taxel.skin import open_skin


@contextmanager
def open_workstation(arm: str, can: str, skin: str, hand: Hand) -> Iterator[Workstation]:
    """Open the arm, the Allegro hand and the skin of a physical campaign; all are closed at the end of the block.

    arm: `rtde:HOST` or `simulated`. can: CAN channel of the hand. skin: URL of the skin. Raises `TaxelError` for a
    device that cannot be opened.
    """
    kind, _, host = arm.partition(":")
    if arm != "simulated" and not (kind == "rtde" and host):
        raise TaxelError(f"--arm: expected rtde:HOST or simulated, found '{arm}'")
    with ExitStack() as stack:
        bus = stack.enter_context(open_bus(can))
        allegro = stack.enter_context(AllegroHand(bus))
        skin_open = stack.enter_context(open_skin(skin, hand))
        if kind == "simulated":
            simulated = SimulatedArm(UPRIGHT_RAD)
            yield Workstation(simulated, allegro, skin_open, simulated.step)
        else:
            yield Workstation(stack.enter_context(Ur5eArm(host)), allegro, skin_open)
