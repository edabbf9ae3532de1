/* Every implementation of the CRC-32 equals its definition, for all sizes, alignments and initial values. */
#include "codec/crc32.h"

#include "check.h"
#include "codec/crc32_variants.h"
#include "codec/crc32_zeros.h"
#include "emulator/base/random.h"

#define SIZE_MAX_TRIED 700u
#define PLACES 17u

static uint8_t bytes[SIZE_MAX_TRIED + PLACES];

/* Compute the CRC-32 bit by bit from its definition, continued from `crc`. */
static uint32_t by_definition(uint32_t crc, const uint8_t *data, size_t size)
{
    crc = ~crc;
    for (size_t i = 0; i < size; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc >> 1) ^ ((crc & 1u) ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}

static void all_variants_agree_for_every_size_and_alignment(void)
{
    struct random_source random;
    random_init(&random, 1, 0);
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)random_u64(&random);
    }
    for (size_t size = 0; size <= SIZE_MAX_TRIED; size++) {
        const uint8_t *const data = bytes + size % PLACES;
        const uint32_t state = (uint32_t)random_u64(&random), expected = by_definition(state, data, size);
        CHECK_EQUAL(taxel_crc32(state, data, size), expected);
        CHECK_EQUAL(taxel_crc32_sliced(state, data, size), expected);
        if (taxel_crc32_has_clmul() && size >= TAXEL_CRC32_CLMUL_MIN) {
            CHECK_EQUAL(taxel_crc32_clmul(state, data, size), expected);
        }
    }
}

static void a_crc_can_be_continued(void)
{
    for (size_t cut = 0; cut <= 200; cut++) {
        CHECK_EQUAL(taxel_crc32(taxel_crc32(0, bytes, cut), bytes + cut, 200 - cut), by_definition(0, bytes, 200));
    }
}

static void the_check_value_is_that_of_the_standard(void)
{
    CHECK_EQUAL(taxel_crc32(0, (const uint8_t *)"123456789", 9), 0xCBF43926u);
}

static void the_effect_of_zeros_equals_that_of_zero_bytes(void)
{
    static const uint8_t none[SIZE_MAX_TRIED];
    struct random_source random;
    random_init(&random, 2, 0);
    for (size_t size = 0; size <= SIZE_MAX_TRIED; size++) {
        struct taxel_crc32_zeros zeros;
        const uint32_t state = (uint32_t)random_u64(&random);
        taxel_crc32_zeros_init(&zeros, size);
        CHECK_EQUAL(taxel_crc32_zeros_after(&zeros, state), (uint32_t)~by_definition(~state, none, size));
        CHECK_EQUAL(taxel_crc32_zeros_after(&zeros, 0), 0);
    }
}

int main(void)
{
    RUN(all_variants_agree_for_every_size_and_alignment);
    RUN(a_crc_can_be_continued);
    RUN(the_effect_of_zeros_equals_that_of_zero_bytes);
    RUN(the_check_value_is_that_of_the_standard);
    return check_summary();
}
