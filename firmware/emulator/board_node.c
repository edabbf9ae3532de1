#include "emulator/board_node.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/board_cortex.h"
#include "emulator/board_parts.h"
#include "emulator/costs.h"

static vtime cycles(const struct board_node *board, unsigned count)
{
    return (vtime)(int64_t)(count * board->cycle);
}

static void on_front_end_configure(void *context, const struct taxel_scan_settings *settings)
{
    struct board_node *board = context;
    front_end_configure(&board->front_end, settings, board->clock_rate);
    if (board->electronics) {
        electronics_configure(board->electronics);
    }
}

/* Seconds that a clock which wanders is ahead of its mean rate. */
static double ahead(const struct board_node *board, vtime time)
{
    return clock_wander_ahead(&board->wander, (double)time / (double)VTIME_SECOND);
}

/* Of the interrupt that starts the conversion of a crossing, but for what it does afterwards. */
static unsigned start_cost(const struct board_node *board, uint16_t crossing, uint8_t tx)
{
    static const uint8_t division[TAXEL_LINES_MAX] = COST_QUOTIENT;
    const uint16_t settle_cycles = board->sensor.settings.settle_cycles;
    const unsigned skipped = board->begins_scan ? crossing : crossing - board->crossing - 1u;
    const unsigned cost = COST_CONVERSION + COST_SETTLE_LOOP * (settle_cycles / COST_SETTLE_LOOP + 1u) + division[tx] +
                          COST_SKIPPED_CROSSING * skipped + (tx != board->conversion_tx ? COST_NEW_TX : 0u);
    return board->begins_scan ? cost + COST_SCAN : cost;
}

/* SysTick cuts into whatever runs at [from, to): how much later that ends. */
static vtime tick_between(struct board_node *board, vtime from, vtime to)
{
    const vtime period = board->tick_period, length = board->tick_length;
    if (to - board->tick >= period) { /* a conversion is much shorter: seldom, and a step for the most part */
        board->tick = board->clock_zero + (to - board->clock_zero) / period * period;
    }
    const vtime last = board->tick;
    return last == board->clock_zero || last + length <= from ? 0 : last > from ? length : last + length - from;
}

static void on_conversion_start(void *context, uint8_t tx, uint8_t rx)
{
    struct board_node *board = context;
    const uint16_t crossing = (uint16_t)(tx * board->description->columns + rx);
    board->conversion_taxel = board->taxel_at[tx][rx];
    board->begins_scan = board->conversion_taxel == 0;
    const vtime busy = cycles(board, start_cost(board, crossing, tx));
    const vtime begin = board->interrupt + busy + tick_between(board, board->interrupt, board->interrupt + busy);
    vtime duration = begin - board->interrupt + board->front_end.conversion_time;
    board->cpu_free = begin + cycles(board, COST_AFTER_START + (board->begins_scan ? COST_AFTER_SCAN : 0u));
    board->crossing = crossing;
    board->conversion_tx = tx;
    board->conversion_rx = rx;
    if (board->wander.amplitude != 0.0) {
        if (board->begins_scan) {
            board->wander_rate = clock_wander_rate(&board->wander, (double)board->now / (double)VTIME_SECOND);
        }
        duration = (vtime)((double)duration / board->wander_rate);
    }
    board->conversion_end = board->interrupt + duration;
}

static uint32_t on_clock_us(void *context)
{
    const struct board_node *board = context;
    const double us = (double)(board->now - board->clock_zero) * board->clock_rate / (double)VTIME_US +
                      board->description->clock_start_us;
    if (board->wander.amplitude == 0.0) {
        return (uint32_t)(uint64_t)us;
    }
    return (uint32_t)(uint64_t)(us + 1e6 * (ahead(board, board->now) - ahead(board, board->clock_zero)));
}

static uint32_t on_interrupts_disable(void *context)
{
    (void)context; /* an emulated interrupt never cuts into another */
    return 0;
}

static void on_interrupts_restore(void *context, uint32_t state)
{
    (void)context;
    (void)state;
}

static void on_restart(void *context)
{
    ((struct board_node *)context)->restart_wanted = true;
}

static void on_enter_bootloader(void *context)
{
    struct board_node *board = context;
    board->boot->stay = true;
    board->restart_wanted = true;
}

static void fill_taxel_table(struct board_node *board)
{
    uint8_t taxel = 0;
    for (unsigned tx = 0; tx < board->description->rows; tx++) {
        for (unsigned rx = 0; rx < board->description->columns; rx++) {
            const unsigned crossing = tx * board->description->columns + rx;
            if ((board->description->crossing_map[crossing >> 3] >> (crossing & 7u)) & 1u) {
                board->taxel_at[tx][rx] = taxel++;
            }
        }
    }
}

/* What of the effects is this board's. Returns 0, or -1 without memory. */
static int open_effects(struct board_node *board, const struct world_description *world)
{
    const struct effects *effects = &world->effects;
    const uint8_t address = board->description->address;
    board->effects = effects;
    board->clock_rate += effects->clock.skew_ppm[board->index] * 1e-6;
    board->cycle = (double)VTIME_SECOND / CPU_HZ / board->clock_rate;
    board->tick_period = cycles(board, COST_TICK_PERIOD);
    board->tick_length = cycles(board, COST_TICK);
    board->wander = clock_wander_open(&effects->clock, board->index, world->seed, address);
    board->wander_rate = 1.0;
    silent_open(&board->contact, &effects->silent, board->index, world->seed, address);
    gain_apply(&effects->gain, board->index, world->parts_seed, address, &board->front_end);
    if (effects->late.delay[board->index] > 0.0) {
        board->fields.history = late_history_open(board->description->taxel_count, effects->late.delay[board->index]);
    }
    if (electronics_needed(world, board->index)) {
        board->electronics = electronics_open(world, board->index, &board->front_end);
        board->fields.watched = board->electronics && board->electronics->lines;
    }
    if ((effects->late.delay[board->index] > 0.0 && !board->fields.history) ||
        (electronics_needed(world, board->index) && !board->electronics)) {
        fprintf(stderr, "board 0x%02X: out of memory\n", address);
        return -1;
    }
    return 0;
}

void board_node_free(struct board_node *board)
{
    board_cortex_close(board);
    free(board->electronics);
    free(board->boot);
    board->boot = NULL;
    late_history_free(board->fields.history);
    board->electronics = NULL;
    board->fields.history = NULL;
}

int board_node_init(struct board_node *board, const struct board_description *description,
                    const struct world_description *world, const struct stimulus *stimulus, const struct skin *skin,
                    size_t index, size_t first_taxel, const struct droop_loads *loads)
{
    memset(board, 0, sizeof *board);
    board->power_back_at = VTIME_NEVER;
    board->description = description;
    board->index = index;
    board->fields = (struct board_fields){
        .stimulus = stimulus,
        .skin = skin,
        .source = exchange_board(&world->effects.exchange, index),
        .first_taxel = first_taxel,
        .taxels = description->taxel_count,
    };
    board->loads = loads;
    board->boot = malloc(sizeof *board->boot);
    if (!board->boot) {
        fprintf(stderr, "board 0x%02X: out of memory\n", description->address);
        return -1;
    }
    boot_node_init(board->boot, world, description);
    board->clock_rate = 1.0 + description->clock_ppm * 1e-6;
    board->conversion_end = VTIME_NEVER;
    board->compact_end = VTIME_NEVER;
    normals_init(&board->normals, world->seed, description->address);
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
        fprintf(stderr, "board 0x%02X: the firmware refuses its configuration (map, sizes or scan settings)\n",
                description->address);
        return -1;
    }
    if (description->image && board_cortex_open(board, world)) {
        return -1;
    }
    board_power(board, true, 0, TAXEL_RESET_CAUSE_POWER_ON);
    return 0;
}

static double rise_of(const void *source, size_t taxel, vtime time)
{
    return board_fields_rise(source, taxel, time);
}

static void rises_of(const void *source, vtime time, double *rise)
{
    board_fields_rises(source, time, rise);
}

uint16_t board_convert(struct board_node *board)
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
        .begins_scan = board->begins_scan,
        .time = middle,
        .powered = board->powered_at,
        .fraction = board_fields_fraction(fields, middle),
        .loads = board->loads,
        .rise = rise_of,
        .rises = rises_of,
        .source = fields,
        .still = fields->watched && board_fields_are_still(fields, middle),
        .fields = fields->number,
    };
    return electronics_convert(board->electronics, &conversion);
}

/* When an interrupt begins that is raised at `time`. One that waits for another follows it without leaving to the main program. */
static vtime from(const struct board_node *board, vtime time)
{
    return vtime_max(time, board->cpu_free > time ? board->cpu_free - cycles(board, COST_TAIL_CHAIN) : 0);
}

/* The CPU is busy with an interrupt: the main loop comes to its end so much later. */
static void delay_main_loop(struct board_node *board, vtime by)
{
    if (board->compact_end != VTIME_NEVER) {
        board->compact_end += by;
    }
}

/* The main loop begins with what there is to do, once the CPU is free. Coding takes time; exchanging buffers does not. */
static void start_main_loop(struct board_node *board)
{
    if (board->compact_end != VTIME_NEVER || board->runs != RUNS_APPLICATION || !taxel_sensor_has_work(&board->sensor)) {
        return;
    }
    const unsigned taxels = board->description->taxel_count;
    board->compact_end = board->cpu_free;
    if (!board->sensor.compact.ready) {
        board->compact_end += cycles(board, COST_COMPACT + COST_COMPACT_TAXEL * taxels);
    }
}

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

void board_advance(struct board_node *board, vtime until)
{
    if (!board->powered) {
        return;
    }
    if (board->psoc) {
        board_cortex_advance(board, until);
        return;
    }
    if (board->runs != RUNS_APPLICATION) {
        board_catch_up(board, until);
    }
    while (board->conversion_end <= until) {
        const vtime start = from(board, board->conversion_end);
        if (start > until) {
            return; /* the CPU is still busy with the bus */
        }
        run_main_loop(board, start);
        const uint16_t raw = board_convert(board);
        board->interrupt = board->now = start;
        board->cpu_free = start + cycles(board, COST_CONVERSION);
        board->conversion_end = VTIME_NEVER;
        taxel_sensor_on_conversion(&board->sensor, raw);
        delay_main_loop(board, board->cpu_free - start);
    }
    run_main_loop(board, until);
}

vtime board_enter(struct board_node *board, vtime now, unsigned cost)
{
    board_advance(board, now);
    board->interrupt = board->now = from(board, now);
    board->cpu_free = board->now + cycles(board, cost);
    delay_main_loop(board, board->cpu_free - board->now);
    return board->now;
}

vtime board_cycles(const struct board_node *board, unsigned count)
{
    return cycles(board, count);
}
