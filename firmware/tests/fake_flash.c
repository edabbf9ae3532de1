#include "fake_flash.h"

#include <string.h>

#define WORD (FAKE_FLASH_ROW / FAKE_FLASH_WORDS)

/* Initialise an erased simulated flash; `seed` selects the random content of interrupted writes. */
void fake_flash_init(struct fake_flash *flash, uint64_t seed)
{
    memset(flash, 0, sizeof *flash);
    random_init(&flash->random, seed, 0);
}

/* Plan a power cut during a later row write; the writes are counted from this call. */
void fake_flash_plan(struct fake_flash *flash, struct fake_cut cut)
{
    flash->operations = 0;
    flash->cut = cut;
}

/* Store word number `word` of a row as the interrupted write leaves it: old, erased, new or random. */
static void fill_word(struct fake_flash *flash, uint8_t *stored, const uint8_t *next, unsigned word)
{
    const struct fake_cut *const cut = &flash->cut;
    enum { OLD, ERASED, NEW, RANDOM } content = NEW;
    switch (cut->tear) {
    case FAKE_TEAR_ERASING:
        content = word < cut->word ? ERASED : OLD;
        break;
    case FAKE_TEAR_PROGRAMMING:
        content = word < cut->word ? NEW : ERASED;
        break;
    case FAKE_TEAR_OVERWRITING:
        content = word < cut->word ? NEW : OLD;
        break;
    case FAKE_TEAR_DISTURBED:
        content = word < cut->word ? NEW : word == cut->word ? RANDOM : ERASED;
        break;
    default:
        content = (int)(random_u64(&flash->random) & 3u);
        break;
    }
    if (content == ERASED) {
        memset(stored, 0, WORD);
    } else if (content == NEW) {
        memcpy(stored, next, WORD);
    } else if (content == RANDOM) {
        const uint64_t bits = random_u64(&flash->random);
        memcpy(stored, &bits, WORD);
    }
}

/* Return whether the 32-bit words of a row add up to 0 although they are not all 0; the chip does not write such a row
 * reliably. */
static bool adds_up_to_zero(const uint8_t *bytes)
{
    uint32_t sum = 0, any = 0;
    for (unsigned i = 0; i < FAKE_FLASH_ROW; i += WORD) {
        uint32_t word;
        memcpy(&word, bytes + i, WORD);
        sum += word;
        any |= word;
    }
    return sum == 0 && any != 0;
}

/* Write a row of the simulated flash. Returns 0, or -1 if the flash is worn out. A planned power cut interrupts
 * the write and leaves the program by longjmp(). */
int fake_flash_write_row(struct fake_flash *flash, uint16_t row, const uint8_t *bytes)
{
    uint8_t *const stored = flash->bytes + (size_t)row * FAKE_FLASH_ROW;
    flash->operations++;
    if (flash->is_worn_out || flash->is_stuck) {
        return flash->is_worn_out ? -1 : 0;
    }
    flash->wear[row]++;
    flash->zero_sums += adds_up_to_zero(bytes);
    if (flash->operations != flash->cut.operation) {
        memcpy(stored, bytes, FAKE_FLASH_ROW);
        return 0;
    }
    for (unsigned word = 0; word < FAKE_FLASH_WORDS; word++) {
        fill_word(flash, stored + WORD * word, bytes + WORD * word, word);
    }
    flash->cuts++;
    flash->cut.operation = 0;
    longjmp(*flash->power, 1);
}
