/* Processor interface of the hub's firmware: one struct of functions that the port fills in.
 *
 * Integration (the port's side; hub/hub.h shows the configuration):
 *
 *     static void start_transfer(void *context, const struct taxel_i2c_transfer *transfer) { ... }
 *     ...
 *     static const struct taxel_hub_hal hal = {
 *         .context = NULL, .i2c_start = start_transfer, .i2c_abort = abort_transfer, .i2c_drive = drive_lines,
 *         .i2c_scl = read_scl, .i2c_sda = read_sda, .uart_kick = enable_transmit_interrupt, .uart_hold = NULL,
 *         .clock_us = clock_us, .delay_us = delay_us, .wake_at = set_wake_time,
 *         .restart = reset, .enter_bootloader = reset_into_bootloader,
 *     };
 *     // I2C interrupt, end of a transfer: taxel_hub_on_i2c_done(&hub, TAXEL_I2C_OK);
 */
#ifndef TAXEL_HUB_HAL_H
#define TAXEL_HUB_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

enum taxel_i2c_result {
    TAXEL_I2C_OK = 0,
    TAXEL_I2C_NACK_ADDRESS = -1,
    TAXEL_I2C_NACK_DATA = -2,
    TAXEL_I2C_ARBITRATION_LOST = -3,
    TAXEL_I2C_BUS_ERROR = -4, /* a start or stop condition at a wrong position */
    TAXEL_I2C_TIMEOUT = -5,
    TAXEL_I2C_BUSY = -6, /* a line is low before the start */
};

/* Write write_size bytes, then, after a repeated start, read read_size bytes; either may be 0. With both 0, only the
 * address is sent, for writing: a probe. */
struct taxel_i2c_transfer {
    uint8_t address;
    const uint8_t *write_bytes;
    size_t write_size;
    uint8_t *read_bytes;
    size_t read_size;
    /* the first byte read is the length of a compact snapshot; read_size is then the upper limit */
    bool length_prefixed;
};

/* Return the number of bytes that the port must read after the first byte (`first`) of a length-prefixed transfer. */
static inline size_t taxel_i2c_bytes_after_length(const struct taxel_i2c_transfer *transfer, uint8_t first)
{
    const size_t size = taxel_compact_size(first);
    return size < transfer->read_size ? size : transfer->read_size - 1u;
}

struct taxel_hub_hal {
    /* First argument of all functions; may be NULL. */
    void *context;

    /* Start a transfer; the port calls taxel_hub_on_i2c_done() at its end. The struct is valid during the call only,
     * the bytes to which it points until the end of the transfer. */
    void (*i2c_start)(void *context, const struct taxel_i2c_transfer *transfer);
    /* Abort the transfer in progress: release both lines. No taxel_hub_on_i2c_done() follows. */
    void (*i2c_abort)(void *context);
    /* Manual control of the two lines, for bus recovery: drive a line low (false) or release it (true), and read its
     * level. */
    void (*i2c_drive)(void *context, bool scl_high, bool sda_high);
    bool (*i2c_scl)(void *context);
    bool (*i2c_sda)(void *context);
    /* Free the bus, and return the fault (enum taxel_board_fault) that remains, or TAXEL_BOARD_FAULT_NONE. For a
     * controller whose lines cannot be driven one by one: the three functions above are then not called and may be
     * NULL. NULL: the hub drives the lines. */
    uint8_t (*i2c_recover)(void *context);

    /* Bytes are queued: the UART's interrupt fetches them with taxel_hub_uart_pull(). */
    void (*uart_kick)(void *context);
    /* Stop the host's adapter (RTS high) or let it send again (low). NULL: RTS is not wired. Also called from the
     * interrupt that calls taxel_hub_on_uart_byte(). RTS must be low while the processor starts. */
    void (*uart_hold)(void *context, bool hold);

    /* Microseconds since boot; never decreases. */
    uint64_t (*clock_us)(void *context);
    /* Wait for at least so many microseconds; called with values up to 5. */
    void (*delay_us)(void *context, uint32_t microseconds);
    /* Call taxel_hub_run() at the latest when clock_us() reaches this value, and after every interrupt. The earliest
     * of several requests applies; each call of taxel_hub_run() cancels the requests made before it. */
    void (*wake_at)(void *context, uint64_t clock_us);

    /* Reset the processor, after the bytes that taxel_hub_uart_pull() has returned are sent. */
    void (*restart)(void *context);
    /* Reset the processor in the same way and stay in its bootloader. NULL: there is none, and the command is rejected. */
    void (*enter_bootloader)(void *context);
};

#endif
