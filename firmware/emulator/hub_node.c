#include "emulator/hub_node.h"

#include <math.h>
#include <string.h>

#include "emulator/base/costs.h"
#include "emulator/hub_cortex.h"
#include "emulator/hub_original.h"

static const uint8_t unique_id[8] = {'T', 'A', 'X', 'E', 'L', 'H', 'U', 'B'};

/* Return the virtual time, in picoseconds, that the hub needs for `count` CPU cycles. */
static vtime cycles_to_time(const struct hub_node *node, double count)
{
    return (vtime)(count / CPU_HZ / node->clock_rate * (double)VTIME_SECOND);
}

/* Make the hub's main loop run at `time` at the latest: bring its next run forward if `time` is earlier. */
static void wake_not_after(struct hub_node *node, vtime time)
{
    node->wake = vtime_min(node->wake, time);
}

/* Start an I2C transfer on the emulated bus; HAL function of the emulated hub. */
static void on_i2c_start(void *context, const struct taxel_i2c_transfer *transfer)
{
    struct hub_node *node = context;
    bus_start_transfer(node->bus, BUS_HUB, transfer, node->now);
}

/* Abort the hub's I2C transfer; HAL function of the emulated hub. */
static void on_i2c_abort(void *context)
{
    struct hub_node *node = context;
    bus_abort(node->bus, BUS_HUB, node->now);
}

/* Set the levels of SCL and SDA by hand; true releases a line; HAL function of the emulated hub. */
static void on_i2c_drive(void *context, bool scl_high, bool sda_high)
{
    bus_drive_lines(((struct hub_node *)context)->bus, scl_high, sda_high);
}

/* Return whether the clock line is high; HAL function of the emulated hub. */
static bool on_i2c_scl(void *context)
{
    const struct hub_node *node = context;
    return bus_is_scl_high(node->bus, node->now);
}

/* Return whether the data line is high; HAL function of the emulated hub. */
static bool on_i2c_sda(void *context)
{
    return bus_is_sda_high(((struct hub_node *)context)->bus);
}

/* Start the transmission of queued bytes to the host; HAL function of the emulated hub. */
static void on_uart_kick(void *context)
{
    struct hub_node *node = context;
    uart_start_transmit(node->uart, node->now);
}

/* Request with RTS that the host pauses (`hold` true) or continues; HAL function of the emulated hub. */
static void on_uart_hold(void *context, bool hold)
{
    struct hub_node *node = context;
    uart_set_hold(node->uart, hold, node->now);
}

/* Return the hub's clock in microseconds, with its rate error and start value; HAL function of the emulated hub. */
static uint64_t on_clock_us(void *context)
{
    const struct hub_node *node = context;
    return (uint64_t)((double)(node->now - node->booted) * node->clock_rate / (double)VTIME_US + node->clock_start_us);
}

/* Let the given time in microseconds elapse for the hub; HAL function of the emulated hub. */
static void on_delay_us(void *context, uint32_t microseconds)
{
    ((struct hub_node *)context)->now += microseconds * VTIME_US;
}

/* Request that the main loop runs at the latest when the hub's clock reaches this value; HAL function of the emulated
 * hub. */
static void on_wake_at(void *context, uint64_t clock_us)
{
    struct hub_node *node = context;
    /* + 1: the clock is truncated to whole microseconds, so it must not be read a fraction too early */
    const double since_boot_us = fmax(0.0, (double)(clock_us + 1u) - node->clock_start_us);
    const vtime time = node->booted + (vtime)(since_boot_us / node->clock_rate * (double)VTIME_US);
    wake_not_after(node, vtime_max(time, node->now));
}

/* Request a restart, which the event loop makes; HAL function of the emulated hub. */
static void on_restart(void *context)
{
    ((struct hub_node *)context)->restart_requested = true;
}

/* Request a restart into the bootloader, which the event loop makes; HAL function of the emulated hub. */
static void on_enter_bootloader(void *context)
{
    struct hub_node *node = context;
    node->boot.stay_requested = true;
    node->restart_requested = true;
}

/* Pass a byte from the host to the application of the hub; callback of the emulated UART. */
static void on_byte_for_hub(void *context, uint8_t byte)
{
    taxel_hub_on_uart_byte(context, byte);
}

/* Copy up to `size` bytes to send from the application of the hub; callback of the emulated UART. Returns their
 * number. */
static size_t pull_from_hub(void *context, uint8_t *bytes, size_t size)
{
    return taxel_hub_uart_pull(context, bytes, size);
}

/* Pass a byte from the host to the bootloader of the hub; callback of the emulated UART. */
static void on_byte_for_bootloader(void *context, uint8_t byte)
{
    struct hub_node *node = context;
    /* the bootloader measures gaps between bytes */
    node->boot.now = vtime_max(node->uart->receive_next, node->boot.reset_at);
    taxel_boot_uart_on_byte(&node->boot.uart, byte);
}

/* Copy up to `size` bytes to send from the bootloader of the hub; callback of the emulated UART. Returns their
 * number. */
static size_t pull_from_bootloader(void *context, uint8_t *bytes, size_t size)
{
    return taxel_boot_uart_pull(&((struct hub_node *)context)->boot.uart, bytes, size);
}

/* Create the hub of the world, without power. Returns 0, or -1 after an error line on stderr. */
int hub_node_init(struct hub_node *node, struct bus *bus, struct uart *uart, const struct world_description *world)
{
    memset(node, 0, sizeof *node);
    node->bus = bus;
    node->uart = uart;
    node->power_return_time = VTIME_NEVER;
    node->clock_rate = 1.0 + world->hub_clock_ppm * 1e-6;
    node->clock_start_us = world->hub_clock_start_us;
    node->hal = (struct taxel_hub_hal){
        .context = node,
        .i2c_start = on_i2c_start,
        .i2c_abort = on_i2c_abort,
        .i2c_drive = on_i2c_drive,
        .i2c_scl = on_i2c_scl,
        .i2c_sda = on_i2c_sda,
        .uart_kick = on_uart_kick,
        .uart_hold = world->flow_control ? on_uart_hold : NULL,
        .clock_us = on_clock_us,
        .delay_us = on_delay_us,
        .wake_at = on_wake_at,
        .restart = on_restart,
        .enter_bootloader = on_enter_bootloader,
    };
    node->config = (struct taxel_hub_config){
        .hal = &node->hal,
        .firmware_version = node->firmware_version,
        .unique_id = unique_id,
        .fault_record = node->fault_record,
        .scl_hz = (uint32_t)world->scl_hz,
        .slots = node->slots,
        .slot_capacity = HUB_SLOTS,
        .transfer_pool = node->transfer_pool,
        .transfer_pool_size = HUB_TRANSFER_POOL,
        .transmit_ring = node->transmit_ring,
        .transmit_ring_size = HUB_TRANSMIT_RING,
    };
    boot_node_init_hub(&node->boot, world, unique_id);
    if (world->original.is_on) {
        return hub_original_open(node, world);
    }
    return world->hub_image ? hub_cortex_open(node, world) : 0;
}

/* Free the memory of the emulated hub. */
void hub_node_free(struct hub_node *node)
{
    hub_cortex_close(node);
    hub_original_close(node);
}

/* Return whether the hub sends its measurements: after a command of the host, or always (original hub). */
bool hub_node_is_streaming(const struct hub_node *node)
{
    return node->original || node->hub.streaming;
}

/* Start the hub's firmware at the end of its bootloader. */
static void start_application(struct hub_node *node)
{
    node->program = PROGRAM_APPLICATION;
    node->has_confirmed = false;
    node->booted = node->now = node->cpu_free = node->wake = node->boot.now;
    memcpy(node->firmware_version, boot_node_get_version(&node->boot), sizeof node->firmware_version);
    node->uart->user = (struct uart_user){.context = &node->hub, .on_byte = on_byte_for_hub, .pull = pull_from_hub};
    taxel_hub_init(&node->hub, &node->config, node->boot.reset_cause);
}

/* Continue after the bootloader has run: start the application, hang until the watchdog resets the hub, restart, or
 * stay in the bootloader. */
static void handle_boot_outcome(struct hub_node *node, enum boot_outcome outcome)
{
    const vtime deadline = boot_node_next_deadline(&node->boot);
    switch (outcome) {
    case BOOT_STARTS_IMAGE:
        start_application(node);
        break;
    case BOOT_STARTS_HANGING_IMAGE:
        node->program = PROGRAM_HANGING;
        node->wake = node->boot.now + BOOT_NODE_WATCHDOG_TIME;
        break;
    case BOOT_RESTARTS:
        hub_node_boot(node, node->boot.now, TAXEL_RESET_CAUSE_COMMAND);
        break;
    default:
        node->program = PROGRAM_BOOTLOADER;
        node->wake = deadline;
        node->uart->user =
            (struct uart_user){.context = node, .on_byte = on_byte_for_bootloader, .pull = pull_from_bootloader};
        break;
    }
}

/* Reset the hub at virtual time `now`. reset_cause: reset cause of the protocol. A transfer in progress is aborted and
 * RTS is released. */
void hub_node_boot(struct hub_node *node, vtime now, uint8_t reset_cause)
{
    bus_abort(node->bus, BUS_HUB, now);
    uart_set_hold(node->uart, false, now);
    if (node->psoc) {
        node->is_powered = true;
        hub_cortex_set_power(node, true, now, reset_cause);
        return;
    }
    if (node->original) {
        node->is_powered = true;
        hub_original_boot(node, now);
        return;
    }
    if (node->is_powered && reset_cause != TAXEL_RESET_CAUSE_COMMAND && reset_cause != TAXEL_RESET_CAUSE_WATCHDOG) {
        boot_node_power_off(&node->boot, now); /* brown-out reset */
    }
    if (reset_cause == TAXEL_RESET_CAUSE_POWER_ON || reset_cause == TAXEL_RESET_CAUSE_BROWN_OUT) {
        memset(node->fault_record, 0, sizeof node->fault_record);
    }
    node->is_powered = true;
    node->restart_requested = false;
    node->booted = node->now = node->cpu_free = now;
    node->wake = VTIME_NEVER;
    handle_boot_outcome(node, boot_node_reset(&node->boot, now, reset_cause));
}

/* Run one pass of the bootloader's main loop, then transmit its response. If an image hangs, reset the hub instead, as
 * its watchdog does. */
static void run_bootloader(struct hub_node *node, vtime now)
{
    node->now = now;
    node->wake = VTIME_NEVER;
    if (node->program == PROGRAM_HANGING) {
        hub_node_boot(node, now, TAXEL_RESET_CAUSE_WATCHDOG);
        return;
    }
    handle_boot_outcome(node, boot_node_run(&node->boot, now));
    node->cpu_free = vtime_max(node->cpu_free, node->boot.busy_until);
    if (node->program == PROGRAM_BOOTLOADER) {
        uart_start_transmit(node->uart, vtime_max(now, node->boot.busy_until));
    }
}

/* Switch the hub's power off. The bus is released and the UART stops. */
void hub_node_unplug(struct hub_node *node, vtime now)
{
    bus_abort(node->bus, BUS_HUB, now);
    if (node->psoc) {
        hub_cortex_set_power(node, false, now, TAXEL_RESET_CAUSE_POWER_ON);
    }
    boot_node_power_off(&node->boot, now);
    node->is_powered = false;
    node->wake = VTIME_NEVER;
    uart_set_hold(node->uart, false, now);
    uart_stop_transmit(node->uart);
}

/* Occupy the hub's CPU until a virtual time. */
void hub_node_stall(struct hub_node *node, vtime until)
{
    if (node->psoc) {
        hub_cortex_stall(node, until);
        return;
    }
    node->cpu_free = vtime_max(node->cpu_free, until);
}

/* Let the processor of the hub take a HardFault. A native hub stores the fault in its record and restarts at once. */
void hub_node_take_hard_fault(struct hub_node *node, vtime now, uint32_t program_counter, uint32_t link_register)
{
    if (node->psoc) {
        hub_cortex_take_hard_fault(node);
    } else if (node->is_powered && !node->original && node->program == PROGRAM_APPLICATION) {
        const struct taxel_fault_record record = {
            .code = TAXEL_FAULT_CODE_EXCEPTION,
            .exception = CORTEX_M0_HARD_FAULT,
            .count = (uint16_t)(taxel_get_u16(node->fault_record + TAXEL_FAULT_RECORD_OFFSET_COUNT) + 1u),
            .program_counter = program_counter,
            .link_register = link_register,
        };
        taxel_fault_record_pack(&record, node->fault_record);
        hub_node_boot(node, now, TAXEL_RESET_CAUSE_WATCHDOG);
    }
}

/* Handle the end of the hub's I2C transfer: interrupt of the firmware, and a pass of its main loop after the
 * interrupt's processor time. */
void hub_node_on_i2c_done(struct hub_node *node, vtime now)
{
    if (node->psoc) {
        hub_cortex_on_bus_event(node, now);
        return;
    }
    if (node->original) {
        hub_original_on_i2c_done(node, now);
        return;
    }
    node->cpu_free = vtime_max(node->cpu_free, now) + cycles_to_time(node, COST_MASTER_DONE);
    taxel_hub_on_i2c_done(&node->hub, node->bus->result);
    wake_not_after(node, now + cycles_to_time(node, COST_MASTER_DONE));
}

/* Handle a byte that has arrived at the hub: add the time of its interrupt, then request a pass of the main loop. */
void hub_node_on_uart_received(struct hub_node *node, vtime now)
{
    if (node->psoc || node->original) {
        return; /* the executed image has run its own interrupt; the original hub ignores the byte */
    }
    node->cpu_free = vtime_max(node->cpu_free, now) + cycles_to_time(node, COST_UART_INTERRUPT);
    wake_not_after(node, node->cpu_free);
}

/* Add the CPU time of the interrupt in which the hub refilled its transmit FIFO with this number of bytes. */
void hub_node_on_uart_sent(struct hub_node *node, vtime now, size_t bytes)
{
    if (node->psoc || node->original) {
        return;
    }
    node->cpu_free =
        vtime_max(node->cpu_free, now) + cycles_to_time(node, COST_UART_INTERRUPT + COST_UART_BYTE * (double)bytes);
}

/* Confirm an image on trial (a new image that the bootloader replaces unless it is confirmed) once a host has completed
 * the handshake and sent a command. The flash row is written between two passes. */
static void confirm_image(struct hub_node *node)
{
    if (node->has_confirmed || !node->hub.version || !node->hub.inbox.commands) {
        return;
    }
    node->has_confirmed = true;
    node->cpu_free = vtime_max(node->cpu_free, boot_node_confirm_image(&node->boot, node->now));
}

/* Return the virtual time at which hub_node_run() must be called next. */
vtime hub_node_next_time(const struct hub_node *node)
{
    if (node->psoc) {
        return psoc_next_event(node->psoc);
    }
    if (node->original) {
        return hub_original_next_time(node);
    }
    return node->wake == VTIME_NEVER ? VTIME_NEVER : vtime_max(node->wake, node->cpu_free);
}

/* Run one pass of the hub's main loop or, with an emulated processor, its instructions until `horizon`. The time to
 * frame a snapshot occupies the CPU after the pass. */
void hub_node_run(struct hub_node *node, vtime horizon)
{
    if (node->psoc) {
        (void)psoc_run(node->psoc, vtime_max(horizon, hub_node_next_time(node) + 1u)); /* at least one instruction */
        return;
    }
    if (node->original) {
        hub_original_run(node, horizon);
        return;
    }
    const uint32_t sent = node->hub.outbox.bytes_sent;
    const vtime start = vtime_max(node->wake, node->cpu_free);
    if (node->program != PROGRAM_APPLICATION) {
        run_bootloader(node, start);
        return;
    }
    node->wake = VTIME_NEVER;
    node->now = start + cycles_to_time(node, COST_HUB_PASS);
    taxel_hub_run(&node->hub);
    /* The hub checks and frames a snapshot after it has started the next transfer, so this work occupies the CPU, but
     * not the bus. */
    /* The difference is negative if frames were dropped, because the hub subtracts their bytes. */
    const double framed = fmax(0.0, (int32_t)(node->hub.outbox.bytes_sent - sent));
    node->cpu_free = node->now + cycles_to_time(node, framed * COST_HUB_FRAME_BYTE);
    if (node->restart_requested) {
        hub_node_boot(node, node->now, TAXEL_RESET_CAUSE_COMMAND);
        return;
    }
    confirm_image(node);
}
