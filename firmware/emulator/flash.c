#include "emulator/flash.h"

#include <string.h>

#define WORD 4u
#define WORDS (FLASH_ROW / WORD)

void flash_init(struct flash *flash, uint64_t seed, uint8_t address)
{
    memset(flash, 0, sizeof *flash);
    random_init(&flash->random, seed ^ 0xF1A5Fu, address);
    flash->cut_at = VTIME_NEVER;
}

bool flash_plan_cut(struct flash *flash, const struct flash_cut_plan *plan)
{
    if (flash->plan_count == FLASH_CUTS_MAX) {
        return false;
    }
    if (!flash->plan_count && flash->cut_at == VTIME_NEVER) {
        flash->counted_from = flash->operations;
    }
    flash->plans[flash->plan_count++] = *plan;
    return true;
}

static void note_planned(struct flash *flash, const struct flash_write *write, const uint8_t *wanted)
{
    const struct flash_cut_plan *plan = &flash->plans[0];
    struct flash_cut_made *made = &flash->made[flash->made_count % FLASH_CUTS_MAX];
    if (!flash->plan_count || flash->cut_at != VTIME_NEVER || flash->operations - flash->counted_from != plan->operation) {
        return;
    }
    made->row = write->row;
    made->after = plan->after;
    memcpy(made->wanted, wanted, FLASH_ROW);
    flash->cut_at = write->begin + plan->after;
    flash->off = plan->off;
    flash->plan_count--;
    memmove(flash->plans, flash->plans + 1, flash->plan_count * sizeof flash->plans[0]);
}

static void forget_ended(struct flash *flash, vtime now)
{
    unsigned kept = 0;
    for (unsigned i = 0; i < flash->count; i++) {
        if (flash->writes[i].end > now) {
            flash->writes[kept++] = flash->writes[i];
        }
    }
    flash->count = kept;
}

vtime flash_write(struct flash *flash, uint16_t row, const uint8_t *bytes, vtime now)
{
    uint8_t *const stored = flash->bytes + (size_t)row * FLASH_ROW;
    forget_ended(flash, now);
    if (flash->count == FLASH_WRITES_UNDER_WAY) { /* the oldest cannot be cut any more */
        memmove(flash->writes, flash->writes + 1, sizeof flash->writes - sizeof flash->writes[0]);
        flash->count--;
    }
    struct flash_write *write = &flash->writes[flash->count];
    write->begin = flash->count ? vtime_max(now, flash->writes[flash->count - 1u].end) : now;
    write->end = write->begin + FLASH_WRITE;
    write->row = row;
    memcpy(write->before, stored, FLASH_ROW);
    memcpy(stored, bytes, FLASH_ROW);
    flash->count++;
    flash->operations++;
    flash->wear[row]++;
    note_planned(flash, write, bytes);
    return write->end;
}

/* In the first half of its time a row is erased, in the second programmed; the word under way holds anything. Now and then
 * the whole row is a mixture, as data sheets warn. */
static void tear(struct flash *flash, const struct flash_write *write, vtime now)
{
    uint8_t *const stored = flash->bytes + (size_t)write->row * FLASH_ROW;
    const vtime half = FLASH_WRITE / 2u;
    const vtime since = now - write->begin;
    const bool erasing = since < half;
    const unsigned word_under_way = (unsigned)((erasing ? since : since - half) * WORDS / half);
    const bool is_mixture = random_u64(&flash->random) % 4u == 0;
    for (unsigned word = 0; word < WORDS; word++) {
        const uint64_t drawn = random_u64(&flash->random);
        uint8_t *const place = stored + WORD * word;
        const unsigned content = is_mixture ? (unsigned)(drawn >> 62) : word == word_under_way ? 3u : 0u;
        if (content == 3u) {
            memcpy(place, &drawn, WORD);
        } else if (is_mixture ? content == 1u : erasing ? word < word_under_way : word > word_under_way) {
            memset(place, 0, WORD);
        } else if (is_mixture ? content == 2u : erasing) {
            memcpy(place, write->before + WORD * word, WORD);
        } /* else it is the new one */
    }
    flash->torn++;
}

void flash_cut(struct flash *flash, vtime now)
{
    forget_ended(flash, now);
    for (unsigned i = flash->count; i-- > 0;) {
        const struct flash_write *write = &flash->writes[i];
        if (write->begin >= now) {
            memcpy(flash->bytes + (size_t)write->row * FLASH_ROW, write->before, FLASH_ROW);
            flash->wear[write->row]--;
        } else {
            tear(flash, write, now);
        }
    }
    flash->count = 0;
    if (flash->cut_at <= now) {
        flash->made_count++;
        flash->counted_from = flash->operations;
    }
    flash->cut_at = VTIME_NEVER;
}
