/* The firmware of an original board: one raw count per taxel, a read buffer of a status word and the counts, and a
 * start by general call.
 *
 *     offset 0: status, little-endian: 0xFFFE ready, 0x0000 not ready
 *     offset 2 + 2 i: raw count of taxel i, little-endian
 *     then, on some fingertips: accelerations x, y, z, signed; here constant, gravity along z
 *     0xFF after the end of the buffer
 *
 * A write of exactly one byte 0x01 clears the status and requests counts. When the converter is idle, the board starts
 * the next scan, then copies the counts of the previous scan into the read buffer and sets the status. The counts are
 * therefore those of the scan that the previous request started, and the copy runs beside the new scan without guard.
 *
 * The port (board_original.c) executes the events in order of time: while original_board_next_event() is due, it calls
 * original_board_on_conversion() with the raw count if original_board_is_converting() returns true, else
 * original_board_copy_word(). */
#ifndef EMULATOR_ORIGINAL_ORIGINAL_BOARD_H
#define EMULATOR_ORIGINAL_ORIGINAL_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/base/vtime.h"
#include "emulator/original/original_settings.h"

#define ORIGINAL_STATUS_READY 0xFFFEu
#define ORIGINAL_STATUS_NOT_READY 0x0000u
#define ORIGINAL_START_COMMAND 0x01u
#define ORIGINAL_STATUS_SIZE 2u
#define ORIGINAL_READ_SIZE_MAX (ORIGINAL_STATUS_SIZE + 2u * ORIGINAL_WORDS_MAX)
#define ORIGINAL_GRAVITY 256 /* of an acceleration; scale of the later sources */

struct original_board {
    uint8_t taxel_count;
    bool has_accelerations;
    size_t read_size;      /* bytes of the read buffer that the SCB sends */
    vtime conversion_time; /* of one taxel */
    vtime copy_time;       /* of one word */
    uint16_t counts[ORIGINAL_WORDS_MAX];
    uint8_t read_buffer[ORIGINAL_READ_SIZE_MAX];
    size_t read_position;
    unsigned write_size; /* bytes of the present write */
    uint8_t written;     /* its first byte */
    bool is_scanning;
    bool is_copying;         /* the main loop is busy: it polls the flags of the SCB afterwards */
    bool has_request;        /* counts are requested while the converter scans */
    bool has_unread_command; /* a command arrived while the main loop was busy */
    bool has_unread_rewind;  /* a read ended while the main loop was busy */
    uint8_t scan_taxel, copy_taxel;
    vtime conversion_end, copy_end; /* of the present taxel and word; VTIME_NEVER: none */
    uint32_t scans, reads;
};

/* Set up a board before its first reset. */
void original_board_init(struct original_board *board, uint8_t address, uint8_t taxel_count,
                         const struct original_settings *settings);

/* Power up or reset the board. The first scan starts at `now`. */
void original_board_reset(struct original_board *board, vtime now, vtime conversion_time);

/* Return when the next conversion or copy of a word ends. */
vtime original_board_next_event(const struct original_board *board);

/* Return whether the next event is the end of a conversion, of taxel board->scan_taxel. */
bool original_board_is_converting(const struct original_board *board);

/* Process the end of a conversion, with its raw count, or of the copy of a word. */
void original_board_on_conversion(struct original_board *board, uint16_t raw_count);
void original_board_copy_word(struct original_board *board);

/* Process the bytes of an I2C transfer and its stop condition. on_write() returns whether the byte is acknowledged. */
void original_board_on_address(struct original_board *board);
bool original_board_on_write(struct original_board *board, uint8_t byte);
uint8_t original_board_on_read(struct original_board *board);
void original_board_on_stop(struct original_board *board, vtime now);

#endif
