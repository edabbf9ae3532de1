#include "emulator/original/original_sender.h"

#include <string.h>

#define BITS_PER_BYTE 10.0 /* 8N1 */

/* Set up the driver. `clock_rate`: CPU clock of the hub relative to its nominal frequency, which shifts its ticks. */
void original_sender_init(struct original_sender *sender, const struct original_settings *settings, double baud,
                          double clock_rate)
{
    memset(sender, 0, sizeof *sender);
    sender->ring_size = settings->ring_size;
    sender->is_paced = settings->is_paced;
    sender->byte_time = (vtime)(BITS_PER_BYTE / baud * (double)VTIME_SECOND);
    sender->tick_period = (vtime)((double)VTIME_SECOND / ORIGINAL_TICK_HZ / clock_rate);
}

/* Discard all bytes; the ticks of the interrupt begin at `now`. */
void original_sender_reset(struct original_sender *sender, vtime now)
{
    sender->ring_head = sender->ring_tail = 0;
    sender->message_left = 0;
    sender->fifo_fill = 0;
    sender->tick_origin = now;
}

/* Return the number of bytes in the ring. */
static size_t ring_fill(const struct original_sender *sender)
{
    return sender->ring_head - sender->ring_tail;
}

/* Move bytes of the message into the free space of the ring, and record the time if the driver was empty before. */
static void fill_ring(struct original_sender *sender, vtime now)
{
    if (sender->message_left && !original_sender_has_bytes(sender)) {
        sender->waiting_since = now;
    }
    while (sender->message_left && ring_fill(sender) < sender->ring_size) {
        sender->ring[sender->ring_head++ % sender->ring_size] = *sender->message++;
        sender->message_left--;
    }
}

/* Begin to send a message, which must stay valid until original_sender_is_free(). */
void original_sender_put(struct original_sender *sender, const uint8_t *message, size_t size, vtime now)
{
    sender->message = message;
    sender->message_left = size;
    fill_ring(sender, now);
}

bool original_sender_is_free(const struct original_sender *sender)
{
    return sender->message_left == 0;
}

bool original_sender_has_bytes(const struct original_sender *sender)
{
    return ring_fill(sender) || sender->fifo_fill;
}

/* Take up to ORIGINAL_FIFO_SIZE bytes out of the ring; returns their number. */
static size_t take_from_ring(struct original_sender *sender, uint8_t *bytes, vtime now)
{
    size_t size = 0;
    while (size < ORIGINAL_FIFO_SIZE && ring_fill(sender)) {
        bytes[size++] = sender->ring[sender->ring_tail++ % sender->ring_size];
    }
    fill_ring(sender, now);
    return size;
}

/* Return when the FIFO becomes empty: one byte time before wire_end, because the last byte is then in the shift
 * register. */
static vtime fifo_empty_time(const struct original_sender *sender)
{
    return sender->wire_end > sender->byte_time ? sender->wire_end - sender->byte_time : 0;
}

/* Return the first tick at or after virtual time `time`. */
static vtime tick_at_or_after(const struct original_sender *sender, vtime time)
{
    const vtime elapsed = vtime_max(time, sender->tick_origin) - sender->tick_origin;
    return sender->tick_origin + (elapsed + sender->tick_period - 1u) / sender->tick_period * sender->tick_period;
}

/* Return the next tick of the interrupt at which the FIFO is empty, so that the interrupt can load bytes.
 * VTIME_NEVER if the ring is empty, if loaded bytes still wait for the wire, or if the driver is not paced. */
vtime original_sender_next_tick(const struct original_sender *sender, vtime now)
{
    if (!sender->is_paced || sender->fifo_fill || !ring_fill(sender)) {
        return VTIME_NEVER;
    }
    return tick_at_or_after(sender, vtime_max(now, fifo_empty_time(sender)));
}

/* Execute the interrupt at `now`: load the FIFO if it is empty. Calls at times other than ticks have no effect. */
void original_sender_tick(struct original_sender *sender, vtime now)
{
    if (original_sender_next_tick(sender, now) == now) {
        sender->fifo_fill = take_from_ring(sender, sender->fifo, now);
    }
}

/* Copy the next bytes to send to `bytes` when the wire is free at `now`, and add their time to the sums. Returns their
 * number; 0 if there are none, or if `size` is smaller than a FIFO. */
size_t original_sender_pull(struct original_sender *sender, uint8_t *bytes, size_t size, vtime now)
{
    uint8_t chunk[ORIGINAL_FIFO_SIZE];
    const vtime waiting_since = vtime_max(sender->waiting_since, sender->wire_end);
    const size_t count = sender->is_paced ? sender->fifo_fill : take_from_ring(sender, chunk, now);
    if (!count || size < ORIGINAL_FIFO_SIZE) {
        return 0;
    }
    memcpy(bytes, sender->is_paced ? sender->fifo : chunk, count);
    sender->fifo_fill = 0;
    sender->pacing_time += now > waiting_since ? now - waiting_since : 0;
    sender->wire_time += count * sender->byte_time;
    sender->wire_end = now + count * sender->byte_time;
    sender->bytes += count;
    return count;
}
