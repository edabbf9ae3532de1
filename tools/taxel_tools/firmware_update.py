"""Firmware update of a board or of the hub, as a procedure that can run concurrently with others."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_protocol.bootloader_packets import compute_row_sum
from taxel_tools.errors import BoardError
from taxel_tools.files.firmware import Firmware, FirmwareImage, format_slot
from taxel_tools.procedure import Clock, Pause, Procedure, Version
from taxel_tools.session import BootInfo
from taxel_tools.targets import BoardTarget, Target

START_TIMEOUT_S: Final = 8.0
"""Longest time until a new image answers: three boot attempts of one watchdog period (1 s) each, and the time in which
the bootloader waits for a host."""
CONFIRM_TIMEOUT_S: Final = 10.0
CONFIRM_WRITE_S: Final = 0.05
VERSION_PARTS: Final = 3
DEVICE_TEXTS: Final[dict[int, str]] = {
    BootDevice.BOARD: "a sensor board with 32 KiB of flash",
    BootDevice.HUB: "the hub with 32 KiB of flash",
    BootDevice.BOARD_16K: "a sensor board with 16 KiB of flash",
    BootDevice.BOARD_64K: "a sensor board with 64 KiB of flash",
    BootDevice.HUB_64K: "the hub with 64 KiB of flash",
}


@dataclass(frozen=True)
class Progress:
    """Progress of one update.

    `address`: I2C address of the board, or `HUB`. `stage`: name of the present stage. `done`, `total`: number of
    processed rows and of all rows.
    """

    address: int
    stage: str
    done: int = 0
    total: int = 0


@dataclass(frozen=True)
class Outcome:
    """Result of an update.

    `address`: I2C address of the board, or `HUB`. `before`, `after`: versions; None if unknown. `slot`: flash slot of
    the running image. `rows_written`: written rows. `rows_kept`: rows that an interrupted update had already written
    correctly. `is_written`: False if the device already ran this image. `seconds`: duration.
    """

    address: int
    before: Version | None
    after: Version
    slot: int
    rows_written: int
    rows_kept: int
    is_written: bool
    seconds: float


Report = Callable[[Progress], None]


def update_board(
    address: int, firmware: Firmware, now_s: Clock, report: Report, force: bool = False, downgrade: bool = False
) -> Procedure[Outcome]:
    """Write `firmware` to the board at `address`; see `update_target`."""
    return update_target(BoardTarget(address, now_s), firmware, report, force, downgrade)


def update_target(
    target: Target, firmware: Firmware, report: Report, force: bool = False, downgrade: bool = False
) -> Procedure[Outcome]:
    """Write `firmware` to the free slot of a board or the hub, read back, start and confirm the new image.

    The update may be interrupted at any point and repeated: correct rows at the beginning of the slot are not written
    again. `force`: write even if the device runs this image. `downgrade`: replace a newer version too; without it, the
    device keeps its newer version. Raises `BoardError` and `TransferError`.
    """
    return (yield from _Update(target, firmware, report, force, downgrade).run())


class _Update:
    """One firmware update of a board or of the hub; `kept_rows` and `written_rows` count the rows of the image."""

    def __init__(self, target: Target, firmware: Firmware, report: Report, force: bool, downgrade: bool) -> None:
        """Prepare the firmware update of one board or hub.

        report: receives the progress. force: write the image even if the device already runs it. downgrade: write it
        even if the device has a newer version.
        """
        self.target = target
        self.address = target.address
        self.firmware = firmware
        self.now_s = target.now_s
        self.report = report
        self.force = force
        self.downgrade = downgrade
        self.session = target.session
        self.kept_rows = self.written_rows = 0

    def run(self) -> Procedure[Outcome]:
        """Run the update of one device: check it, write, start and confirm the image. Raises `BoardError`."""
        start_s = self.now_s()
        before = yield from self.target.read_version()
        self.report(Progress(self.address, "entering"))
        yield from self.target.enter()
        info = yield from self.session.read_info()
        try:
            self._check_device(info)
            yield from self._check_downgrade(before, info)
            is_up_to_date = not self.force and (yield from self._is_up_to_date(info))
            image = self.firmware.select_image_for(info.target) if not is_up_to_date else None
            if image is None and not is_up_to_date:
                raise BoardError(
                    self.address,
                    f"the free slot is {format_slot(info.target)}, but {self.firmware.source} is linked only for slot "
                    f"{format_slot(1 - info.target)}; add the file linked for {format_slot(info.target)}",
                )
        except BoardError:
            yield from self.session.exit()
            raise
        if image is None:
            return (yield from self._leave_unchanged(before, find_used_slot(info), start_s))
        yield from self._program(image)
        yield from self._start_image(image, before)
        self.report(Progress(self.address, "done", self._count_rows(image), self._count_rows(image)))
        return self._build_outcome(before, image.slot, True, start_s)

    def _build_outcome(self, before: Version | None, slot: int, is_written: bool, start_s: float) -> Outcome:
        """Build the result of the update.

        before: version that ran before. slot: flash slot of the image. start_s: time at which the update began.
        """
        seconds = self.now_s() - start_s
        after = self.firmware.version
        return Outcome(self.address, before, after, slot, self.written_rows, self.kept_rows, is_written, seconds)

    def _check_device(self, info: BootInfo) -> None:
        """Check that the firmware is for this kind of device. info: information of its bootloader. Raises
        `BoardError`.
        """
        firmware = self.firmware
        if info.device != firmware.device:
            found = DEVICE_TEXTS.get(info.device, f"unknown ({info.device})")
            raise BoardError(
                self.address,
                f"the device is {found}, but {firmware.source} is for {DEVICE_TEXTS[firmware.device]}; use the file "
                "for this device",
            )
        if firmware.kind and info.kind and info.kind != firmware.kind:
            raise BoardError(
                self.address,
                f"the board is of kind {info.kind}, but {firmware.source} is for kind {firmware.kind}; use the file "
                "for this kind",
            )

    def _check_downgrade(self, before: Version | None, info: BootInfo) -> Procedure[None]:
        """Refuse firmware that is older than the firmware of the device, unless `downgrade`. Raises `BoardError`.

        before: version that ran before; None for a device that was found in its bootloader. The version is then read
        from the image in the slot that the update keeps.
        """
        if self.downgrade:
            return
        running: tuple[int, ...]
        if before is None:
            metadata = yield from self.session.read_metadata(find_used_slot(info))
            running = _decode_version(metadata["application_version"]) if metadata is not None else ()
        else:
            running = before
        # The metadata contain no patch number: only the numbers of `running` are compared.
        if is_downgrade(running, self.firmware.version[: len(running)]):
            raise BoardError(
                self.address,
                f"the device has version {format_version(running)}, which is newer than version "
                f"{format_version(self.firmware.version)} of {self.firmware.source}; nothing is written; add "
                "--downgrade to return to the older version",
            )

    def _is_up_to_date(self, info: BootInfo) -> Procedure[bool]:
        """Return whether the slot in use is confirmed and already contains the image of this update."""
        used_slot = find_used_slot(info)
        metadata = yield from self.session.read_metadata(used_slot)
        image = self.firmware.select_image_for(used_slot)
        is_confirmed = info.confirmed == used_slot
        # `custom_id` of the metadata is the CRC-32 of the image in the slot.
        return is_confirmed and metadata is not None and image is not None and metadata["custom_id"] == image.crc

    def _leave_unchanged(self, before: Version | None, slot: int, start_s: float) -> Procedure[Outcome]:
        """End the update without a write: leave the bootloader, and check that the application operates.

        before: version that ran before. slot: slot in use. start_s: time at which the update began.
        """
        yield from self.session.exit()
        yield from self.target.wait_for_application(START_TIMEOUT_S)
        yield from self.target.check_operation()
        self.report(Progress(self.address, "up to date", 1, 1))
        return self._build_outcome(before, slot, False, start_s)

    def _count_rows(self, image: FirmwareImage) -> int:
        """Return the number of flash rows of a firmware image."""
        return len(image.rows())

    def _program(self, image: FirmwareImage) -> Procedure[None]:
        """Write the missing rows of the firmware image to the free slot.

        If the image CRC is wrong although every row sum is correct, all rows are written. Raises `BoardError` if the
        image is for other rows than the free slot, or if its CRC stays wrong.
        """
        first, last = yield from self.session.read_free_rows()
        rows = image.rows()
        if first + len(rows) - 1 > last or first != LAYOUTS[image.device].first_rows[image.slot]:
            problem = f"the free slot has rows {first} to {last}, but the file is for other rows; run taxel scan again"
            raise BoardError(self.address, problem)
        self.kept_rows = yield from self._count_valid_rows(first, rows)
        # First attempt: only the missing rows. Second attempt: all rows.
        for first_row_index in (self.kept_rows, 0):
            self.kept_rows = first_row_index
            for index in range(first_row_index, len(rows)):
                self.report(Progress(self.address, "writing", index, len(rows)))
                yield from self.session.write_row(first + index, rows[index])
                self.written_rows += 1
            if (yield from self.session.verify_application()):
                if not self.written_rows:  # The bootloader selects an image for the next start only after a row write.
                    yield from self.session.set_active(image.slot)
                return
        raise BoardError(
            self.address, "the image CRC-32 is wrong although the sum of every row is right; replace the device"
        )

    def _count_valid_rows(self, first: int, rows: list[bytes]) -> Procedure[int]:
        """Count the rows at the beginning of the slot that an interrupted update has already written correctly.

        first: first row of the slot. rows: rows of the new image.
        """
        for index, row in enumerate(rows):
            if (yield from self.session.read_row_sum(first + index)) != compute_row_sum(row):
                return index
            self.report(Progress(self.address, "comparing", index, len(rows)))
        return len(rows)

    def _start_image(self, image: FirmwareImage, before: Version | None) -> Procedure[None]:
        """Restart the device into the new image, and check that the image confirms itself and starts again.

        before: version that ran before. Raises `BoardError`.
        """
        total, device_name = self._count_rows(image), self.target.device_name
        self.report(Progress(self.address, "starting", total, total))
        yield from self.session.exit()
        yield Pause(CONFIRM_WRITE_S)
        self._check_version((yield from self.target.wait_for_application(START_TIMEOUT_S)), before)
        self.report(Progress(self.address, "confirming", total, total))
        yield from self.target.trigger_confirmation(CONFIRM_TIMEOUT_S)
        yield Pause(CONFIRM_WRITE_S)
        # Only the bootloader reports the confirmed slot; `enter` also tests the new image's command for the restart.
        yield from self.target.enter()
        info = yield from self.session.read_info()
        yield from self.session.exit()
        if info.confirmed != image.slot:
            end = "stays in its bootloader" if has_one_slot(image.device) else "returns to the previous image"
            problem = f"the new image has not confirmed itself; the {device_name} {end}"
            raise BoardError(self.address, problem)
        if (yield from self.target.wait_for_application(START_TIMEOUT_S)) is None:
            raise BoardError(self.address, "the confirmed image does not answer after a restart; cycle the power")
        yield from self.target.check_operation()

    def _check_version(self, found: Version | None, before: Version | None) -> None:
        """Check that the application has the new version after the restart. Raises `BoardError`.

        found: its version; before: version that ran before the update.
        """
        device_name = self.target.device_name
        if found is None:
            raise BoardError(
                self.address, f"no application answers {START_TIMEOUT_S:g} s after the restart; run the command again"
            )
        if found != self.firmware.version:
            verb = "returned to" if found == before else "runs"
            problem = (
                f"the new image {format_version(self.firmware.version)} did not start, the {device_name} {verb} "
                f"{format_version(found)}; do not use this file"
            )
            raise BoardError(self.address, problem)


def has_one_slot(device: int) -> bool:
    """Return whether a device has one slot only, which an update overwrites while no other image is stored."""
    return device in LAYOUTS and len(LAYOUTS[BootDevice(device)].first_rows) == 1


def find_used_slot(info: BootInfo) -> int:
    """Return the slot of the image that the device runs: the other one than the target, or the only one."""
    return info.target if has_one_slot(info.device) else 1 - info.target


def format_version(version: Sequence[int] | None) -> str:
    """Format a version such as "1.2.3"; "?" for None."""
    return "?" if version is None else ".".join(str(part) for part in version)


def parse_version(text: str) -> Version | None:
    """Parse a version such as "1.2.3"; None for any other string, such as the empty version of a bootloader."""
    parts = text.split(".")
    if len(parts) != VERSION_PARTS or not all(part.isdecimal() for part in parts):
        return None
    return int(parts[0]), int(parts[1]), int(parts[2])


def is_downgrade(running: Sequence[int], new: Sequence[int]) -> bool:
    """Return whether firmware of version `new` is older than the running version."""
    return tuple(new) < tuple(running)


def _decode_version(stored: int) -> tuple[int, int]:
    """Decode major and minor version in the metadata of an image; the metadata do not contain the patch number."""
    return stored >> 8, stored & 0xFF
