#include "emulator/hub_cortex.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/base/reset_bits.h"

/* Start an address byte on the bus after a start condition, as the program commands; callback of the hub's chip. clock:
 * period of SCL in picoseconds. */
static void on_i2c_start(void *context, uint8_t address_byte, vtime clock, vtime now)
{
    struct hub_node *node = context;
    node->bus->scl_period = clock;
    bus_bytewise_start(node->bus, address_byte, now);
}

/* Write one byte to the bus, as the program commands; callback of the hub's chip. */
static void on_i2c_write(void *context, uint8_t byte, vtime now)
{
    bus_bytewise_write(((struct hub_node *)context)->bus, byte, now);
}

/* Read one byte from the bus, as the program commands; callback of the hub's chip. */
static void on_i2c_read(void *context, vtime now)
{
    bus_bytewise_read(((struct hub_node *)context)->bus, now);
}

/* Send a stop condition, as the program commands; callback of the hub's chip. */
static void on_i2c_stop(void *context, vtime now)
{
    bus_bytewise_stop(((struct hub_node *)context)->bus, now);
}

/* Abort the transfer in progress, because the program has disabled its I2C block; callback of the hub's chip. */
static void on_i2c_abort(void *context, vtime now)
{
    bus_abort(((struct hub_node *)context)->bus, BUS_HUB, now);
}

/* Set the levels of SCL and SDA that the program drives by hand; true releases a line; callback of the hub's chip. */
static void on_i2c_drive(void *context, bool scl_high, bool sda_high)
{
    bus_drive_lines(((struct hub_node *)context)->bus, scl_high, sda_high);
}

/* Return whether the clock line is high at the virtual time `now`; callback of the hub's chip. */
static bool on_i2c_scl(void *context, vtime now)
{
    return bus_is_scl_high(((struct hub_node *)context)->bus, now);
}

/* Return whether the data line is high; callback of the hub's chip. */
static bool on_i2c_sda(void *context, vtime now)
{
    (void)now;
    return bus_is_sda_high(((struct hub_node *)context)->bus);
}

/* Start the UART's transmitter, because the chip has bytes to send; callback of the hub's chip. */
static void on_uart_kick(void *context, vtime now)
{
    uart_start_transmit(((struct hub_node *)context)->uart, now);
}

/* Set RTS as the program commands; `hold` requests that the host pauses; callback of the hub's chip. Has no effect if
 * RTS is not wired. */
static void on_uart_hold(void *context, bool hold, vtime now)
{
    struct hub_node *node = context;
    if (node->rts_is_wired) {
        uart_set_hold(node->uart, hold, now);
    }
}

/* Deliver a byte of the host that has arrived at the RX pin of the hub. The emulated processor of the hub first
 * executes its program up to the arrival time of the byte; its UART block then receives the byte. */
static void on_uart_byte(void *context, uint8_t byte)
{
    struct hub_node *node = context;
    hub_cortex_run(node, node->uart->receive_next);
    psoc_uart_receive(node->psoc, byte);
}

/* Take at most one byte to send from the hub's chip, because the shift register reads the FIFO byte by byte; callback
 * of the emulated UART. Returns the number of bytes. */
static size_t pull_uart_byte(void *context, uint8_t *bytes, size_t size)
{
    struct hub_node *node = context;
    hub_cortex_run(node, node->uart->transmit_next);
    return size && psoc_uart_take(node->psoc, bytes);
}

/* Create the emulated processor of the hub, which executes the firmware image instruction by instruction. Returns 0, or
 * -1 after an error line on stderr. */
int hub_cortex_open(struct hub_node *node, const struct world_description *world)
{
    struct psoc_config config = {
        .name = "hub",
        .flash = &node->boot.flash,
        .part = world->hub_part,
        .clock_rate = node->clock_rate,
        .seed = world->seed,
        .reset_time = BOOT_NODE_INIT_TIME,
        .wires =
            {
                .context = node,
                .i2c_start = on_i2c_start,
                .i2c_write = on_i2c_write,
                .i2c_read = on_i2c_read,
                .i2c_stop = on_i2c_stop,
                .i2c_abort = on_i2c_abort,
                .i2c_drive = on_i2c_drive,
                .i2c_scl = on_i2c_scl,
                .i2c_sda = on_i2c_sda,
                .uart_kick = on_uart_kick,
                .uart_hold = on_uart_hold,
            },
    };
    memcpy(config.unique_id, node->config.unique_id, sizeof config.unique_id);
    node->rts_is_wired = world->flow_control;
    node->psoc = malloc(sizeof *node->psoc);
    if (!node->psoc || psoc_init(node->psoc, &config)) {
        fprintf(stderr, "hub: out of memory for its processor\n");
        return -1;
    }
    return 0;
}

/* Free the emulated chip of a hub that executes an image; does nothing for a hub with native firmware. */
void hub_cortex_close(struct hub_node *node)
{
    if (node->psoc) {
        psoc_free(node->psoc);
        free(node->psoc);
        node->psoc = NULL;
    }
}

/* Switch the hub's processor off, or reset it at virtual time `now`. reset_cause: reset cause of the protocol. */
void hub_cortex_set_power(struct hub_node *node, bool on, vtime now, uint8_t reset_cause)
{
    psoc_power_off(node->psoc);
    boot_node_power_off(&node->boot, now);
    node->uart->user = (struct uart_user){.context = node, .on_byte = on_uart_byte, .pull = pull_uart_byte};
    if (on) {
        psoc_power_on(node->psoc, now, reset_bits(reset_cause));
    }
}

/* Run the hub's chip up to the virtual time `until`. psoc_run() returns true if it ended earlier, because the program
 * acted on a wire or on the flash; the run is then continued. */
void hub_cortex_run(struct hub_node *node, vtime until)
{
    while (node->is_powered && psoc_run(node->psoc, until)) {
    }
}

/* Run the hub's processor up to the virtual time `now`, then pass the present event of the bus to its I2C block. */
void hub_cortex_on_bus_event(struct hub_node *node, vtime now)
{
    static const enum psoc_i2c_event events[] = {
        [BUS_ACKNOWLEDGED] = PSOC_I2C_ACK,
        [BUS_NOT_ACKNOWLEDGED] = PSOC_I2C_NACK,
        [BUS_BYTE] = PSOC_I2C_BYTE,
        [BUS_STOPPED] = PSOC_I2C_STOP,
        [BUS_ARBITRATION_LOST] = PSOC_I2C_ARBITRATION_LOST,
        [BUS_ERROR] = PSOC_I2C_BUS_ERROR,
    };
    hub_cortex_run(node, now);
    psoc_i2c_on_event(node->psoc, now, events[node->bus->event], node->bus->byte);
}

/* Suspend the hub's main program up to the virtual time `until`; interrupts are served. */
void hub_cortex_stall(struct hub_node *node, vtime until)
{
    psoc_stall(node->psoc, until);
}

/* Make the emulated processor of a hub that executes an image take a HardFault. */
void hub_cortex_take_hard_fault(struct hub_node *node)
{
    psoc_inject_hard_fault(node->psoc);
}
