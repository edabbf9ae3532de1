/* The hub's firmware on a HAL with virtual time that is fast to reset: the boards' answers are computed on demand
 * (hub_bus.c), and the state of a booted bus is saved and restored for each input. Every call of the HAL and every
 * frame from the UART is checked. */
#ifndef TAXEL_HUB_BENCH_H
#define TAXEL_HUB_BENCH_H

#include "codec/deframer.h"
#include "fuzz/fuzz.h"
#include "hub/hub.h"
#include "hub/internal.h"

#define BENCH_BOARDS 6u
#define BENCH_BUSES 8u
#define BENCH_NEVER UINT64_MAX
#define BENCH_WRITE_MAX 64u

enum bench_state {
    BENCH_COLD = 0,  /* just reset */
    BENCH_WARM,      /* boards found, host and hub have completed the handshake */
    BENCH_STREAMING, /* after three cycles */
    BENCH_STATES,
};

/* Outcome of the next transfer, in addition to enum taxel_i2c_result. */
enum bench_outcome {
    BENCH_PROCEED = 1,
    BENCH_HANG,  /* the transfer never ends */
    BENCH_FLIP,  /* one byte read is damaged */
    BENCH_NOISE, /* every byte read is damaged */
};

struct bench_board {
    uint8_t address; /* 0: no board */
    uint8_t taxel_count;
    bool foreign; /* a device that is not a sensor board */
    bool unplugged, rejects_settings;
    bool holds_scan; /* repeats the last sequence number instead of a new snapshot */
    uint8_t map_version;
    uint8_t pointer;
    uint16_t sequence;
    uint32_t clock_offset_us;
    uint8_t settings[TAXEL_SCAN_SETTINGS_SIZE];
};

struct bench {
    struct taxel_hub hub;
    struct taxel_hub_config config;
    struct bench_board boards[BENCH_BOARDS];
    uint64_t now_us;
    uint64_t wake_us; /* earliest wake-up that the hub requested; BENCH_NEVER: none */
    uint64_t
        done_us; /* end of the transfer in progress; BENCH_NEVER: none, BENCH_NEVER - 1: a transfer that never ends */
    unsigned clock_calls; /* in this pass of the main loop */
    bool ends_at_once;    /* transfers end inside i2c_start */
    struct taxel_i2c_transfer transfer;
    uint8_t transfer_write[BENCH_WRITE_MAX];
    int outcome; /* of the next transfer */
    uint8_t damage_position, damage_value;
    bool scl, sda, scl_held;
    unsigned sda_held_clocks;
    bool host_is_held;
    bool host_reads; /* the host reads all bytes after each pass */
    bool restarted;
    bool compact_requested; /* the host sent a START with the COMPACT flag */

    struct taxel_deframer deframer;
    uint8_t chunk[2u * (TAXEL_ENCODED_MAX + 2u)];
    uint8_t body[TAXEL_BODY_MAX];
    uint64_t bytes_pulled;
    uint32_t frames_pulled, replies, replies_bad, replies_busy;
};

extern struct bench bench;

/* Restore bench and hub on bus number `bus` (0 to BENCH_BUSES - 1) in one of its states. */
void bench_restore(unsigned bus, enum bench_state state);

/* Run one pass of the hub's main loop. */
void bench_pass(void);
/* Advance to the next event and run one pass; false if no event is due until `until_us`. */
bool bench_step(uint64_t until_us);

/* Deliver bytes of the host to the hub and run one pass. */
void bench_receive(const uint8_t *bytes, size_t size);
/* Encode a frame of the host into `wire`, delimiters included; returns its size. */
size_t bench_frame(uint8_t type, const uint8_t *payload, size_t size, uint8_t *wire, size_t capacity);
/* Take up to `size` bytes from the hub's UART and decode and check them as the host. */
void bench_pull(size_t size);

/* hub_checks.c: checks of the pool bytes of a transfer, of a frame for the host, and of the hub after a pass. */
void bench_check_buffer(size_t offset, size_t size);
void bench_check_frame(void *context, const struct taxel_frame *frame);
void bench_check_hub(void);

/* hub_bus.c: the devices of a bus, and their response to a transfer. */
void bench_populate(unsigned bus);
int8_t bench_transfer(const struct taxel_i2c_transfer *transfer);

#endif
