"""The original hub as a link: handshake, boards, commands, errors, and all kinds of byte sources."""

import os
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import taxel
from host.tests.original_hub.original_streams import ORDER, join_messages, synthesise_messages
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.link import CaptureWriter, LinkError
from taxel.monitor import open_paced
from taxel.skin import Skin
from taxel_protocol import Command
from taxel_protocol.original import FORMATS, READ_SEQUENCE

EMULATOR = "emulator:?protocol=original&speed=max&seed=3"
FITTED_ORDER = tuple(address for address in READ_SEQUENCE if not 0x10 <= address <= 0x14)
"""Read sequence of the boards of the original hand, which lacks the boards of the thumb."""


def open_emulator(options: str = "&duration_s=6", hand: str = "original") -> Skin:
    return taxel.open(EMULATOR + options, hand=hand)


def test_emulated_original_hub_delivers_all_boards_in_every_cycle() -> None:
    with open_emulator() as skin:
        assert skin.missing_boards == []
        frames = list(skin)
        assert skin.link.read_sequence == FITTED_ORDER  # type: ignore[attr-defined]
        assert len({frame.address for frame in frames}) == 17
        assert all(count.missing == 0 for count in skin.losses.boards.values())
        assert len(frames) == skin.link.decoder.messages  # type: ignore[attr-defined]


def test_times_of_a_frame_are_the_milliseconds_of_the_hub() -> None:
    with open_emulator() as skin:
        frames = list(skin)
    assert all(frame.hub_time_us % 1000 == 0 and frame.board_time_us == frame.hub_time_us for frame in frames)
    assert all(frame.time_s == pytest.approx(frame.hub_time_us * 1e-6) for frame in frames)


def test_baseline_and_scans_of_the_whole_skin_are_available() -> None:
    with open_emulator("&duration_s=12") as skin:
        baseline = skin.take_baseline(20)
        assert np.isfinite(baseline.mean).all()
        assert baseline.mean.shape == (1037,)
        assert next(skin.scans()).valid.all()


@pytest.mark.parametrize(
    ("options", "hand", "boards"),
    [
        ("&generation=first&duration_s=4", "first_generation", 22),
        ("&generation=first&message=high_byte_first&duration_s=4", "first_generation", 22),
        ("&generation=first&message=no_timestamp&duration_s=4", "first_generation", 22),
        ("&accelerations=0x0B,0x17,0x1C&duration_s=4", "original", 17),
        ("&duration_s=6", "original_complete", 22),
    ],
)
def test_all_boards_of_each_variant_are_read_without_losses(options: str, hand: str, boards: int) -> None:
    with open_emulator(options, hand) as skin:
        frames = list(skin)
        assert len({frame.address for frame in frames}) == boards
        assert sum(count.missing for count in skin.losses.boards.values()) == 0
        counts = np.concatenate([frame.raw_counts for frame in frames[2 * boards :]])
    assert 1000 < np.median(counts) < 2200  # counts without contact


def test_hub_status_states_streaming_boards_and_cycle_time_and_boards_not_polled_are_missing() -> None:
    with open_emulator("&skip=0x0B,0x17&duration_s=8") as skin:
        assert set(skin.missing_boards) == {"fingertip_middle", "fingertip_pinkie"}
        for _ in skin:
            pass
        assert skin.hub.status is not None
        assert skin.hub.status["boards_streaming"] == 15
        # The messages of the 15 polled boards have 1930 bytes, which take 168 ms at 115,200 baud.
        assert skin.hub.status["cycle_time_us"] == pytest.approx(168_000, abs=2000)
        assert sorted(skin.hub.board_status) == sorted(ORDER)


def test_requests_of_status_addresses_and_time_and_a_restart_of_the_stream_are_answered() -> None:
    with open_emulator("") as skin:
        skin.hub.read_status()
        assert skin.hub.scan_bus() == sorted(FITTED_ORDER)
        assert int.from_bytes(skin.hub.command(Command.GET_TIME), "little") > 0
        skin.hub.stop()
        skin.hub.start()
        assert len(list(zip(range(40), skin, strict=False))) == 40


@pytest.mark.parametrize(
    "command",
    [
        lambda hub: hub.transfer(0x08, b"\0", 1),
        lambda hub: hub.set_scan_settings(dict.fromkeys(_list_scan_settings(), 1)),
        lambda hub: hub.set_rate(10.0),
        lambda hub: hub.start(compact=True),
        lambda hub: hub.command(Command.REBOOT),
        lambda hub: hub.command(99),
    ],
)
def test_command_of_the_projects_own_firmware_is_refused_with_a_one_line_message(
    command: Callable[[object], object],
) -> None:
    with open_emulator("") as skin, pytest.raises(LinkError, match="the original hub does not support") as error:
        command(skin.hub)
    assert "\n" not in str(error.value)


def _list_scan_settings() -> list[str]:
    """List the names of all scan settings."""
    from taxel_protocol.layout import list_fields
    from taxel_protocol.registers import ScanSettings

    return [field.name for field in list_fields(ScanSettings)]


def test_file_of_bytes_is_read_as_a_recording(tmp_path: Path) -> None:
    sent = synthesise_messages(30)
    path = tmp_path / "stream.raw"
    path.write_bytes(join_messages(sent))
    with taxel.open(f"file:{path}?protocol=original", hand="original") as skin:
        frames = list(skin)
        assert skin.link.is_recorded
    assert [(frame.address, frame.cycle) for frame in frames] == [(message.address, message.cycle) for message in sent]
    assert frames[0].raw_counts.tolist() == list(np.frombuffer(sent[0].data[7:-1], "<u2"))
    assert frames[0].time_s == pytest.approx(120.0)  # the first timestamp


def test_file_of_bytes_is_played_at_the_speed_of_the_wire(tmp_path: Path) -> None:
    path = tmp_path / "stream.raw"
    path.write_bytes(join_messages(synthesise_messages(12)))
    start_s = time.monotonic()
    with open_paced(f"file:{path}?protocol=original", "original") as skin:
        assert len(list(skin)) == 12 * len(ORDER)
    assert 1.0 < time.monotonic() - start_s < 6.0  # at most 2.3 s, without the cycles that are read to learn the order


def test_capture_file_of_bytes_keeps_the_arrival_times(tmp_path: Path) -> None:
    path = tmp_path / "stream.bin"
    with CaptureWriter(path) as writer:
        for index, message in enumerate(synthesise_messages(30)):
            writer.write(message.data, 5_000_000_000 + index * 11_000_000)
    with taxel.open(f"file:{path}?protocol=original&hand=original") as skin:
        frames = list(skin)
    assert len(frames) == 30 * len(ORDER)
    assert 4.9 < frames[0].time_s < 5.1  # the first message arrived at 5 s


def _send_in_real_time(write: Callable[[bytes], object], stop: threading.Event) -> None:
    """Write the messages of an original hub at the speed of the wire, until `stop` is set or 400 cycles are sent."""
    sent = synthesise_messages(400)
    start_s, size = time.monotonic(), 0
    for message in sent:
        if stop.is_set():
            return
        size += len(message.data)
        time.sleep(max(0.0, start_s + size / 11520 - time.monotonic()))
        write(message.data)


@pytest.fixture
def serial_port() -> Iterator[str]:
    """Yield the name of a pseudo-terminal at whose other end an original hub sends at 115,200 baud."""
    master, slave = os.openpty()
    tty.setraw(slave)
    stop = threading.Event()
    thread = threading.Thread(target=_send_in_real_time, args=(lambda data: os.write(master, data), stop))
    thread.start()
    yield os.ttyname(slave)
    stop.set()
    thread.join()
    os.close(master)
    os.close(slave)


def count_frames_for(skin: Skin, seconds: float) -> int:
    """Poll a skin for a time; return the number of frames."""
    frames = 0
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        frames += len(skin.poll())
    return frames


def test_serial_port_delivers_frames_with_times_of_this_computer(serial_port: str) -> None:
    with taxel.open(f"serial://{serial_port}?protocol=original", hand="original") as skin:
        assert skin.link.baud == 115200.0
        assert count_frames_for(skin, 1.0) > 50  # 17 boards at 5.2 poll cycles per second send 88
        assert all(count.missing == 0 for count in skin.losses.boards.values())
        frame = next(iter(skin))
        assert abs(time.monotonic() - frame.time_s) < 0.3


def test_device_name_without_a_scheme_is_accepted(serial_port: str) -> None:
    with taxel.open(f"{serial_port}?protocol=original&hand=original") as skin:
        assert count_frames_for(skin, 0.5) > 20


def test_socket_url_delivers_frames() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    stop = threading.Event()

    def serve() -> None:
        """Accept one connection and send the messages of an original hub to it."""
        connection, _ = server.accept()
        with connection:
            _send_in_real_time(connection.sendall, stop)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        with taxel.open(f"socket://127.0.0.1:{server.getsockname()[1]}?protocol=original", hand="original") as skin:
            assert count_frames_for(skin, 0.5) > 20
            stop.set()
            thread.join()
    finally:
        stop.set()
        thread.join()
        server.close()


def test_port_without_an_original_hub_raises_an_error_that_states_the_baud_rate() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        with pytest.raises(TaxelError, match=r"no reply from a hub.*baud rate is 115200"):
            taxel.open(f"serial://{os.ttyname(slave)}?protocol=original", hand="original")
    finally:
        os.close(master)
        os.close(slave)


def test_board_that_the_hand_does_not_have_raises_an_error_with_its_address(tmp_path: Path) -> None:
    order = [address for address in READ_SEQUENCE if address in FORMATS["original"].taxels]
    path = tmp_path / "stream.raw"
    path.write_bytes(join_messages(synthesise_messages(20, order=order)))
    with (
        taxel.open(f"file:{path}?protocol=original", hand="original") as skin,
        pytest.raises(LinkError, match=r"board 0x10, which hand 'original' does not have"),
    ):
        list(skin)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ("&variant=other", "option 'variant' must be one of"),
        ("&variant=first_generation&hand=original", "has 65 taxels, but format 'first_generation' has 6 taxels"),
        ("&hand=allegro", "has no such board"),
        ("&baud=7", "option 'baud' must be a number"),
        ("&variant=fingertip_records", "format 'fingertip_records' has 25 taxels"),
    ],
)
def test_invalid_option_is_refused_with_a_one_line_message(options: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "stream.raw"
    path.write_bytes(b"")
    with pytest.raises(TaxelError, match=text) as error:
        taxel.open(f"file:{path}?protocol=original{options}")
    assert "\n" not in str(error.value)


def test_missing_file_is_refused() -> None:
    with pytest.raises(LinkError, match="cannot be read"):
        taxel.open("file:/nonexistent.raw?protocol=original", hand="original")


def test_default_hand_belongs_to_the_variant(tmp_path: Path) -> None:
    first = FORMATS["first_generation"]
    path = tmp_path / "stream.raw"
    path.write_bytes(join_messages(synthesise_messages(20, order=READ_SEQUENCE, message_format=first)))
    with taxel.open(f"file:{path}?protocol=original&variant=first_generation") as skin:
        assert skin.hand == load_hand("first_generation")
        assert len(list(skin)) == 20 * 22


def test_addresses_of_early_firmware_become_those_of_later_firmware(tmp_path: Path) -> None:
    untimed = FORMATS["first_generation_untimed"]
    path = tmp_path / "stream.raw"
    path.write_bytes(join_messages(synthesise_messages(20, order=range(0x01, 0x17), message_format=untimed)))
    with taxel.open(f"file:{path}?protocol=original&variant=first_generation_untimed") as skin:
        frames = list(skin)
        assert {frame.address for frame in frames} == set(range(0x08, 0x1E))  # those of the later firmware
        assert sum(count.missing for count in skin.losses.boards.values()) == 0
