"""Configuration writes interrupted by power cuts: the old or the new one stays valid, and a retry succeeds."""

from typing import Any, Final

from cut_plan import CutSequence, WorldPlan, name_moment
from cut_records import decode_configuration, name_operation
from cut_routes import BOARD, BoardRoute
from cut_runs import BRICKED, CUT_AGAIN, DAMAGED, OFF_S, RUNS_MAX, CampaignError, CutRecord, WorldResult
from flash_worlds import make_small_world, read_unique_ids

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualSMBus, VirtualWorld
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS
from taxel_tools.provision import find_boards, provision
from taxel_tools.provisioning_plan import Entry
from taxel_tools.wires import SmbusWire

BLANK_BOARDS: Final = 4
NEW_ADDRESS: Final = 0x30
"""New address of the first blank board; the other boards get the following addresses."""


def run_configurations(plan: WorldPlan) -> WorldResult:
    """Write configurations to emulated boards while the planned power cuts occur, up to the first failure.

    All writes go to the same configured board or, if the plan's route names a blank board, each to a different one.
    """
    result = WorldResult(plan.number, plan.route)
    is_blank = "blank" in plan.route
    lines = [f"boot_listens {int(plan.bootloader_listens)}"]
    lines += [f"blank 0x{BOARD + i:02X}" for i in range(BLANK_BOARDS) if is_blank]
    text = make_small_world(BLANK_BOARDS if is_blank else 2, lines, plan.seed + plan.number)
    unique_ids_by_address = read_unique_ids(text)
    with VirtualWorld(text) as world:
        world.run(0.4)
        bench = _BlankBoards(world) if is_blank else _ConfiguredBoard(world, plan.route.endswith("hub"))
        for index, sequence in enumerate(plan.sequences):
            board = BOARD + index if is_blank else BOARD
            try:
                _Provision(world, bench, board, unique_ids_by_address[board], index, sequence, result).run()
            except TaxelError as error:
                result.failures.append(f"world {plan.number}, sequence {index} ({sequence}): {error}")
                break
        result.longest_gap_s = bench.longest_gap_s
        result.torn = sum(world.read_flash(board).torn for board in unique_ids_by_address)
        result.virtual_s = world.now_s
    return result


class _ConfiguredBoard:
    """A board that keeps its address, reached through an adapter or the hub; the hub polls the neighbour board."""

    def __init__(self, world: VirtualWorld, through_hub: bool) -> None:
        """Connect to a configured board through the hub or, otherwise, through an I2C adapter."""
        self._route = BoardRoute(world, through_hub)
        self.wire = self._route.wire

    @property
    def longest_gap_s(self) -> float:
        """Longest time in seconds without a frame of the neighbour board, which keeps its power."""
        return self._route.neighbour.longest_gap_s

    def get_addresses(self, board: int) -> tuple[int, int]:
        """Return the present and the new I2C address of a board, which are equal here."""
        return board, board

    def is_alive(self, board: int, unique_id: bytes, configuration: dict[str, Any] | None) -> bool:
        """Return whether the application of the configured board runs.

        The arguments are those of `_BlankBoards.is_alive` and are not used. Raises `TaxelError` if the hub does not
        poll the neighbour board.
        """
        self._route.check_hub()
        return self._route.version() is not None


class _BlankBoards:
    """Blank boards that share an address, reached through an adapter."""

    longest_gap_s = 0.0

    def __init__(self, world: VirtualWorld) -> None:
        """Connect to blank emulated boards through an I2C adapter."""
        self.wire = SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)

    def get_addresses(self, board: int) -> tuple[int, int]:
        """Return the present I2C address of a blank board, and the new one."""
        return BOOT_DEFAULT_ADDRESS, NEW_ADDRESS + board - BOARD

    def is_alive(self, board: int, unique_id: bytes, configuration: dict[str, Any] | None) -> bool:
        """Return whether the board's bootloader answers at the address of its configuration.

        Without a configuration, the bootloader must answer at the default address.
        """
        address = configuration["address"] if configuration else BOOT_DEFAULT_ADDRESS
        return unique_id in [board.unique_id for board in find_boards(self.wire, address)]


class _Provision:
    """One configuration write with its power cuts."""

    def __init__(
        self,
        world: VirtualWorld,
        bench: _ConfiguredBoard | _BlankBoards,
        board: int,
        unique_id: bytes,
        index: int,
        sequence: CutSequence,
        result: WorldResult,
    ) -> None:
        """Prepare the write of a new configuration to a board, during which its power is cut.

        board: the board's number in the emulator. unique_id: id of its processor. index: number of this write in the
        series. sequence: planned power cuts. result: receives one record per cut.
        """
        self.world, self.bench, self.board, self.unique_id = world, bench, board, unique_id
        self.sequence, self.result = sequence, result
        self.present_address, address = bench.get_addresses(board)
        # The kind is 9 in every write; the serial number and the seven current codes differ from write to write.
        self.entry = Entry(unique_id, address, 9, f"S{index:05d}", tuple(1 + index % 200 for _ in range(7)))
        self.old_configuration = decode_configuration(world.read_flash(board).data)
        self.cuts_before = world.count_power_cuts(board)
        self.recorded_count = 0

    def run(self) -> None:
        """Repeat the provisioning command until the configuration is written; the planned cuts interrupt it.

        Raises `CampaignError` if the command does not succeed in `RUNS_MAX` runs or if the configuration is wrong
        afterwards.
        """
        for cut in self.sequence.cuts:
            self.world.plan_power_cut(self.board, cut.operation, cut.after_s, OFF_S)
        for runs in range(1, RUNS_MAX + 1):
            failure: str | None = None
            try:
                provision(self.bench.wire, [self.present_address], [self.entry])
            except TaxelError as error:
                failure = str(error)
            self.world.run(OFF_S + 0.15)  # Until the power is back and the bootloader has waited for a host.
            outcome = self._record_outcomes()
            if failure is None and self.recorded_count == len(self.sequence.cuts):
                self.result.runs.append(runs)
                if outcome != "new":
                    raise CampaignError("the command reported success, but the old configuration is valid")
                return
        raise CampaignError(f"{RUNS_MAX} runs of the command did not finish; the last ended with: {failure}")

    def _record_outcomes(self) -> str:
        """Record the new power cuts with the configuration that is valid now, and return this outcome.

        Raises `CampaignError` if the board is bricked or its configuration is neither the old nor the new one.
        """
        cuts = self.world.read_power_cuts(self.board, self.cuts_before)
        configuration = decode_configuration(self.world.read_flash(self.board).data)
        outcome = self._classify_outcome(configuration)
        for i, cut in enumerate(cuts[self.recorded_count :], start=self.recorded_count):
            is_last = i == len(cuts) - 1
            record = CutRecord(name_operation(cut), name_moment(cut.after_s), outcome if is_last else CUT_AGAIN)
            self.result.cut_records.append(record)
        self.recorded_count = len(cuts)
        if outcome in (BRICKED, DAMAGED):
            expected = f"{self.old_configuration} or {self.entry}"
            raise CampaignError(f"{outcome}: expected configuration {expected}, found {configuration}")
        return outcome

    def _classify_outcome(self, configuration: dict[str, Any] | None) -> str:
        """Return the state after a power cut: "old" or "new" configuration, `BRICKED` or `DAMAGED`.

        configuration: valid configuration in the flash; None without one.
        """
        if not self.bench.is_alive(self.board, self.unique_id, configuration):
            return BRICKED
        if configuration == self.old_configuration:
            return "old"
        return "new" if configuration is not None and self._matches_entry(configuration) else DAMAGED

    def _matches_entry(self, configuration: dict[str, Any]) -> bool:
        """Return whether a configuration in flash equals the entry that was written."""
        entry = self.entry
        assert entry.serial_number is not None
        assert entry.idac_codes is not None
        return bool(
            configuration["address"] == entry.address
            and configuration["kind"] == entry.kind
            and configuration["serial_number"] == entry.serial_number.encode().ljust(16, b"\0")
            and configuration["idac_codes"] == bytes(entry.idac_codes).ljust(16, b"\0")
        )
