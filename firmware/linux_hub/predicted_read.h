/* Reads of compact snapshots by a master that must state the number of bytes before the transfer. A hub reads the
 * length byte first and then exactly the bytes that follow; an adapter of Linux cannot. The number is predicted from
 * the board's latest snapshots; a snapshot that is longer is read again in full. */
#ifndef LINUX_HUB_PREDICTED_READ_H
#define LINUX_HUB_PREDICTED_READ_H

#include <stddef.h>
#include <stdint.h>

#include "hal/hub_hal.h"

/* A longer history wastes bus time after a touch, a shorter one repeats more reads: the sizes of successive delta
 * frames differ by a few bytes. */
#define PREDICTED_READ_HISTORY 4u
#define PREDICTED_READ_ADDRESSES 128u
/* Bytes beyond the largest of the latest sizes: a longer read costs bus time, a shorter one is repeated more often. On
 * the emulated original hand at rest, margins of 0, 1, 2 and 4 bytes give 45, 49, 49 and 48 poll cycles per second at
 * 400 kHz. */
#define PREDICTED_READ_MARGIN 2u
/* The margin in bytes of a repeated read, in which the board may return a newer snapshot. */
#define PREDICTED_READ_MARGIN_AGAIN 8u

/* Sizes of the latest compact snapshots of each address, length byte included; 0: none. */
struct predicted_read {
    uint16_t sizes[PREDICTED_READ_ADDRESSES][PREDICTED_READ_HISTORY];
    uint8_t next[PREDICTED_READ_ADDRESSES];
};

/* Return the number of bytes that the first read of a length-prefixed transfer should have. */
size_t predicted_read_size(const struct predicted_read *prediction, const struct taxel_i2c_transfer *transfer);

/* Evaluate a read of `size` bytes. Returns 0 if the snapshot is complete; otherwise it must be read again, with the
 * number of bytes that is returned. */
size_t predicted_read_remainder(struct predicted_read *prediction, const struct taxel_i2c_transfer *transfer,
                                size_t size);

#endif
