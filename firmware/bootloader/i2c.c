/* One write transaction is one packet. A write that does not begin with a packet's first byte is meant for an
 * application and is ignored, like a probe. The response stays readable until the next packet. */
#include <stdatomic.h>

#include "bootloader/internal.h"

#define SIZE_TOO_LONG (TAXEL_BOOT_PACKET_MAX + 1u)

/* Initialises the I2C connection `slave` of the bootloader `boot`. No packet has been received. */
void taxel_boot_i2c_init(struct taxel_boot_i2c *slave, struct taxel_boot *boot)
{
    memset(slave, 0, sizeof *slave);
    slave->boot = boot;
}

/* The 7-bit I2C address of the board: the address of its configuration in flash, or 0x77 without a
 * configuration. */
uint8_t taxel_boot_i2c_address(const struct taxel_boot_flash *flash)
{
    const uint8_t *const configuration = taxel_boot_configuration(flash);
    return configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS] : TAXEL_BOOT_DEFAULT_ADDRESS;
}

/* A stop or repeated start condition ends a write. Bytes that begin like a packet are passed to the main loop. */
static void end_write(struct taxel_boot_i2c *slave)
{
    if (!slave->has_packet && slave->received && slave->packet[0] == TAXEL_BOOT_PACKET_START) {
        slave->response_size = 0;
        slave->has_packet = true;
    }
}

/* I2C interrupt: the bootloader was addressed. Returns whether to acknowledge: no write while a packet is being
 * executed; a read then returns no response yet. A silenced board does not acknowledge reads. */
bool taxel_boot_i2c_on_address(struct taxel_boot_i2c *slave, bool reading)
{
    end_write(slave);
    if (reading) {
        slave->readable = slave->has_packet ? 0 : slave->response_size;
        slave->position = 0;
        return slave->has_packet || !slave->boot->silent;
    }
    if (slave->has_packet) {
        return false;
    }
    slave->received = 0;
    return true;
}

/* I2C interrupt: store a byte of a packet. Returns whether to acknowledge; the bytes of a packet that is too long are
 * not acknowledged. */
bool taxel_boot_i2c_on_write(struct taxel_boot_i2c *slave, uint8_t byte)
{
    if (slave->has_packet) {
        return false;
    }
    if (slave->received >= TAXEL_BOOT_PACKET_MAX) {
        slave->received = SIZE_TOO_LONG;
        return false;
    }
    slave->packet[slave->received++] = byte;
    return true;
}

/* The next byte of the response for a master that reads: 0xFF before a response is ready and after its last
 * byte. */
uint8_t taxel_boot_i2c_on_read(struct taxel_boot_i2c *slave)
{
    return slave->position < slave->readable ? slave->response[slave->position++] : 0xFFu;
}

/* Handles a stop condition: the bytes written before it form a packet, which taxel_boot_i2c_run() processes. */
void taxel_boot_i2c_on_stop(struct taxel_boot_i2c *slave)
{
    end_write(slave);
}

/* Handles a start or stop condition at a wrong position: discards the bytes of an incomplete packet. */
void taxel_boot_i2c_on_bus_error(struct taxel_boot_i2c *slave)
{
    if (!slave->has_packet) {
        slave->received = 0;
    }
}

/* Main loop: execute a received packet and prepare the response for the next read. */
void taxel_boot_i2c_run(struct taxel_boot_i2c *slave)
{
    if (slave->has_packet) {
        const size_t size = taxel_boot_take_packet(slave->boot, slave->packet, slave->received, slave->response);
        slave->response_size = (uint8_t)size;
        slave->received = 0;
        atomic_signal_fence(memory_order_release);
        slave->has_packet = false; /* from here on the buffers belong to the interrupt */
    }
    taxel_boot_run(slave->boot);
}
