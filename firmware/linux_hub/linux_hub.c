#include "linux_hub/linux_hub.h"

#include <stdlib.h>

#include "hub/hub.h"
#include "linux_hub/byte_ring.h"
#include "linux_hub/predicted_read.h"

#define SLOTS (TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN + 1u)
/* two uncompressed snapshots of the largest board */
#define TRANSFER_POOL (2u * TAXEL_HUB_BUFFER_SIZE(TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXEL_TAXELS_MAX))
#define TRANSMIT_RING 4096u
#define PULL_SIZE 512u
/* Three seconds of snapshots of a hand of 17 boards at 1 MHz bus clock: longer than pauses of a Python host. */
#define OUTPUT_SIZE (1u << 19)
#define INPUT_SIZE 4096u
#define RECOVERY_TIMEOUT_US 10000u
#define NEVER (UINT64_MAX / 2u) /* the origin can be added without an overflow */

struct linux_hub {
    struct taxel_hub hub;
    struct taxel_hub_config config;
    struct taxel_hub_hal hal;
    struct linux_hub_settings settings;
    struct linux_hub_bus bus;
    struct predicted_read prediction;
    struct taxel_i2c_transfer transfer; /* started in the present pass */
    bool has_transfer;
    bool is_held; /* the firmware's receive ring is nearly full */
    bool restart_requested;
    uint64_t origin_us; /* the bus's clock when the hub's clock was 0; modulo 2^64 */
    uint64_t wake_us;   /* on the hub's clock */
    struct byte_ring output, input;
    struct taxel_hub_slot slots[SLOTS];
    uint8_t transfer_pool[TRANSFER_POOL];
    uint8_t transmit_ring[TRANSMIT_RING];
    uint8_t output_bytes[OUTPUT_SIZE];
    uint8_t input_bytes[INPUT_SIZE];
};

/* HAL function: keep the transfer, which linux_hub_execute() executes after the pass. */
static void on_i2c_start(void *context, const struct taxel_i2c_transfer *transfer)
{
    struct linux_hub *hub = context;
    hub->transfer = *transfer;
    hub->has_transfer = true;
}

/* HAL function: discard the transfer. The bus ends transfers at their time limit, so the firmware has no reason to call
 * this function. */
static void on_i2c_abort(void *context)
{
    ((struct linux_hub *)context)->has_transfer = false;
}

/* HAL function: try to free the bus by a read from an address without a device, because an adapter cannot drive single
 * lines. A driver with a recovery of its own has already executed this recovery at the end of the failed transfer.
 * Returns the remaining fault (enum taxel_board_fault). */
static uint8_t on_i2c_recover(void *context)
{
    const struct linux_hub *hub = context;
    uint8_t byte;
    switch (hub->bus.transfer(hub->bus.context, LINUX_HUB_RECOVERY_ADDRESS, NULL, 0, &byte, 1, RECOVERY_TIMEOUT_US)) {
    case TAXEL_I2C_NACK_ADDRESS:
    case TAXEL_I2C_NACK_DATA:
        return TAXEL_BOARD_FAULT_NONE;
    case TAXEL_I2C_TIMEOUT:
        return TAXEL_BOARD_FAULT_SCL_STUCK;
    default: /* also an acknowledge: no device has this address, so a line is held low */
        return TAXEL_BOARD_FAULT_SDA_STUCK;
    }
}

/* HAL function: bytes are queued. Does nothing, because linux_hub_pass() moves queued bytes to the output. */
static void on_uart_kick(void *context)
{
    (void)context;
}

/* HAL function: pause (`hold`) or continue the transfer of the host's bytes into the firmware's receive ring. */
static void on_uart_hold(void *context, bool hold)
{
    ((struct linux_hub *)context)->is_held = hold;
}

/* HAL function: return the hub's clock in microseconds. */
static uint64_t on_clock_us(void *context)
{
    const struct linux_hub *hub = context;
    return hub->bus.clock_us(hub->bus.context) - hub->origin_us;
}

/* HAL function: do not wait; only the manual control of the lines needs a delay, which this port does not have. */
static void on_delay_us(void *context, uint32_t microseconds)
{
    (void)context;
    (void)microseconds;
}

/* HAL function: request that the next pass begins at the latest at this time of the hub's clock. */
static void on_wake_at(void *context, uint64_t clock_us)
{
    struct linux_hub *hub = context;
    hub->wake_us = clock_us < hub->wake_us ? clock_us : hub->wake_us;
}

/* HAL function: request a restart after this pass. */
static void on_restart(void *context)
{
    ((struct linux_hub *)context)->restart_requested = true;
}

/* Create and start a hub. The settings and the bus are copied. Returns NULL if the memory is insufficient. */
struct linux_hub *linux_hub_create(const struct linux_hub_settings *settings, const struct linux_hub_bus *bus)
{
    struct linux_hub *hub = calloc(1, sizeof *hub);
    if (!hub) {
        return NULL;
    }
    hub->settings = *settings;
    hub->bus = *bus;
    hub->hal = (struct taxel_hub_hal){
        .context = hub,
        .i2c_start = on_i2c_start,
        .i2c_abort = on_i2c_abort,
        .i2c_recover = on_i2c_recover,
        .uart_kick = on_uart_kick,
        .uart_hold = on_uart_hold,
        .clock_us = on_clock_us,
        .delay_us = on_delay_us,
        .wake_at = on_wake_at,
        .restart = on_restart,
        .enter_bootloader = NULL, /* the firmware is a part of this program */
    };
    hub->config = (struct taxel_hub_config){
        .hal = &hub->hal,
        .firmware_version = hub->settings.firmware_version,
        .unique_id = hub->settings.unique_id,
        .scl_hz = settings->scl_hz,
        .slots = hub->slots,
        .slot_capacity = SLOTS,
        .transfer_pool = hub->transfer_pool,
        .transfer_pool_size = TRANSFER_POOL,
        .transmit_ring = hub->transmit_ring,
        .transmit_ring_size = TRANSMIT_RING,
    };
    hub->output = (struct byte_ring){.bytes = hub->output_bytes, .capacity = OUTPUT_SIZE};
    hub->input = (struct byte_ring){.bytes = hub->input_bytes, .capacity = INPUT_SIZE};
    linux_hub_restart(hub, TAXEL_RESET_CAUSE_POWER_ON);
    return hub;
}

/* Release the memory of the hub. NULL is permitted. */
void linux_hub_free(struct linux_hub *hub)
{
    free(hub);
}

/* Start the firmware again. The bytes of the host that it has not taken are lost; `cause`: enum taxel_reset_cause. */
void linux_hub_restart(struct linux_hub *hub, uint8_t cause)
{
    hub->has_transfer = hub->is_held = hub->restart_requested = false;
    hub->input.count = 0;
    hub->origin_us = hub->bus.clock_us(hub->bus.context) - hub->settings.clock_start_us;
    taxel_hub_init(&hub->hub, &hub->config, cause);
}

/* Move bytes of the host into the firmware's receive ring, until the ring is nearly full or no bytes are left. */
static void feed_input(struct linux_hub *hub)
{
    uint8_t byte;
    while (!hub->is_held && byte_ring_read(&hub->input, &byte, 1)) {
        taxel_hub_on_uart_byte(&hub->hub, byte);
    }
}

/* Move the firmware's queued bytes to the output, as far as they fit. Returns whether any byte was moved. */
static bool drain_output(struct linux_hub *hub)
{
    uint8_t bytes[PULL_SIZE];
    bool any = false;
    for (;;) {
        const size_t space = byte_ring_space(&hub->output);
        const size_t size = taxel_hub_uart_pull(&hub->hub, bytes, space < PULL_SIZE ? space : PULL_SIZE);
        if (!size) {
            return any;
        }
        (void)byte_ring_write(&hub->output, bytes, size);
        any = true;
    }
}

/* Return whether the settings permit probes of this address. */
static bool may_probe(const struct linux_hub *hub, uint8_t address)
{
    return hub->settings.probed[address >> 3] & (1u << (address & 7u));
}

/* Execute a transfer with the address, read buffer and time limit of the firmware's transfer, but with these sizes and
 * bytes to write. Returns enum taxel_i2c_result. */
static int transfer(struct linux_hub *hub, const uint8_t *write_bytes, size_t write_size, size_t read_size)
{
    const struct taxel_i2c_transfer *started = &hub->transfer;
    const uint32_t timeout_us = hub->hub.job.deadline_us - hub->hub.job.started_us;
    return hub->bus.transfer(hub->bus.context, started->address, write_bytes, write_size, started->read_bytes,
                             read_size, timeout_us);
}

/* Execute the read of a compact snapshot: read as many bytes as predicted, and read again from the start while the
 * snapshot is longer. A board repeats a snapshot in a read that begins with a write of the register pointer. Returns
 * enum taxel_i2c_result. */
static int transfer_predicted(struct linux_hub *hub)
{
    static const uint8_t pointer = TAXEL_REGISTER_COMPACT;
    const struct taxel_i2c_transfer *started = &hub->transfer;
    size_t size = predicted_read_size(&hub->prediction, started);
    int result = transfer(hub, started->write_bytes, started->write_size, size);
    /* ends at the latest with a read of the upper limit, which contains every snapshot */
    while (result == TAXEL_I2C_OK && (size = predicted_read_remainder(&hub->prediction, started, size)) != 0) {
        result = transfer(hub, &pointer, sizeof pointer, size);
    }
    return result;
}

/* Execute the transfer that the firmware has started, and report its result to the firmware. A probe of an address that
 * must not be probed ends as not acknowledged. */
static void execute_transfer(struct linux_hub *hub)
{
    const struct taxel_i2c_transfer *started = &hub->transfer;
    const bool is_probe = !started->write_size && !started->read_size;
    int result;
    if (is_probe && !may_probe(hub, started->address)) {
        result = TAXEL_I2C_NACK_ADDRESS;
    } else if (started->length_prefixed) {
        result = transfer_predicted(hub);
    } else {
        result = transfer(hub, started->write_bytes, started->write_size, started->read_size);
    }
    taxel_hub_on_i2c_done(&hub->hub, (int8_t)result);
}

/* Run one pass of the main loop, without the transfer that the pass starts: linux_hub_execute() executes the transfer.
 * Returns the time on the bus's clock at which the next pass is due at the latest. */
uint64_t linux_hub_pass(struct linux_hub *hub)
{
    feed_input(hub);
    hub->wake_us = NEVER;
    taxel_hub_run(&hub->hub);
    bool is_due = drain_output(hub); /* space in the transmit ring: the firmware may continue */
    if (hub->restart_requested) {
        linux_hub_restart(hub, TAXEL_RESET_CAUSE_COMMAND);
        is_due = true;
    }
    is_due = is_due || hub->has_transfer || (hub->input.count && !hub->is_held);
    return is_due ? hub->bus.clock_us(hub->bus.context) : hub->wake_us + hub->origin_us;
}

/* Execute the transfer that the last pass has started, if any. */
void linux_hub_execute(struct linux_hub *hub)
{
    if (hub->has_transfer) {
        hub->has_transfer = false;
        execute_transfer(hub);
    }
}

/* Append bytes of the host. Returns the number of bytes that fitted into the buffer. */
size_t linux_hub_send(struct linux_hub *hub, const uint8_t *bytes, size_t size)
{
    return byte_ring_write(&hub->input, bytes, size);
}

/* Take up to `size` bytes for the host. Returns their number. */
size_t linux_hub_receive(struct linux_hub *hub, uint8_t *bytes, size_t size)
{
    return byte_ring_read(&hub->output, bytes, size);
}

/* Return the number of bytes that the host can receive. */
size_t linux_hub_waiting(const struct linux_hub *hub)
{
    return hub->output.count;
}

/* Return the number of bytes of the host that the firmware has not taken yet. */
size_t linux_hub_unread(const struct linux_hub *hub)
{
    return hub->input.count;
}
