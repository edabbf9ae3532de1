"""Measure the cycles that a board's processor needs to code compact snapshots, in an executed image: per snapshot and
per taxel.
"""

from pathlib import Path
from typing import Final, Literal

from executed_world import BOARD_IMAGE, format_image_line, make_board_world

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin

BOARDS: Final = (0x2C, 0x20)
"""A small and a large board of the allegro hand."""
NOISE_COUNTS: Final = 4.0
SETTLE_S, RUN_S = 2.0, 4.0


def measure_busy_cycles(image: Path, address: int, frames: Literal["plain", "compact"]) -> float:
    """Return the processor cycles that a board's main loop needs per scan while a hub streams the board.

    image: path of the board's firmware image. frames: frame format.
    """
    hand = load_hand("allegro")
    text = make_board_world(hand, address, WorldSettings(noise_counts=NOISE_COUNTS)) + format_image_line(address)
    with (
        VirtualWorld(text, files={BOARD_IMAGE: image}) as world,
        Skin(VirtualMemoryLink(world), hand, frames=frames) as skin,
    ):

        def run(seconds: float) -> None:
            """Read frames from the emulated hub for `seconds` of virtual time."""
            end = world.now_s + seconds
            while world.now_s < end:
                skin.poll(0.01)

        run(SETTLE_S)
        counts = [_read_busy(world, address)]
        run(RUN_S)
        counts.append(_read_busy(world, address))
        scans = (counts[1][1] - counts[0][1]) / hand.get_board(address).kind.taxel_count
        return (counts[1][0] - counts[0][0]) / scans


def _read_busy(world: VirtualWorld, address: int) -> tuple[int, int]:
    """Return a board's cycles awake outside interrupts, and its conversions, both since the start."""
    processor, handlers = world.read_processor(address), world.read_handler_costs(address)
    return processor.cycles - processor.sleep_cycles - sum(cost.own for cost in handlers.values()), handlers[
        "CSD"
    ].count


def measure_compact(image: Path) -> dict[str, int | list[int]]:
    """Return the costs `compact` (per snapshot) and `compact_taxel` (per taxel) of costs.h, in cycles.

    Compact frames add cycles to the main loop of a board. The two costs are the intercept and the slope of the straight
    line through these added cycles of two boards, as a function of the number of taxels.
    """
    hand = load_hand("allegro")
    taxels = [hand.get_board(address).kind.taxel_count for address in BOARDS]
    added = [
        measure_busy_cycles(image, address, "compact") - measure_busy_cycles(image, address, "plain")
        for address in BOARDS
    ]
    each = (added[1] - added[0]) / (taxels[1] - taxels[0])
    return {"compact": round(added[0] - each * taxels[0]), "compact_taxel": round(each)}
