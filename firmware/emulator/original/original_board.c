#include "emulator/original/original_board.h"

#include <string.h>

#include "generated/taxel_protocol.h"

/* Write the status word at the start of the read buffer. */
static void set_status(struct original_board *board, uint16_t status)
{
    taxel_put_u16(board->read_buffer, status);
}

/* Set up a board before its first reset. In a read the board sends a status word, then its raw counts and
 * accelerations, one word (2 bytes) each. original_settings_complete() has checked that these words fit into the read
 * buffer. With the fault `truncated_taxel` the length of a read does not include the status word, so the last word is
 * missing. */
void original_board_init(struct original_board *board, uint8_t address, uint8_t taxel_count,
                         const struct original_settings *settings)
{
    const bool is_truncated = (settings->faults & ORIGINAL_TRUNCATED_TAXEL) != 0;
    memset(board, 0, sizeof *board);
    board->taxel_count = taxel_count;
    board->has_accelerations = settings->has_accelerations[address];
    board->read_size =
        2u * original_settings_count_words(settings, address, taxel_count) + (is_truncated ? 0 : ORIGINAL_STATUS_SIZE);
    board->copy_time = (vtime)(settings->copy_us * (double)VTIME_US);
    board->conversion_end = board->copy_end = VTIME_NEVER;
}

/* Begin a scan of all taxels at virtual time `now`. */
static void start_scan(struct original_board *board, vtime now)
{
    board->is_scanning = true;
    board->scan_taxel = 0;
    board->conversion_end = now + board->conversion_time;
}

/* Start the next scan, then begin to copy the counts of the previous scan, which are in memory now, to the read
 * buffer. */
static void execute_request(struct original_board *board, vtime now)
{
    board->has_request = false;
    start_scan(board, now);
    board->is_copying = true;
    board->copy_taxel = 0;
    board->copy_end = now + board->copy_time;
}

/* Execute a start command that the main loop has found: set the status to not ready, and request counts. A running scan
 * is completed first. */
static void execute_command(struct original_board *board, vtime now)
{
    set_status(board, ORIGINAL_STATUS_NOT_READY);
    board->has_request = true;
    if (!board->is_scanning) {
        execute_request(board, now);
    }
}

/* Reset the board (power-up or reset): clear counts and buffers, and start the first scan at `now`. A board with
 * accelerations always sends x = y = 0 and gravity as z. conversion_time: of one taxel. */
void original_board_reset(struct original_board *board, vtime now, vtime conversion_time)
{
    memset(board->counts, 0, sizeof board->counts);
    memset(board->read_buffer, 0, sizeof board->read_buffer);
    if (board->has_accelerations) {
        const size_t z = ORIGINAL_STATUS_SIZE + 2u * (board->taxel_count + TAXEL_ORIGINAL_ACCELERATIONS - 1u);
        taxel_put_u16(board->read_buffer + z, ORIGINAL_GRAVITY);
    }
    board->conversion_time = conversion_time;
    board->read_position = 0;
    board->write_size = 0;
    board->is_copying = board->has_request = board->has_unread_command = board->has_unread_rewind = false;
    board->copy_end = VTIME_NEVER;
    start_scan(board, now);
}

/* Return when the next conversion or copy of a word ends; VTIME_NEVER if neither is in progress. */
vtime original_board_next_event(const struct original_board *board)
{
    return vtime_min(board->conversion_end, board->copy_end);
}

bool original_board_is_converting(const struct original_board *board)
{
    return board->conversion_end <= board->copy_end;
}

/* Store the raw count of the conversion that ends at board->conversion_end, and convert the next taxel. After the last
 * taxel, execute a waiting request. */
void original_board_on_conversion(struct original_board *board, uint16_t raw_count)
{
    const vtime now = board->conversion_end;
    board->counts[board->scan_taxel++] = raw_count;
    if (board->scan_taxel < board->taxel_count) {
        board->conversion_end = now + board->conversion_time;
        return;
    }
    board->scans++;
    board->is_scanning = false;
    board->conversion_end = VTIME_NEVER;
    if (board->has_request && !board->is_copying) {
        execute_request(board, now);
    }
}

/* Execute what arrived while the main loop was busy: the end of a read, which rewinds the read buffer; a start command;
 * or a request whose scan has ended meanwhile. */
static void poll_flags(struct original_board *board, vtime now)
{
    if (board->has_unread_rewind) {
        board->has_unread_rewind = false;
        board->read_position = 0;
    }
    if (board->has_unread_command) {
        board->has_unread_command = false;
        execute_command(board, now);
    } else if (board->has_request && !board->is_scanning) {
        execute_request(board, now);
    }
}

/* Copy one word at board->copy_end, from memory that the running scan overwrites. After the last word, set the status
 * to ready and let the main loop poll its flags. */
void original_board_copy_word(struct original_board *board)
{
    const vtime now = board->copy_end;
    const size_t taxel = board->copy_taxel++;
    taxel_put_u16(board->read_buffer + ORIGINAL_STATUS_SIZE + 2u * taxel, board->counts[taxel]);
    if (board->copy_taxel < board->taxel_count) {
        board->copy_end = now + board->copy_time;
        return;
    }
    board->is_copying = false;
    board->copy_end = VTIME_NEVER;
    set_status(board, ORIGINAL_STATUS_READY);
    poll_flags(board, now);
}

/* Begin a write or read of the I2C master. */
void original_board_on_address(struct original_board *board)
{
    board->write_size = 0;
}

/* Receive a byte from the I2C master. Returns whether it is acknowledged: the write buffer has one byte, so a further
 * byte is not. */
bool original_board_on_write(struct original_board *board, uint8_t byte)
{
    if (board->write_size++ == 0) {
        board->written = byte;
        return true;
    }
    return false;
}

/* Return the next byte of the read buffer, 0xFF after its end. */
uint8_t original_board_on_read(struct original_board *board)
{
    board->has_unread_rewind = true;
    return board->read_position < board->read_size ? board->read_buffer[board->read_position++] : 0xFF;
}

/* End a transfer of the I2C master: a write of exactly the start command becomes a command, and a read rewinds the
 * buffer. A busy main loop handles both later. */
void original_board_on_stop(struct original_board *board, vtime now)
{
    const bool is_command = board->write_size == 1u && board->written == ORIGINAL_START_COMMAND;
    board->reads += board->has_unread_rewind;
    board->has_unread_command = board->has_unread_command || is_command;
    board->write_size = 0;
    if (!board->is_copying) {
        poll_flags(board, now);
    }
}
