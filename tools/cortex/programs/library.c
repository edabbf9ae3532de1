/* CRC-32, sorting, 64-bit arithmetic and floating point of libgcc, memory and string functions of the C library. */
#include <stdlib.h>
#include <string.h>

#include "image.h"

#define COUNT 200u

static uint32_t words[COUNT], state = 1;
static uint8_t bytes[1024], copy[1024];

/* Return the next number of the generator xorshift32 (Marsaglia, 2003): the same on every processor. */
static uint32_t next_random(void)
{
    state ^= state << 13;
    state ^= state >> 17;
    return state ^= state << 5;
}

/* Return the CRC-32 (IEEE 802.3) of a buffer, bit by bit: shifts and conditional XOR. */
static uint32_t crc32(const uint8_t *data, size_t size)
{
    uint32_t crc = ~0u;
    while (size--) {
        crc ^= *data++;
        for (unsigned bit = 0; bit < 8; bit++) {
            crc = crc >> 1 ^ (0xEDB88320u & -(crc & 1u));
        }
    }
    return ~crc;
}

/* Comparison function for qsort(): ascending order of unsigned numbers. */
static int compare_values(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sort 200 random numbers with qsort() and print their checksum. */
static void test_sort(void)
{
    for (size_t i = 0; i < COUNT; i++) {
        words[i] = next_random();
    }
    qsort(words, COUNT, sizeof *words, compare_values);
    put_word("sorted", crc32((const uint8_t *)words, sizeof words));
}

/* Divide, multiply and shift 64-bit and 32-bit numbers, signed and unsigned, with the library functions that the
 * compiler calls for them; print a checksum of the results. */
static void test_arithmetic(void)
{
    uint64_t sum = 0;
    for (unsigned i = 0; i < 300; i++) {
        const uint64_t a = (uint64_t)next_random() << 32 | next_random(), b = (uint64_t)next_random() << (i % 33) | 1u;
        const int64_t c = (int64_t)a, d = -(int64_t)(b >> 3 | 1u);
        sum = sum * 31u + a / b + a % b + (uint64_t)(c / d) + (uint64_t)(c % d) + a * b + (a >> (i % 64)) +
              (a << (i % 64));
        sum += (uint32_t)a / ((uint32_t)b | 1u) + (uint32_t)((int32_t)a % ((int32_t)(b >> 5) | 1));
    }
    put_word("64 bit, high", (uint32_t)(sum >> 32));
    put_word("64 bit, low", (uint32_t)sum);
}

/* Compute with float and double in software, since the Cortex-M0 has no floating-point unit, and print the exact bits
 * of the results. */
static void test_floating_point(void)
{
    float f = 1.5f;
    double g = 0.7;
    for (unsigned i = 1; i < 100; i++) {
        f = f * 1.0625f + (float)(int32_t)next_random() / 3.0e9f;
        g = g / (1.0 + 1.0 / i) - (double)f * 1e-3 + (f > 2.0f ? 0.25 : -0.125);
    }
    uint32_t float_bits;
    uint64_t double_bits;
    memcpy(&float_bits, &f, sizeof float_bits);
    memcpy(&double_bits, &g, sizeof double_bits);
    put_word("float", float_bits);
    put_word("double, high", (uint32_t)(double_bits >> 32));
    put_word("double, low", (uint32_t)double_bits);
}

/* Call memcpy, memmove, memset, memcmp and strlen with random offsets and sizes, aligned and unaligned; print checksums
 * of the buffers. */
static void test_memory(void)
{
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)next_random();
    }
    for (unsigned i = 0; i < 200; i++) {
        const size_t from = next_random() % 900, to = next_random() % 900, size = next_random() % 120;
        memcpy(copy + to, bytes + from, size);
        memmove(bytes + to, bytes + from, size);
        memset(copy + from, (int)i, size / 2);
        copy[sizeof copy - 1] = 0;
        bytes[i] = (uint8_t)(bytes[i] + memcmp(copy + to, bytes + from, size) + (int)strlen((const char *)copy));
    }
    put_word("bytes", crc32(bytes, sizeof bytes));
    put_word("copy", crc32(copy, sizeof copy));
}

/* Run all tests of library functions; every processor must print the same checksums. */
int main(void)
{
    test_sort();
    test_arithmetic();
    test_floating_point();
    test_memory();
    return 0;
}
