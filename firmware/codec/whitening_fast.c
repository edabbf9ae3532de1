#include "codec/whitening.h"

#include <pthread.h>

#include "generated/taxel_protocol.h"

/* The sequence as long as a body, so that the XOR below is one straight loop that the compiler makes vectors of. */
static uint8_t sequence[TAXEL_BODY_MAX + 1u];
static pthread_once_t sequence_once = PTHREAD_ONCE_INIT;

static void fill_sequence(void)
{
    uint8_t value = (uint8_t)TAXEL_WHITENING_SEED;
    for (size_t i = 0; i < sizeof sequence; i++) {
        sequence[i] = value;
        value = (uint8_t)(TAXEL_WHITENING_FACTOR * value + TAXEL_WHITENING_INCREMENT);
    }
}

void taxel_whiten(uint8_t *bytes, size_t first, size_t size)
{
    pthread_once(&sequence_once, fill_sequence);
    for (size_t i = 0; i < size; i++) {
        bytes[i] ^= sequence[first + i];
    }
}
