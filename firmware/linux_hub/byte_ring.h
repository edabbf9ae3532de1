/* A ring buffer of bytes whose size is fixed when it is created. Not thread-safe. */
#ifndef LINUX_HUB_BYTE_RING_H
#define LINUX_HUB_BYTE_RING_H

#include <stddef.h>
#include <stdint.h>

struct byte_ring {
    uint8_t *bytes;
    size_t capacity;
    size_t first; /* index of the oldest byte */
    size_t count;
};

/* Return the number of free bytes. */
static inline size_t byte_ring_space(const struct byte_ring *ring)
{
    return ring->capacity - ring->count;
}

/* Append up to `size` bytes; returns how many fitted. */
size_t byte_ring_write(struct byte_ring *ring, const uint8_t *bytes, size_t size);
/* Remove up to `size` bytes, oldest first; returns their number. */
size_t byte_ring_read(struct byte_ring *ring, uint8_t *bytes, size_t size);

#endif
