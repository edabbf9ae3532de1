/* An emulated world built in memory: the emulator without its main(), its UART ending in a frame decoder. */
#ifndef TAXEL_TESTS_FAKE_WORLD_H
#define TAXEL_TESTS_FAKE_WORLD_H

#include "codec/deframer.h"
#include "emulator/world.h"

struct fake_world {
    struct world world;
    struct world_description description;
    struct stimulus stimulus;
    struct endpoint endpoint;
    struct host_script script;
    char *captured; /* what the endpoint has written: records of time, size and bytes */
    size_t captured_size, captured_read;

    struct taxel_deframer deframer;
    uint8_t chunk[2 * (TAXEL_ENCODED_MAX + 2)];
    uint8_t body[TAXEL_BODY_MAX];
    uint32_t stream_crc; /* of every byte that the host received */
    uint64_t stream_bytes;
    unsigned taxel_frames, bad_board_crcs, sequence_gaps, replies, restarts;
    unsigned frames_of[TAXEL_ADDRESS_MAX + 1];
    uint16_t counts_of[TAXEL_ADDRESS_MAX + 1][TAXEL_TAXELS_MAX]; /* latest */
    uint8_t reply_status, reply_tag;
    uint16_t next_sequence;
    uint8_t tag;
};

/* Describe a world with the defaults of a world file and `boards` boards at 0x20 and up, of `taxels` taxels each. */
void fake_world_describe(struct fake_world *fake, size_t boards, uint16_t taxels);
void fake_world_fault(struct fake_world *fake, double time_s, enum fault_kind kind, uint8_t address, double value);
void fake_world_fault_at(struct fake_world *fake, double time_s, enum fault_kind kind, uint8_t address, double position,
                         double second);

/* Create the described world. stimulus_fd: a stimulus stream, or -1. Returns 0, or -1 after an error of the
 * emulator. */
int fake_world_open(struct fake_world *fake, int stimulus_fd);
void fake_world_close(struct fake_world *fake);

/* Run the world for `seconds` of virtual time in steps of `step`, and decode what the host has received. Returns 0, or
 * -1 after an error. */
int fake_world_run_in_steps(struct fake_world *fake, double seconds, vtime step);
int fake_world_run(struct fake_world *fake, double seconds);

/* Run for 0.5 s, then send the handshake and the command START. Returns whether the hub streams. */
bool fake_world_start(struct fake_world *fake);
void fake_world_command(struct fake_world *fake, uint8_t command, const uint8_t *arguments, size_t size);

struct taxel_hub_slot *fake_world_slot(struct fake_world *fake, uint8_t address);
/* Return whether every poll, except at most one in progress, is in one outcome counter, and every forwarded frame
 * arrived complete with a correct board CRC. */
bool fake_world_adds_up(const struct fake_world *fake);

#endif
