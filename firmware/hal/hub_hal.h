/* What the hub's firmware needs from its processor. One struct of functions; the port fills it in. */
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
    TAXEL_I2C_BUS_ERROR = -4, /* a start or stop where none belongs */
    TAXEL_I2C_TIMEOUT = -5,
    TAXEL_I2C_BUSY = -6, /* a line is low before the start */
};

/* Write write_size bytes, then, after a repeated start, read read_size bytes; either may be 0. With both 0 the address is
 * sent for writing and nothing else: a probe. */
struct taxel_i2c_transfer {
    uint8_t address;
    const uint8_t *write_bytes;
    size_t write_size;
    uint8_t *read_bytes;
    size_t read_size;
    bool counted; /* the first byte read tells, as a compact snapshot's length, how many follow; read_size is the most of all */
};

/* For those who carry it out: bytes still to be read after the first, of a transfer that is counted. */
static inline size_t taxel_i2c_counted_rest(const struct taxel_i2c_transfer *transfer, uint8_t first)
{
    const size_t rest = taxel_compact_size(first);
    return rest < transfer->read_size ? rest : transfer->read_size - 1u;
}

struct taxel_hub_hal {
    void *context;

    /* Begin a transfer; the port calls taxel_hub_on_i2c_done() when it has ended. */
    void (*i2c_start)(void *context, const struct taxel_i2c_transfer *transfer);
    /* Give a transfer up: release both lines. No taxel_hub_on_i2c_done() follows. */
    void (*i2c_abort)(void *context);
    /* The two lines by hand, for bus recovery: drive a line low or let it go, and read it back. */
    void (*i2c_drive)(void *context, bool scl_high, bool sda_high);
    bool (*i2c_scl)(void *context);
    bool (*i2c_sda)(void *context);

    /* Bytes wait in the transmit ring: fetch them with taxel_hub_uart_pull(). */
    void (*uart_kick)(void *context);
    /* Let the host's adapter send no more (RTS high), or go on. NULL: the line is not wired. Also called from the interrupt that
     * hands bytes over. While the processor starts the line must say "go on". */
    void (*uart_hold)(void *context, bool hold);

    /* Microseconds since boot. */
    uint64_t (*clock_us)(void *context);
    void (*delay_us)(void *context, uint32_t microseconds);
    /* Call taxel_hub_run() at that clock_us() at the latest. It is also called after every interrupt. Of several requests the
     * earliest holds, and any call of taxel_hub_run() uses up those made before it. */
    void (*wake_at)(void *context, uint64_t clock_us);

    void (*restart)(void *context);
    /* As restart, but the bootloader stays. */
    void (*enter_bootloader)(void *context);
};

#endif
