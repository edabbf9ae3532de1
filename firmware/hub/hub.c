#include <stdatomic.h>

#include "hub/internal.h"

#define DRAIN_POLL_US 1000u

/* Return the time since the start of the hub in microseconds, 64 bits. */
uint64_t taxel_hub_clock(const struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    return hal->clock_us(hal->context);
}

/* Return the time since the start of the hub in microseconds, modulo 2^32. */
uint32_t taxel_hub_now(const struct taxel_hub *hub)
{
    return (uint32_t)taxel_hub_clock(hub);
}

/* Request that the main loop runs again in `microseconds` at the latest. */
void taxel_hub_wake_in(const struct taxel_hub *hub, uint32_t microseconds)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    hal->wake_at(hal->context, taxel_hub_clock(hub) + microseconds);
}

/* Return the index of the slot of the board with this I2C address, or TAXEL_NO_SLOT. A slot is the hub's state of one
 * known board. */
uint8_t taxel_hub_slot_of(const struct taxel_hub *hub, uint8_t address)
{
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        if (taxel_hub_slot_at(hub, i)->address == address) {
            return i;
        }
    }
    return TAXEL_NO_SLOT;
}

/* Initialise the hub, queue a HUB_HANDSHAKE frame and begin a bus scan. `config` must stay valid; `reset_cause`: enum
 * taxel_reset_cause. */
void taxel_hub_init(struct taxel_hub *hub, const struct taxel_hub_config *config, uint8_t reset_cause)
{
    memset(hub, 0, sizeof *hub);
    hub->config = config;
    hub->reset_cause = reset_cause;
    hub->settings_read_slot = TAXEL_NO_SLOT;
    /* the clock may start at any value */
    hub->bus_down_until_us = hub->host_bus_until_us = hub->bus_scan.next_us = taxel_hub_now(hub);
    taxel_hub_inbox_init(hub);
    taxel_hub_send_handshake(hub, 0, 0);
    taxel_hub_start_bus_scan(hub, false);
}

/* Record in the I2C interrupt that the transfer has ended with `result` (enum taxel_i2c_result). The main loop
 * evaluates the result. */
void taxel_hub_on_i2c_done(struct taxel_hub *hub, int8_t result)
{
    hub->job_result = result;
    atomic_signal_fence(memory_order_release);
    hub->job_done = true;
}

/* Evaluate the I2C transfer in progress if it has ended, or abort it if its time limit has passed. After a successful
 * poll, the next transfer is started first. */
static void process_job_outcome(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    struct taxel_job *job = &hub->job;
    if (job->kind != TAXEL_JOB_NONE && !hub->job_done && taxel_hub_is_due(taxel_hub_now(hub), job->deadline_us)) {
        hal->i2c_abort(hal->context);
        hub->job_result = TAXEL_I2C_TIMEOUT;
        hub->job_done = true;
    }
    if (!hub->job_done) {
        return;
    }
    atomic_signal_fence(memory_order_acquire); /* the interrupt's writes to the transfer buffer are visible */
    hub->job_done = false;
    taxel_hub_note_result(hub, hub->job_result);
    if (job->kind == TAXEL_JOB_POLL && hub->job_result == TAXEL_I2C_OK) {
        taxel_hub_keep_snapshot(hub);
        job->kind = TAXEL_JOB_NONE;
        /* the bus is busy with the next transfer while this snapshot is checked and framed */
        taxel_hub_start_next_job(hub);
        taxel_hub_process_snapshot(hub);
        return;
    }
    taxel_hub_finish_job(hub, hub->job_result);
}

/* Move a time (microseconds modulo 2^32) that has passed to `now`. A time that passed more than 2^31 us (35 minutes)
 * ago would be treated as a future time. */
static void clamp_past_time(uint32_t now, uint32_t *time)
{
    if (taxel_hub_is_due(now, *time)) {
        *time = now;
    }
}

/* Reset the processor, into the bootloader if requested, once the UART has sent all queued bytes or the time limit has
 * passed. */
static void restart_when_drained(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    if (taxel_hub_uart_pending(hub) && !taxel_hub_is_due(taxel_hub_now(hub), hub->restart_by_us)) {
        taxel_hub_wake_in(hub, DRAIN_POLL_US);
    } else if (hub->bootloader_requested) {
        hal->enter_bootloader(hal->context);
    } else {
        hal->restart(hal->context);
    }
}

/* Run one pass of the main loop: evaluate the last transfer, execute received commands, start the next transfer, send
 * status frames, and request the time of the next pass. */
TAXEL_OWN_FRAME void taxel_hub_run(struct taxel_hub *hub)
{
    if (hub->restart_requested) { /* start no new work; drain the transmit queue first */
        restart_when_drained(hub);
        return;
    }
    taxel_hub_discard_queued(hub);
    process_job_outcome(hub);
    taxel_hub_read_inbox(hub);
    if (hub->job.kind == TAXEL_JOB_NONE) {
        taxel_hub_start_next_job(hub);
    }
    taxel_hub_report_step(hub);
    const uint32_t now = taxel_hub_now(hub); /* read late: the bus is idle until a transfer starts */
    clamp_past_time(now, &hub->bus_down_until_us);
    clamp_past_time(now, &hub->host_bus_until_us);
    clamp_past_time(now, &hub->bus_scan.next_us);
    if (hub->job.kind != TAXEL_JOB_NONE) { /* each pass cancels the earlier requests of wake_at() */
        taxel_hub_wake_in(hub, taxel_hub_is_due(now, hub->job.deadline_us) ? 0 : hub->job.deadline_us - now);
    }
}
