/* The UART driver of the original hub: a ring of 128 bytes between the main program and the transmit FIFO of 8 bytes.
 *
 * Paced (as in the original): an interrupt every 0.5 ms fills the FIFO with up to 8 bytes, but only if the FIFO is
 * empty. At 115,200 baud 8 bytes take 0.69 ms, so that 8 bytes leave per 1 ms: 8,000 B/s instead of 11,520 B/s. Not
 * paced: the FIFO is refilled whenever the wire is free. The main program waits until its whole message is in the
 * ring. */
#ifndef EMULATOR_ORIGINAL_ORIGINAL_SENDER_H
#define EMULATOR_ORIGINAL_ORIGINAL_SENDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/base/vtime.h"
#include "emulator/original/original_settings.h"

#define ORIGINAL_FIFO_SIZE 8u
#define ORIGINAL_TICK_HZ 2000.0

struct original_sender {
    uint8_t ring[ORIGINAL_RING_SIZE_MAX];
    size_t ring_size, ring_head, ring_tail; /* bytes put in, taken out; the ring contains their difference */
    const uint8_t *message;                 /* the part of the message that is not in the ring yet */
    size_t message_left;
    bool is_paced;
    uint8_t fifo[ORIGINAL_FIFO_SIZE]; /* paced: bytes that the interrupt has loaded, while the wire is busy */
    size_t fifo_fill;
    vtime byte_time;     /* on the wire */
    vtime tick_period;   /* of the interrupt */
    vtime tick_origin;   /* time of the reset: ticks are multiples of the period after it */
    vtime wire_end;      /* end of the bytes taken last */
    vtime waiting_since; /* when the ring ceased to be empty */
    vtime wire_time;     /* sum of the time in which the wire was busy */
    vtime pacing_time;   /* sum of the time in which bytes waited for the interrupt while the wire was idle */
    uint64_t bytes;
};

void original_sender_init(struct original_sender *sender, const struct original_settings *settings, double baud,
                          double clock_rate);
/* Discard all bytes; the ticks of the interrupt begin at `now`. */
void original_sender_reset(struct original_sender *sender, vtime now);

/* Send a message, which must stay valid until original_sender_is_free(). */
void original_sender_put(struct original_sender *sender, const uint8_t *message, size_t size, vtime now);

/* Return whether the whole message is in the ring: the main program continues. */
bool original_sender_is_free(const struct original_sender *sender);

/* Return whether the ring or the FIFO contains bytes. */
bool original_sender_has_bytes(const struct original_sender *sender);

/* Return the next tick of the interrupt at which bytes can move; VTIME_NEVER if the ring is empty or the driver is not
 * paced. */
vtime original_sender_next_tick(const struct original_sender *sender, vtime now);

/* Execute the interrupt of a tick at `now`. */
void original_sender_tick(struct original_sender *sender, vtime now);

/* Copy the next bytes to send when the wire is free at `now`: at most one FIFO of bytes. Returns their number; 0 if
 * `size` is smaller than a FIFO. */
size_t original_sender_pull(struct original_sender *sender, uint8_t *bytes, size_t size, vtime now);

#endif
