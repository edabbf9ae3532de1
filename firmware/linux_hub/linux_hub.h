/* The hub's firmware (hub/hub.h) in a process of Linux: its I2C transfers are executed one after the other by a
 * function, its UART is a pair of buffers.
 *
 * Integration in virtual time; hub_thread.h shows the integration in real time:
 *
 *     const struct linux_hub_bus bus = {.context = world, .transfer = transfer, .clock_us = clock_us};
 *     struct linux_hub *hub = linux_hub_create(&settings, &bus);
 *     linux_hub_send(hub, command, sizeof command);
 *     do {
 *         next_us = linux_hub_pass(hub);
 *         linux_hub_execute(hub);
 *     } while (next_us <= clock_us(world));    // then let the time pass until next_us
 *     size = linux_hub_receive(hub, bytes, sizeof bytes);
 *     linux_hub_free(hub); */
#ifndef LINUX_HUB_LINUX_HUB_H
#define LINUX_HUB_LINUX_HUB_H

#include <stddef.h>
#include <stdint.h>

#include "hal/hub_hal.h"

/* A read of this address without an acknowledge gives nine clocks while SDA is released, then a stop condition: the
 * bus recovery of the I2C specification (UM10204, section 3.1.16). 0x7F is reserved and belongs to no device. */
#define LINUX_HUB_RECOVERY_ADDRESS 0x7Fu

/* The bus. Its functions are called from linux_hub_pass() and linux_hub_execute() only. */
struct linux_hub_bus {
    void *context; /* first argument of both functions */
    /* Execute a transfer as described at struct taxel_i2c_transfer, within about `timeout_us`; both sizes 0: a probe.
     * Returns enum taxel_i2c_result. */
    int (*transfer)(void *context, uint8_t address, const uint8_t *write_bytes, size_t write_size, uint8_t *read_bytes,
                    size_t read_size, uint32_t timeout_us);
    /* Microseconds of a clock that never decreases. */
    uint64_t (*clock_us)(void *context);
};

struct linux_hub_settings {
    uint32_t scl_hz;             /* clock of the bus, Hz: time limits of transfers, instants of clock readings */
    uint8_t firmware_version[3]; /* in HUB_HANDSHAKE */
    uint8_t unique_id[8];
    uint64_t clock_start_us; /* the hub's clock after a start */
    uint8_t probed[16];      /* a bit for each address that may be probed; other devices on the bus are not addressed */
};

struct linux_hub;

/* Start the hub. Returns NULL if the memory is insufficient. The settings and the bus are copied. */
struct linux_hub *linux_hub_create(const struct linux_hub_settings *settings, const struct linux_hub_bus *bus);
void linux_hub_free(struct linux_hub *hub);

/* Reset, as after an interruption of the supply: the host's bytes that the hub has not taken are lost, the clock
 * begins again. `cause`: enum taxel_reset_cause. */
void linux_hub_restart(struct linux_hub *hub, uint8_t cause);

/* Run one pass of the firmware's main loop. Returns the time (clock_us of the bus) at which the next pass is due at the
 * latest. Received bytes make a pass due at once. */
uint64_t linux_hub_pass(struct linux_hub *hub);
/* Execute the transfer that the last pass has started, if any. Uses neither the host's bytes nor those for the host. */
void linux_hub_execute(struct linux_hub *hub);

/* Append bytes of the host; returns the number of bytes that fitted into the buffer, which empties while the hub
 * runs. */
size_t linux_hub_send(struct linux_hub *hub, const uint8_t *bytes, size_t size);
/* Take up to `size` bytes for the host; returns their number. When the host does not receive, the hub discards and
 * counts snapshots, as with a UART without a reader. */
size_t linux_hub_receive(struct linux_hub *hub, uint8_t *bytes, size_t size);
/* Return the number of bytes that wait for linux_hub_receive(). */
size_t linux_hub_waiting(const struct linux_hub *hub);
/* Return the number of bytes of the host that the hub has not taken yet. */
size_t linux_hub_unread(const struct linux_hub *hub);

#endif
