#include "fake_hub.h"

#define RUN_COST_US 5u

/* Abort the transfer in progress and count this; HAL function of the simulated hub. */
static void on_i2c_abort(void *context)
{
    struct fake_hub *fake = context;
    fake->done_us = FAKE_NEVER;
    fake->aborts++;
}

/* Return whether the data line is high: neither the hub nor a slave holds it low. */
static bool sda_level(const struct fake_hub *fake)
{
    return fake->sda && !fake->sda_held_clocks;
}

/* Set and record the levels of SCL and SDA; HAL function of the simulated hub. Each falling edge of SCL brings a slave
 * that holds SDA closer to its release. */
static void on_i2c_drive(void *context, bool scl_high, bool sda_high)
{
    struct fake_hub *fake = context;
    if (fake->scl && !scl_high && fake->sda_held_clocks) {
        fake->sda_held_clocks--;
    }
    fake->scl = scl_high;
    fake->sda = sda_high;
    if (fake->line_count < FAKE_LINES) {
        fake->lines[fake->line_count].scl = scl_high;
        fake->lines[fake->line_count].sda = sda_high;
        fake->lines[fake->line_count++].at_us = fake->now_us;
    }
}

/* Return whether the clock line is high; HAL function of the simulated hub. */
static bool on_i2c_scl(void *context)
{
    const struct fake_hub *fake = context;
    return fake->scl && !fake->scl_held;
}

/* Return whether the data line is high; HAL function of the simulated hub. */
static bool on_i2c_sda(void *context)
{
    return sda_level(context);
}

/* Start the transmitter (no effect here); HAL function of the simulated hub. */
static void on_uart_kick(void *context)
{
    (void)context; /* fake_hub_run() drains after every pass */
}

/* Request with RTS that the host pauses (`hold` true) or continues, and count the changes; HAL function of the
 * simulated hub. */
static void on_uart_hold(void *context, bool hold)
{
    struct fake_hub *fake = context;
    fake->hold_changes += fake->is_host_held != hold;
    fake->is_host_held = hold;
}

/* Return the simulated time in microseconds; HAL function of the simulated hub. */
static uint64_t on_clock_us(void *context)
{
    return ((const struct fake_hub *)context)->now_us;
}

/* Advance the simulated time; HAL function of the simulated hub. */
static void on_delay_us(void *context, uint32_t microseconds)
{
    ((struct fake_hub *)context)->now_us += microseconds;
}

/* Store the time of the next pass of the main loop; the earliest request applies; HAL function of the simulated hub. */
static void on_wake_at(void *context, uint64_t clock_us)
{
    struct fake_hub *fake = context;
    fake->wake_us = clock_us < fake->wake_us ? clock_us : fake->wake_us;
}

/* Count the requests for a restart; HAL function of the simulated hub. */
static void on_restart(void *context)
{
    ((struct fake_hub *)context)->restarts++;
}

/* Count the requests for the bootloader; HAL function of the simulated hub. */
static void on_enter_bootloader(void *context)
{
    ((struct fake_hub *)context)->bootloader_entries++;
}

/* Execute a transfer at once, or with the outcome that the script of the test selects, and report its end after the
 * time on the bus; HAL function of the simulated hub. */
static void on_i2c_start(void *context, const struct taxel_i2c_transfer *transfer)
{
    struct fake_hub *fake = context;
    const int outcome = fake->script ? fake->script(fake, transfer) : FAKE_PROCEED;
    fake->overlapping += fake->done_us != FAKE_NEVER;
    fake->transfers++;
    const uint64_t bytes = 2u + transfer->write_size + transfer->read_size;
    fake->done_us = fake->now_us + 5u + bytes * 9u * 1000000u / fake->config.scl_hz;
    if (!sda_level(fake) || fake->scl_held) {
        fake->result = TAXEL_I2C_BUSY;
        fake->done_us = fake->now_us + 10u;
    } else if (outcome == FAKE_HANG) {
        fake->done_us = FAKE_NEVER;
    } else if (outcome != FAKE_PROCEED) {
        fake->result = (int8_t)outcome;
    } else {
        fake->result = fake_bus_transfer(fake, transfer);
    }
}

/* Initialise a simulated hub without boards: HAL functions, memory and default settings. fake_hub_boot() starts
 * it. */
void fake_hub_init(struct fake_hub *fake)
{
    memset(fake, 0, sizeof *fake);
    fake->hal = (struct taxel_hub_hal){
        .context = fake,
        .i2c_start = on_i2c_start,
        .i2c_abort = on_i2c_abort,
        .i2c_drive = on_i2c_drive,
        .i2c_scl = on_i2c_scl,
        .i2c_sda = on_i2c_sda,
        .uart_kick = on_uart_kick,
        .uart_hold = on_uart_hold,
        .clock_us = on_clock_us,
        .delay_us = on_delay_us,
        .wake_at = on_wake_at,
        .restart = on_restart,
        .enter_bootloader = on_enter_bootloader,
    };
    fake->config = (struct taxel_hub_config){
        .hal = &fake->hal,
        .firmware_version = (const uint8_t *)"\x04\x05\x06",
        .unique_id = (const uint8_t *)"\x08\x07\x06\x05\x04\x03\x02\x01",
        .scl_hz = 400000,
        .slots = fake->slots,
        .slot_capacity = FAKE_SLOTS,
        .transfer_pool = fake->pool,
        .transfer_pool_size = FAKE_POOL,
        .transmit_ring = fake->ring,
        .transmit_ring_size = FAKE_RING,
    };
    fake_host_init(fake);
    fake->scl = fake->sda = true;
    fake->drain_bytes = FAKE_PULL;
    fake->now_us = 1000;
}

/* Start the firmware of the hub, as after a brown-out. */
void fake_hub_boot(struct fake_hub *fake)
{
    fake->wake_us = fake->now_us;
    fake->done_us = FAKE_NEVER;
    fake->next_sequence = 0;
    taxel_hub_init(&fake->hub, &fake->config, TAXEL_RESET_CAUSE_BROWN_OUT);
}

/* Add a device with this I2C address to the bus. `sensor`: the board, or NULL for a device that only acknowledges.
 * Returns the device. */
struct fake_device *fake_hub_add(struct fake_hub *fake, uint8_t address, struct fake_sensor *sensor)
{
    struct fake_device *device = &fake->devices[fake->device_count++];
    device->address = address;
    device->sensor = sensor;
    return device;
}

/* Take bytes from the hub as the UART does, and decode them as the host. */
static void drain(struct fake_hub *fake)
{
    uint8_t bytes[FAKE_PULL];
    const size_t size = taxel_hub_uart_pull(&fake->hub, bytes, fake->drain_bytes);
    taxel_deframer_push(&fake->deframer, bytes, size);
}

/* Run one pass of the hub's main loop, after reporting the end of a transfer if one is due; then let the UART take
 * bytes. */
static void pass(struct fake_hub *fake)
{
    if (fake->done_us <= fake->now_us) {
        fake->done_us = FAKE_NEVER;
        taxel_hub_on_i2c_done(&fake->hub, fake->result);
    }
    fake->wake_us = FAKE_NEVER; /* this pass serves the request */
    taxel_hub_run(&fake->hub);
    fake->now_us += RUN_COST_US;
    drain(fake);
}

/* Advance the simulated time to the next event of the hub and run its main loop. Returns false if no event is due
 * before `until` (microseconds). */
bool fake_hub_step(struct fake_hub *fake, uint64_t until)
{
    const uint64_t next = fake->wake_us < fake->done_us ? fake->wake_us : fake->done_us;
    if (next > until) {
        return false;
    }
    fake->now_us = next > fake->now_us ? next : fake->now_us;
    pass(fake);
    return true;
}

/* Run the hub for the given simulated time. */
void fake_hub_run(struct fake_hub *fake, uint64_t microseconds)
{
    const uint64_t until = fake->now_us + microseconds;
    while (fake->now_us <= until && fake_hub_step(fake, until)) {
    }
    fake->now_us = until > fake->now_us ? until : fake->now_us;
}

/* Run the hub until it has completed this number of poll cycles. Returns false if they are not completed within 10
 * s. */
bool fake_hub_run_cycles(struct fake_hub *fake, uint32_t cycles)
{
    const uint32_t target = fake->hub.cycle.count + cycles;
    const uint64_t until = fake->now_us + 10000000u;
    while (fake->hub.cycle.count != target && fake_hub_step(fake, until)) {
    }
    return fake->hub.cycle.count == target;
}

/* Deliver bytes of the host to the hub, then run its main loop once. */
void fake_hub_receive(struct fake_hub *fake, const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        taxel_hub_on_uart_byte(&fake->hub, bytes[i]);
    }
    pass(fake);
}
