#include "emulator/world_file/world_reader.h"

/* Return the index of the board whose I2C address is word number `index` of the line, or -1 after an error line on
 * stderr. */
int world_reader_find_board(const struct world_reader *reader, int index)
{
    long address;
    if (world_line_read_integer(&reader->line, index, 0, 127, &address)) {
        return -1;
    }
    for (size_t i = 0; i < reader->world->board_count; i++) {
        if (reader->world->boards[i].address == address) {
            return (int)i;
        }
    }
    return world_line_report_error(&reader->line, "no board has that address");
}
