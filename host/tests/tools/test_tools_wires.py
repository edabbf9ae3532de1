"""Bus connections and the scheduler: order, failures, and the number of commands in flight."""

import errno
import os
import pickle

import pytest

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BootCommand
from taxel_protocol.limits import REGISTER_SETTINGS, WHO_AM_I
from taxel_tools.errors import BoardError, FirmwareFileError, LostError, NackError, PlanError, StatusError, WireError
from taxel_tools.procedure import Pause, Transfer
from taxel_tools.scheduler import run, run_all
from taxel_tools.session import BootSession
from taxel_tools.wires import SmbusWire


class BrokenBus:
    """An adapter whose transfers all end with the same error."""

    def __init__(self, number: int) -> None:
        self.number = number

    def i2c_rdwr(self, *messages) -> None:
        raise OSError(self.number, os.strerror(self.number))

    def close(self) -> None:
        pass


def read_once(address: int, size: int = 1):
    """Read the first `size` registers of a board, as a procedure; the first byte is WHO_AM_I."""
    return (yield Transfer(address, b"\0", size))


def test_a_procedure_receives_the_bytes_read(worlds, open_wire):
    assert run(open_wire(worlds(boards=1)), read_once(0x50)) == bytes([WHO_AM_I])


def test_procedures_run_concurrently_and_fail_independently(worlds, open_wire):
    wire = open_wire(worlds(boards=2))
    results = run_all(wire, {address: read_once(address) for address in (0x50, 0x51, 0x52)})
    assert results[0x50] == results[0x51] == bytes([WHO_AM_I])
    assert isinstance(results[0x52], NackError)


def test_pauses_of_several_procedures_overlap(worlds, open_wire):
    world = worlds(boards=1)
    wire = open_wire(world)

    def pause_procedure():
        yield Pause(0.2)

    start_s = world.now_s
    run_all(wire, {i: pause_procedure() for i in range(9)})
    assert 0.2 <= world.now_s - start_s < 0.21


@pytest.mark.parametrize(
    ("number", "kind"),
    [(errno.ENXIO, NackError), (errno.EREMOTEIO, NackError), (errno.ETIMEDOUT, LostError), (errno.EAGAIN, LostError)],
)
def test_each_errno_of_an_adapter_raises_its_exception(number, kind):
    with pytest.raises(kind, match=r"board 0x50: .* on /dev/i2c-1"):
        run(SmbusWire(BrokenBus(number), "/dev/i2c-1"), read_once(0x50))


def test_a_missing_adapter_ends_every_procedure():
    with pytest.raises(WireError, match="/dev/i2c-1: No such device; check the adapter and its driver"):
        run_all(SmbusWire(BrokenBus(errno.ENODEV), "/dev/i2c-1"), {i: read_once(0x50) for i in range(3)})


def test_the_ring_buffer_of_the_hub_never_overflows_and_replies_are_flushed(worlds, hub):
    world = worlds(hand="allegro", usb_latency_ms=16.0)
    wire = hub(world)
    addresses = wire.scan()

    def read_repeatedly(address):
        for _ in range(20):
            yield Transfer(address, bytes([REGISTER_SETTINGS]) + bytes(11), 12)  # 12 bytes in each direction

    start_s = world.now_s
    results = run_all(wire, {address: read_repeatedly(address) for address in addresses})
    assert not any(isinstance(result, TaxelError) for result in results.values())
    assert not wire.hub.logs  # the hub logs an overflow of its ring buffer
    # A reply that is not flushed waits up to 16 ms in the USB adapter; the mean time of a transfer is far shorter.
    assert (world.now_s - start_s) / (20 * len(addresses)) < 0.004


def test_a_refused_packet_gives_one_error_line_with_its_status(worlds, adapter):
    wire = adapter(worlds(boards=1))
    session = BootSession(0x50, wire.now_s)

    def procedure():
        yield from session.enter()
        yield from session.write_row(40, bytes(128))  # of slot A, rows 32 to 127

    with pytest.raises(StatusError, match="board 0x50: a write to a row of the slot in use was refused") as error:
        run(wire, procedure())
    assert error.value.status == 0x0D


def test_writes_to_rows_of_the_bootloader_are_refused(worlds, adapter):
    world = worlds(boards=1)
    wire = adapter(world)
    flash_content = world.read_flash(0x50).data
    session = BootSession(0x50, wire.now_s)

    def procedure():
        yield from session.enter()
        yield from session.write_row(3, bytes(128))

    with pytest.raises(StatusError, match="a write to a protected row"):
        run(wire, procedure())
    assert world.read_flash(0x50).data == flash_content


def test_a_bootloader_without_a_session_refuses_commands(worlds, adapter):
    world = worlds("blank 0x50", boards=1)
    wire = adapter(world)
    with pytest.raises(StatusError, match="the bootloader does not support the command"):
        run(wire, BootSession(0x77, wire.now_s).request(BootCommand.VERIFY_APPLICATION, reply=1))


@pytest.mark.parametrize(
    "error",
    [
        BoardError(0x21, "x"),
        NackError(0x21, "x"),
        LostError(0x21, "x"),
        StatusError(0x21, "x", 8),
        WireError("/dev/i2c-1", "x"),
        FirmwareFileError("f", "line 1", "a", "b", "c"),
        PlanError("f", "board[0]", "a", "b", "c"),
    ],
)
def test_errors_can_be_pickled(error):
    unpickled = pickle.loads(pickle.dumps(error))
    assert (type(unpickled), str(unpickled), vars(unpickled)) == (type(error), str(error), vars(error))
