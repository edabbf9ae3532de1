/* The bootloader: one source for boards (packets over I2C) and the hub (over its UART). */
#include "bootloader/bootloader.h"
#include "boards/psoc4/flash_rows.h"
#include "boards/psoc4/regs/core.h"
#include "boards/psoc4/regs/scb.h"
#include "boards/psoc4/clocks.h"
#include "boards/psoc4/reset.h"
#include "boards/psoc4/ticks.h"
#include "boards/psoc4/watchdog.h"
#include "board_pins.h"

#if IMAGE_DEVICE == 2
#include "boards/psoc4/uart.h"
static struct taxel_boot_uart wire;
#ifdef TAXEL_BOOT_64K
#define LAYOUT taxel_boot_layout_hub_64k
#else
#define LAYOUT taxel_boot_layout_hub
#endif
#define wire_off uart_off
#else
#include "boards/psoc4/i2c_slave.h"
static struct taxel_boot_i2c wire;
#ifdef TAXEL_BOOT_ONE_SLOT
#define LAYOUT taxel_boot_layout_board_16k
#elif defined TAXEL_BOOT_64K
#define LAYOUT taxel_boot_layout_board_64k
#else
#define LAYOUT taxel_boot_layout_board
#endif
#define wire_off i2c_slave_end
#endif

static struct taxel_boot boot;

/* HAL function of the bootloader: write one flash row of 128 bytes. On a board (IMAGE_DEVICE 1; 2 is the hub), the I2C
 * slave is off during the write, so that the bus is not held. Always returns 0, because the caller reads the row
 * back. */
static int on_write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    (void)context;
    (void)interrupts_mask();
#if IMAGE_DEVICE != 2
    /* Wait for the end of the transfer in progress; without an end, the watchdog resets the processor. */
    while (!i2c_slave_try_off()) {
        interrupts_unmask(0);
        (void)interrupts_mask();
    }
#endif
    flash_rows_write(row, bytes);
#if IMAGE_DEVICE != 2
    i2c_slave_on();
#endif
    interrupts_unmask(0);
    return 0;
}

/* HAL function of the bootloader: return the time since the start of the clock, in microseconds modulo 2^32. */
static uint32_t on_clock_us(void *context)
{
    (void)context;
    return ticks_us_32();
}

/* HAL function of the bootloader: return TAXEL_RESET_CAUSE_COMMAND if software requested the last reset, otherwise
 * 0. */
static uint8_t on_reset_cause(void *context)
{
    (void)context;
    return reset_was_commanded() ? TAXEL_RESET_CAUSE_COMMAND : 0; /* the bootloader distinguishes no other causes */
}

/* HAL function of the bootloader: return whether the application requested that the bootloader keeps running after the
 * reset. The request is cleared. */
static bool on_stay_requested(void *context)
{
    (void)context;
    return reset_stay_requested();
}

/* HAL function of the bootloader: start the image whose vector table is at address `vectors`. I2C or UART are
 * switched off, as after a reset. The watchdog and SysTick keep running and one interrupt stays enabled; the
 * start-up code of the image expects this state. */
static void on_start(void *context, uint32_t vectors)
{
    (void)context;
    (void)interrupts_mask();
    wire_off();
    /* word 0: initial stack pointer, word 1: address of the first instruction */
    const uint32_t *const table = (const uint32_t *)(uintptr_t)vectors;
    __asm__ volatile("msr msp, %0\n\tbx %1" ::"r"(table[0]), "r"(table[1]) : "memory");
    __builtin_unreachable();
}

/* HAL function of the bootloader: reset the processor. Does not return. */
static void on_restart(void *context)
{
    (void)context;
    reset_now();
}

/* HAL function of the bootloader: write the unique id of the processor to `id`, 8 bytes. */
static void on_unique_id(void *context, uint8_t *id)
{
    (void)context;
    reset_unique_id(id);
}

static const struct taxel_boot_hal hal = {
    .flash = (const uint8_t *)0,
    .flash_write_row = on_write_row,
    .clock_us = on_clock_us,
    .reset_cause = on_reset_cause,
    .stay_requested = on_stay_requested,
    .start = on_start,
    .restart = on_restart,
    .unique_id = on_unique_id,
};

static const struct taxel_boot_config config = {
    .flash = {.hal = &hal, .layout = &LAYOUT},
    .checksum = TAXEL_BOOT_CHECKSUM_ANY,
    .version = {TAXEL_BOOT_VERSION, 0, 0},
};

#if IMAGE_DEVICE == 2

/* Pass a received byte to the bootloader of the hub. Called by the UART driver. */
void uart_on_byte(uint8_t byte)
{
    taxel_boot_uart_on_byte(&wire, byte);
}

/* Ignore that a received byte was lost because the FIFO was full. Called by the UART driver. */
void uart_on_lost_byte(void)
{
    /* the packet's checksum fails, and the host repeats the packet */
}

/* Copy up to `size` bytes of the bootloader's response to `bytes` and return their number. Called by the UART driver
 * for bytes to send. */
size_t uart_pull(uint8_t *bytes, size_t size)
{
    return taxel_boot_uart_pull(&wire, bytes, size);
}

/* Hub: set up the UART as the connection of the bootloader to the host. */
static void wire_init(void)
{
    taxel_boot_uart_init(&wire, &boot);
    uart_init();
}

/* Hub: process a received packet and start the transmission of its response. Called in each pass of the main loop. */
static void wire_run(void)
{
    taxel_boot_uart_run(&wire);
    if (wire.position < wire.response_size) {
        uart_kick();
    }
}

#else

/* Pass the board's address, sent by a master for reading or writing, to the bootloader. Called by the I2C driver.
 * Returns whether to acknowledge. */
bool i2c_slave_on_address(bool reading)
{
    return taxel_boot_i2c_on_address(&wire, reading);
}

/* Pass a byte from the master to the bootloader. Called by the I2C driver. Returns whether to acknowledge the byte. */
bool i2c_slave_on_write(uint8_t byte)
{
    return taxel_boot_i2c_on_write(&wire, byte);
}

/* Return the next byte of the bootloader's response. Called by the I2C driver when the master reads. */
uint8_t i2c_slave_on_read(void)
{
    return taxel_boot_i2c_on_read(&wire);
}

/* Pass a stop condition, which completes a packet, to the bootloader. Called by the I2C driver. */
void i2c_slave_on_stop(void)
{
    taxel_boot_i2c_on_stop(&wire);
}

/* Pass a start or stop condition at a wrong position to the bootloader, which discards the incomplete packet. Called by
 * the I2C driver. */
void i2c_slave_on_bus_error(void)
{
    taxel_boot_i2c_on_bus_error(&wire);
}

/* Board: set up the I2C slave, at the configured address, as the connection of the bootloader to the host. */
static void wire_init(void)
{
    taxel_boot_i2c_init(&wire, &boot);
    i2c_slave_init(taxel_boot_i2c_address(&config.flash));
}

/* Board: process a received packet. Called in each pass of the main loop. */
static void wire_run(void)
{
    taxel_boot_i2c_run(&wire);
}

#endif

/* Run the bootloader of a board (I2C) or of the hub (UART) until it starts the application. */
int main(void)
{
    clocks_start();
    watchdog_start();
    reset_take_cause();
    ticks_init();
    taxel_boot_init(&boot, &config);
    wire_init();
    for (;;) {
        watchdog_feed();
        wire_run();
        wait_for_interrupt(); /* ends with the SysTick interrupt at the latest, within 1 ms */
    }
}
