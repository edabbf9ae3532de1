/* Compact snapshots on the board: the main loop encodes the newest scan, the I2C interrupt sends the result.
 *
 * Integration: give the board memory for n taxels in struct taxel_sensor_config; everything else is called by
 * sensor.h's functions.
 *
 *     static taxel_compact_state states[n];
 *     static uint8_t residuals[n], buffers[2][TAXEL_COMPACT_BUFFER_SIZE(n)];
 *     config.compact = (struct taxel_compact_memory){
 *         .states = states, .residuals = residuals, .buffers = {buffers[0], buffers[1]},
 *     };
 */
#ifndef TAXEL_SENSOR_COMPACT_H
#define TAXEL_SENSOR_COMPACT_H

#include <stdbool.h>

#include "codec/compact.h"

struct taxel_sensor;

/* Memory for a board of n taxels, n from 1 to TAXEL_COMPACT_TAXELS_MAX (238); owned by the caller. */
struct taxel_compact_memory {
    taxel_compact_state *states; /* n elements; NULL: the board has no compact snapshots */
    uint8_t *residuals;          /* n bytes */
    uint8_t *buffers[2];         /* TAXEL_COMPACT_BUFFER_SIZE(n) bytes each: length byte and compact snapshot */
};

/* The last snapshot that was marked as a key frame. */
struct taxel_compact_pending_key_frame {
    bool is_pending;       /* not acknowledged yet */
    bool is_packed;        /* `states` already hold the new key frame */
    uint8_t timeout_reads; /* number of later snapshots read after which the acknowledgement is treated as lost */
    uint16_t id;
    uint32_t timestamp_us;
};

struct taxel_compact {
    uint8_t *reader_buffer; /* buffer that a reader gets */
    uint8_t *work_buffer;   /* buffer into which the main loop encodes */

    /* shared by interrupt and main loop */
    bool has_reader;       /* compact snapshots were read recently */
    bool read_in_progress; /* a read of reader_buffer has not ended */
    bool reader_buffer_valid;
    bool is_unread; /* reader_buffer was not read yet */
    bool reader_has_key_frame;
    bool acknowledge_received;
    bool forget_received;
    uint8_t reads_since_key_frame; /* snapshots read since the last key frame was put into reader_buffer */
    uint16_t acknowledged_id;
    uint32_t last_read_us;

    /* main loop only */
    bool work_ready; /* work_buffer holds a complete snapshot */
    bool work_is_key_frame;
    bool has_key_frame;
    bool is_size_raised; /* the last coded counts took clearly more bytes than usual */
    uint8_t updates;
    uint8_t start_scale; /* initial scale, as bits of `format` */
    uint16_t key_frame_id;
    uint16_t usual_size; /* of coded counts, in sixteenths of a byte */
    uint32_t key_frame_us;
    struct taxel_compact_pending_key_frame pending;
};

void taxel_sensor_compact_init(struct taxel_sensor *sensor);
bool taxel_sensor_has_compact(const struct taxel_sensor *sensor);

/* To be called from the I2C interrupt. begin_read: a read of register COMPACT begins; `again`: the pointer was written
 * just before, so the last snapshot may be repeated. end_read: any other event on the bus. write: a write of `size`
 * bytes has ended; returns whether these bytes are defined. */
void taxel_sensor_compact_begin_read(struct taxel_sensor *sensor, bool again);
void taxel_sensor_compact_end_read(struct taxel_sensor *sensor);
bool taxel_sensor_compact_write(struct taxel_sensor *sensor, const uint8_t *bytes, size_t size);

#endif
