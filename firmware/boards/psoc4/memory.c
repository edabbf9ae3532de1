/* The C library functions that the compiler and the portable sources call: small code, one byte at a time. Built
 * without link-time optimisation, which would replace the loop of memcpy() by a call of memcpy(). */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Copy bytes between ranges that do not overlap. The images are linked without a C library. */
void *memcpy(void *restrict to, const void *restrict from, size_t size)
{
    uint8_t *out = to;
    const uint8_t *in = from;
    while (size--) {
        *out++ = *in++;
    }
    return to;
}

/* Copy bytes between ranges that may overlap. */
void *memmove(void *to, const void *from, size_t size)
{
    uint8_t *out = to;
    const uint8_t *in = from;
    if (out <= in) {
        return memcpy(to, from, size);
    }
    while (size--) {
        out[size] = in[size];
    }
    return to;
}

/* Fill `size` bytes with `value`. */
void *memset(void *to, int value, size_t size)
{
    uint8_t *out = to;
    while (size--) {
        *out++ = (uint8_t)value;
    }
    return to;
}

/* Compare two ranges of bytes. Returns the difference of the first pair of unequal bytes, 0 if all are equal. */
int memcmp(const void *a, const void *b, size_t size)
{
    const uint8_t *first = a;
    const uint8_t *second = b;
    int difference = 0;
    while (size-- && difference == 0) {
        difference = *first++ - *second++;
    }
    return difference;
}

/* Return a pointer to the first byte with this value, or NULL if there is none. */
void *memchr(const void *bytes, int value, size_t size)
{
    const uint8_t *in = bytes;
    for (; size; size--, in++) {
        if (*in == (uint8_t)value) {
            return (void *)(uintptr_t)in;
        }
    }
    return NULL;
}

/* Return the number of characters before the final zero. */
size_t strlen(const char *text)
{
    size_t length = 0;
    while (text[length]) {
        length++;
    }
    return length;
}
