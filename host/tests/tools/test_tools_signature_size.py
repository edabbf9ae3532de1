"""The program whose size stands for a check of signatures in the bootloader verifies Ed25519 correctly."""

import ctypes
import importlib.util
import random
import shutil
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

SCRIPT = Path(__file__).resolve().parents[3] / "tools" / "firmware" / "signature_size" / "signature_size.py"
BOOTLOADER_FREE_BYTES = 12
"""Free flash of the board's bootloader (docs/firmware-size.md)."""


@pytest.fixture(scope="module")
def module():
    """Load the program signature_size.py as a module."""
    spec = importlib.util.spec_from_file_location("signature_size", SCRIPT)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.fixture(scope="module")
def verify(module, tmp_path_factory):
    """Compile the check of signatures for this computer; return it as a function of signature, key and message."""
    path = module.compile_program("gcc", ("-O2", "-shared", "-fPIC"), tmp_path_factory.mktemp("verify"), "verify.so")
    function = ctypes.CDLL(str(path)).ed25519_verify
    function.restype = ctypes.c_bool
    return lambda signature, key, message: function(signature, key, message, ctypes.c_uint32(len(message)))


def test_valid_signatures_are_accepted_and_every_change_is_rejected(verify):
    rng = random.Random(44)
    for size in (0, 1, 46, 47, 48, 63, 64, 65, 200):  # also around the block of the hash
        key = Ed25519PrivateKey.from_private_bytes(rng.randbytes(32))
        public, message = key.public_key().public_bytes_raw(), rng.randbytes(size)
        signature = key.sign(message)
        assert verify(signature, public, message)
        for _ in range(3):
            changed = [bytearray(part) for part in (signature, public, message or b"x")]
            part = changed[rng.randrange(3)]
            part[rng.randrange(len(part))] ^= 1 << rng.randrange(8)
            assert not verify(*(bytes(part) for part in changed))


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="needs gcc-arm-none-eabi")
def test_a_check_of_signatures_is_more_than_ten_times_larger_than_the_free_space_of_the_bootloader(module, tmp_path):
    code, constants, _ = module.measure(tmp_path)
    assert code + constants > 10 * BOOTLOADER_FREE_BYTES
