"""Measure the cycles of the hub's firmware in an executed image: interrupts, a pass of the main loop, a framed byte."""

import bisect
from pathlib import Path
from typing import Final

from executed_world import HUB_IMAGE, format_image_line, make_board_world
from firmware_elf import read_linked_image

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin

Costs = dict[str, int | list[int]]

CYCLES_PER_US: Final = 48
BOARD: Final = 0x20
"""Largest board of the allegro hand."""
PROBE_US: Final = 11 * 2.5
"""Duration of an unacknowledged address: start, nine clocks, stop."""
PROBES: Final = 10
BYTES_S: Final = 0.08
FRAMING: Final = ("put_body", "emit", "taxel_crc32", "taxel_encoder_put", "taxel_encoder_begin", "taxel_encoder_end")
SAMPLE_S, SAMPLES = 2.03e-6, 60_000


def measure_pass_cycles(world: VirtualWorld) -> int:
    """Return the processor cycles from the end of an I2C probe to the start of the next, while the hub searches for
    boards.

    The cycles follow from the shortest duration of `PROBES` successive probes, minus `PROBE_US` for each probe.
    """
    times: list[float] = []
    probes = 0
    while len(times) < 40 * PROBES and world.now_s < 1.0:
        world.run(2e-6)
        now = world.read_handler_costs(0)["SCB0"].count // 2  # one interrupt for the address and one for the stop
        if now > probes:
            times.append(world.now_s)
            probes = now
    shortest = min(end - begin for begin, end in zip(times, times[PROBES:], strict=False))
    return round((shortest * 1e6 / PROBES - PROBE_US) * CYCLES_PER_US)


def measure_byte_cycles(world: VirtualWorld) -> int:
    """Return the processor cycles of the hub's I2C interrupts per byte on the bus while it streams."""
    cycles, count = world.read_handler_costs(0)["SCB0"].own, int(world.statistics()["bus_bytes"])
    world.run(BYTES_S)
    return round((world.read_handler_costs(0)["SCB0"].own - cycles) / (int(world.statistics()["bus_bytes"]) - count))


def measure_streaming(world: VirtualWorld, skin: Skin, elf: Path) -> Costs:
    """Measure the processor cycles of a streaming hub: of the UART interrupt, and of the framing of each byte.

    The framing is measured by sampling the program counter. elf: linked image, for the addresses of its functions.
    """
    functions = read_linked_image(elf).functions
    addresses = [function.address for function in functions]
    framing = 0
    before, sent = world.read_handler_costs(0)["SCB1"], int(world.statistics()["uart_bytes_sent"])
    begin = world.now_s
    for number in range(SAMPLES):
        world.run(SAMPLE_S)
        function = functions[max(bisect.bisect_right(addresses, world.read_processor(0).pc) - 1, 0)]
        framing += function.name in FRAMING
        if number % 1000 == 0:  # read the frames of the hub regularly
            skin.poll(0.0)
    after = world.read_handler_costs(0)["SCB1"]
    sent = int(world.statistics()["uart_bytes_sent"]) - sent
    cycles = (world.now_s - begin) * 1e6 * CYCLES_PER_US
    own, count = after.own - before.own, after.count - before.count
    return {
        "hub_frame_byte": round(cycles * framing / SAMPLES / sent),
        "uart_interrupt": after.own_min,
        "uart_byte": round((own - after.own_min * count) / sent),
    }


def measure_hub(image: Path) -> Costs:
    """Measure all processor costs of the hub in costs.h, by their names in lower case.

    image: path of hub-factory.hex; the folder above it contains hub-a.elf.
    """
    hand = load_hand("allegro")
    text = make_board_world(hand, BOARD, WorldSettings()) + format_image_line(0)
    with VirtualWorld(text, files={HUB_IMAGE: image}) as world:
        pass_gap = measure_pass_cycles(world)
        done = world.read_handler_costs(0)["SCB0"].own_min
    # Use the whole hand: a single board is polled more often than it has new snapshots, and these polls produce no
    # frames.
    whole = format_world(hand, WorldSettings()) + format_image_line(0)
    with VirtualWorld(whole, files={HUB_IMAGE: image}) as world, Skin(VirtualMemoryLink(world), hand) as skin:
        end = world.now_s + 1.0
        while world.now_s < end:
            skin.poll(0.01)
        streaming_costs = measure_streaming(world, skin, image.parents[1] / "hub-a.elf")
        byte = measure_byte_cycles(world)
    return {"master_done": done, "master_byte": byte, "hub_pass": pass_gap - done} | streaming_costs
