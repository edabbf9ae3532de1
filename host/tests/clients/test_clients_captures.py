"""All clients decode a capture to the same frames and losses as the Python decoder, also with damaged bytes."""

import subprocess

import pytest

from host.tests.clients.conftest import captures, programs, reference, run_client, skip_if_missing
from taxel.recording.formats import convert

SECONDS, SEED = 2.0, 45
KINDS = ("plain", "compact")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with a damaged capture of each kind; the seed repeats the damage."""
    folder = tmp_path_factory.mktemp("captures")
    for kind in KINDS:
        captures.record_capture(folder / "intact.bin", SECONDS, kind)
        stream = reference.read_stream(folder / "intact.bin")
        damaged = captures.damage(stream, SEED)
        complete = damaged[: damaged.rindex(b"\0") + 1]  # the dissector has no end of a stream
        captures.write_capture(folder / f"{kind}.bin", complete)
    return folder


@pytest.fixture(scope="module")
def expected(folder):
    """Frames and losses of each capture by the Python decoder."""
    streams = {kind: reference.read_stream(folder / f"{kind}.bin") for kind in KINDS}
    return {
        kind: reference.format_stream(reference.Stream(kind, reference.TO_HOST, data), has_wire=False)
        for kind, data in streams.items()
    }


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_frames_and_losses_of_a_damaged_capture_are_equal(language, folder, expected, kind):
    assert " lost=0 " not in next(line for line in expected[kind] if line.startswith("end "))
    assert run_client(language, "capture", str(folder / f"{kind}.bin")) == expected[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_the_dissector_shows_the_same_frames_and_losses(folder, expected, kind):
    names = ("taxel.sequence", "taxel.lost", "taxel.flags", "taxel.missing", "taxel.counts", "taxel.discarded")
    target = folder / f"{kind}.pcapng"
    convert(folder / f"{kind}.bin", target)
    packets = skip_if_missing(programs.run_dissector, target, names)
    columns = [[value for packet in packets for value in packet[i].split(";") if value] for i in range(len(names))]
    frames = [line for line in expected[kind] if line.startswith("frame ")]
    end = next(line for line in expected[kind] if line.startswith("end "))

    def pick(name):
        """Return the values of a field in the expected lines that contain it."""
        return [line.partition(f" {name}=")[2].partition(" ")[0] for line in frames if f" {name}=" in line]

    # `expected` contains the lines of the Python decoder, which the fields of the dissector must equal.
    assert columns[0] == pick("sequence")
    assert columns[1] == pick("lost")
    assert [int(value, 16) for value in columns[2]] == [int(value) for value in pick("flags")]
    assert columns[3] == pick("missing")
    assert columns[4] == [counts for counts in pick("counts") if counts]
    assert f" discarded={sum(map(int, columns[5]))} " in end


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no capture at all", "is not a taxel capture"),
        (b"TAXELCAP\x02\x00\x00\x00\x00\x00\x00\x00", "version 2"),
        (b"TAXELCAP\x01\x00\x00\x00\xff\xff\xff\xff", "damaged header"),
        (b"TAXELCAP\x01\x00\x00\x00\x00\x00\x00\x00" + bytes(8) + b"\x09\x00\x00\x00ab", "inside a record"),
    ],
)
@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_a_damaged_capture_is_refused_with_one_line(language, tmp_path, content, message):
    path = tmp_path / "damaged.bin"
    path.write_bytes(content)
    with pytest.raises(subprocess.CalledProcessError) as failure:
        run_client(language, "capture", str(path))
    assert message in failure.value.stderr
    assert str(path) in failure.value.stderr
    assert len(failure.value.stderr.splitlines()) == 1
