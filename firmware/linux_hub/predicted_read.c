#include "linux_hub/predicted_read.h"

/* Return `size`, clipped to the upper limit of the transfer. */
static size_t limit(size_t size, const struct taxel_i2c_transfer *transfer)
{
    return size < transfer->read_size ? size : transfer->read_size;
}

/* Return the number of bytes that the first read of a length-prefixed transfer should have: the largest of the board's
 * latest sizes with a margin, or the upper limit for a board that has not been read yet. */
size_t predicted_read_size(const struct predicted_read *prediction, const struct taxel_i2c_transfer *transfer)
{
    const uint16_t *sizes = prediction->sizes[transfer->address % PREDICTED_READ_ADDRESSES];
    size_t largest = 0;
    for (size_t i = 0; i < PREDICTED_READ_HISTORY; i++) {
        largest = sizes[i] > largest ? sizes[i] : largest;
    }
    return largest ? limit(largest + PREDICTED_READ_MARGIN, transfer) : transfer->read_size;
}

/* Evaluate a read of `size` bytes, and store the size of the snapshot in the history of its board. Returns 0 if the
 * bytes contain the whole snapshot, otherwise the number of bytes with which it must be read again. A length byte 0
 * (the board has no new snapshot) is not stored. */
size_t predicted_read_remainder(struct predicted_read *prediction, const struct taxel_i2c_transfer *transfer,
                                size_t size)
{
    const uint8_t length = transfer->read_bytes[0];
    const size_t needed = 1u + taxel_i2c_bytes_after_length(transfer, length);
    const uint8_t address = transfer->address % PREDICTED_READ_ADDRESSES;
    if (length) {
        prediction->sizes[address][prediction->next[address]] = (uint16_t)needed;
        prediction->next[address] = (uint8_t)((prediction->next[address] + 1u) % PREDICTED_READ_HISTORY);
    }
    return needed <= size ? 0 : limit(needed + PREDICTED_READ_MARGIN_AGAIN, transfer);
}
