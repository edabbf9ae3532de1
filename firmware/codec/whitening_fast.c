#include "codec/whitening.h"

#include "generated/taxel_protocol.h"

/* The whitening sequence for the longest body, so that the compiler can vectorise the XOR below. */
static uint8_t sequence[TAXEL_BODY_MAX + 1u];

/* Compute the whitening sequence when the program or library is loaded: a check at each frame costs as much as the
 * XOR of a short frame. */
__attribute__((constructor)) static void fill_sequence(void)
{
    uint8_t value = (uint8_t)TAXEL_WHITENING_SEED;
    for (size_t i = 0; i < sizeof sequence; i++) {
        sequence[i] = value;
        value = (uint8_t)(TAXEL_WHITENING_FACTOR * value + TAXEL_WHITENING_INCREMENT);
    }
}

/* XOR `size` bytes of a frame body, which begin at position `first` of the body, with the whitening sequence. The first
 * call whitens the bytes, a second one restores them. */
void taxel_whiten(uint8_t *out, const uint8_t *bytes, size_t first, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        out[i] = bytes[i] ^ sequence[first + i];
    }
}
