"""The example programs of the clients print the frames of a capture, and of a hub on a serial port."""

import re
import subprocess

import pytest

import taxel
from host.tests.clients.conftest import captures, programs, reference, run_client, skip_if_missing
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import CaptureWriter
from taxel.link.emulator import find_emulator_program


def cut_before_last_delimiter(path):
    """Cut a capture before the delimiter of its last taxel frame, whose end is then not yet received."""
    data = reference.read_stream(path)
    lines = reference.format_stream(reference.Stream("cut", reference.TO_HOST, data), has_wire=True)
    wires = [bytes.fromhex(line.rpartition("wire=")[2]) for line in lines if "TAXELS" in line]
    wire = next(wire for wire in reversed(wires) if wire in data)  # the capture contains it in this form
    assert wire[-1] == 0
    with CaptureWriter(path, {}, overwrite=True) as writer:
        writer.write(data[: data.rindex(wire) + len(wire) - 1], 0)


@pytest.mark.parametrize("is_cut", [False, True])
@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_the_example_prints_one_line_for_each_taxel_frame(language, is_cut, tmp_path, monkeypatch):
    captures.record_capture(tmp_path / "skin.bin", 0.2, "compact")
    if is_cut:  # the delimiter of the last taxel frame is missing
        cut_before_last_delimiter(tmp_path / "skin.bin")
    monkeypatch.chdir(programs.CLIENTS / language)
    lines = run_client(language, str(tmp_path / "skin.bin"), name="print_frames")
    stream = reference.Stream("example", reference.TO_HOST, reference.read_stream(tmp_path / "skin.bin"))
    frames = [line for line in reference.format_stream(stream, has_wire=False) if "TAXELS" in line]
    expected = []
    for line in frames:
        words = dict(word.split("=") for word in line.split(" ")[1:])
        first = words["counts"].partition(",")[0]
        address, cycle = int(words["header_address"]), words["header_cycle"]
        expected.append(f"board 0x{address:02X}, cycle {cycle}: taxel 0 has {first} counts")
    assert expected
    assert lines == [*expected, "0 frames lost"]


@pytest.mark.parametrize("before", ["nothing", "a stream that no host stopped"])
def test_the_live_example_starts_a_hub_on_a_serial_port_and_stops_it(tmp_path, before):
    command = skip_if_missing(programs.build_program, "cpp", "live_frames")
    hand = load_hand("flat8")
    (tmp_path / "world.txt").write_text(format_world(hand, WorldSettings()))
    emulator = [find_emulator_program(), "--world", tmp_path / "world.txt", "--uart", "pty"]
    with subprocess.Popen(emulator, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True) as process:
        try:
            device = process.stdout.readline().strip()
            if before != "nothing":
                with taxel.open(f"serial://{device}", "flat8") as skin:
                    next(iter(skin))
                    skin._stream.close()  # as by a killed program: the hub continues to stream
            lines = programs.run_program([*command, device, "40"])
        finally:
            process.kill()
    assert [line.partition(",")[0] for line in lines[:40]] == [f"board 0x{hand.boards[0].address:02X}"] * 40
    assert re.fullmatch(r"\d+ frames lost", lines[40])
    assert before != "nothing" or lines[40] == "0 frames lost"


@pytest.mark.parametrize("arguments", [[], ["/dev/null", "5"], ["/dev/ttyNONE", "5"]])
def test_the_live_example_ends_with_one_error_line_without_a_serial_port(arguments):
    command = skip_if_missing(programs.build_program, "cpp", "live_frames")
    with pytest.raises(subprocess.CalledProcessError) as failure:
        programs.run_program([*command, *arguments])
    assert len(failure.value.stderr.splitlines()) == 1
