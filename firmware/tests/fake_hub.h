/* A simulated hub: the hub firmware on a HAL with virtual time. On its bus are boards with the sensor firmware and
 * foreign devices; a script may change the outcome of any transfer. Its UART is connected to a frame decoder. */
#ifndef TAXEL_TESTS_FAKE_HUB_H
#define TAXEL_TESTS_FAKE_HUB_H

#include "codec/deframer.h"
#include "fake_sensor.h"
#include "hub/hub.h"
#include "hub/internal.h"

#define FAKE_DEVICES 40u
#define FAKE_SLOTS 32u
#define FAKE_FRAMES 4096u
#define FAKE_LINES 128u
#define FAKE_RING 256u
#define FAKE_PULL 1280u
#define FAKE_POOL (2u * TAXEL_HUB_BUFFER_SIZE(TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)))
#define FAKE_NEVER UINT64_MAX

/* Outcome of a transfer selected by a script, in addition to enum taxel_i2c_result. */
enum fake_outcome {
    FAKE_PROCEED = 1,
    FAKE_HANG = 2, /* the transfer never ends */
};

struct fake_device {
    uint8_t address;
    struct fake_sensor *sensor; /* NULL: a foreign device, which answers with `foreign` bytes */
    uint8_t foreign;
    bool unplugged;
    unsigned nacks;      /* number of next addresses that are not acknowledged */
    unsigned corrupt;    /* number of next reads that are damaged */
    unsigned held_scans; /* number of next snapshot reads without a newer scan */
    uint32_t clock_offset_us;
    uint8_t map_version; /* reported in the identity; 0: the firmware's own */
};

struct fake_frame {
    uint8_t type;
    uint16_t sequence;
    uint16_t length;
    uint8_t payload[TAXEL_PAYLOAD_MAX];
};

struct fake_hub {
    struct taxel_hub hub;
    struct taxel_hub_config config;
    struct taxel_hub_hal hal;
    struct taxel_hub_slot slots[FAKE_SLOTS];
    uint8_t pool[FAKE_POOL];
    uint8_t ring[FAKE_RING];
    uint64_t now_us, wake_us;

    struct fake_device devices[FAKE_DEVICES];
    size_t device_count;
    int (*script)(struct fake_hub *fake, const struct taxel_i2c_transfer *transfer);
    int script_state; /* for the script's use */
    uint64_t done_us;
    int8_t result;
    uint64_t transfers;
    unsigned aborts, restarts, bootloader_entries;
    unsigned overlapping; /* transfers started before the end of the previous one */

    bool scl, sda;            /* levels driven by the hub */
    unsigned sda_held_clocks; /* number of clocks after which a slave releases SDA */
    bool scl_held;
    struct {
        bool scl, sda;
        uint64_t at_us;
    } lines[FAKE_LINES];
    size_t line_count;

    bool is_host_held; /* RTS stops the host */
    unsigned hold_changes;
    size_t drain_bytes; /* bytes that the host reads after each pass of the hub; 0: none */
    struct taxel_deframer deframer;
    uint8_t chunk[2 * (TAXEL_ENCODED_MAX + 2)];
    uint8_t body[TAXEL_BODY_MAX];
    struct fake_frame frames[FAKE_FRAMES];
    size_t frame_count;
    unsigned sequence_gaps;
    uint16_t next_sequence;

    uint8_t tag;
    uint8_t reply[TAXEL_PAYLOAD_MAX];
    size_t reply_size;
};

void fake_hub_init(struct fake_hub *fake);
void fake_hub_boot(struct fake_hub *fake);
struct fake_device *fake_hub_add(struct fake_hub *fake, uint8_t address, struct fake_sensor *sensor);

/* Add boards of 10 taxels at first_address and the addresses after it, booted, with one scan done. */
void fake_hub_add_boards(struct fake_hub *fake, struct fake_sensor *sensors, uint8_t first_address, size_t count);
void fake_hub_free_boards(struct fake_hub *fake);
/* Boot the hub, let it detect the boards, complete the handshake, start streaming, and discard the frames received so
 * far. Returns whether all succeeded. */
bool fake_hub_start(struct fake_hub *fake);

/* Execute the next event of the hub, unless it is later than `until_us`. Returns whether there was one. */
bool fake_hub_step(struct fake_hub *fake, uint64_t until_us);

/* Run for some virtual time. */
void fake_hub_run(struct fake_hub *fake, uint64_t microseconds);

/* Run until `cycles` more poll cycles have ended. Returns false if they do not end within 10 virtual seconds. */
bool fake_hub_run_cycles(struct fake_hub *fake, uint32_t cycles);

void fake_hub_receive(struct fake_hub *fake, const uint8_t *bytes, size_t size);
void fake_hub_send(struct fake_hub *fake, uint8_t type, const uint8_t *payload, size_t size);

/* Send a command and run until its reply. Returns its status, or -1 without a reply within `timeout_us`. */
int fake_hub_command_within(struct fake_hub *fake, uint8_t command, const uint8_t *arguments, size_t size,
                            uint64_t timeout_us);
int fake_hub_command(struct fake_hub *fake, uint8_t command, const uint8_t *arguments, size_t size);
bool fake_hub_handshake(struct fake_hub *fake);

size_t fake_hub_count(const struct fake_hub *fake, uint8_t type);
const struct fake_frame *fake_hub_last(const struct fake_hub *fake, uint8_t type);
/* Return the number of frames of a type whose payload begins with this address. */
size_t fake_hub_count_of(const struct fake_hub *fake, uint8_t type, uint8_t address);
size_t fake_hub_count_faults(const struct fake_hub *fake, uint8_t address, uint8_t fault);
void fake_hub_forget_frames(struct fake_hub *fake);

struct taxel_hub_slot *fake_hub_slot(struct fake_hub *fake, uint8_t address);
/* Return whether, for every board, each poll is in exactly one outcome counter, except at most one poll in progress. */
bool fake_hub_accounts_balance(const struct fake_hub *fake);

/* Execute a transfer on the devices (fake_bus.c), and initialise the frame decoder (fake_host.c). */
int8_t fake_bus_transfer(struct fake_hub *fake, const struct taxel_i2c_transfer *transfer);
void fake_host_init(struct fake_hub *fake);

#endif
