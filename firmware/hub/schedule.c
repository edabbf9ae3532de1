/* Selection of the next transfer. One poll cycle: every known board once, then, at most every 50 ms, one board's
 * clock and a few probes for unknown boards. When not streaming, the hub scans the bus instead. */
#include "hub/internal.h"

/* shortest interval of a clock reading and probes: every cycle of 17 boards at 400 kHz */
#define UPKEEP_PERIOD_US 50000u
#define PROBES_PER_CYCLE 4u            /* finds a new board within 28 such cycles, at 0.1 ms of bus time each */
#define INCOMPATIBLE_RETRY_US 1000000u /* costs 1.5 ms of bus time per second at 400 kHz */
#define BUS_SCAN_PERIOD_US 20000u      /* between two scans of the idle bus */
/* bytes: longest read of all transfers except polls, and the reply to SCAN_BUS */
#define SMALL_READ (TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN + 1u)
/* after a transfer of the host: the host may wait for a flash row, and twice for its adapter */
#define HOST_BUS_US 100000u

#define slot_at taxel_hub_slot_at

/* Return whether the idle bus is reserved for the host, which has accessed boards in the last 0.1 s, for example boards
 * in their bootloaders. */
static bool host_owns_idle_bus(const struct taxel_hub *hub)
{
    return !hub->streaming && !taxel_hub_is_due(taxel_hub_now(hub), hub->host_bus_until_us);
}

/* Start a transfer that the board needs before its poll: a read of its identity or a write of its scan settings.
 * Returns false if the board needs no such transfer. */
static bool launch_upkeep(struct taxel_hub *hub, uint8_t slot)
{
    const struct taxel_hub_slot *board = slot_at(hub, slot);
    const bool is_new = board->state == TAXEL_BOARD_STATE_IDENTIFYING && !host_owns_idle_bus(hub);
    if (is_new || (board->state == TAXEL_BOARD_STATE_STREAMING && board->info_requested)) {
        taxel_hub_launch_read(hub, TAXEL_JOB_IDENTIFY, slot, TAXEL_REGISTER_IDENTITY, TAXEL_IDENTITY_SIZE);
        return true;
    }
    if (board->state == TAXEL_BOARD_STATE_STREAMING && board->settings_dirty) {
        taxel_hub_launch_write_settings(hub, slot);
        return true;
    }
    return false;
}

/* Find the first board that needs a read of its identity or a write of its scan settings, and start this transfer.
 * Returns false if no board needs one. */
static bool launch_any_upkeep(struct taxel_hub *hub)
{
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        if (launch_upkeep(hub, i)) {
            return true;
        }
    }
    return false;
}

/* Result of an attempt to start a transfer. LAUNCH_NOTHING: no transfer is due; LAUNCH_STARTED: a transfer was started;
 * LAUNCH_WAIT: a poll is due but cannot start yet. */
enum launch { LAUNCH_NOTHING, LAUNCH_STARTED, LAUNCH_WAIT };

/* Start the poll of a board, or make it wait. While the UART is slower than the bus, a poll waits for a free buffer
 * (LAUNCH_WAIT), so that every board is polled equally often. A UART without a reader must not stop the hub: a poll
 * without a buffer then ends as dropped, without a transfer (LAUNCH_NOTHING). */
static enum launch launch_poll(struct taxel_hub *hub, uint8_t slot)
{
    struct taxel_hub_slot *board = slot_at(hub, slot);
    if (taxel_hub_find_buffer(hub, taxel_hub_poll_size(hub, board))) {
        taxel_hub_launch_poll(hub, slot);
        return LAUNCH_STARTED;
    }
    if (!taxel_hub_uart_is_stalled(hub)) {
        taxel_hub_wake_in(hub, TAXEL_HUB_SPACE_POLL_US);
        return LAUNCH_WAIT;
    }
    board->dropped++;
    hub->outbox.frames_dropped++;
    return LAUNCH_NOTHING;
}

/* Start the second attempt of a poll that failed in this cycle; LAUNCH_NOTHING if there is none. */
static enum launch launch_retry(struct taxel_hub *hub)
{
    for (uint8_t i = 0; hub->has_retry && i < hub->slot_count; i++) {
        struct taxel_hub_slot *board = slot_at(hub, i);
        if (board->retry_pending) {
            const enum launch launched = launch_poll(hub, i);
            board->retry_pending = launched == LAUNCH_WAIT;
            if (launched != LAUNCH_NOTHING) {
                return launched;
            }
        }
    }
    hub->has_retry = false;
    return LAUNCH_NOTHING;
}

/* Return whether this cycle includes the clock reading and the probes of unknown addresses. They take a twentieth of a
 * fast cycle and are therefore due only every UPKEEP_PERIOD_US. There are two exceptions: the first cycles, until each
 * board's clock has been reported, and cycles without any other transfer. */
static bool upkeep_is_due(const struct taxel_hub *hub)
{
    const struct taxel_cycle *cycle = &hub->cycle;
    return !cycle->has_launched || cycle->count < hub->slot_count ||
           taxel_hub_now(hub) - cycle->last_upkeep_us >= UPKEEP_PERIOD_US;
}

/* Return whether the snapshot of the last poll still waits for the check of its CRC. */
static bool is_unchecked(const struct taxel_hub *hub)
{
    return hub->unframed.size && !hub->unframed.is_checked;
}

/* Start the next transfer of the cycle's poll stage. Each known board is visited once: identity, settings or
 * acknowledgement first, then its poll, or a probe if the board is absent. LAUNCH_NOTHING: all boards have been
 * visited. */
static enum launch launch_from_polls(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    while (cycle->position < hub->slot_count) {
        const uint8_t slot = cycle->position;
        struct taxel_hub_slot *board = slot_at(hub, slot);
        if (is_unchecked(hub) && hub->unframed.slot == slot) {
            return LAUNCH_WAIT; /* its last snapshot is checked first: the check may request a second attempt */
        }
        if (board->state == TAXEL_BOARD_STATE_INCOMPATIBLE &&
            taxel_hub_now(hub) - board->last_read_us >= INCOMPATIBLE_RETRY_US) {
            board->state = TAXEL_BOARD_STATE_IDENTIFYING; /* the board may have new firmware */
        }
        if (launch_upkeep(hub, slot)) {
            return LAUNCH_STARTED; /* this board's poll follows */
        }
        if (board->state == TAXEL_BOARD_STATE_STREAMING && taxel_hub_launch_acknowledge(hub, slot)) {
            return LAUNCH_STARTED;
        }
        if (board->state == TAXEL_BOARD_STATE_STREAMING) {
            const enum launch launched = launch_poll(hub, slot);
            if (launched == LAUNCH_WAIT) {
                return LAUNCH_WAIT;
            }
            cycle->position++;
            board->polls++;
            board->attempts = 0;
            if (launched == LAUNCH_STARTED) {
                return LAUNCH_STARTED;
            }
            continue;
        }
        cycle->position++;
        if (board->state == TAXEL_BOARD_STATE_ABSENT) {
            board->polls++;
            taxel_hub_launch_probe(hub, TAXEL_JOB_PROBE_SLOT, slot, board->address);
            return LAUNCH_STARTED;
        }
    }
    /* The last board's snapshot is checked before the next cycle starts: a second attempt belongs to this cycle. */
    return is_unchecked(hub) && !upkeep_is_due(hub) ? LAUNCH_WAIT : LAUNCH_NOTHING;
}

/* Start a clock reading (register CLOCK) of the next streaming board; one board per call, in turn. Returns false if no
 * board is streaming. */
static bool launch_clock(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    for (uint8_t tried = 0; tried < hub->slot_count; tried++) {
        cycle->clock_slot = (uint8_t)(cycle->clock_slot + 1u);
        cycle->clock_slot = cycle->clock_slot < hub->slot_count ? cycle->clock_slot : 0;
        if (slot_at(hub, cycle->clock_slot)->state == TAXEL_BOARD_STATE_STREAMING) {
            taxel_hub_launch_read(hub, TAXEL_JOB_CLOCK, cycle->clock_slot, TAXEL_REGISTER_CLOCK, sizeof(uint32_t));
            return true;
        }
    }
    return false;
}

/* Return the usable I2C address that follows `address`. The first address follows the last address. */
static uint8_t next_address(uint8_t address)
{
    const bool is_outside = address < TAXEL_ADDRESS_MIN || address >= TAXEL_ADDRESS_MAX;
    return is_outside ? (uint8_t)TAXEL_ADDRESS_MIN : (uint8_t)(address + 1u);
}

/* Start a probe of the next I2C address that belongs to no known board. Returns false if this cycle's probes are used
 * up. */
static bool launch_unknown_probe(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    while (cycle->probes_left) {
        cycle->probes_left--;
        cycle->probe_address = next_address(cycle->probe_address);
        if (hub->slot_count < taxel_hub_config_of(hub)->slot_capacity &&
            taxel_hub_slot_of(hub, cycle->probe_address) == TAXEL_NO_SLOT) {
            taxel_hub_launch_probe(hub, TAXEL_JOB_PROBE_ADDRESS, TAXEL_NO_SLOT, cycle->probe_address);
            return true;
        }
    }
    return false;
}

/* Begin a poll cycle. */
static void begin_cycle(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    cycle->stage = TAXEL_STAGE_POLLS;
    cycle->position = 0;
    cycle->has_launched = false;
    cycle->started_us = taxel_hub_clock(hub);
}

/* End a poll cycle: measure its duration, advance the cycle number, and wait for the next one. */
static void end_cycle(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    cycle->last_length_us = (uint32_t)(taxel_hub_clock(hub) - cycle->started_us);
    cycle->number++;
    cycle->count++;
    cycle->stage = TAXEL_STAGE_WAIT;
}

/* Advance through the stages of the poll cycle until a transfer starts, a poll must wait, or the cycle waits for the
 * start of the next one. */
static void launch_from_cycle(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    struct taxel_cycle *cycle = &hub->cycle;
    enum launch launched;
    for (;;) {
        switch (cycle->stage) {
        case TAXEL_STAGE_POLLS:
            launched = launch_from_polls(hub);
            if (launched != LAUNCH_NOTHING) {
                return;
            }
            if (!upkeep_is_due(hub)) {
                end_cycle(hub);
                break;
            }
            cycle->last_upkeep_us = taxel_hub_now(hub);
            cycle->stage = TAXEL_STAGE_CLOCK;
            break;
        case TAXEL_STAGE_CLOCK:
            cycle->stage = TAXEL_STAGE_PROBES;
            cycle->probes_left = PROBES_PER_CYCLE;
            if (launch_clock(hub)) {
                return;
            }
            break;
        case TAXEL_STAGE_PROBES:
            if (launch_unknown_probe(hub)) {
                return;
            }
            end_cycle(hub);
            break;
        default: {
            /* A cycle without any transfer (no board to poll and no free slot) must not restart at once. */
            const bool is_idle = !hub->slot_count || (!cycle->has_launched && cycle->period_us < BUS_SCAN_PERIOD_US);
            const uint64_t next = cycle->started_us + (is_idle ? BUS_SCAN_PERIOD_US : cycle->period_us);
            if (taxel_hub_clock(hub) < next) {
                hal->wake_at(hal->context, next);
                (void)launch_any_upkeep(hub); /* the host's commands do not wait for the next cycle */
                return;
            }
            begin_cycle(hub);
            break;
        }
        }
    }
}

/* Select compact or uncompressed snapshots for all polls. After a change, each board's register pointer must be written
 * again. */
void taxel_hub_set_compact(struct taxel_hub *hub, bool compact)
{
    for (uint8_t i = 0; hub->use_compact != compact && i < hub->slot_count; i++) {
        slot_at(hub, i)->pointer_is_snapshot = false;
    }
    hub->use_compact = compact;
}

/* Begin poll cycles and the periodic status report. Does nothing if the hub is streaming. */
void taxel_hub_start_streaming(struct taxel_hub *hub)
{
    if (hub->streaming) {
        return;
    }
    hub->streaming = true;
    hub->report.next_us = taxel_hub_now(hub);
    if (hub->cycle.stage != TAXEL_STAGE_WAIT && hub->cycle.position) {
        hub->cycle.number++; /* STOP interrupted the last cycle: later frames must have another number */
    }
    begin_cycle(hub);
}

/* Begin to probe all I2C addresses. `for_command`: the command SCAN_BUS requested the scan, and the addresses that
 * respond are collected for its reply. */
void taxel_hub_start_bus_scan(struct taxel_hub *hub, bool for_command)
{
    hub->bus_scan.active = true;
    hub->bus_scan.for_command = hub->bus_scan.for_command || for_command;
    hub->bus_scan.address = (uint8_t)TAXEL_ADDRESS_MIN;
    if (hub->bus_scan.for_command) {
        memset(hub->inbox.payload, 0, TAXEL_HUB_ADDRESS_BITMAP_SIZE);
    }
}

/* End a bus scan and schedule the next one. For SCAN_BUS, queue the reply: one byte for each address that responded.
 * During the scan, the payload of the executed command is replaced by a bitmap of these addresses. */
static void end_bus_scan(struct taxel_hub *hub)
{
    struct taxel_bus_scan *bus_scan = &hub->bus_scan;
    uint8_t *addresses = taxel_hub_bytes(hub, hub->job.pool_offset);
    size_t count = 0;
    bus_scan->active = false;
    bus_scan->next_us = taxel_hub_now(hub) + BUS_SCAN_PERIOD_US;
    if (!bus_scan->for_command) {
        return;
    }
    bus_scan->for_command = false;
    for (uint8_t address = (uint8_t)TAXEL_ADDRESS_MIN; address <= TAXEL_ADDRESS_MAX; address++) {
        if (hub->inbox.payload[address >> 3] & (1u << (address & 7u))) {
            addresses[count++] = address;
        }
    }
    taxel_hub_reply(hub, TAXEL_REPLY_STATUS_OK, addresses, count);
}

/* Start the probe of the next address of a bus scan. Returns false, and ends the scan, after the last address. */
static bool launch_from_bus_scan(struct taxel_hub *hub)
{
    struct taxel_bus_scan *bus_scan = &hub->bus_scan;
    if (bus_scan->address <= TAXEL_ADDRESS_MAX) {
        const uint8_t address = bus_scan->address++;
        taxel_hub_launch_probe(hub, TAXEL_JOB_PROBE_ADDRESS, taxel_hub_slot_of(hub, address), address);
        return true;
    }
    end_bus_scan(hub);
    return false;
}

/* Start a transfer while the hub is not streaming: identity or settings of a board, or, every 20 ms, a bus scan. The
 * host's transfers have precedence: no bus scan begins within 0.1 s after the start of a transfer of the host. */
static void launch_from_idle(struct taxel_hub *hub)
{
    const uint32_t now = taxel_hub_now(hub);
    if (launch_any_upkeep(hub)) {
        return;
    }
    const uint32_t scan_us = hub->bus_scan.next_us, host_us = hub->host_bus_until_us;
    const uint32_t next = taxel_hub_is_due(scan_us, host_us) ? scan_us : host_us;
    if (!taxel_hub_is_due(now, next)) {
        taxel_hub_wake_in(hub, next - now);
        return;
    }
    taxel_hub_start_bus_scan(hub, false);
    (void)launch_from_bus_scan(hub);
}

/* Return whether the command in progress is I2C_TRANSFER, a transfer of the host. */
static bool pass_through_is_requested(const struct taxel_hub *hub)
{
    return hub->command.active && hub->command.command == TAXEL_COMMAND_I2C_TRANSFER;
}

/* Start the transfer of the command I2C_TRANSFER. The transfer may move the board's register pointer, so the next poll
 * writes the pointer again. */
static void launch_pass_through(struct taxel_hub *hub)
{
    const uint8_t slot = taxel_hub_slot_of(hub, hub->command.address);
    if (slot != TAXEL_NO_SLOT) {
        slot_at(hub, slot)->pointer_is_snapshot = false;
    }
    hub->host_bus_until_us = taxel_hub_now(hub) + HOST_BUS_US;
    taxel_hub_launch(hub, TAXEL_JOB_PASS_THROUGH, slot, hub->command.address, hub->command.transfer_read);
}

/* Return whether no transfer may start, because a recovery in the last 10 ms left a line low. In this case, also
 * request that the main loop runs again at the end of the 10 ms. Without a bus fault the clock is not read, because
 * reading the clock takes time. */
static bool bus_is_down(const struct taxel_hub *hub)
{
    if (hub->bus_fault == TAXEL_BOARD_FAULT_NONE) {
        return false;
    }
    const uint32_t now = taxel_hub_now(hub);
    if (taxel_hub_is_due(now, hub->bus_down_until_us)) {
        return false;
    }
    taxel_hub_wake_in(hub, hub->bus_down_until_us - now);
    return true;
}

/* Start the next I2C transfer, if any. Order: reading settings back, second attempts, the host's transfer, bus scan,
 * then the poll cycle or, when not streaming, the idle bus. */
void taxel_hub_start_next_job(struct taxel_hub *hub)
{
    const uint8_t slot = hub->settings_read_slot;
    if (bus_is_down(hub)) {
        return;
    }
    if (slot != TAXEL_NO_SLOT) {
        /* the settings are read into the buffer of the previous transfer, behind the identity */
        hub->settings_read_slot = TAXEL_NO_SLOT;
        taxel_hub_launch_read(hub, hub->settings_read_kind, slot, TAXEL_REGISTER_SETTINGS,
                              TAXEL_SETTINGS_REGISTER_SIZE);
        return;
    }
    const size_t largest = taxel_hub_read_max(hub);
    const size_t small = SMALL_READ < largest ? SMALL_READ : largest;
    /* taxel_hub_uart_is_stalled() updates the state of the UART, on which the search depends: search again after it. */
    if (!taxel_hub_find_buffer(hub, small) && !(taxel_hub_uart_is_stalled(hub) && taxel_hub_find_buffer(hub, small))) {
        taxel_hub_wake_in(hub, TAXEL_HUB_SPACE_POLL_US);
        return;
    }
    if (launch_retry(hub) != LAUNCH_NOTHING) {
        return;
    }
    if (pass_through_is_requested(hub)) {
        launch_pass_through(hub);
        return;
    }
    if (hub->bus_scan.active && launch_from_bus_scan(hub)) {
        return;
    }
    if (hub->streaming) {
        launch_from_cycle(hub);
    } else {
        launch_from_idle(hub);
    }
}
