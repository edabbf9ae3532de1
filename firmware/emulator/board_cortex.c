#include "emulator/board_cortex.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "emulator/board_internal.h"
#include "emulator/base/reset_bits.h"

/* Apply the settings of this conversion, which the program has written to registers, to the front end. */
static void apply_conversion_settings(struct board_node *board, const struct psoc_conversion *conversion)
{
    const struct front_end_settings settings = {
        .conversion_clocks = conversion->period,
        .sense_clocks = conversion->sense,
        .modulator_divider = conversion->sample,
        .idac_code = conversion->idac_code,
    };
    if (front_end_apply_settings(&board->front_end, &settings, board->clock_rate) && board->electronics) {
        electronics_configure(board->electronics);
    }
}

/* Set the processor's clock rate from the drift of the board's clock at virtual time `now`. */
static void update_clock_rate(struct board_node *board, vtime now)
{
    if (board->clock_drift.amplitude != 0.0) {
        const double rate = clock_drift_factor(&board->clock_drift, (double)now / (double)VTIME_SECOND);
        psoc_set_clock_rate(board->psoc, board->clock_rate * rate);
    }
}

/* Compute the result of a conversion, as the number of sample clocks in which the current source was on; callback of
 * the board's chip. */
static uint16_t on_convert(void *context, const struct psoc_conversion *conversion)
{
    struct board_node *board = context;
    const int tx = conversion->tx, rx = conversion->rx;
    if (tx < 0 || rx < 0 || tx >= board->description->rows || rx >= board->description->columns) {
        return 0; /* without a crossing there is no charge to balance */
    }
    apply_conversion_settings(board, conversion);
    board->conversion_end = conversion->end;
    board->conversion_tx = (uint8_t)tx;
    board->conversion_rx = (uint8_t)rx;
    board->conversion_taxel = board->taxel_at[tx][rx];
    board->is_first_of_scan = board->conversion_taxel == 0;
    if (board->is_first_of_scan) {
        update_clock_rate(board, conversion->end);
    }
    const uint16_t raw = board_run_conversion(board);
    board->conversion_end = VTIME_NEVER;
    /* the raw count is the period minus the clocks of the current source */
    return raw < conversion->period ? (uint16_t)(conversion->period - raw) : 0;
}

/* Create the emulated processor of a board, which executes the firmware image instruction by instruction. Returns 0, or
 * -1 after an error line on stderr. */
int board_cortex_open(struct board_node *board, const struct world_description *world)
{
    char name[16];
    snprintf(name, sizeof name, "board 0x%02X", board->description->address);
    struct psoc_config config = {
        .name = name,
        .flash = &board->boot->flash,
        .part = board->description->part,
        .clock_rate = board->clock_rate,
        .seed = world->seed,
        .reset_time = board->boot->init_time,
        .wires = {.context = board, .convert = on_convert},
    };
    memcpy(config.unique_id, board->description->unique_id, sizeof config.unique_id);
    board->psoc = malloc(sizeof *board->psoc);
    if (!board->psoc || psoc_init(board->psoc, &config)) {
        fprintf(stderr, "%s: out of memory for its processor\n", name);
        return -1;
    }
    board->address = board->description->address;
    return 0;
}

/* Free the emulated chip of a board that executes an image; does nothing for a board with native firmware. */
void board_cortex_close(struct board_node *board)
{
    if (board->psoc) {
        psoc_free(board->psoc);
        free(board->psoc);
        board->psoc = NULL;
    }
}

/* Switch a board that executes an image off and, if `on`, on again at the virtual time `now`. reset_cause: enum
 * taxel_reset_cause. */
void board_cortex_set_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause)
{
    psoc_power_off(board->psoc);
    boot_node_power_off(board->boot, now);
    if (on) {
        psoc_power_on(board->psoc, now, reset_bits(reset_cause));
    }
}

/* Run the board's processor until a virtual time, with power cuts at their times. */
void board_cortex_advance(struct board_node *board, vtime until)
{
    while (board->is_powered) {
        /* read in each pass: a flash write in psoc_run() can schedule a cut */
        const vtime event = board_next_power_event(board);
        if (psoc_run(board->psoc, vtime_min(until, event))) {
            continue;
        }
        if (event > until) {
            return;
        }
        board_run_power_events(board, until);
    }
}
