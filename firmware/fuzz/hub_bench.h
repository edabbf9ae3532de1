/* The hub's firmware on a HAL of virtual microseconds, small and quick to set back: boards are answers computed on the spot
 * (hub_bus.c), and a bus, once booted, is kept as bytes and copied back for the next input. Every call of the HAL and every frame
 * that leaves the UART is checked here. */
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
    BENCH_STREAMING, /* three cycles on */
    BENCH_STATES,
};

/* What becomes of the next transfer that ends, beside enum taxel_i2c_result. */
enum bench_verdict {
    BENCH_PROCEED = 1,
    BENCH_HANG, /* it never ends */
    BENCH_FLIP, /* a byte that is read is damaged */
    BENCH_NOISE, /* every byte that is read is */
};

struct bench_board {
    uint8_t address; /* 0: no board */
    uint8_t taxel_count;
    bool foreign; /* a device that is no board */
    bool unplugged, rejects_settings, holds_scan;
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
    uint64_t now_us, wake_us, done_us;
    unsigned clock_calls; /* since the hub began to run */
    bool ends_at_once;    /* transfers end inside i2c_start */
    struct taxel_i2c_transfer transfer;
    uint8_t transfer_write[BENCH_WRITE_MAX];
    int verdict; /* of the next transfer to end */
    uint8_t verdict_place, verdict_value;
    bool scl, sda, scl_held;
    unsigned sda_held_clocks;
    bool host_is_held;
    bool host_reads; /* everything, after each pass */
    bool restarted;
    bool wants_compact; /* the host has sent a START that asks for compact snapshots */

    struct taxel_deframer deframer;
    uint8_t chunk[2u * (TAXEL_ENCODED_MAX + 2u)];
    uint8_t body[TAXEL_BODY_MAX];
    uint64_t bytes_pulled;
    uint32_t frames_pulled, replies, replies_bad, replies_busy;
};

extern struct bench bench;

/* Set the bench to one of its buses in one of its states; the same bytes every time. */
void bench_restore(unsigned bus, enum bench_state state);

/* One pass of the hub's main loop, or the next event and then a pass; false if nothing happens until then. */
void bench_pass(void);
bool bench_step(uint64_t until_us);

void bench_receive(const uint8_t *bytes, size_t size);
/* A frame of the host into `wire`, delimiters included; returns its bytes. */
size_t bench_frame(uint8_t type, const uint8_t *payload, size_t size, uint8_t *wire, size_t capacity);
void bench_pull(size_t size);

/* hub_bus.c: which devices a bus has, and what they make of a transfer. */
void bench_populate(unsigned bus);
int8_t bench_transfer(const struct taxel_i2c_transfer *transfer);

#endif
