/* The power of a board, its boot, and the program that runs on it. */
#include <string.h>

#include "codec/crc32.h"
#include "emulator/board_cortex.h"
#include "emulator/board_internal.h"
#include "emulator/board_original.h"
#include "emulator/base/costs.h"

#define STALL_TIME (TAXEL_SCAN_STALL_US * VTIME_US + VTIME_MS) /* with a margin for the rate of the board's clock */
#define CONFIRM_SCANS 10u /* an image on trial is confirmed after these scans and one snapshot that was read */

/* Set the register-map version that the world file prescribes, for tests of incompatible boards. */
static void override_map_version(struct board_node *board)
{
    uint8_t *identity = board->sensor.identity;
    if (board->description->map_version_override) {
        identity[TAXEL_IDENTITY_OFFSET_MAP_VERSION] = board->description->map_version_override;
        taxel_put_u32(identity + TAXEL_IDENTITY_OFFSET_CRC32, taxel_crc32(0, identity, TAXEL_IDENTITY_OFFSET_CRC32));
    }
}

/* Start the board's application after the bootloader, with configuration and version from the flash. The board scans
 * from the end of its boot time on. */
static void start_application(struct board_node *board)
{
    const struct boot_node *boot = board->boot;
    const vtime application_boot_time = (vtime)(board->description->boot_ms * (double)VTIME_MS) - boot->init_time;
    board->program = PROGRAM_APPLICATION;
    board->has_confirmed = false;
    board->flash_busy_until = 0;
    board->boot_end = boot->now + application_boot_time;
    board->clock_origin = board->last_tick = board->boot_end - board_cycles_to_time(board, COST_SENSOR_INIT);
    board->interrupt_begin = board->now = board->boot_end;
    board->cpu_free = board->boot_end;
    board->config.reset_cause = boot->reset_cause;
    board->config.address = board->address = boot_node_get_address(boot);
    board->config.kind = boot_node_get_kind(boot);
    memcpy(board->config.firmware_version, boot_node_get_version(boot), sizeof board->config.firmware_version);
    (void)taxel_sensor_init(&board->sensor, &board->config); /* board_node_init() has checked the configuration */
    override_map_version(board);
    taxel_scan_start(&board->sensor);
}

/* Continue after the bootloader has run: start the application, hang until the watchdog resets the board, restart, or
 * stay in the bootloader. */
void board_handle_boot_outcome(struct board_node *board, enum boot_outcome outcome)
{
    board->conversion_end = VTIME_NEVER;
    board->compact_end = VTIME_NEVER;
    switch (outcome) {
    case BOOT_STARTS_IMAGE:
        start_application(board);
        break;
    case BOOT_STARTS_HANGING_IMAGE:
        board->program = PROGRAM_HANGING;
        board->watchdog_at = board->boot->now + BOOT_NODE_WATCHDOG_TIME;
        break;
    case BOOT_RESTARTS:
        board_set_power(board, true, board->boot->now, TAXEL_RESET_CAUSE_COMMAND);
        break;
    default:
        board->program = PROGRAM_BOOTLOADER;
        break;
    }
}

/* Store a fault in the record that a host reads after the reset. */
static void store_fault(struct board_node *board, const struct taxel_fault_record *fault)
{
    struct taxel_fault_record record = *fault;
    record.count = (uint16_t)(taxel_get_u16(board->fault_record + TAXEL_FAULT_RECORD_OFFSET_COUNT) + 1u);
    taxel_fault_record_pack(&record, board->fault_record);
}

/* Lose the interrupt of the conversion in progress: the scan stalls until the watchdog resets the board. */
void board_lose_conversion(struct board_node *board, vtime now)
{
    if (board->psoc) {
        psoc_lose_conversion(board->psoc);
    } else if (!board->original && board->program == PROGRAM_APPLICATION && board->conversion_end != VTIME_NEVER) {
        board->conversion_end = VTIME_NEVER;
        board->now = now;
        (void)taxel_scan_check(&board->sensor); /* the last check that finds progress; it feeds the watchdog */
        board->stalled_at = now + STALL_TIME;
        board->watchdog_at = now + BOOT_NODE_WATCHDOG_TIME;
    }
}

/* Let the processor of a board take a HardFault: the board does not respond until the watchdog resets it. A native
 * application stores a fault record with the given registers; an executed image has its own registers. Original boards
 * and native bootloaders ignore the fault. */
void board_take_hard_fault(struct board_node *board, vtime now, uint32_t program_counter, uint32_t link_register)
{
    if (board->psoc) {
        psoc_inject_hard_fault(board->psoc);
    } else if (!board->original && board->program == PROGRAM_APPLICATION) {
        store_fault(board, &(struct taxel_fault_record){.code = TAXEL_FAULT_CODE_EXCEPTION,
                                                        .exception = CORTEX_M0_HARD_FAULT,
                                                        .program_counter = program_counter,
                                                        .link_register = link_register});
        board->program = PROGRAM_HANGING;
        board->conversion_end = board->compact_end = board->stalled_at = VTIME_NEVER;
        board->watchdog_at = now + BOOT_NODE_WATCHDOG_TIME;
    }
}

/* Store the fault of an application whose scan has stalled, and reset the board by its watchdog, if these are due by
 * `until`. */
void board_run_stall(struct board_node *board, vtime until)
{
    if (board->program == PROGRAM_APPLICATION && board->stalled_at <= until) {
        board->now = board->stalled_at;
        board->stalled_at = VTIME_NEVER;
        if (taxel_scan_check(&board->sensor) == TAXEL_SCAN_STALLED) {
            store_fault(board, &(struct taxel_fault_record){.code = TAXEL_FAULT_CODE_NOT_SCANNING});
        }
    }
    if (board->program == PROGRAM_APPLICATION && board->watchdog_at <= until) {
        board_set_power(board, true, board->watchdog_at, TAXEL_RESET_CAUSE_WATCHDOG);
    }
}

/* Switch a board's power off (`on` false), or reset the board (`on` true), at virtual time `now`. All pending
 * conversions and held lines end. reset_cause: enum taxel_reset_cause. */
void board_set_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause)
{
    board->is_powered = on;
    board->watchdog_at = board->stalled_at = VTIME_NEVER;
    if (!on || reset_cause == TAXEL_RESET_CAUSE_POWER_ON || reset_cause == TAXEL_RESET_CAUSE_BROWN_OUT) {
        memset(board->fault_record, 0, sizeof board->fault_record);
    }
    board->conversion_end = VTIME_NEVER;
    board->compact_end = VTIME_NEVER;
    board->restart_requested = false;
    board->sda_hold_clocks = 0; /* a board without power or after a reset releases the lines */
    board->scl_held_until = 0;
    board->address_stretch = 0;
    if (board->psoc || board->original) {
        if (on && reset_cause == TAXEL_RESET_CAUSE_POWER_ON) {
            board->power_on_time = now;
        }
        if (board->psoc) {
            board_cortex_set_power(board, on, now, reset_cause);
        } else {
            board_original_set_power(board, on, now);
        }
        return;
    }
    if (!on) {
        boot_node_power_off(board->boot, now);
        return;
    }
    if (reset_cause == TAXEL_RESET_CAUSE_POWER_ON) {
        board->power_on_time = now;
    }
    board->address = boot_node_get_address(board->boot);
    board_handle_boot_outcome(board, boot_node_reset(board->boot, now, reset_cause));
}

/* Return the virtual time of the next planned power cut or return of power of a board; VTIME_NEVER if there is none. */
vtime board_next_power_event(const struct board_node *board)
{
    return vtime_min(board->boot->flash.cut_time, board->power_return_time);
}

/* Execute planned power cuts, and the returns of power after them, until a virtual time. */
void board_run_power_events(struct board_node *board, vtime until)
{
    while (board_next_power_event(board) <= until) {
        const vtime now = board_next_power_event(board);
        const bool power_returns = now == board->power_return_time;
        board->power_return_time = power_returns ? VTIME_NEVER : now + board->boot->flash.off_time;
        board_set_power(board, power_returns, now, TAXEL_RESET_CAUSE_POWER_ON);
    }
}

/* Advance a board that is not running its application: time limit of the bootloader, watchdog of a hanging image, power
 * cuts. */
void board_advance_bootloader(struct board_node *board, vtime until)
{
    for (;;) {
        board_run_power_events(board, until);
        if (!board->is_powered) {
            return;
        }
        if (board->program == PROGRAM_BOOTLOADER && boot_node_next_deadline(board->boot) <= until) {
            board_handle_boot_outcome(board, boot_node_run(board->boot, boot_node_next_deadline(board->boot)));
        } else if (board->program == PROGRAM_HANGING && board->watchdog_at <= until) {
            board_set_power(board, true, board->watchdog_at, TAXEL_RESET_CAUSE_WATCHDOG);
        } else {
            return;
        }
    }
}

/* Mark the running image as confirmed, as the application does, after CONFIRM_SCANS scans and a read by the hub. The
 * CPU and the bus are blocked during the flash write. */
void board_confirm_image(struct board_node *board, vtime now)
{
    if (board->has_confirmed || board->sensor.scan.scans < CONFIRM_SCANS || !board->sensor.slave.snapshot_reads) {
        return;
    }
    board->has_confirmed = true;
    board->flash_busy_until = boot_node_confirm_image(board->boot, now);
    board->cpu_free = vtime_max(board->cpu_free, board->flash_busy_until);
}
