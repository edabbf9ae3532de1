#include "emulator/board_node.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/board_cortex.h"
#include "emulator/board_original.h"
#include "emulator/board_internal.h"
#include "emulator/base/costs.h"

/* Set up front end and electronics with new scan settings; HAL function of the emulated board. */
static void on_front_end_configure(void *context, const struct taxel_scan_settings *settings)
{
    struct board_node *board = context;
    front_end_configure(&board->front_end, settings, board->clock_rate);
    if (board->electronics) {
        electronics_configure(board->electronics);
    }
}

/* Return the seconds by which the drifting clock of the board leads a clock of constant rate at a virtual time. */
static double compute_clock_drift_lead_s(const struct board_node *board, vtime time)
{
    return clock_drift_offset(&board->clock_drift, (double)time / (double)VTIME_SECOND);
}

/* Return the CPU cycles from the entry of the interrupt that starts a conversion up to the start of this conversion.
 * COST_...: cycles of parts of the firmware, counted in executed images (costs.h). The firmware divides `crossing` by
 * the number of columns, which takes a time that depends on the quotient `tx`, and skips crossings without a taxel one
 * by one. */
static unsigned compute_conversion_start_cycles(const struct board_node *board, uint16_t crossing, uint8_t tx)
{
    static const uint8_t division_cycles[TAXEL_LINES_MAX] = COST_QUOTIENT;
    const uint16_t settle_cycles = board->sensor.settings.settle_cycles;
    const unsigned skipped = board->is_first_of_scan ? crossing : crossing - board->crossing - 1u;
    const unsigned cost = COST_CONVERSION + COST_SETTLE_LOOP * (settle_cycles / COST_SETTLE_LOOP + 1u) +
                          division_cycles[tx] + COST_SKIPPED_CROSSING * skipped +
                          (tx != board->conversion_tx ? COST_NEW_TX : 0u);
    return board->is_first_of_scan ? cost + COST_SCAN : cost;
}

/* Return the virtual time by which an interrupt of the timer SysTick delays code that runs from `from` to `to`; 0 if no
 * interrupt falls into this time. An interrupt that began before `from` delays the code by its remaining time. */
static vtime compute_systick_delay(struct board_node *board, vtime from, vtime to)
{
    const vtime period = board->tick_period, length = board->tick_length;
    if (to - board->last_tick >= period) { /* rarely true, because a conversion is much shorter than the period */
        board->last_tick = board->clock_origin + (to - board->clock_origin) / period * period;
    }
    const vtime last = board->last_tick;
    return last == board->clock_origin || last + length <= from ? 0 : last > from ? length : last + length - from;
}

/* Start a conversion; HAL function of the emulated board. Schedules the end of the conversion from the processor time
 * until its start, interrupts of the system tick, and the drift of the board's clock. */
static void on_conversion_start(void *context, uint8_t tx, uint8_t rx)
{
    struct board_node *board = context;
    const uint16_t crossing = (uint16_t)(tx * board->description->columns + rx);
    board->conversion_taxel = board->taxel_at[tx][rx];
    board->is_first_of_scan = board->conversion_taxel == 0;
    const vtime busy = board_cycles_to_time(board, compute_conversion_start_cycles(board, crossing, tx));
    const vtime begin = board->interrupt_begin + busy +
                        compute_systick_delay(board, board->interrupt_begin, board->interrupt_begin + busy);
    vtime duration = begin - board->interrupt_begin + board->front_end.conversion_time;
    board->cpu_free =
        begin + board_cycles_to_time(board, COST_AFTER_START + (board->is_first_of_scan ? COST_AFTER_SCAN : 0u));
    board->crossing = crossing;
    board->conversion_tx = tx;
    board->conversion_rx = rx;
    if (board->clock_drift.amplitude != 0.0) {
        if (board->is_first_of_scan) {
            board->clock_drift_rate =
                clock_drift_factor(&board->clock_drift, (double)board->now / (double)VTIME_SECOND);
        }
        duration = (vtime)((double)duration / board->clock_drift_rate);
    }
    board->conversion_end = board->interrupt_begin + duration;
}

/* Return the board's clock in microseconds, with its rate error and drift; HAL function of the emulated board. */
static uint32_t on_clock_us(void *context)
{
    const struct board_node *board = context;
    const double us = (double)(board->now - board->clock_origin) * board->clock_rate / (double)VTIME_US +
                      board->description->clock_start_us;
    if (board->clock_drift.amplitude == 0.0) {
        return (uint32_t)(uint64_t)us;
    }
    const double lead_s =
        compute_clock_drift_lead_s(board, board->now) - compute_clock_drift_lead_s(board, board->clock_origin);
    return (uint32_t)(uint64_t)(us + 1e6 * lead_s);
}

/* Do nothing and return 0; HAL function of the emulated board. */
static uint32_t on_interrupts_disable(void *context)
{
    (void)context; /* emulated interrupts do not preempt each other */
    return 0;
}

/* Do nothing; HAL function of the emulated board. */
static void on_interrupts_restore(void *context, uint32_t state)
{
    (void)context;
    (void)state;
}

/* Request a restart, which the event loop makes; HAL function of the emulated board. */
static void on_restart(void *context)
{
    ((struct board_node *)context)->restart_requested = true;
}

/* Request a restart into the bootloader, which the event loop makes; HAL function of the emulated board. */
static void on_enter_bootloader(void *context)
{
    struct board_node *board = context;
    board->boot->stay_requested = true;
    board->restart_requested = true;
}

/* Fill the table of taxel indices by TX and RX line: taxels are numbered in the order of the bits set in the crossing
 * map. */
static void fill_taxel_table(struct board_node *board)
{
    uint8_t taxel = 0;
    for (unsigned tx = 0; tx < board->description->rows; tx++) {
        for (unsigned rx = 0; rx < board->description->columns; rx++) {
            const unsigned crossing = tx * board->description->columns + rx;
            if ((board->description->crossing_map[crossing >> 3] >> (crossing & 7u)) & 1u) {
                board->tx_of_taxel[taxel] = (uint8_t)tx;
                board->rx_of_taxel[taxel] = (uint8_t)rx;
                board->taxel_at[tx][rx] = taxel++;
            }
        }
    }
}

/* Set up the effects of this board. Returns 0, or -1 if out of memory. */
static int open_effects(struct board_node *board, const struct world_description *world)
{
    const struct effects *effects = &world->effects;
    const uint8_t address = board->description->address;
    board->effects = effects;
    board->clock_rate += effects->clock.skew_ppm[board->board_index] * 1e-6;
    board->cycle = (double)VTIME_SECOND / CPU_HZ / board->clock_rate;
    board->tick_period = board_cycles_to_time(board, COST_TICK_PERIOD);
    board->tick_length = board_cycles_to_time(board, COST_TICK);
    board->clock_drift = clock_drift_open(&effects->clock, board->board_index, world->seed, address);
    board->clock_drift_rate = 1.0;
    silent_open(&board->contact, &effects->silent, board->board_index, world->seed, address);
    gain_apply(&effects->gain, board->board_index, world->parts_seed, address, &board->front_end);
    if (effects->late.delay[board->board_index] > 0.0) {
        board->fields.history =
            late_history_open(board->description->taxel_count, effects->late.delay[board->board_index]);
    }
    if (electronics_are_needed(world, board->board_index)) {
        board->electronics = electronics_open(world, board->board_index, &board->front_end);
        board->fields.tracks_changes = board->electronics && board->electronics->couples_crossings;
    }
    if ((effects->late.delay[board->board_index] > 0.0 && !board->fields.history) ||
        (electronics_are_needed(world, board->board_index) && !board->electronics)) {
        fprintf(stderr, "board 0x%02X: out of memory for its effects\n", address);
        return -1;
    }
    return 0;
}

/* Free the memory of a board. */
void board_node_free(struct board_node *board)
{
    board_cortex_close(board);
    board_original_close(board);
    free(board->electronics);
    free(board->boot);
    board->boot = NULL;
    late_history_free(board->fields.history);
    board->electronics = NULL;
    board->fields.history = NULL;
}

/* Create a board of the world and power it on. `board_index`: index in the world; `first_taxel`: index of its first
 * taxel in the stimulus; `loads`: TX loads of all boards, for voltage droop. Returns 0, or -1 after an error line on
 * stderr. */
int board_node_init(struct board_node *board, const struct board_description *description,
                    const struct world_description *world, const struct stimulus *stimulus, const struct skin *skin,
                    size_t board_index, size_t first_taxel, const struct droop_loads *loads)
{
    memset(board, 0, sizeof *board);
    board->power_return_time = VTIME_NEVER;
    board->description = description;
    board->board_index = board_index;
    board->fields = (struct board_fields){
        .stimulus = stimulus,
        .skin = skin,
        .source = exchange_source_board(&world->effects.exchange, board_index),
        .first_taxel = first_taxel,
        .taxels = description->taxel_count,
    };
    board->loads = loads;
    board->boot = malloc(sizeof *board->boot);
    if (!board->boot) {
        fprintf(stderr, "board 0x%02X: out of memory for its flash\n", description->address);
        return -1;
    }
    boot_node_init(board->boot, world, description);
    board->clock_rate = 1.0 + description->clock_ppm * 1e-6;
    board->conversion_end = VTIME_NEVER;
    board->compact_end = VTIME_NEVER;
    board->watchdog_at = board->stalled_at = VTIME_NEVER;
    normal_source_init(&board->normals, world->seed, description->address);
    front_end_init(&board->front_end, description->taxel_count, world->noise_counts, &board->normals);
    fill_taxel_table(board);
    if (open_effects(board, world)) {
        return -1;
    }
    board->hal = (struct taxel_sensor_hal){
        .context = board,
        .front_end_configure = on_front_end_configure,
        .conversion_start = on_conversion_start,
        .clock_us = on_clock_us,
        .interrupts_disable = on_interrupts_disable,
        .interrupts_restore = on_interrupts_restore,
        .restart = on_restart,
        .enter_bootloader = on_enter_bootloader,
    };
    board->config = (struct taxel_sensor_config){
        .hal = &board->hal,
        .address = description->address,
        .kind = description->kind,
        .rows = description->rows,
        .columns = description->columns,
        .taxel_count = description->taxel_count,
        .crossing_map = description->crossing_map,
        .fault_record = board->fault_record,
        .settings = world->scan,
        .snapshots = {board->snapshots[0], board->snapshots[1], board->snapshots[2]},
        .compact =
            {
                .states = board->compact_states,
                .residuals = board->compact_residuals,
                .buffers = {board->compact_buffers[0], board->compact_buffers[1]},
            },
    };
    memcpy(board->config.firmware_version, description->firmware_version, sizeof description->firmware_version);
    memcpy(board->config.unique_id, description->unique_id, sizeof description->unique_id);
    if (taxel_sensor_init(&board->sensor, &board->config)) {
        fprintf(stderr,
                "board 0x%02X: the firmware rejects its crossing map, its lines and taxels, or the scan settings\n",
                description->address);
        return -1;
    }
    if (description->image && board_cortex_open(board, world)) {
        return -1;
    }
    if (world->original.is_on && board_original_open(board, world)) {
        return -1;
    }
    board_set_power(board, true, 0, TAXEL_RESET_CAUSE_POWER_ON);
    return 0;
}

/* Return the relative rise of the capacitance of one taxel at a virtual time; callback of the electronics. context: the
 * board's fields. */
static double get_rise(const void *context, size_t taxel, vtime time)
{
    return board_fields_rise(context, taxel, time);
}

/* Write the relative rises of the capacitance of all taxels at a virtual time to `rise`; callback of the
 * electronics. */
static void get_all_rises(const void *context, vtime time, double *rise)
{
    board_fields_all_rises(context, time, rise);
}

/* Return the raw count of the conversion that ends now, with the fields in the middle of the conversion. A stimulus in
 * counts is returned directly. */
uint16_t board_run_conversion(struct board_node *board)
{
    const vtime middle = board->conversion_end - board->front_end.conversion_time / 2u;
    const struct board_fields *fields = &board->fields;
    board->conversions++;
    if (fields->stimulus->kind == STIMULUS_COUNTS) {
        const double value = stimulus_value(fields->stimulus, fields->first_taxel + board->conversion_taxel, middle);
        return value >= 65535.0 ? 65535u : (uint16_t)(value + 0.5);
    }
    if (!board->electronics) {
        const double rise = board_fields_rise(fields, board->conversion_taxel, middle);
        return front_end_convert(&board->front_end, board->conversion_taxel, rise);
    }
    const struct electronics_conversion conversion = {
        .tx = board->conversion_tx,
        .rx = board->conversion_rx,
        .is_first_of_scan = board->is_first_of_scan,
        .time = middle,
        .power_on_time = board->power_on_time,
        .fraction = board_fields_fraction(fields, middle),
        .loads = board->loads,
        .get_rise = get_rise,
        .get_all_rises = get_all_rises,
        .rise_context = fields,
        .fields_are_constant = fields->tracks_changes && board_fields_are_constant(fields, middle),
        .change_count = fields->change_count,
    };
    return electronics_convert(board->electronics, &conversion);
}

/* Return the virtual time at which an interrupt that is raised at `time` begins: at once if the CPU is free. Otherwise
 * it begins when the CPU is free, less the cycles that tail-chaining saves, because the CPU does not return to the main
 * program between two interrupts. */
static vtime interrupt_begin_time(const struct board_node *board, vtime time)
{
    return vtime_max(time, board->cpu_free > time ? board->cpu_free - board_cycles_to_time(board, COST_TAIL_CHAIN) : 0);
}

/* Delay the work of the main loop, the coding of a compact snapshot that ends at compact_end, by the duration of an
 * interrupt. */
static void delay_main_loop(struct board_node *board, vtime duration)
{
    if (board->compact_end != VTIME_NEVER) {
        board->compact_end += duration;
    }
}

/* Start pending work of the main loop once the CPU is free. Coding a compact snapshot takes time; exchanging
 * buffers does not. */
static void start_main_loop(struct board_node *board)
{
    if (board->compact_end != VTIME_NEVER || board->program != PROGRAM_APPLICATION ||
        !taxel_sensor_has_work(&board->sensor)) {
        return;
    }
    const unsigned taxels = board->description->taxel_count;
    board->compact_end = board->cpu_free;
    if (!board->sensor.compact.work_ready) {
        board->compact_end += board_cycles_to_time(board, COST_COMPACT + COST_COMPACT_TAXEL * taxels);
    }
}

/* Run the firmware's main loop until a virtual time. Each pass is executed as a whole, at the virtual time at which the
 * processor would have finished its work, the coding of a compact snapshot. */
static void run_main_loop(struct board_node *board, vtime until)
{
    start_main_loop(board);
    while (board->compact_end <= until) {
        board->now = board->compact_end;
        board->compact_end = VTIME_NEVER;
        taxel_sensor_run(&board->sensor);
        start_main_loop(board);
    }
}

/* Advance the board to a virtual time: conversions, their interrupts and the main loop. An interrupt waits while the
 * CPU is busy with the bus. */
void board_advance(struct board_node *board, vtime until)
{
    if (!board->is_powered) {
        return;
    }
    if (board->psoc) {
        board_cortex_advance(board, until);
        return;
    }
    if (board->original) {
        board_original_advance(board, until);
        return;
    }
    board_run_stall(board, until);
    if (board->program != PROGRAM_APPLICATION) {
        board_advance_bootloader(board, until);
    }
    while (board->conversion_end <= until) {
        const vtime start = interrupt_begin_time(board, board->conversion_end);
        if (start > until) {
            return; /* the CPU is still busy with the bus */
        }
        run_main_loop(board, start);
        const uint16_t raw = board_run_conversion(board);
        board->interrupt_begin = board->now = start;
        board->cpu_free = start + board_cycles_to_time(board, COST_CONVERSION);
        board->conversion_end = VTIME_NEVER;
        taxel_sensor_on_conversion(&board->sensor, raw);
        delay_main_loop(board, board->cpu_free - start);
    }
    run_main_loop(board, until);
}

/* Begin an interrupt of the board's CPU that takes this number of cycles. Returns its start, which is delayed while
 * another interrupt runs. */
vtime board_begin_interrupt(struct board_node *board, vtime now, unsigned cycles)
{
    board_advance(board, now);
    board->interrupt_begin = board->now = interrupt_begin_time(board, now);
    board->cpu_free = board->now + board_cycles_to_time(board, cycles);
    delay_main_loop(board, board->cpu_free - board->now);
    return board->now;
}
