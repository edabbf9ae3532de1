/* A record is stored in a pair of rows. A write never changes the row with the newest valid record. After a power
 * cut, either the old or the new record is therefore valid. */
#include "bootloader/internal.h"
#include "codec/crc32.h"

#define WORD 4u

/* Read a little-endian 32-bit number from 4 bytes. */
uint32_t taxel_boot_u32(const uint8_t *bytes)
{
    uint32_t value = 0;
    for (unsigned i = WORD; i > 0; i--) {
        value = (value << 8) | bytes[i - 1u];
    }
    return value;
}

/* Write a 32-bit number to 4 bytes, little-endian. */
void taxel_boot_put_u32(uint8_t *bytes, uint32_t value)
{
    for (unsigned i = 0; i < WORD; i++) {
        bytes[i] = (uint8_t)value;
        value >>= 8;
    }
}

/* Return the address of flash row number `row` (128 bytes). */
const uint8_t *taxel_boot_row(const struct taxel_boot_flash *flash, uint16_t row)
{
    /* NOLINTNEXTLINE(clang-analyzer-core.NullPointerArithm): on a PSoC 4200 the flash begins at address 0 */
    return flash->hal->flash + (size_t)row * TAXEL_BOOT_ROW_SIZE;
}

/* Write one flash row if its content differs, and verify it. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_write_row(const struct taxel_boot_flash *flash, uint16_t row, const uint8_t *bytes)
{
    const uint8_t *const stored = taxel_boot_row(flash, row);
    if (memcmp(stored, bytes, TAXEL_BOOT_ROW_SIZE) != 0) { /* saves a write cycle of the row */
        const int error = flash->hal->flash_write_row(flash->hal->context, row, bytes);
        if (error || memcmp(stored, bytes, TAXEL_BOOT_ROW_SIZE) != 0) {
            return TAXEL_BOOT_ERROR_FLASH;
        }
    }
    return 0;
}

/* Return whether the flash row contains a record with this magic number and a correct CRC-32. */
static bool is_valid(const uint8_t *row, uint32_t magic)
{
    return taxel_boot_u32(row) == magic &&
           taxel_boot_u32(row + TAXEL_BOOT_RECORD_OFFSET_CRC32) == taxel_crc32(0, row, TAXEL_BOOT_RECORD_OFFSET_CRC32);
}

/* Return the sequence number of the record in a flash row; the later of two records has the higher number, modulo
 * 2^32. */
static uint32_t sequence_of(const uint8_t *row)
{
    return taxel_boot_u32(row + TAXEL_BOOT_RECORD_OFFSET_SEQUENCE);
}

/* Return the newest valid record in a pair of flash rows, or NULL if neither is valid. The two rows are written in
 * turn, so that a power cut during a write leaves the older record. The signed difference of the sequence numbers
 * selects the newer record even after the 32-bit number has wrapped. */
const uint8_t *taxel_boot_record_newest(const struct taxel_boot_flash *flash, uint16_t first_row, uint32_t magic)
{
    const uint8_t *const first = taxel_boot_row(flash, first_row);
    const uint8_t *const second = first + TAXEL_BOOT_ROW_SIZE;
    const bool first_is_valid = is_valid(first, magic);
    if (!is_valid(second, magic)) {
        return first_is_valid ? first : NULL;
    }
    return first_is_valid && (int32_t)(sequence_of(first) - sequence_of(second)) > 0 ? first : second;
}

/* Compute the last 32-bit word of a row: 1 if the words before it add up to zero, otherwise 0. The sum of all words of
 * the row is therefore never zero, because such a row needs a special write sequence. */
static uint32_t balance_of(const uint8_t *row)
{
    uint32_t sum = 0;
    for (size_t i = 0; i < TAXEL_BOOT_RECORD_OFFSET_BALANCE; i += WORD) {
        sum += taxel_boot_u32(row + i);
    }
    return sum == 0;
}

/* Store `size` bytes as the newest record of a pair of flash rows, in the row that does not contain the present record.
 * An equal record is not written again. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_record_write(const struct taxel_boot_flash *flash, uint16_t first_row, uint32_t magic,
                            const uint8_t *content, uint8_t size)
{
    const uint8_t *const newest = taxel_boot_record_newest(flash, first_row, magic);
    uint8_t row[TAXEL_BOOT_ROW_SIZE];
    uint32_t sequence = 0;
    memset(row, 0, sizeof row);
    if (newest) {
        if (memcmp(newest + TAXEL_BOOT_RECORD_OFFSET_PAYLOAD, content, size) == 0) {
            return 0;
        }
        sequence = sequence_of(newest) + 1u;
        /* the second row, if the newest record is in the first one */
        first_row = (uint16_t)(first_row + (newest == taxel_boot_row(flash, first_row)));
    }
    taxel_boot_put_u32(row, magic);
    taxel_boot_put_u32(row + TAXEL_BOOT_RECORD_OFFSET_SEQUENCE, sequence);
    memcpy(row + TAXEL_BOOT_RECORD_OFFSET_PAYLOAD, content, size);
    taxel_boot_put_u32(row + TAXEL_BOOT_RECORD_OFFSET_CRC32, taxel_crc32(0, row, TAXEL_BOOT_RECORD_OFFSET_CRC32));
    taxel_boot_put_u32(row + TAXEL_BOOT_RECORD_OFFSET_BALANCE, balance_of(row));
    return taxel_boot_write_row(flash, first_row, row);
}
