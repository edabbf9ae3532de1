/* Reading of captures on a PC (protocol/SPEC.md, part 4): separates the records of a block of the file at memory
 * speed. Built into the library that the Python host loads; not part of the firmware images.
 *
 * Integration (`bytes`: the next `size` bytes of the file, behind its header):
 *
 *     struct taxel_capture_block block;
 *     taxel_capture_gather(bytes, size, position, arrivals, &block);
 *     use(bytes, block.payload, arrivals, block.records);
 *     position += block.payload;
 *     // Then keep the bytes from block.used on, and read on until block.next_record_size bytes are there.
 */
#ifndef TAXEL_CAPTURE_H
#define TAXEL_CAPTURE_H

#include <stddef.h>
#include <stdint.h>

#define TAXEL_CAPTURE_RECORD_HEAD 12u
#define TAXEL_CAPTURE_RECORD_MAX (1u << 24)

/* One record: the position in the stream of its end, and its arrival time. */
struct taxel_capture_arrival {
    uint64_t end;
    uint64_t time_ns;
};

/* Content of a block. Only 64-bit members: the Python host reads this struct as one array. */
struct taxel_capture_block {
    uint64_t used;    /* bytes of the complete records; the start of the next record, or damage, follows */
    uint64_t payload; /* payload bytes of these records */
    uint64_t records;
    /* bytes of the incomplete record; 0: its head is incomplete; above the maximum: damage */
    uint64_t next_record_size;
};

/* Move the payloads of the complete records in `bytes` together, to the start of `bytes`. `arrivals` has space for
 * size / 12 elements; `position`: bytes of the stream before this block. */
void taxel_capture_gather(uint8_t *bytes, size_t size, uint64_t position, struct taxel_capture_arrival *arrivals,
                          struct taxel_capture_block *block);

#endif
