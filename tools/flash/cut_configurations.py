"""Configurations whose writing is cut: afterwards the old or the new one counts, and a retry succeeds."""

from __future__ import annotations

from typing import Any, Final

from cut_plan import CutSequence, WorldPlan, moment_of
from cut_records import configuration_of, operation_of
from cut_runs import AGAIN, BRICKED, DAMAGED, OFF_S, RUNS_MAX, CampaignError, Struck, WorldResult
from cut_target import BOARD, BoardWay
from flash_worlds import small_world, unique_ids

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualSMBus, VirtualWorld
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS
from taxel_tools.plan import Entry
from taxel_tools.provision import find, provision
from taxel_tools.wires import SmbusWire

BLANK_BOARDS: Final = 4
NEW_ADDRESS: Final = 0x30
"""Of the first blank board; the others follow."""


def run_configurations(plan: WorldPlan) -> WorldResult:
    """Every sequence of a world, with one board again and again, or with one blank board each; to the first failure."""
    result = WorldResult(plan.number, plan.way)
    is_blank = "blank" in plan.way
    lines = [f"boot_listens {int(plan.listens)}"]
    lines += [f"blank 0x{BOARD + place:02X}" for place in range(BLANK_BOARDS) if is_blank]
    text = small_world(BLANK_BOARDS if is_blank else 2, lines, plan.seed + plan.number)
    ids = unique_ids(text)
    with VirtualWorld(text) as world:
        world.run(0.4)
        bench = _Blank(world) if is_blank else _Configured(world, plan.way.endswith("hub"))
        for place, sequence in enumerate(plan.sequences):
            board = BOARD + place if is_blank else BOARD
            try:
                _Provision(world, bench, board, ids[board], place, sequence, result).run()
            except TaxelError as error:
                result.failures.append(f"world {plan.number}, sequence {place} ({sequence}): {error}")
                break
        result.longest_gap_s = bench.longest_gap_s
        result.torn = sum(world.board_flash(board).torn for board in ids)
        result.virtual_s = world.now_s
    return result


class _Configured:
    """A board that keeps its address, through an adapter or the hub; the hub polls the board beside it."""

    def __init__(self, world: VirtualWorld, through_hub: bool) -> None:
        self._way = BoardWay(world, through_hub)
        self.wire = self._way.wire

    @property
    def longest_gap_s(self) -> float:
        return self._way.beside.longest_gap_s

    def place(self, board: int) -> tuple[int, int]:
        """Where it answers now, and where it is to answer."""
        return board, board

    def is_alive(self, board: int, unique_id: bytes, configuration: dict[str, Any] | None) -> bool:
        """Its application runs, and the hub polls the other board."""
        self._way.check_hub()
        return self._way.version() is not None


class _Blank:
    """Blank boards that share an address, through an adapter."""

    longest_gap_s = 0.0

    def __init__(self, world: VirtualWorld) -> None:
        self.wire = SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)

    def place(self, board: int) -> tuple[int, int]:
        """Where it answers now, and where it is to answer."""
        return BOOT_DEFAULT_ADDRESS, NEW_ADDRESS + board - BOARD

    def is_alive(self, board: int, unique_id: bytes, configuration: dict[str, Any] | None) -> bool:
        """Its bootloader answers where its configuration says."""
        address = configuration["address"] if configuration else BOOT_DEFAULT_ADDRESS
        return unique_id in [one.unique_id for one in find(self.wire, address)]


class _Provision:
    """One configuration with its cuts."""

    def __init__(
        self,
        world: VirtualWorld,
        bench: _Configured | _Blank,
        board: int,
        unique_id: bytes,
        place: int,
        sequence: CutSequence,
        result: WorldResult,
    ) -> None:
        self.world, self.bench, self.board, self.unique_id = world, bench, board, unique_id
        self.sequence, self.result = sequence, result
        self.at, address = bench.place(board)
        self.entry = Entry(unique_id, address, 9, f"S{place:05d}", tuple(1 + place % 200 for _ in range(7)))
        self.old = configuration_of(world.board_flash(board).data)
        self.cuts_before = world.cut_count(board)
        self.judged = 0

    def run(self) -> None:
        for cut in self.sequence.cuts:
            self.world.plan_cut(self.board, cut.operation, cut.after_s, OFF_S)
        for runs in range(1, RUNS_MAX + 1):
            failure: str | None = None
            try:
                provision(self.bench.wire, [self.at], [self.entry])
            except TaxelError as error:
                failure = str(error)
            self.world.run(OFF_S + 0.15)  # the power is back, and the bootloader has waited
            outcome = self._judge()
            if failure is None and self.judged == len(self.sequence.cuts):
                self.result.runs.append(runs)
                if outcome != "new":
                    raise CampaignError("the command said that it has succeeded, but the old configuration counts")
                return
        raise CampaignError(f"{RUNS_MAX} runs of the command did not finish; the last ended with: {failure}")

    def _judge(self) -> str:
        made = self.world.cuts(self.board, self.cuts_before)
        configuration = configuration_of(self.world.board_flash(self.board).data)
        outcome = self._outcome(configuration)
        for place, cut in enumerate(made[self.judged :], start=self.judged):
            last = place == len(made) - 1
            self.result.struck.append(Struck(operation_of(cut), moment_of(cut.after_s), outcome if last else AGAIN))
        self.judged = len(made)
        if outcome in (BRICKED, DAMAGED):
            raise CampaignError(f"{outcome}: {configuration} counts, expected {self.old} or {self.entry}")
        return outcome

    def _outcome(self, configuration: dict[str, Any] | None) -> str:
        if not self.bench.is_alive(self.board, self.unique_id, configuration):
            return BRICKED
        if configuration == self.old:
            return "old"
        return "new" if configuration is not None and self._is_wanted(configuration) else DAMAGED

    def _is_wanted(self, configuration: dict[str, Any]) -> bool:
        entry = self.entry
        assert entry.serial_number is not None
        assert entry.idac_codes is not None
        return bool(
            configuration["address"] == entry.address
            and configuration["kind"] == entry.kind
            and configuration["serial_number"] == entry.serial_number.encode().ljust(16, b"\0")
            and configuration["idac_codes"] == bytes(entry.idac_codes).ljust(16, b"\0")
        )
