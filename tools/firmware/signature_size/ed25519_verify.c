/* Verification of an Ed25519 signature (RFC 8032) in as little code as possible: the measure of `signature_size.py`.
 *
 * No image contains this code. Field elements are 32 limbs of 8 bits, points have extended coordinates, and every
 * doubling is an addition. The scalar h is not reduced modulo the group order, which is correct for a public key in the
 * subgroup of prime order. Times depend on the data: all data of a verification are public. */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "sha512_constants.h"

#define LIMBS 32
#define FOLD 38u /* 2^256 modulo p = 2^255 - 19 */

typedef uint8_t element[LIMBS];
typedef struct {
    element x, y, z, t;
} point;

static const element one = {1};
static const element d2 = TWICE_D, root_of_minus_1 = ROOT_OF_MINUS_1;
static const element base_x = BASE_X, base_y = BASE_Y;
static const element group_order = GROUP_ORDER;

/* ---- SHA-512 (FIPS 180-4) ---- */

/* Rotate to the right by 1 to 63 bits. */
static uint64_t rotate(uint64_t x, unsigned bits)
{
    return x >> bits | x << (64u - bits);
}

/* Add one block of 128 bytes to the state of the hash SHA-512; names and rotations as in FIPS 180-4, section 6.4.2. */
static void compress(uint64_t state[8], const uint8_t *block)
{
    uint64_t w[16], s[8];
    memcpy(s, state, sizeof s);
    for (unsigned i = 0; i < 16u; i++) {
        w[i] = 0;
        for (unsigned k = 0; k < 8u; k++) {
            w[i] = w[i] << 8 | *block++;
        }
    }
    for (unsigned i = 0; i < 80u; i++) {
        uint64_t *const word = &w[i & 15u];
        if (i >= 16u) {
            const uint64_t a = w[(i + 1u) & 15u], b = w[(i + 14u) & 15u];
            *word +=
                (rotate(a, 1) ^ rotate(a, 8) ^ a >> 7) + w[(i + 9u) & 15u] + (rotate(b, 19) ^ rotate(b, 61) ^ b >> 6);
        }
        const uint64_t first = s[7] + (rotate(s[4], 14) ^ rotate(s[4], 18) ^ rotate(s[4], 41)) +
                               ((s[4] & s[5]) ^ (~s[4] & s[6])) + sha512_k[i] + *word;
        const uint64_t second =
            (rotate(s[0], 28) ^ rotate(s[0], 34) ^ rotate(s[0], 39)) + ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
        memmove(s + 1, s, 7 * sizeof s[0]);
        s[4] += first;
        s[0] = first + second;
    }
    for (unsigned i = 0; i < 8u; i++) {
        state[i] += s[i];
    }
}

/* Compute the SHA-512 of R, public key and message: 64 bytes, read as the little-endian scalar h of RFC 8032. The loop
 * ends at the first end of a block (i is 0) after the padding. */
static void hash(uint8_t digest[64], const uint8_t *r, const uint8_t *key, const uint8_t *message, uint32_t size)
{
    uint64_t state[8];
    uint8_t block[128];
    const uint32_t total = 64u + size;
    memcpy(state, sha512_start, sizeof state);
    for (uint32_t at = 0, i = 0; at < total + 17u || i; at++) { /* 0x80, zeros, length of 16 bytes */
        block[i] = at < 32u      ? r[at]
                   : at < 64u    ? key[at - 32u]
                   : at < total  ? message[at - 64u]
                   : at == total ? 0x80
                                 : 0;
        i = (i + 1u) & 127u;
        if (!i) {
            if (at >= total + 16u) {
                for (unsigned k = 0; k < 5u; k++) {
                    block[127u - k] = (uint8_t)((uint64_t)total * 8u >> (8u * k));
                }
            }
            compress(state, block);
        }
    }
    for (unsigned i = 0; i < 64u; i++) {
        digest[i] = (uint8_t)(state[i >> 3] >> (56u - 8u * (i & 7u)));
    }
}

/* ---- field of integers modulo p ---- */

/* Reduce sums of limbs, each below 2^27, to limbs of 8 bits. A carry from the last limb is multiplied by FOLD (2^256
 * modulo p) and added to the first limb. */
static void carry(element out, const uint32_t sums[LIMBS])
{
    uint32_t carried = 0;
    for (unsigned i = 0; i < LIMBS; i++) {
        carried += sums[i];
        out[i] = (uint8_t)carried;
        carried >>= 8;
    }
    while (carried) {
        carried *= FOLD;
        for (unsigned i = 0; i < LIMBS; i++) {
            carried += out[i];
            out[i] = (uint8_t)carried;
            carried >>= 8;
        }
    }
}

/* Compute a + b modulo p. */
static void add(element out, const element a, const element b)
{
    uint32_t sums[LIMBS];
    for (unsigned i = 0; i < LIMBS; i++) {
        sums[i] = (uint32_t)a[i] + b[i];
    }
    carry(out, sums);
}

/* Compute a - b modulo p. */
static void subtract(element out, const element a, const element b)
{
    uint32_t sums[LIMBS];
    for (unsigned i = 0; i < LIMBS; i++) { /* a + (2^256 - 1 - b) + (p - 37), and 2^256 - 1 is 37 modulo p */
        sums[i] = (uint32_t)a[i] + (255u - b[i]) + (i ? i < LIMBS - 1u ? 0xFFu : 0x7Fu : 0xC8u);
    }
    carry(out, sums);
}

/* Compute a times b modulo p. The product of two limbs whose numbers add up to LIMBS + i is multiplied by FOLD and added
 * to limb i, because FOLD is 2^256 modulo p. */
static void multiply(element out, const element a, const element b)
{
    uint32_t sums[LIMBS];
    for (unsigned i = 0; i < LIMBS; i++) {
        sums[i] = 0;
        for (unsigned j = 0; j < LIMBS; j++) {
            sums[i] += (uint32_t)a[j] * b[(i - j) & (LIMBS - 1u)] * (j <= i ? 1u : FOLD);
        }
    }
    carry(out, sums);
}

/* Compute the power of a whose exponent has `bits` bits: all are set, except that its low byte is `low`. */
static void power(element out, const element a, unsigned bits, uint8_t low)
{
    element result;
    memcpy(result, one, sizeof result);
    while (bits--) {
        multiply(result, result, result);
        if (bits >= 8u || low >> bits & 1u) {
            multiply(result, result, a);
        }
    }
    memcpy(out, result, sizeof result);
}

/* Replace a field element (below 2^256, which is less than 3 p) by its representative from 0 to p - 1: subtract p at
 * most twice. A carry from a + 19 - 2^255 shows that a is at least p. */
static void freeze(element a)
{
    for (unsigned pass = 0; pass < 2u; pass++) {
        element reduced;
        uint32_t carried = 19u;
        for (unsigned i = 0; i < LIMBS; i++) { /* a + 19 - 2^255 */
            carried += a[i] + (i == LIMBS - 1u ? 0x80u : 0u);
            reduced[i] = (uint8_t)carried;
            carried >>= 8;
        }
        if (carried) {
            memcpy(a, reduced, sizeof reduced);
        }
    }
}

/* Return whether a field element is 0 modulo p. */
static bool is_zero(const element a)
{
    element copy, zero = {0};
    memcpy(copy, a, sizeof copy);
    freeze(copy);
    return memcmp(copy, zero, sizeof zero) == 0;
}

/* ---- curve ---- */

/* Add two points in extended coordinates (RFC 8032, section 5.1.4). out may be p or q. */
static void add_points(point *out, const point *p, const point *q)
{
    element a, b, c, e, f, g;
    subtract(a, p->y, p->x);
    subtract(b, q->y, q->x);
    multiply(a, a, b);
    add(b, p->y, p->x);
    add(c, q->y, q->x);
    multiply(b, b, c);
    multiply(c, p->t, q->t);
    multiply(c, c, d2);
    multiply(e, p->z, q->z);
    add(e, e, e);
    subtract(f, e, c);
    add(g, e, c);
    subtract(e, b, a);
    add(b, b, a);
    multiply(out->x, e, f);
    multiply(out->y, g, b);
    multiply(out->t, e, b);
    multiply(out->z, f, g);
}

/* Multiply a point by a little-endian scalar of `bits` bits: double and add. */
static void multiply_point(point *out, const point *p, const uint8_t *scalar, unsigned bits)
{
    memset(out, 0, sizeof *out);
    out->y[0] = out->z[0] = 1;
    while (bits--) {
        add_points(out, out, out);
        if (scalar[bits >> 3] >> (bits & 7u) & 1u) {
            add_points(out, out, p);
        }
    }
}

/* Decode a point and store its negative (RFC 8032, section 5.1.3). Returns false if `bytes` encode no point. `bytes`
 * contain y, with the lowest bit of x on top. A root x of u / v is u v^3 (u v^7)^((p - 5) / 8), or this number times a
 * root of -1. */
static bool decode_negative(point *out, const uint8_t *bytes)
{
    element u, v, v3, check;
    memcpy(out->y, bytes, LIMBS);
    out->y[LIMBS - 1] &= 0x7Fu;
    memcpy(out->z, one, sizeof out->z);
    multiply(u, out->y, out->y);
    multiply(v, u, d2); /* twice d y^2: the factors of 2 cancel below */
    subtract(u, u, one);
    add(u, u, u);
    add(v, v, one);
    add(v, v, one);
    multiply(v3, v, v);
    multiply(v3, v3, v);
    multiply(check, v3, v3);
    multiply(check, check, v);
    multiply(check, check, u);
    power(check, check, 252, 0xFD); /* (p - 5) / 8 = 2^252 - 3 */
    multiply(out->x, check, v3);
    multiply(out->x, out->x, u);
    for (unsigned attempt = 0; attempt < 2u; attempt++) {
        multiply(check, out->x, out->x);
        multiply(check, check, v);
        subtract(check, check, u);
        if (is_zero(check)) {
            freeze(out->x);
            if ((out->x[0] & 1u) == bytes[LIMBS - 1] >> 7) { /* the encoded x; its negative has the other parity */
                element zero = {0};
                subtract(out->x, zero, out->x);
            }
            multiply(out->t, out->x, out->y);
            return true;
        }
        multiply(out->x, out->x, root_of_minus_1);
    }
    return false;
}

/* Return whether the little-endian number `value` is smaller than the group order. */
static bool is_reduced(const uint8_t *value)
{
    for (unsigned i = LIMBS; i--;) {
        if (value[i] != group_order[i]) {
            return value[i] < group_order[i];
        }
    }
    return false;
}

/* Return whether the signature (R and S) of the message of `size` bytes is valid for the public key: the encoding of
 * S B - h A must be R, with the base point B and the public key's point A. */
bool ed25519_verify(const uint8_t signature[64], const uint8_t key[32], const uint8_t *message, uint32_t size);
bool ed25519_verify(const uint8_t signature[64], const uint8_t key[32], const uint8_t *message, uint32_t size)
{
    uint8_t scalar[64];
    point a, p, sum;
    if (!is_reduced(signature + 32) || !decode_negative(&a, key)) {
        return false;
    }
    hash(scalar, signature, key, message, size); /* a: the negative of the public key's point A; p = -h A */
    multiply_point(&p, &a, scalar, 512);
    memcpy(a.x, base_x, sizeof a.x);
    memcpy(a.y, base_y, sizeof a.y);
    memcpy(a.z, one, sizeof a.z);
    multiply(a.t, a.x, a.y);
    multiply_point(&sum, &a, signature + 32, 256); /* S B; the signature is valid if S B - h A is R */
    add_points(&sum, &sum, &p);
    power(sum.z, sum.z, 255, 0xEB); /* 1 / z = z^(p - 2), because p - 2 = 2^255 - 21 has the low byte 0xEB */
    multiply(sum.x, sum.x, sum.z);
    multiply(sum.y, sum.y, sum.z);
    freeze(sum.x);
    freeze(sum.y);
    sum.y[LIMBS - 1] |= (uint8_t)(sum.x[0] << 7); /* the encoding of a point is y, with the lowest bit of x on top */
    return memcmp(sum.y, signature, LIMBS) == 0;
}
