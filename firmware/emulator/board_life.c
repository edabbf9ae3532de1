/* A board's power, its boot, and which program runs on it. */
#include <string.h>

#include "codec/crc32.h"
#include "emulator/board_cortex.h"
#include "emulator/board_parts.h"
#include "emulator/costs.h"

#define CONFIRM_SCANS 10u /* of an image on trial, and one snapshot that was read */

static void claim_map_version(struct board_node *board)
{
    uint8_t *identity = board->sensor.identity;
    if (board->description->map_version_override) {
        identity[TAXEL_IDENTITY_OFFSET_MAP_VERSION] = board->description->map_version_override;
        taxel_put_u32(identity + TAXEL_IDENTITY_OFFSET_CRC32, taxel_crc32(0, identity, TAXEL_IDENTITY_OFFSET_CRC32));
    }
}

static void start_application(struct board_node *board)
{
    const struct boot_node *boot = board->boot;
    const vtime rest = (vtime)(board->description->boot_ms * (double)VTIME_MS) - boot->init_time;
    board->runs = RUNS_APPLICATION;
    board->has_confirmed = false;
    board->flash_until = 0;
    board->boot_end = boot->now + rest;
    board->clock_zero = board->tick = board->boot_end - board_cycles(board, COST_SENSOR_INIT);
    board->interrupt = board->now = board->boot_end;
    board->cpu_free = board->boot_end;
    board->config.reset_cause = boot->cause;
    board->config.address = board->address = boot_node_address(boot);
    board->config.kind = boot_node_kind(boot);
    memcpy(board->config.firmware_version, boot_node_version(boot), sizeof board->config.firmware_version);
    (void)taxel_sensor_init(&board->sensor, &board->config); /* was valid at board_node_init() */
    claim_map_version(board);
    taxel_scan_start(&board->sensor);
}

void board_after_boot(struct board_node *board, enum boot_node_outcome outcome)
{
    board->conversion_end = VTIME_NEVER;
    board->compact_end = VTIME_NEVER;
    switch (outcome) {
    case BOOT_NODE_STARTS:
        start_application(board);
        break;
    case BOOT_NODE_HANGS:
        board->runs = RUNS_NOTHING;
        board->watchdog_at = board->boot->now + BOOT_NODE_WATCHDOG;
        break;
    case BOOT_NODE_RESTARTS:
        board_power(board, true, board->boot->now, TAXEL_RESET_CAUSE_COMMAND);
        break;
    default:
        board->runs = RUNS_BOOTLOADER;
        break;
    }
}

void board_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause)
{
    board->powered = on;
    board->conversion_end = VTIME_NEVER;
    board->compact_end = VTIME_NEVER;
    board->restart_wanted = false;
    board->hold_clocks = 0; /* a board without power, or at its start, lets go of the lines */
    board->scl_held_until = 0;
    board->stretch = 0;
    if (board->psoc) {
        if (on && reset_cause == TAXEL_RESET_CAUSE_POWER_ON) {
            board->powered_at = now;
        }
        board_cortex_power(board, on, now, reset_cause);
        return;
    }
    if (!on) {
        boot_node_power_off(board->boot, now);
        return;
    }
    if (reset_cause == TAXEL_RESET_CAUSE_POWER_ON) {
        board->powered_at = now;
    }
    board->address = boot_node_address(board->boot);
    board_after_boot(board, boot_node_reset(board->boot, now, reset_cause));
}

vtime board_power_event(const struct board_node *board)
{
    return vtime_min(board->boot->flash.cut_at, board->power_back_at);
}

void board_power_events(struct board_node *board, vtime until)
{
    while (board_power_event(board) <= until) {
        const vtime now = board_power_event(board);
        const bool is_back = now == board->power_back_at;
        board->power_back_at = is_back ? VTIME_NEVER : now + board->boot->flash.off;
        board_power(board, is_back, now, TAXEL_RESET_CAUSE_POWER_ON);
    }
}

void board_catch_up(struct board_node *board, vtime until)
{
    for (;;) {
        board_power_events(board, until);
        if (!board->powered) {
            return;
        }
        if (board->runs == RUNS_BOOTLOADER && boot_node_deadline(board->boot) <= until) {
            board_after_boot(board, boot_node_run(board->boot, boot_node_deadline(board->boot)));
        } else if (board->runs == RUNS_NOTHING && board->watchdog_at <= until) {
            board_power(board, true, board->watchdog_at, TAXEL_RESET_CAUSE_WATCHDOG);
        } else {
            return;
        }
    }
}

void board_confirm(struct board_node *board, vtime now)
{
    if (board->has_confirmed || board->sensor.scan.scans < CONFIRM_SCANS || !board->sensor.slave.snapshot_reads) {
        return;
    }
    board->has_confirmed = true;
    board->flash_until = boot_node_confirm(board->boot, now);
    board->cpu_free = vtime_max(board->cpu_free, board->flash_until);
}
