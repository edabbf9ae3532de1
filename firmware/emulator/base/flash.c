#include "emulator/base/flash.h"

#include <string.h>

#define WORD 4u
#define WORDS (FLASH_ROW_SIZE / WORD)

/* Initialise an erased flash array of `size` bytes without a planned power cut. `seed` and the I2C address select the
 * random content of interrupted writes. */
void flash_init(struct flash *flash, uint32_t size, uint64_t seed, uint8_t address)
{
    memset(flash, 0, sizeof *flash);
    flash->size = size;
    random_init(&flash->random, seed ^ 0xF1A5Fu, address); /* a constant of the flash: own random sequence */
    flash->cut_time = VTIME_NEVER;
}

/* Plan a power cut during a later write of the flash. The write number of the first plan is counted from this call,
 * that of each later plan from the previous cut. Returns false if the list of plans is full. */
bool flash_plan_cut(struct flash *flash, const struct flash_cut_plan *plan)
{
    if (flash->plan_count == FLASH_CUTS_MAX) {
        return false;
    }
    if (!flash->plan_count && flash->cut_time == VTIME_NEVER) {
        flash->writes_before_cut = flash->write_count;
    }
    flash->plans[flash->plan_count++] = *plan;
    return true;
}

/* Schedule the next planned power cut if it belongs to this write (counted from the previous cut): set the time of the
 * cut, fill in its record, and remove the plan. The owner of the flash switches off the power at that time. */
static void schedule_planned_cut(struct flash *flash, const struct flash_pending_write *write, const uint8_t *new_bytes)
{
    const struct flash_cut_plan *plan = &flash->plans[0];
    struct flash_cut_record *record = &flash->cut_records[flash->cut_count % FLASH_CUTS_MAX];
    if (!flash->plan_count || flash->cut_time != VTIME_NEVER ||
        flash->write_count - flash->writes_before_cut != plan->write_number) {
        return;
    }
    record->row = write->row;
    record->delay = plan->delay;
    memcpy(record->new_bytes, new_bytes, FLASH_ROW_SIZE);
    flash->cut_time = write->begin + plan->delay;
    flash->off_time = plan->off_time;
    flash->plan_count--;
    memmove(flash->plans, flash->plans + 1, flash->plan_count * sizeof flash->plans[0]);
}

/* Remove the writes that ended before `now` from the list of pending writes: a power cut can no longer tear their
 * rows. */
static void remove_completed_writes(struct flash *flash, vtime now)
{
    unsigned kept = 0;
    for (unsigned i = 0; i < flash->pending_count; i++) {
        if (flash->pending[i].end > now) {
            flash->pending[kept++] = flash->pending[i];
        }
    }
    flash->pending_count = kept;
}

/* Store a row of 128 bytes at once, but keep its old content until the write has ended (20 ms after the previous
 * write): a power cut before the end tears or restores the row. Returns the end time of the write. */
vtime flash_write_row(struct flash *flash, uint16_t row, const uint8_t *bytes, vtime now)
{
    uint8_t *const stored = flash->bytes + (size_t)row * FLASH_ROW_SIZE;
    remove_completed_writes(flash, now);
    if (flash->pending_count == FLASH_PENDING_WRITES_MAX) { /* a power cut can no longer tear the oldest write */
        memmove(flash->pending, flash->pending + 1, sizeof flash->pending - sizeof flash->pending[0]);
        flash->pending_count--;
    }
    struct flash_pending_write *write = &flash->pending[flash->pending_count];
    write->begin = flash->pending_count ? vtime_max(now, flash->pending[flash->pending_count - 1u].end) : now;
    write->end = write->begin + FLASH_WRITE_TIME;
    write->row = row;
    memcpy(write->before, stored, FLASH_ROW_SIZE);
    memcpy(stored, bytes, FLASH_ROW_SIZE);
    flash->pending_count++;
    flash->write_count++;
    flash->wear[row]++;
    schedule_planned_cut(flash, write, bytes);
    return write->end;
}

/* Leave a row in the state of a write that a power failure interrupts at `now`. In the first half of the write time the
 * row is erased, in the second half it is programmed, in both word by word; the word in progress contains random bits.
 * One torn row in four is a random mixture of old, erased, new and random words, as data sheets allow. */
static void tear_row(struct flash *flash, const struct flash_pending_write *write, vtime now)
{
    uint8_t *const stored = flash->bytes + (size_t)write->row * FLASH_ROW_SIZE;
    const vtime half = FLASH_WRITE_TIME / 2u;
    const vtime since = now - write->begin;
    const bool erasing = since < half;
    const unsigned word_in_progress = (unsigned)((erasing ? since : since - half) * WORDS / half);
    const bool is_mixture = random_u64(&flash->random) % 4u == 0;
    for (unsigned word = 0; word < WORDS; word++) {
        const uint64_t random_bits = random_u64(&flash->random);
        uint8_t *const word_bytes = stored + WORD * word;
        /* of a mixture: 0 new word, 1 erased, 2 old word, 3 random bits */
        const unsigned content = is_mixture ? (unsigned)(random_bits >> 62) : word == word_in_progress ? 3u : 0u;
        if (content == 3u) {
            memcpy(word_bytes, &random_bits, WORD);
        } else if (is_mixture ? content == 1u : erasing ? word < word_in_progress : word > word_in_progress) {
            memset(word_bytes, 0, WORD);
        } else if (is_mixture ? content == 2u : erasing) {
            memcpy(word_bytes, write->before + WORD * word, WORD);
        } /* otherwise the new word is stored already */
    }
    flash->torn_count++;
}

/* Apply a power failure at `now`: a write that has not started is undone, a running write tears its row. Writes are
 * processed from the latest to the earliest, so that a row written twice regains its oldest content. */
void flash_cut_power(struct flash *flash, vtime now)
{
    remove_completed_writes(flash, now);
    for (unsigned i = flash->pending_count; i-- > 0;) {
        const struct flash_pending_write *write = &flash->pending[i];
        if (write->begin >= now) {
            memcpy(flash->bytes + (size_t)write->row * FLASH_ROW_SIZE, write->before, FLASH_ROW_SIZE);
            flash->wear[write->row]--;
        } else {
            tear_row(flash, write, now);
        }
    }
    flash->pending_count = 0;
    if (flash->cut_time <= now) {
        flash->cut_count++;
        flash->writes_before_cut = flash->write_count;
    }
    flash->cut_time = VTIME_NEVER;
}
