#!/bin/sh
# Bytes of code and constants of each file on a Cortex-M0, without the port: startup, flash and bus driver, memcpy().
# Needs clang and llvm-size; images are built with other compilers, so these are close, not exact.
set -e
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
printf '#include <stddef.h>\nvoid *memcpy(void *, const void *, size_t);\nvoid *memset(void *, int, size_t);\n' > "$work/string.h"
printf 'int memcmp(const void *, const void *, size_t);\n' >> "$work/string.h"
for source in bootloader/*.c codec/crc32_small.c; do
    name=$(basename "$source" .c)
    "${CLANG:-clang}" --target=thumbv6m-none-eabi -mcpu=cortex-m0 -Oz -fomit-frame-pointer -ffreestanding -I. \
        -isystem "$work" -c "$source" -o "$work/$name.o"
    "${LLVM_SIZE:-llvm-size}" -A "$work/$name.o" |
        awk -v name="$name" '$1 ~ /^\.(text|rodata)/ { bytes += $2 } END { printf "%6d %s\n", bytes, name }'
done | sort -n | awk '
    { print; if ($2 != "confirm" && $2 != "uart") board += $1; if ($2 != "confirm" && $2 != "i2c") hub += $1 }
    END { printf "%6d board\n%6d hub\n", board, hub }'
