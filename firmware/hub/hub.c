#include <stdatomic.h>

#include "hub/internal.h"

#define DRAIN_POLL_US 1000u

uint64_t taxel_hub_clock(const struct taxel_hub *hub)
{
    return hub->config->hal->clock_us(hub->config->hal->context);
}

uint8_t taxel_hub_slot_of(const struct taxel_hub *hub, uint8_t address)
{
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        if (hub->config->slots[i].address == address) {
            return i;
        }
    }
    return TAXEL_NO_SLOT;
}

void taxel_hub_init(struct taxel_hub *hub, const struct taxel_hub_config *config)
{
    memset(hub, 0, sizeof *hub);
    hub->config = config;
    hub->settings_read_slot = TAXEL_NO_SLOT;
    taxel_hub_inbox_init(hub);
    taxel_hub_send_hello(hub, 0, 0);
    taxel_hub_start_sweep(hub, false);
}

void taxel_hub_on_i2c_done(struct taxel_hub *hub, int8_t result)
{
    hub->job_result = result;
    atomic_signal_fence(memory_order_release);
    hub->job_done = true;
}

static bool job_has_timed_out(const struct taxel_hub *hub)
{
    return hub->job.kind != TAXEL_JOB_NONE && !hub->job_done && taxel_hub_clock(hub) >= hub->job.deadline_us;
}

static void take_job_outcome(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = hub->config->hal;
    if (job_has_timed_out(hub)) {
        hal->i2c_abort(hal->context);
        hub->job_result = TAXEL_I2C_TIMEOUT;
        hub->job_done = true;
    }
    if (!hub->job_done) {
        return;
    }
    atomic_signal_fence(memory_order_acquire); /* the transfer buffer is as the interrupt left it */
    const struct taxel_job job = hub->job;
    hub->job.kind = TAXEL_JOB_NONE;
    hub->job_done = false;
    taxel_hub_note_result(hub, hub->job_result);
    if (job.kind == TAXEL_JOB_POLL && hub->job_result == TAXEL_I2C_OK) {
        hub->unframed_size = job.read_size;
        hub->unframed_slot = job.slot;
        taxel_hub_start_next_job(hub); /* the bus works on while this snapshot is checked and framed */
        hub->unframed_size = 0;
        taxel_hub_take_snapshot(hub, &job);
        return;
    }
    taxel_hub_finish_job(hub, &job, hub->job_result);
}

void taxel_hub_run(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = hub->config->hal;
    if (hub->restart_wanted) { /* nothing new is begun; what has been said goes out first */
        if (taxel_hub_uart_pending(hub) && taxel_hub_clock(hub) < hub->restart_by_us) {
            hal->wake_at(hal->context, taxel_hub_clock(hub) + DRAIN_POLL_US);
        } else {
            (hub->bootloader_wanted ? hal->enter_bootloader : hal->restart)(hal->context);
        }
        return;
    }
    take_job_outcome(hub);
    taxel_hub_read_inbox(hub);
    if (hub->job.kind == TAXEL_JOB_NONE) {
        taxel_hub_start_next_job(hub);
    }
    taxel_hub_report_step(hub);
    if (hub->job.kind != TAXEL_JOB_NONE) {
        hal->wake_at(hal->context, hub->job.deadline_us); /* this pass may have used up the call that launch() asked for */
    }
}
