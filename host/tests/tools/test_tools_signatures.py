"""`taxel keygen`, `taxel sign`, and the refusals of `taxel flash`: signatures and downgrades."""

import io
import random
import sys

import pytest

from host.tests.command_line import run_taxel
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.errors import SignatureError
from taxel_tools.files import load_firmware
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.files.intel_hex import write_intel_hex
from taxel_tools.files.signature import get_signature_path
from taxel_tools.signing import generate_key, load_development_key, load_private_key, sign_images
from taxel_tools.trust import check_firmware

URL = "emulator:?hand=rig4"
BOARD = ("--board", "0x50")
PHYSICAL_URLS = ("/dev/i2c-99", "serial:///dev/ttyNONE")
ALTERED_BYTES = 16
ALTERATIONS = 200


@pytest.fixture(autouse=True)
def _empty_key_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "configuration"))


@pytest.fixture
def run(capsys):
    """Runs `taxel`; returns exit status, standard output and standard error."""

    def call(*arguments):
        status = run_taxel(*arguments)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.fixture
def write_files(tmp_path, make_image):
    """Writes the unsigned .bin files of both slots."""

    def write(name="fw", **options):
        """Write the files and return their paths. options: of `make_image`."""
        paths = []
        for slot in (0, 1):
            paths.append(tmp_path / f"{name}-{'ab'[slot]}.bin")
            paths[-1].write_bytes(make_image(slot, **options).data)
        return paths

    return write


@pytest.fixture
def keys(tmp_path, run):
    """Two key pairs of `taxel keygen`: private and public file of each."""
    pairs = []
    for name in ("release", "other"):
        assert run("keygen", tmp_path / name)[0] == 0
        pairs.append((tmp_path / f"{name}.key", tmp_path / f"{name}.pub"))
    return pairs


def test_a_signed_release_is_written(run, write_files, keys):
    files = write_files()
    (key, public), _ = keys
    status, out, _ = run("sign", *files, "--key", key)
    assert (status, out.split()) == (0, [str(get_signature_path(path)) for path in files])
    status, out, err = run("flash", URL, *files, *BOARD, "--trust", public)
    assert status == 0, err
    assert "signature: valid, release.pub" in err
    assert "confirmed" in out


def test_a_key_in_the_key_folder_is_trusted(run, write_files, keys, tmp_path):
    files = write_files()
    (key, public), _ = keys
    run("sign", *files, "--key", key)
    folder = tmp_path / "configuration" / "taxel" / "firmware-keys"
    folder.mkdir(parents=True)
    (folder / "vendor.pub").write_bytes(public.read_bytes())
    status, _, err = run("flash", URL, *files, *BOARD, "--dry-run")
    assert (status, "signature: valid, vendor.pub" in err) == (0, True)


def refuse(run, files, *options, url=URL):
    """Run an update that must be refused before any write, and return its single error line."""
    status, out, err = run("flash", url, *files, *BOARD, *options)
    assert (status, out) == (1, "")
    assert "will be written" not in err
    assert len(err.splitlines()) == 1
    return err


def test_an_unsigned_image_is_refused(run, write_files, keys):
    assert "signature: expected a signature file fw-a.sig beside it, found none" in refuse(run, write_files())


def test_an_unsigned_image_is_written_only_with_the_option(run, write_files):
    status, _, err = run("flash", URL, *write_files(), *BOARD, "--unsigned")
    assert (status, "warning: " in err) == (0, True)


def test_an_image_signed_with_a_wrong_key_is_refused(run, write_files, keys):
    files = write_files()
    (_, public), (other, _) = keys
    run("sign", *files, "--key", other)
    err = refuse(run, files, "--trust", public)
    assert "expected a trusted key (release.pub), found the key " in err
    assert "none is configured" in refuse(run, files)


@pytest.mark.parametrize("url", PHYSICAL_URLS)
def test_the_development_key_is_refused_for_a_physical_device(run, write_files, url):
    files = write_files()
    run("sign", *files, "--development")
    assert "found the development key, with which everyone can sign" in refuse(run, files, url=url)


def test_the_development_key_is_accepted_for_an_emulated_device(run, write_files):
    files = write_files()
    run("sign", *files, "--development")
    assert run("flash", URL, *files, *BOARD, "--dry-run")[0] == 0


def test_altered_bytes_with_a_new_crc_are_refused(run, write_files, keys, make_image):
    """The CRC-32 of the altered image is correct, so a bootloader would start the image."""
    files = write_files(size=600)
    (key, public), _ = keys
    run("sign", *files, "--key", key)
    trusted = {load_private_key(key, None).public_key().public_bytes_raw(): "release"}
    content = files[0].read_bytes()[32:]
    rng = random.Random(44)
    for _ in range(ALTERATIONS):
        altered = bytearray(content)
        begin = rng.randrange(len(altered) - ALTERED_BYTES)
        altered[begin : begin + ALTERED_BYTES] = rng.randbytes(ALTERED_BYTES)
        files[0].write_bytes(make_image(0, content=bytes(altered)).data)
        firmware = load_firmware(files)  # the image is valid apart from its signature
        with pytest.raises(SignatureError, match=r"fw-a\.sig: signature: expected a signature of fw-a\.bin"):
            check_firmware(firmware, trusted, is_emulated=True)
    assert "a signature of other bytes" in refuse(run, files, "--trust", public)


@pytest.mark.parametrize("options", [{"kind": 10}, {"version": (9, 2, 3)}, {"device": BootDevice.HUB}])
def test_a_signature_does_not_fit_another_kind_version_or_device(write_files, options):
    files = write_files()
    sign_images(files, load_development_key())
    check_firmware(load_firmware(files), {}, is_emulated=True)
    write_files(**options)
    with pytest.raises(SignatureError, match="a signature of other bytes"):
        check_firmware(load_firmware(files), {}, is_emulated=True)


def test_a_signature_does_not_fit_the_other_slot(write_files):
    files = write_files()
    sign_images(files, load_development_key())
    get_signature_path(files[0]).write_bytes(get_signature_path(files[1]).read_bytes())
    with pytest.raises(SignatureError):
        check_firmware(load_firmware(files), {}, is_emulated=True)


def test_one_signature_fits_every_format_of_an_image(write_files, tmp_path, make_image):
    files = write_files()
    sign_images(files, load_development_key())
    for slot, path in enumerate(files):
        image = make_image(slot)
        path.with_suffix(".cyacd").write_text(write_cyacd(image, LAYOUTS[image.device].first_rows[slot]))
        address = LAYOUTS[image.device].slot_address(slot)
        path.with_suffix(".hex").write_text(write_intel_hex(image.data, address))
    for suffix in (".cyacd", ".hex"):
        check_firmware(load_firmware([path.with_suffix(suffix) for path in files]), {}, is_emulated=True)


def test_every_damaged_or_truncated_signature_file_is_refused_in_one_line(write_files):
    files = write_files()
    sign_images(files, load_development_key())
    path = get_signature_path(files[0])
    whole = path.read_bytes()
    begin = whole.index(b"taxel_signature")
    rng = random.Random(45)
    damaged = [whole[:size] for size in range(begin, len(whole) - 2, 7)]
    damaged += [bytes(rng.randbytes(200)), b"[" * 5000, whole.replace(b'"image"', b'"file"'), b"x" * 100_000, b""]
    for position in range(whole.index(b"public_key"), len(whole) - 1, 3):
        changed = bytearray(whole)
        changed[position] ^= 1 << rng.randrange(7)  # the file stays ASCII text
        damaged.append(bytes(changed))
    for data in damaged:
        path.write_bytes(data)
        with pytest.raises(SignatureError) as raised:
            check_firmware(load_firmware(files), {}, is_emulated=True)
        assert len(str(raised.value).splitlines()) == 1


def test_a_truncated_image_is_refused(run, write_files):
    files = write_files()
    run("sign", *files, "--development")
    files[0].write_bytes(files[0].read_bytes()[:-4])
    assert "the file is truncated; copy it again" in refuse(run, files)


def test_a_downgrade_is_refused_without_a_confirmation(run, write_files):
    files = write_files(version=(0, 0, 1))
    run("sign", *files, "--development")
    err = run("flash", URL, *files, *BOARD)[2]
    assert "version 0.0.1 is older than the running version of 0x50 (" in err
    assert err.endswith("nothing is written; add --downgrade to return to the older version\n")
    status, out, err = run("flash", URL, *files, *BOARD, "--downgrade")
    assert (status, "confirmed" in out) == (0, True), err


@pytest.mark.parametrize(("answer", "status"), [("y\n", 0), ("n\n", 1), ("", 1)])
def test_a_downgrade_can_be_confirmed_at_a_terminal(run, write_files, monkeypatch, answer, status):
    files = write_files(version=(0, 0, 1))
    run("sign", *files, "--development")
    terminal = io.StringIO(answer)
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", terminal)
    assert run("flash", URL, *files, *BOARD)[0] == status


def test_a_downgrade_of_the_hub_is_refused_without_a_confirmation(run, write_files):
    files = write_files(version=(0, 0, 1), device=BootDevice.HUB)
    run("sign", *files, "--development")
    status, _, err = run("flash", URL, *files)
    assert (status, "older than the running version of the hub" in err) == (1, True)


def test_a_file_for_a_debug_probe_needs_a_signature_of_its_bytes(run, keys, tmp_path, monkeypatch):
    (tmp_path / "openocd").write_text("#!/bin/sh\n")
    (tmp_path / "openocd").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    (key, public), _ = keys
    path = tmp_path / "bootloader.hex"
    path.write_text(write_intel_hex(bytes(4096), 0))
    assert "bootloader.sig beside it, found none" in run("flash", "--swd", path)[2]
    assert run("sign", "--swd", path, "--key", key)[0] == 0
    assert "signature: valid, release.pub" in run("flash", "--swd", path, "--trust", public)[2]
    path.write_text(write_intel_hex(bytes(4095) + b"\1", 0))
    status, _, err = run("flash", "--swd", path, "--trust", public)
    assert (status, "a signature of other bytes" in err) == (1, True)


def test_a_private_key_file_is_readable_only_by_its_owner(run, tmp_path):
    assert run("keygen", tmp_path / "release")[0] == 0
    assert (tmp_path / "release.key").stat().st_mode & 0o777 == 0o600


def test_an_existing_private_key_is_not_replaced(run, tmp_path):
    assert run("keygen", tmp_path / "release")[0] == 0
    private = tmp_path / "release.key"
    before = private.read_bytes()
    status, _, err = run("keygen", tmp_path / "release")
    assert (status, "exists already" in err) == (1, True)
    assert private.read_bytes() == before


def test_an_encrypted_key_needs_its_passphrase(run, write_files, tmp_path, monkeypatch):
    files = write_files()
    monkeypatch.setenv("TAXEL_KEY_PASSPHRASE", "correct horse")
    assert "encrypted;" in run("keygen", tmp_path / "release")[1]
    assert b"ENCRYPTED" in (tmp_path / "release.key").read_bytes()
    arguments = ("sign", *files, "--key", tmp_path / "release.key")
    assert run(*arguments)[0] == 0
    for passphrase in ("wrong", ""):
        monkeypatch.setenv("TAXEL_KEY_PASSPHRASE", passphrase)
        status, _, err = run(*arguments)
        assert (status, len(err.splitlines())) == (1, 1), err


@pytest.mark.parametrize(
    "content", [b"", b"not a key", b"-----BEGIN PRIVATE KEY-----\nAAAA\n-----END PRIVATE KEY-----\n"]
)
def test_a_file_that_is_no_private_key_is_refused_in_one_line(run, write_files, tmp_path, content):
    (tmp_path / "x.key").write_bytes(content)
    status, _, err = run("sign", *write_files(), "--key", tmp_path / "x.key")
    assert (status, len(err.splitlines())) == (1, 1), err


def test_a_private_key_is_refused_where_a_public_key_is_expected(run, write_files, keys):
    (key, _), _ = keys
    status, _, err = run("flash", URL, *write_files(), *BOARD, "--trust", key)
    assert (status, "expected a public key of taxel keygen" in err) == (1, True)


def test_generated_keys_differ():
    assert generate_key(None)[1] != generate_key(None)[1]
