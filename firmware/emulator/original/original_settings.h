/* Settings of the original hub and boards: the world-file line `protocol original key=value ...`.
 *
 * The firmware of the thesis's boards is not public. The defaults are those of the first generation (branch main of
 * the author's hardware project); ../README.md lists the keys and the settings with which the later hand reaches its
 * rate. */
#ifndef EMULATOR_ORIGINAL_ORIGINAL_SETTINGS_H
#define EMULATOR_ORIGINAL_ORIGINAL_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/base/world_line.h"
#include "emulator/geometry/board_description.h"
#include "generated/taxel_original.h"

#define ORIGINAL_SCL_HZ 100000.0 /* SCB of hub and boards, 8 + 8 clocks of oversampling */
#define ORIGINAL_BAUD 115200.0   /* the divider of the hub's 24 MHz, 17 * 12, gives 117647 */
#define ORIGINAL_DELAY_MS 50.0   /* after each cycle */
#define ORIGINAL_RING_SIZE 128u  /* bytes of the transmit ring */
#define ORIGINAL_RING_SIZE_MAX 4096u
#define ORIGINAL_COPY_US 1.0 /* estimate: 24 CPU cycles for one word */
/* Counts and accelerations of a board: the length of a message has one byte, 2 * 123 + 8 = 254. */
#define ORIGINAL_WORDS_MAX 123u
/* Modulator 12 MHz, TX clock 300 kHz, 100 sub-conversions: 4,000 counts in 333 us. The current source, calibrated by
 * the original firmware to 40 % of full scale at rest, has the code for the capacitance of the emulated taxels. */
#define ORIGINAL_SCAN_SETTINGS {100, 40, 4, 4, 0}
#define ORIGINAL_RECEIVE_SIZE 50u /* bytes of the hub's receive buffer, with the fault `receive_buffer` */

/* What the hub does with a board that does not answer. */
enum original_variant {
    ORIGINAL_MAIN,   /* after 5 failed tries the board is skipped in this cycle */
    ORIGINAL_BRANCH, /* after 10 failed tries the board is offline until the hub is reset */
};

enum original_message {
    ORIGINAL_WITH_TIMESTAMP,    /* address, timestamp in ms (big-endian), counts (little-endian) */
    ORIGINAL_WITHOUT_TIMESTAMP, /* address, counts (little-endian) */
    ORIGINAL_HIGH_BYTE_FIRST,   /* address, timestamp, counts (big-endian) */
};

/* Known faults of the original firmware, as bits. */
enum original_fault {
    ORIGINAL_TRUNCATED_TAXEL = 1u
        << 0, /* boards give 2 n bytes to the SCB: the last taxel reads 0xFFFF (before 79ee17f) */
    ORIGINAL_WRONG_BUFFER = 1u << 1,    /* the hub sends n + 5 bytes of its receive buffer (before 79ee17f) */
    ORIGINAL_RECEIVE_BUFFER = 1u << 2,  /* the receive buffer has 50 bytes; what follows overwrites the message */
    ORIGINAL_WAIT_FOR_EVER = 1u << 3,   /* a line that is held at the start of a transfer stops the hub for ever */
    ORIGINAL_STALE_TIMESTAMP = 1u << 4, /* the timestamp is read before the interrupt that updates it */
};

/* One entry of the hub's list of boards. */
struct original_board_entry {
    uint8_t address;
    uint8_t taxels;
    uint8_t words; /* raw counts, and three accelerations of some fingertips */
};

struct original_settings {
    bool is_on;
    enum original_variant variant;
    enum original_message message;
    unsigned faults; /* bits of enum original_fault */
    double delay_ms;
    bool is_paced; /* the UART driver sends 8 bytes at most at a tick of 2 kHz, only if its FIFO is empty */
    uint16_t ring_size;
    double copy_us; /* time in which a board copies one raw count into its read buffer */
    /* read order; without the key `order`, the boards in the order of their lines */
    struct original_board_entry list[WORLD_BOARDS_MAX];
    size_t list_size;
    bool has_accelerations[TAXEL_ADDRESS_MAX + 1u]; /* of the board with this address: three words after its counts */
};

/* Read `protocol original key=value ...`. `scl_hz` and `baud` receive the clock rates of the line or their defaults.
 * Returns 0, or -1 after an error line on stderr. */
int original_settings_read(struct original_settings *settings, const struct world_line *line, double *scl_hz,
                           double *baud);

/* Complete the list of boards and check all boards, once the world file has described them. Returns 0, or -1 after an
 * error line on stderr that names the file `path`. */
int original_settings_complete(struct original_settings *settings, const struct board_description *boards,
                               size_t board_count, const char *path);

/* Return the number of words that the board with this address sends: raw counts of its `taxels`, and three
 * accelerations of some fingertips. */
unsigned original_settings_count_words(const struct original_settings *settings, uint8_t address, unsigned taxels);

/* Set the settings to those of a line without keys. */
void original_settings_set_defaults(struct original_settings *settings);

#endif
