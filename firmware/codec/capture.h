/* A PC's way to read captures (protocol/SPEC.md, part 4): takes a block of the file apart at memory speed. Built into the library
 * that the Python host loads; not part of the firmware images. */
#ifndef TAXEL_CAPTURE_H
#define TAXEL_CAPTURE_H

#include <stddef.h>
#include <stdint.h>

#define TAXEL_CAPTURE_RECORD_HEAD 12u
#define TAXEL_CAPTURE_RECORD_MAX (1u << 24)

/* A record: the bytes of the stream up to its end, and when they arrived. */
struct taxel_capture_arrival {
    uint64_t end;
    uint64_t time_ns;
};

/* What a block held. Only 64-bit members: the Python host reads it as one array. */
struct taxel_capture_block {
    uint64_t used;    /* bytes of the whole records; behind them stands the beginning of the next one, or damage */
    uint64_t payload; /* bytes that these records held */
    uint64_t records;
    uint64_t wanted;  /* bytes of the record behind them, 0 if its head is not there; more than the maximum is damage */
};

/* Move the payloads of the whole records in `bytes` together, to its start. `arrivals` has room for size / 12 of them; `position`
 * counts the stream's bytes before this block. */
void taxel_capture_gather(uint8_t *bytes, size_t size, uint64_t position, struct taxel_capture_arrival *arrivals,
                          struct taxel_capture_block *block);

#endif
