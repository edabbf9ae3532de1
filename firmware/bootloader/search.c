/* Search among boards that share an address, by their unique ids: a board that the search does not select stops
 * responding. */
#include "bootloader/internal.h"

/* Return whether a unique id begins with the first `bits` bits of `prefix`, most significant bit of each byte first. */
static bool begins_with(const uint8_t *id, const uint8_t *prefix, uint8_t bits)
{
    for (unsigned i = 0; i < bits; i++) {
        if (((unsigned)(id[i / 8u] ^ prefix[i / 8u]) << (i % 8u)) & 0x80u) {
            return false;
        }
    }
    return true;
}

/* Execute the command SEARCH: a board whose unique id begins with the given bits replies with its id and the complement
 * of the id; all others become silent until the next SEARCH. A host thus distinguishes boards that share one I2C
 * address; the complement reveals simultaneous replies. Returns status DATA for more than 64 bits, otherwise OK. */
uint8_t taxel_boot_search(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_hal *const hal = boot->config->flash.hal;
    const uint8_t bits = packet->data[TAXEL_BOOT_SEARCH_ARGUMENTS_OFFSET_BITS];
    if (bits > 8u * sizeof(uint64_t)) {
        return TAXEL_BOOT_STATUS_DATA;
    }
    hal->unique_id(hal->context, reply);
    boot->silent = !begins_with(reply, packet->data + TAXEL_BOOT_SEARCH_ARGUMENTS_OFFSET_UNIQUE_ID, bits);
    for (size_t i = 0; i < TAXEL_BOOT_SEARCH_REPLY_OFFSET_COMPLEMENT; i++) {
        reply[TAXEL_BOOT_SEARCH_REPLY_OFFSET_COMPLEMENT + i] = (uint8_t)~reply[i];
    }
    return TAXEL_BOOT_STATUS_OK;
}
