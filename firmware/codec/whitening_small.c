#include "codec/whitening.h"

#include "generated/taxel_protocol.h"

/* Compute element number `index` (modulo 256, the period) of the whitening sequence k[i+1] = factor * k[i] + increment.
 * The loop has one pass per bit of `index`. In the pass for bit b, factor and increment are those of 2^b elements at
 * once, so a set bit skips 2^b elements. */
static uint8_t compute_element(size_t index)
{
    uint8_t value = (uint8_t)TAXEL_WHITENING_SEED;
    uint8_t factor = (uint8_t)TAXEL_WHITENING_FACTOR;
    uint8_t increment = (uint8_t)TAXEL_WHITENING_INCREMENT;
    for (uint8_t bits = (uint8_t)index; bits; bits >>= 1) {
        if (bits & 1u) {
            value = (uint8_t)(factor * value + increment);
        }
        increment = (uint8_t)((factor + 1u) * increment);
        factor = (uint8_t)(factor * factor);
    }
    return value;
}

/* XOR `size` bytes of a frame body, which begin at position `first` of the body, with the whitening sequence, which is
 * computed to save RAM. The first call whitens the bytes, a second one restores them. */
void taxel_whiten(uint8_t *out, const uint8_t *bytes, size_t first, size_t size)
{
    uint8_t value = compute_element(first);
    for (size_t i = 0; i < size; i++) {
        out[i] = bytes[i] ^ value;
        value = (uint8_t)(TAXEL_WHITENING_FACTOR * value + TAXEL_WHITENING_INCREMENT);
    }
}
