/* The hub: the main loop makes a pass after an interrupt or at the requested time; I2C and UART run in interrupts. */
#include "board_pins.h"
#include "boards/psoc4/bus_clock.h"
#include "boards/psoc4/clocks.h"
#include "boards/psoc4/fault.h"
#include "boards/psoc4/i2c_master.h"
#include "boards/psoc4/regs/core.h"
#include "part/sflash.h"
#include "boards/psoc4/reset.h"
#include "boards/psoc4/self.h"
#include "boards/psoc4/ticks.h"
#include "boards/psoc4/uart.h"
#include "boards/psoc4/watchdog.h"
#include "hub/hub.h"

#ifdef BOARD_SLOTS
#define SLOTS BOARD_SLOTS
#else
#define SLOTS 17u /* boards of the hand */
#endif
#define TRANSFER_POOL (2u * TAXEL_HUB_BUFFER_SIZE((TAXEL_COMPACT_OVERHEAD_PACKED + 2u * BOARD_TAXELS_MAX + 3u) & ~3u))
#define TRANSMIT_RING 288u /* bytes: a status frame, or a frame of 30 taxels, plus the reserve for replies */
#define NEVER UINT64_MAX

static struct taxel_hub hub;
static struct taxel_hub_slot slots[SLOTS];
static uint8_t transfer_pool[TRANSFER_POOL];
static uint8_t transmit_ring[TRANSMIT_RING];
static uint64_t wake_us;
static volatile bool was_interrupted;

/* HAL function of the hub: start an I2C transfer, whose end i2c_master_on_done() reports. */
static void on_i2c_start(void *context, const struct taxel_i2c_transfer *transfer)
{
    (void)context;
    i2c_master_start(transfer);
}

/* HAL function of the hub: abort the I2C transfer in progress and release both lines. */
static void on_i2c_abort(void *context)
{
    (void)context;
    i2c_master_abort();
}

/* HAL function of the hub: set the levels of SCL and SDA by hand to free a blocked bus; true releases a line,
 * false drives it low. */
static void on_i2c_drive(void *context, bool scl_high, bool sda_high)
{
    (void)context;
    i2c_master_drive(scl_high, sda_high);
}

/* HAL function of the hub: return whether the I2C clock line is high. */
static bool on_i2c_scl(void *context)
{
    (void)context;
    return i2c_master_scl();
}

/* HAL function of the hub: return whether the I2C data line is high. */
static bool on_i2c_sda(void *context)
{
    (void)context;
    return i2c_master_sda();
}

/* HAL function of the hub: start the UART transmitter, which then fetches bytes with uart_pull(). */
static void on_uart_kick(void *context)
{
    (void)context;
    uart_kick();
}

#ifdef BOARD_PIN_UART_RTS
/* HAL function of the hub: request with the RTS output that the host pauses (`hold` true) or continues to send. */
static void on_uart_hold(void *context, bool hold)
{
    (void)context;
    uart_hold(hold);
}
#endif

/* HAL function of the hub: return the time since the start of the hub in microseconds. */
static uint64_t on_clock_us(void *context)
{
    (void)context;
    return ticks_us();
}

/* HAL function of the hub: wait for the given time in microseconds without sleeping. */
static void on_delay_us(void *context, uint32_t microseconds)
{
    (void)context;
    ticks_delay_us(microseconds);
}

/* HAL function of the hub: request that the main loop runs again at `clock_us` at the latest. The earliest request
 * applies. */
static void on_wake_at(void *context, uint64_t clock_us)
{
    (void)context;
    wake_us = clock_us < wake_us ? clock_us : wake_us;
}

/* HAL function of the hub: reset the processor, after the bytes in the FIFO of the UART have been sent. Does not
 * return. */
static void on_restart(void *context)
{
    (void)context;
    uart_finish();
    reset_now();
}

/* HAL function of the hub: reset the processor with the request that the bootloader keeps running. Does not
 * return. */
static void on_enter_bootloader(void *context)
{
    (void)context;
    uart_finish();
    reset_into_bootloader();
}

static const struct taxel_hub_hal hal = {
    .i2c_start = on_i2c_start,
    .i2c_abort = on_i2c_abort,
    .i2c_drive = on_i2c_drive,
    .i2c_scl = on_i2c_scl,
    .i2c_sda = on_i2c_sda,
    .uart_kick = on_uart_kick,
#ifdef BOARD_PIN_UART_RTS
    .uart_hold = on_uart_hold,
#endif
    .clock_us = on_clock_us,
    .delay_us = on_delay_us,
    .wake_at = on_wake_at,
    .restart = on_restart,
    .enter_bootloader = on_enter_bootloader,
};

const struct taxel_hub_config taxel_hub_fixed_config = {
    .hal = &hal,
    .firmware_version = SELF_VERSION,
    .unique_id = SFLASH->die,
    .fault_record = fault_record,
    .scl_hz = BUS_SCL_HZ,
    .slots = slots,
    .slot_capacity = SLOTS,
    .transfer_pool = transfer_pool,
    .transfer_pool_size = TRANSFER_POOL,
    .transmit_ring = transmit_ring,
    .transmit_ring_size = TRANSMIT_RING,
};

/* Pass the result of an I2C transfer that has ended to the hub, and prevent the main loop from sleeping. Called by the
 * I2C driver. */
void i2c_master_on_done(int8_t result)
{
    taxel_hub_on_i2c_done(&hub, result);
    was_interrupted = true;
}

/* Pass a byte from the host to the hub, and prevent the main loop from sleeping. Called by the UART driver. */
void uart_on_byte(uint8_t byte)
{
    taxel_hub_on_uart_byte(&hub, byte);
    was_interrupted = true;
}

/* Count a byte from the host that was lost because the FIFO was full. Called by the UART driver. */
void uart_on_lost_byte(void)
{
    hub.inbox.overruns++;
}

/* Copy up to `size` bytes of the hub's frames to `bytes` and return their number. Called by the UART driver for bytes
 * to send. */
size_t uart_pull(uint8_t *bytes, size_t size)
{
    return taxel_hub_uart_pull(&hub, bytes, size);
}

#ifndef IMAGE_STANDALONE
/* Confirm the image of the hub if a host has completed the handshake and sent a command, and no transfer is in
 * progress; returns whether this was the case. Writing the flash row takes 20 ms without interrupts, so RTS stops the
 * host during this time. */
static bool try_confirm(void)
{
    if (!hub.version || !hub.inbox.commands || !i2c_master_is_idle()) {
        return false;
    }
    uart_hold(true);
    ticks_delay_us(TAXEL_HUB_HOLD_SPACE * 10u); /* the adapter still sends bytes, 10 us each at 1 Mbaud */
    const uint32_t interrupts = interrupts_mask();
    self_confirm();
    interrupts_unmask(interrupts);
    uart_hold(hub.inbox.is_holding);
    return true;
}
#endif

/* Sleep until the next interrupt, unless the main loop has work or the timer would interrupt too late. Interrupts are
 * masked, so that none is handled between the check and the sleep; a pending interrupt still ends the sleep. */
static void sleep_until_event(void)
{
    const uint32_t interrupts = interrupts_mask();
    if (!was_interrupted && ticks_interrupts_before(wake_us)) {
        wait_for_interrupt();
    }
    interrupts_unmask(interrupts);
}

/* Run the application of the hub: its main loop after each interrupt and at the requested times, sleep otherwise. An
 * image on trial confirms itself once it has worked. */
int main(void)
{
#ifdef IMAGE_STANDALONE
    reset_take_cause(); /* with a bootloader, the bootloader has stored the cause */
#endif
    clocks_init();
    watchdog_start();
    fault_init();
    ticks_init();
    i2c_master_init();
    uart_init();
    taxel_hub_init(&hub, &taxel_hub_fixed_config, reset_cause());
#ifndef IMAGE_STANDALONE
    bool on_trial = self_is_on_trial();
#endif
    for (;;) {
        watchdog_feed();
        if (!was_interrupted && ticks_us() < wake_us) {
            sleep_until_event();
            continue;
        }
#ifndef IMAGE_STANDALONE
        if (on_trial && try_confirm()) {
            on_trial = false;
        }
#endif
        was_interrupted = false;
        wake_us = NEVER;
        taxel_hub_run(&hub);
    }
}
