/* Packets over I2C: one write transaction is one packet. A write that does not begin with a packet's first byte is
 * meant for an application and is ignored, like a probe. The response stays readable until the next packet. */
#include <stdatomic.h>

#include "bootloader/internal.h"

#define SIZE_TOO_LONG (TAXEL_BOOT_PACKET_MAX + 1u)

/* Initialise the I2C connection `slave` of the bootloader `boot`: no packet has been received. */
void taxel_boot_i2c_init(struct taxel_boot_i2c *slave, struct taxel_boot *boot)
{
    memset(slave, 0, sizeof *slave);
    slave->boot = boot;
}

/* Return the 7-bit I2C address of the board: the address in its stored configuration, or 0x77 without a
 * configuration. */
uint8_t taxel_boot_i2c_address(const struct taxel_boot_flash *flash)
{
    const uint8_t *const configuration = taxel_boot_configuration(flash);
    return configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS] : TAXEL_BOOT_DEFAULT_ADDRESS;
}

/* End a write, at a stop or repeated start condition. Bytes that begin like a packet are passed to the main loop. */
static void end_write(struct taxel_boot_i2c *slave)
{
    if (!slave->has_packet && slave->received && slave->packet[0] == TAXEL_BOOT_PACKET_START) {
        slave->response_size = 0;
        slave->has_packet = true;
    }
}

/* Handle the I2C interrupt of a start condition with the board's address. Returns whether to acknowledge. A write is
 * not acknowledged while a packet is being executed; a read is, but then returns only 0xFF. A board that a SEARCH
 * command has silenced does not acknowledge reads. */
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

/* Store a byte of a packet (I2C interrupt). Returns whether to acknowledge: not while a packet is being executed, and
 * not beyond the longest packet; a longer packet is answered with status LENGTH. */
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

/* Return the next byte of the response for a master that reads: 0xFF before a response is ready and after its last
 * byte. */
uint8_t taxel_boot_i2c_on_read(struct taxel_boot_i2c *slave)
{
    return slave->position < slave->readable ? slave->response[slave->position++] : 0xFFu;
}

/* Handle a stop condition: the bytes written before it form a packet, which taxel_boot_i2c_run() processes. */
void taxel_boot_i2c_on_stop(struct taxel_boot_i2c *slave)
{
    end_write(slave);
}

/* Handle a start or stop condition at a wrong position: discard the bytes of an incomplete packet. */
void taxel_boot_i2c_on_bus_error(struct taxel_boot_i2c *slave)
{
    if (!slave->has_packet) {
        slave->received = 0;
    }
}

/* Run one pass of the main loop: execute a received packet and prepare its response for the next read, then run the
 * bootloader, which may start an image. */
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
