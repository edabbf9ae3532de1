"""Flash that a verification of Ed25519 signatures would take in the bootloader.

    python tools/firmware/signature_size/signature_size.py

Compiles `ed25519_verify.c` for the Cortex-M0 with the size options of the bootloader, and prints the bytes of code and
constants, and the largest stack frame. Needs arm-none-eabi-gcc.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

SOURCE: Final = Path(__file__).with_name("ed25519_verify.c")
P: Final = 2**255 - 19
GROUP_ORDER: Final = 2**252 + 27742317777372353535851937790883648493
"""Order of the base point (RFC 8032, section 5.1)."""
OPTIONS: Final = ("-Os", "-std=gnu11", "-ffreestanding", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra")
CORTEX_M0: Final = ("-mcpu=cortex-m0", "-mthumb", "-fno-expensive-optimizations", "-fstack-usage")


def list_primes(count: int) -> Iterator[int]:
    """Yield the first `count` prime numbers."""
    found: list[int] = []
    number = 2
    while len(found) < count:
        if all(number % prime for prime in found):
            found.append(number)
            yield number
        number += 1


def compute_root(value: int, degree: int) -> int:
    """Return the largest integer whose power of `degree` is at most `value`."""
    low, high = 0, 1 << (value.bit_length() // degree + 1)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if middle**degree <= value else (low, middle)
    return low


def compute_fraction(prime: int, degree: int) -> int:
    """Return the first 64 bits of the fraction of a prime number's root (FIPS 180-4, sections 4.2.3 and 5.3.5).

    degree: 2 for the square root, 3 for the cube root.
    """
    return compute_root(prime << (64 * degree), degree) & (2**64 - 1)


def format_header() -> str:
    """Return the text of sha512_constants.h: constants of hash and curve, computed from their definitions.

    The constants of the curve are those of RFC 8032, section 5.1.
    """
    d = -121665 * pow(121666, -1, P) % P
    y = 4 * pow(5, -1, P) % P
    root = pow(2, (P - 1) // 4, P)
    x = pow((y * y - 1) * pow(d * y * y + 1, -1, P), (P + 3) // 8, P)
    if (x * x - (y * y - 1) * pow(d * y * y + 1, -1, P)) % P:
        x = x * root % P
    x = x if x % 2 == 0 else P - x
    constants = {"TWICE_D": 2 * d % P, "ROOT_OF_MINUS_1": root, "BASE_X": x, "BASE_Y": y, "GROUP_ORDER": GROUP_ORDER}
    lines = [
        f"#define {name} {{{', '.join(str(byte) for byte in value.to_bytes(32, 'little'))}}}"
        for name, value in constants.items()
    ]
    for name, degree, count in (("sha512_k", 3, 80), ("sha512_start", 2, 8)):
        words = ", ".join(f"0x{compute_fraction(prime, degree):016X}u" for prime in list_primes(count))
        lines.append(f"static const uint64_t {name}[{count}] = {{{words}}};")
    return "\n".join(lines) + "\n"


def compile_program(compiler: str, options: tuple[str, ...], folder: Path, output: str) -> Path:
    """Compile the program into `folder` and return the path of the output. Raises CalledProcessError, OSError."""
    (folder / "sha512_constants.h").write_text(format_header())
    path = folder / output
    subprocess.run([compiler, *OPTIONS, *options, f"-I{folder}", str(SOURCE), "-o", str(path)], check=True)
    return path


def measure(folder: Path) -> tuple[int, int, int]:
    """Return the bytes of code, of constants, and of the largest stack frame of the program for the Cortex-M0."""
    path = compile_program("arm-none-eabi-gcc", (*CORTEX_M0, "-c"), folder, "verify.o")
    text = subprocess.run(["arm-none-eabi-size", "-A", str(path)], check=True, capture_output=True, text=True).stdout
    sizes = {match[1]: int(match[2]) for match in re.finditer(r"^(\S+)\s+(\d+)", text, re.MULTILINE)}
    code = sum(size for name, size in sizes.items() if name.startswith(".text"))
    constants = sum(size for name, size in sizes.items() if name.startswith(".rodata"))
    frames = [int(line.split("\t")[1]) for line in path.with_suffix(".su").read_text().splitlines()]
    return code, constants, max(frames)


def main() -> int:
    """Print the sizes; without the compiler the exit status is 1."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            code, constants, frame = measure(Path(folder))
        except OSError as error:
            print(f"signature_size: {error}; install gcc-arm-none-eabi", file=sys.stderr)
            return 1
    print(f"Ed25519 verification: {code} bytes of code, {constants} of constants, largest stack frame {frame} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
