#include "linux_hub/predicted_read.h"

static size_t limit(size_t size, const struct taxel_i2c_transfer *transfer)
{
    return size < transfer->read_size ? size : transfer->read_size;
}

/* Number of bytes with which the read of a length-prefixed transfer should begin: the largest of the latest sizes with
 * a margin, or the upper limit for a board that has not been read yet. */
size_t predicted_read_size(const struct predicted_read *prediction, const struct taxel_i2c_transfer *transfer)
{
    const uint16_t *sizes = prediction->sizes[transfer->address % PREDICTED_READ_ADDRESSES];
    size_t largest = 0;
    for (size_t i = 0; i < PREDICTED_READ_HISTORY; i++) {
        largest = sizes[i] > largest ? sizes[i] : largest;
    }
    return largest ? limit(largest + PREDICTED_READ_MARGIN, transfer) : transfer->read_size;
}

/* Store the size of the snapshot in the history of its board. Returns 0 if the `size` bytes that were read contain all
 * of it, else the number of bytes of the next read. Length 0 means that the board has no new snapshot; it predicts
 * nothing. */
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
