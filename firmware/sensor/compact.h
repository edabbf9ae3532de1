/* The board's side of compact snapshots: the main loop codes the newest scan, the I2C interrupt gives it out. */
#ifndef TAXEL_SENSOR_COMPACT_H
#define TAXEL_SENSOR_COMPACT_H

#include <stdbool.h>

#include "codec/compact.h"

struct taxel_sensor;

/* Memory for a board of n taxels; the caller's. */
struct taxel_compact_memory {
    taxel_compact_state *states; /* n */
    uint8_t *residuals;          /* n */
    uint8_t *buffers[2];         /* TAXEL_COMPACT_BUFFER_SIZE(n) each: length byte and compact snapshot */
};

/* The last snapshot that was marked as a candidate. */
struct taxel_compact_candidate {
    bool waits;  /* for its acknowledgement */
    bool begins; /* it is packed: the states are its own already */
    uint8_t patience; /* snapshots read after it before it counts as lost */
    uint16_t name;
    uint32_t timestamp_us;
};

struct taxel_compact {
    uint8_t *shown; /* what a reader gets */
    uint8_t *work;  /* what the main loop codes into */

    /* between interrupt and main loop */
    bool coding;  /* somebody reads */
    bool reading; /* a read of `shown` is under way */
    bool has_shown;
    bool unread; /* `shown` was not given out yet */
    bool shows_candidate;
    bool acknowledged;
    bool forget;
    uint8_t reads; /* given out since the last candidate was shown */
    uint16_t acknowledged_name;
    uint32_t asked_us;

    /* main loop only */
    bool ready; /* `work` waits to be shown */
    bool ready_is_candidate;
    bool has_reference;
    bool busy; /* the last counts took clearly more than usual */
    uint8_t updates;
    uint8_t start; /* scale to begin from, bits of `form` */
    uint16_t reference_name;
    uint16_t usual_size; /* of coded counts, in sixteenths of a byte */
    uint32_t reference_us;
    struct taxel_compact_candidate candidate;
};

void taxel_sensor_compact_init(struct taxel_sensor *sensor);
bool taxel_sensor_has_compact(const struct taxel_sensor *sensor);

/* From the I2C interrupt: a read at the register begins (`again`: the pointer was written just before), anything else happens on
 * the bus, a write of `size` bytes has ended. The last returns whether it was one that exists. */
void taxel_sensor_compact_begin_read(struct taxel_sensor *sensor, bool again);
void taxel_sensor_compact_end_read(struct taxel_sensor *sensor);
bool taxel_sensor_compact_write(struct taxel_sensor *sensor, const uint8_t *bytes, size_t size);

#endif
