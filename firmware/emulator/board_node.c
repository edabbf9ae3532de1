#include "emulator/board_node.h"

#include <stdio.h>
#include <string.h>

#include "codec/crc32.h"
#include "emulator/costs.h"

#define CORRUPTED_BIT 0x10u

static const uint8_t firmware_version[3] = {0, 1, 0};

static vtime cycles(const struct board_node *board, unsigned count)
{
    return (vtime)(count / CPU_HZ / board->clock_rate * (double)VTIME_SECOND);
}

static void on_front_end_configure(void *context, const struct taxel_scan_settings *settings)
{
    struct board_node *board = context;
    front_end_configure(&board->front_end, settings, board->clock_rate);
}

static void on_conversion_start(void *context, uint8_t tx, uint8_t rx)
{
    struct board_node *board = context;
    board->conversion_taxel = board->taxel_at[tx][rx];
    board->conversion_end = board->now + board->front_end.settle_time + board->front_end.conversion_time;
}

static uint32_t on_clock_us(void *context)
{
    const struct board_node *board = context;
    return (uint32_t)(uint64_t)((double)(board->now - board->boot_end) * board->clock_rate / (double)VTIME_US);
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

int board_node_init(struct board_node *board, const struct board_description *description,
                    const struct world_description *world, const struct stimulus *stimulus, size_t first_taxel)
{
    memset(board, 0, sizeof *board);
    board->description = description;
    board->stimulus = stimulus;
    board->first_taxel = first_taxel;
    board->clock_rate = 1.0 + description->clock_ppm * 1e-6;
    board->conversion_end = VTIME_NEVER;
    random_init(&board->random, world->seed, description->address);
    front_end_init(&board->front_end, description->taxel_count, world->noise_counts, &board->random);
    fill_taxel_table(board);
    board->hal = (struct taxel_sensor_hal){
        .context = board,
        .front_end_configure = on_front_end_configure,
        .conversion_start = on_conversion_start,
        .clock_us = on_clock_us,
        .interrupts_disable = on_interrupts_disable,
        .interrupts_restore = on_interrupts_restore,
        .restart = on_restart,
        .enter_bootloader = on_restart,
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
    };
    memcpy(board->config.firmware_version, firmware_version, sizeof firmware_version);
    memcpy(board->config.unique_id, description->unique_id, sizeof description->unique_id);
    if (taxel_sensor_init(&board->sensor, &board->config)) {
        fprintf(stderr, "board 0x%02X: the firmware refuses its configuration (map, sizes or scan settings)\n",
                description->address);
        return -1;
    }
    board_power(board, true, 0, TAXEL_RESET_CAUSE_POWER_ON);
    return 0;
}

static void claim_map_version(struct board_node *board)
{
    uint8_t *identity = board->sensor.identity;
    if (board->description->map_version_override) {
        identity[TAXEL_IDENTITY_OFFSET_MAP_VERSION] = board->description->map_version_override;
        taxel_put_u32(identity + TAXEL_IDENTITY_OFFSET_CRC32, taxel_crc32(0, identity, TAXEL_IDENTITY_OFFSET_CRC32));
    }
}

void board_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause)
{
    board->powered = on;
    board->conversion_end = VTIME_NEVER;
    board->restart_wanted = false;
    board->hold_clocks = 0; /* a board without power, or at its start, lets go of the lines */
    board->stretch = 0;
    if (!on) {
        return;
    }
    board->boot_end = now + (vtime)(board->description->boot_ms * (double)VTIME_MS);
    board->now = board->boot_end;
    board->cpu_free = board->boot_end;
    board->config.reset_cause = reset_cause;
    (void)taxel_sensor_init(&board->sensor, &board->config); /* was valid at board_node_init() */
    claim_map_version(board);
    taxel_scan_start(&board->sensor);
}

static uint16_t convert(struct board_node *board)
{
    const size_t taxel = board->first_taxel + board->conversion_taxel;
    const vtime middle = board->conversion_end - board->front_end.conversion_time / 2u;
    const double value = stimulus_value(board->stimulus, taxel, middle);
    board->conversions++;
    if (board->stimulus->kind == STIMULUS_COUNTS) {
        return value >= 65535.0 ? 65535u : (uint16_t)(value + 0.5);
    }
    return front_end_convert(&board->front_end, board->conversion_taxel, value);
}

void board_advance(struct board_node *board, vtime until)
{
    if (!board->powered) {
        return;
    }
    while (board->conversion_end <= until) {
        const vtime start = vtime_max(board->conversion_end, board->cpu_free);
        if (start > until) {
            return; /* the CPU is still busy with the bus */
        }
        const uint16_t raw = convert(board);
        board->now = start + cycles(board, COST_CONVERSION_INTERRUPT);
        board->cpu_free = board->now;
        board->conversion_end = VTIME_NEVER;
        taxel_sensor_on_conversion(&board->sensor, raw);
    }
}

/* Begin an interrupt: the scan's interrupts up to now have run, and this one waits until the CPU is free. */
static vtime enter(struct board_node *board, vtime now, unsigned cost)
{
    board_advance(board, now);
    board->now = vtime_max(now, board->cpu_free) + cycles(board, cost);
    board->cpu_free = board->now;
    return board->now;
}

bool board_answers(const struct board_node *board, vtime now, uint8_t address)
{
    return board->powered && now >= board->boot_end && board->description->address == address;
}

vtime board_address(struct board_node *board, vtime now, bool reading, bool *acknowledge)
{
    if (board->nacks) {
        board->nacks--;
        *acknowledge = false;
        return now;
    }
    const vtime ready = enter(board, now, COST_SLAVE_ADDRESS) + board->stretch;
    board->stretch = 0;
    *acknowledge = taxel_sensor_on_address(&board->sensor, reading);
    return ready;
}

vtime board_write(struct board_node *board, vtime now, uint8_t byte, bool *acknowledge)
{
    (void)enter(board, now, COST_SLAVE_BYTE);
    *acknowledge = taxel_sensor_on_write(&board->sensor, byte);
    return now; /* the slave's FIFO takes it: no stretching */
}

vtime board_read(struct board_node *board, vtime now, uint8_t *byte)
{
    (void)enter(board, now, COST_SLAVE_BYTE);
    *byte = taxel_sensor_on_read(&board->sensor);
    if (board->corrupt_bytes) {
        board->corrupt_bytes--;
        *byte ^= CORRUPTED_BIT;
    }
    return now;
}

void board_stop(struct board_node *board, vtime now)
{
    (void)enter(board, now, COST_SLAVE_STOP);
    taxel_sensor_on_stop(&board->sensor);
    if (board->restart_wanted) {
        board_power(board, true, now, TAXEL_RESET_CAUSE_COMMAND);
    }
}
