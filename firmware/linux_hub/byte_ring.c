#include "linux_hub/byte_ring.h"

#include <string.h>

/* Return the smaller of two sizes. */
static size_t smaller(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Append up to `size` bytes. Returns the number of bytes that fitted. */
size_t byte_ring_write(struct byte_ring *ring, const uint8_t *bytes, size_t size)
{
    size = smaller(size, byte_ring_space(ring));
    const size_t end = (ring->first + ring->count) % ring->capacity;
    const size_t before_wrap = smaller(size, ring->capacity - end);
    memcpy(ring->bytes + end, bytes, before_wrap);
    memcpy(ring->bytes, bytes + before_wrap, size - before_wrap);
    ring->count += size;
    return size;
}

/* Remove up to `size` bytes, oldest first. Returns their number. */
size_t byte_ring_read(struct byte_ring *ring, uint8_t *bytes, size_t size)
{
    size = smaller(size, ring->count);
    const size_t before_wrap = smaller(size, ring->capacity - ring->first);
    memcpy(bytes, ring->bytes + ring->first, before_wrap);
    memcpy(bytes + before_wrap, ring->bytes, size - before_wrap);
    ring->first = (ring->first + size) % ring->capacity;
    ring->count -= size;
    return size;
}
