#include "codec/capture.h"

#include <string.h>

/* Most records are one packet of a USB adapter, 62 bytes: they are copied with a fixed size, and the record's head
 * provides the space for the excess bytes. */
#define PACKET 64u

/* Read a little-endian number of `size` bytes: captures have this byte order on every machine. */
static uint64_t get_uint(const uint8_t *bytes, size_t size)
{
    uint64_t value = 0;
    for (size_t i = size; i; i--) {
        value = value << 8 | bytes[i - 1u];
    }
    return value;
}

/* Move `length` bytes from `from` to `to`, which lies at least TAXEL_CAPTURE_RECORD_HEAD bytes before `from`.
 * `readable`: number of bytes that can be read at `from`. If possible, PACKET bytes are copied instead of `length`,
 * because a copy of fixed size is faster. These are at most TAXEL_CAPTURE_RECORD_HEAD bytes more, so the copy ends
 * before the end of the source, and the data behind the source stay unchanged. */
static void move_down(uint8_t *to, const uint8_t *from, size_t length, size_t readable)
{
    if (length <= PACKET && length + TAXEL_CAPTURE_RECORD_HEAD >= PACKET && readable >= PACKET) {
        uint8_t packet[PACKET];
        memcpy(packet, from, PACKET);
        memcpy(to, packet, PACKET);
    } else {
        memmove(to, from, length);
    }
}

/* Join the payloads of the capture records in `bytes`, in place, and list for each record its arrival time (ns) and the
 * stream position of its end. A record consists of a head, with arrival time (ns, 8 bytes) and payload size (4 bytes),
 * and of the payload. `position` is the stream position before the first payload. An incomplete last record stays
 * unchanged. `block` receives the number of records, of the bytes used, of the payload bytes, and the size of an
 * incomplete last record (0: unknown, or there is none). */
void taxel_capture_gather(uint8_t *bytes, size_t size, uint64_t position, struct taxel_capture_arrival *arrivals,
                          struct taxel_capture_block *block)
{
    size_t used = 0, payload = 0, records = 0;
    block->next_record_size = 0;
    while (size - used >= TAXEL_CAPTURE_RECORD_HEAD) {
        const uint64_t time_ns = get_uint(bytes + used, 8);
        const size_t length = (size_t)get_uint(bytes + used + 8, 4);
        if (length > TAXEL_CAPTURE_RECORD_MAX || length > size - used - TAXEL_CAPTURE_RECORD_HEAD) {
            block->next_record_size = (uint64_t)length + TAXEL_CAPTURE_RECORD_HEAD;
            break;
        }
        move_down(bytes + payload, bytes + used + TAXEL_CAPTURE_RECORD_HEAD, length,
                  size - used - TAXEL_CAPTURE_RECORD_HEAD);
        payload += length;
        used += length + TAXEL_CAPTURE_RECORD_HEAD;
        arrivals[records++] = (struct taxel_capture_arrival){position + payload, time_ns};
    }
    block->used = used;
    block->payload = payload;
    block->records = records;
}
