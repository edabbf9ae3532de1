/* Which transfer comes next. One poll cycle: every known board once, then, unless that was done a moment ago, one board's clock
 * and a few probes for boards that nobody has told us about. When not streaming, the hub sweeps the bus instead. */
#include "hub/internal.h"

#define UPKEEP_PERIOD_US 50000u  /* a clock and the probes at most so often: in every cycle of 17 boards at 400 kHz */
#define PROBES_PER_CYCLE 4u      /* finds a new board within 28 such cycles for 0.1 ms of bus each */
#define INCOMPATIBLE_RETRY_US 1000000u /* costs 1.5 ms of bus a second at 400 kHz */
#define SWEEP_PERIOD_US 20000u   /* between two sweeps of the idle bus */
#define SMALL_READ (TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN + 1u) /* what all transfers but polls need, and the answer to SCAN_BUS */
#define HOST_BUS_US 100000u      /* after a transfer for the host: it may wait for a row to be written, and for its adapter twice */

#define slot_at taxel_hub_slot_at

/* A host that talks to boards, to those in their bootloaders above all, has the idle bus to itself. */
static bool bus_is_the_hosts(const struct taxel_hub *hub)
{
    return !hub->streaming && !taxel_hub_has_come(taxel_hub_now(hub), hub->host_until_us);
}

/* What a board needs before it can be polled; false if it needs nothing. */
static bool launch_upkeep(struct taxel_hub *hub, uint8_t slot)
{
    const struct taxel_hub_slot *board = slot_at(hub, slot);
    const bool is_new = board->state == TAXEL_BOARD_STATE_IDENTIFYING && !bus_is_the_hosts(hub);
    if (is_new || (board->state == TAXEL_BOARD_STATE_STREAMING && board->info_wanted)) {
        taxel_hub_launch_read(hub, TAXEL_JOB_IDENTIFY, slot, TAXEL_REGISTER_IDENTITY, TAXEL_IDENTITY_SIZE);
        return true;
    }
    if (board->state == TAXEL_BOARD_STATE_STREAMING && board->settings_dirty) {
        taxel_hub_launch_write_settings(hub, slot);
        return true;
    }
    return false;
}

static bool launch_any_upkeep(struct taxel_hub *hub)
{
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        if (launch_upkeep(hub, i)) {
            return true;
        }
    }
    return false;
}

/* LAUNCH_WAIT: there is a poll to make, but not now. */
enum launch { LAUNCH_NOTHING, LAUNCH_STARTED, LAUNCH_WAIT };

/* Back-pressure: while the UART is slower than the bus, the bus waits, so that every board has its turn; but a UART that takes
 * nothing at all must not stop the hub. Then a poll that has no place ends without a transfer. */
static enum launch launch_poll(struct taxel_hub *hub, uint8_t slot)
{
    struct taxel_hub_slot *board = slot_at(hub, slot);
    if (taxel_hub_find_place(hub, taxel_hub_poll_size(hub, board))) {
        taxel_hub_launch_poll(hub, slot);
        return LAUNCH_STARTED;
    }
    if (!taxel_hub_uart_is_stalled(hub)) {
        taxel_hub_wake_in(hub, TAXEL_HUB_ROOM_POLL_US);
        return LAUNCH_WAIT;
    }
    board->dropped++;
    hub->outbox.frames_dropped++;
    return LAUNCH_NOTHING;
}

static enum launch launch_retry(struct taxel_hub *hub)
{
    for (uint8_t i = 0; hub->retry_wanted && i < hub->slot_count; i++) {
        struct taxel_hub_slot *board = slot_at(hub, i);
        if (board->retry) {
            const enum launch launched = launch_poll(hub, i);
            board->retry = launched == LAUNCH_WAIT;
            if (launched != LAUNCH_NOTHING) {
                return launched;
            }
        }
    }
    hub->retry_wanted = false;
    return LAUNCH_NOTHING;
}

/* One clock and a few probes, which are a twentieth of a fast cycle, need not be in every one: but in the first ones, until each
 * board's clock has been told. */
static bool upkeep_is_due(const struct taxel_hub *hub)
{
    const struct taxel_cycle *cycle = &hub->cycle;
    return !cycle->launched || cycle->count < hub->slot_count || taxel_hub_now(hub) - cycle->upkept_us >= UPKEEP_PERIOD_US;
}

static bool is_unjudged(const struct taxel_hub *hub)
{
    return hub->unframed.size && !hub->unframed.is_judged;
}

static enum launch launch_from_polls(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    while (cycle->position < hub->slot_count) {
        const uint8_t slot = cycle->position;
        struct taxel_hub_slot *board = slot_at(hub, slot);
        if (is_unjudged(hub) && hub->unframed.slot == slot) {
            return LAUNCH_WAIT; /* its last snapshot is judged first: it may want a second attempt */
        }
        if (board->state == TAXEL_BOARD_STATE_INCOMPATIBLE &&
            taxel_hub_now(hub) - board->last_read_us >= INCOMPATIBLE_RETRY_US) {
            board->state = TAXEL_BOARD_STATE_IDENTIFYING; /* it may have been given other firmware */
        }
        if (launch_upkeep(hub, slot)) {
            return LAUNCH_STARTED; /* and then this board's poll */
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
    /* Nothing else comes between the last board's snapshot and the next cycle, to which its second attempt would belong. */
    return is_unjudged(hub) && !upkeep_is_due(hub) ? LAUNCH_WAIT : LAUNCH_NOTHING;
}

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

static uint8_t next_address(uint8_t address)
{
    const bool is_outside = address < TAXEL_ADDRESS_MIN || address >= TAXEL_ADDRESS_MAX;
    return is_outside ? (uint8_t)TAXEL_ADDRESS_MIN : (uint8_t)(address + 1u);
}

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

static void begin_cycle(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    cycle->stage = TAXEL_STAGE_POLLS;
    cycle->position = 0;
    cycle->launched = false;
    cycle->started_us = taxel_hub_clock(hub);
}

static void end_cycle(struct taxel_hub *hub)
{
    struct taxel_cycle *cycle = &hub->cycle;
    cycle->last_length_us = (uint32_t)(taxel_hub_clock(hub) - cycle->started_us);
    cycle->number++;
    cycle->count++;
    cycle->stage = TAXEL_STAGE_WAIT;
}

/* Go through the stages of the cycle until one has a transfer to make, or the next cycle is waited for. */
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
            cycle->upkept_us = taxel_hub_now(hub);
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
            /* A cycle that found nothing to transfer (no board can be polled and no slot is free) must not begin again at once. */
            const bool is_idle = !hub->slot_count || (!cycle->launched && cycle->period_us < SWEEP_PERIOD_US);
            const uint64_t next = cycle->started_us + (is_idle ? SWEEP_PERIOD_US : cycle->period_us);
            if (taxel_hub_clock(hub) < next) {
                hal->wake_at(hal->context, next);
                (void)launch_any_upkeep(hub); /* the host's commands do not wait for a slow cycle */
                return;
            }
            begin_cycle(hub);
            break;
        }
        }
    }
}

void taxel_hub_want_compact(struct taxel_hub *hub, bool compact)
{
    for (uint8_t i = 0; hub->compact != compact && i < hub->slot_count; i++) {
        slot_at(hub, i)->pointer_is_snapshot = false;
    }
    hub->compact = compact;
}

void taxel_hub_start_streaming(struct taxel_hub *hub)
{
    if (hub->streaming) {
        return;
    }
    hub->streaming = true;
    hub->report.next_us = taxel_hub_now(hub);
    if (hub->cycle.stage != TAXEL_STAGE_WAIT && hub->cycle.position) {
        hub->cycle.number++; /* STOP cut the last one: what comes now is of another time */
    }
    begin_cycle(hub);
}

void taxel_hub_start_sweep(struct taxel_hub *hub, bool for_command)
{
    hub->sweep.active = true;
    hub->sweep.for_command = hub->sweep.for_command || for_command;
    hub->sweep.address = (uint8_t)TAXEL_ADDRESS_MIN;
    if (hub->sweep.for_command) {
        memset(hub->inbox.payload, 0, TAXEL_HUB_FOUND_SIZE);
    }
}

static void end_sweep(struct taxel_hub *hub)
{
    struct taxel_sweep *sweep = &hub->sweep;
    uint8_t *found = taxel_hub_bytes(hub, hub->job.at);
    size_t count = 0;
    sweep->active = false;
    sweep->next_us = taxel_hub_now(hub) + SWEEP_PERIOD_US;
    if (!sweep->for_command) {
        return;
    }
    sweep->for_command = false;
    for (uint8_t address = (uint8_t)TAXEL_ADDRESS_MIN; address <= TAXEL_ADDRESS_MAX; address++) {
        if (hub->inbox.payload[address >> 3] & (1u << (address & 7u))) {
            found[count++] = address;
        }
    }
    taxel_hub_reply(hub, TAXEL_REPLY_STATUS_OK, found, count);
}

static bool launch_from_sweep(struct taxel_hub *hub)
{
    struct taxel_sweep *sweep = &hub->sweep;
    if (sweep->address <= TAXEL_ADDRESS_MAX) {
        const uint8_t address = sweep->address++;
        taxel_hub_launch_probe(hub, TAXEL_JOB_PROBE_ADDRESS, taxel_hub_slot_of(hub, address), address);
        return true;
    }
    end_sweep(hub);
    return false;
}

static void launch_from_idle(struct taxel_hub *hub)
{
    const uint32_t now = taxel_hub_now(hub);
    if (launch_any_upkeep(hub)) {
        return;
    }
    const uint32_t next = taxel_hub_has_come(hub->sweep.next_us, hub->host_until_us) ? hub->sweep.next_us : hub->host_until_us;
    if (!taxel_hub_has_come(now, next)) {
        taxel_hub_wake_in(hub, next - now);
        return;
    }
    taxel_hub_start_sweep(hub, false);
    (void)launch_from_sweep(hub);
}

static bool pass_through_is_wanted(const struct taxel_hub *hub)
{
    return hub->command.active && hub->command.command == TAXEL_COMMAND_I2C_TRANSFER;
}

static void launch_pass_through(struct taxel_hub *hub)
{
    const uint8_t slot = taxel_hub_slot_of(hub, hub->command.address);
    if (slot != TAXEL_NO_SLOT) {
        slot_at(hub, slot)->pointer_is_snapshot = false;
    }
    hub->host_until_us = taxel_hub_now(hub) + HOST_BUS_US;
    taxel_hub_launch(hub, TAXEL_JOB_PASS_THROUGH, slot, hub->command.address, hub->command.transfer_read);
}

/* Recovery has left a fault a moment ago. Without one the clock, which takes its time, is not asked. */
static bool bus_is_down(const struct taxel_hub *hub)
{
    if (hub->bus_fault == TAXEL_BOARD_FAULT_NONE) {
        return false;
    }
    const uint32_t now = taxel_hub_now(hub);
    if (taxel_hub_has_come(now, hub->bus_down_until_us)) {
        return false;
    }
    taxel_hub_wake_in(hub, hub->bus_down_until_us - now);
    return true;
}

void taxel_hub_start_next_job(struct taxel_hub *hub)
{
    const uint8_t slot = hub->settings_read_slot;
    if (bus_is_down(hub)) {
        return;
    }
    if (slot != TAXEL_NO_SLOT) {
        hub->settings_read_slot = TAXEL_NO_SLOT; /* into the place of the transfer before, which has the identity */
        taxel_hub_launch_read(hub, hub->settings_read_kind, slot, TAXEL_REGISTER_SETTINGS, TAXEL_SETTINGS_REGISTER_SIZE);
        return;
    }
    const size_t largest = taxel_hub_read_max(hub);
    const size_t small = SMALL_READ < largest ? SMALL_READ : largest;
    if (!taxel_hub_find_place(hub, small) && !(taxel_hub_uart_is_stalled(hub) && taxel_hub_find_place(hub, small))) {
        taxel_hub_wake_in(hub, TAXEL_HUB_ROOM_POLL_US);
        return;
    }
    if (launch_retry(hub) != LAUNCH_NOTHING) {
        return;
    }
    if (pass_through_is_wanted(hub)) {
        launch_pass_through(hub);
        return;
    }
    if (hub->sweep.active && launch_from_sweep(hub)) {
        return;
    }
    if (hub->streaming) {
        launch_from_cycle(hub);
    } else {
        launch_from_idle(hub);
    }
}
