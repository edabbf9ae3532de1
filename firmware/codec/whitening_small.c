#include "codec/whitening.h"

#include "generated/taxel_protocol.h"

/* Element number `index` (modulo 256) of the whitening sequence. Factor and increment of n steps together, for n =
 * 1, 2, 4 ... 128, give any element in at most eight steps. */
static uint8_t element(size_t index)
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

/* Whiten, or restore, `size` bytes of a frame body that begin at position `first` of the body: XOR with the whitening
 * sequence, which is computed to save RAM. */
void taxel_whiten(uint8_t *out, const uint8_t *bytes, size_t first, size_t size)
{
    uint8_t value = element(first);
    for (size_t i = 0; i < size; i++) {
        out[i] = bytes[i] ^ value;
        value = (uint8_t)(TAXEL_WHITENING_FACTOR * value + TAXEL_WHITENING_INCREMENT);
    }
}
