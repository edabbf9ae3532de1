/* The whitening sequence: k[0] = seed, k[i+1] = factor * k[i] + increment modulo 256; period 256.
 *
 * Integration (link exactly one of whitening_small.c and whitening_fast.c):
 *
 *     taxel_whiten(body, body, 0, size);  // whiten; the same call restores the body
 */
#ifndef TAXEL_WHITENING_H
#define TAXEL_WHITENING_H

#include <stddef.h>
#include <stdint.h>

/* XOR `size` bytes with the sequence from element `first` on; `out` may be `bytes`. whitening_small.c: no table;
 * whitening_fast.c: for PCs, first + size at most TAXEL_BODY_MAX + 1. */
void taxel_whiten(uint8_t *out, const uint8_t *bytes, size_t first, size_t size);

#endif
