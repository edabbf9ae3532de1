#include "boards/psoc4/i2c_slave.h"

#include "boards/psoc4/bus_clock.h"
#include "boards/psoc4/bus_pins.h"
#include "boards/psoc4/regs/core.h"
#include "boards/psoc4/regs/scb.h"
#include "boards/psoc4/serial_blocks.h"

#ifdef IMAGE_APPLICATION
#define FILLS_FIFO true
#define REFILL_BELOW 4u /* bytes: half of the FIFO, 90 us at 400 kbit/s */
#else
#define FILLS_FIFO false /* one byte per interrupt takes less flash, which is scarcer than time in the bootloader */
#define REFILL_BELOW 1u
#endif
#define ERRORS (SCB_INTR_I2C_ARB_LOST | SCB_INTR_I2C_BUS_ERROR)
#define SLAVE_EVENTS (ERRORS | SCB_INTR_I2C_STOP | SCB_INTR_S_ADDR_MATCH)

static volatile bool is_selected; /* a master addressed this slave, and no stop condition followed yet */

/* Empty the TX FIFO: its bytes belong to a read that has ended. */
__attribute__((noinline)) static void forget_unsent(void)
{
    BUS_SCB->intr_tx_mask = 0;
    BUS_SCB->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR | SCB_FIFO_CTRL_LEVEL(REFILL_BELOW);
    BUS_SCB->tx_fifo_ctrl = SCB_FIFO_CTRL_LEVEL(REFILL_BELOW);
}

/* Switch the I2C slave on with empty FIFOs and no pending events. */
void i2c_slave_on(void)
{
    is_selected = false;
    forget_unsent();
    BUS_SCB->rx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    BUS_SCB->rx_fifo_ctrl = 0;
    BUS_SCB->intr_s = SCB_INTR_ALL;
    BUS_SCB->ctrl = SCB_CTRL_MODE_I2C | SCB_CTRL_ENABLED;
}

/* Disable the I2C block, which keeps its settings: both lines are released and no address is acknowledged. */
static void off(void)
{
    BUS_SCB->ctrl = SCB_CTRL_MODE_I2C;
}

/* Switch the slave off for a flash write. Returns false while the slave is addressed in a transfer. */
bool i2c_slave_try_off(void)
{
    if (is_selected) {
        return false;
    }
    off(); /* an address that was received but not answered is not acknowledged */
    return true;
}

/* Disable the I2C block and disconnect its pins, before the bootloader starts an image. */
void i2c_slave_end(void)
{
    BUS_SCB->ctrl = 0;
    bus_pins_disconnect();
}

/* Set up the serial block of the bus as an I2C slave with this 7-bit address. */
void i2c_slave_init(uint8_t address)
{
    bus_clock_init();
    bus_pins_release();
    BUS_SCB->i2c_ctrl = SCB_I2C_CTRL_SLAVE | SCB_I2C_CTRL_S_GENERAL_IGNORE;
    BUS_SCB->tx_ctrl = SCB_DATA_WIDTH(8u) | SCB_MSB_FIRST;
    BUS_SCB->rx_ctrl = SCB_DATA_WIDTH(8u) | SCB_MSB_FIRST;
    BUS_SCB->rx_match = SCB_RX_MATCH_ADDRESS(address) | SCB_RX_MATCH_MASK;
    BUS_SCB->intr_s_mask = SLAVE_EVENTS;
    BUS_SCB->intr_rx_mask = SCB_INTR_RX_NOT_EMPTY;
    i2c_slave_on();
    bus_pins_connect(PIN_I2C);
    interrupt_enable(BUS_IRQ);
}

/* Fill the TX FIFO with the bytes that the master reads next: all of it in an application, one byte in the
 * bootloader. */
static void fill(void)
{
    do {
        BUS_SCB->tx_fifo_wr = i2c_slave_on_read();
    } while (FILLS_FIFO && (BUS_SCB->tx_fifo_status & SCB_FIFO_STATUS_USED) < SCB_FIFO_SIZE);
    BUS_SCB->intr_tx = SCB_INTR_TX_TRIGGER;
}

/* Pass a received byte, if there is one, to the program and acknowledge it if the program returns true. */
static void take_byte(void)
{
    if (BUS_SCB->rx_fifo_status & SCB_FIFO_STATUS_USED) { /* at most one byte: the next follows after the acknowledge */
        const bool acknowledge = i2c_slave_on_write((uint8_t)BUS_SCB->rx_fifo_rd);
        BUS_SCB->i2c_s_cmd = acknowledge ? SCB_I2C_S_CMD_ACK : SCB_I2C_S_CMD_NACK;
    }
    BUS_SCB->intr_rx = SCB_INTR_RX_NOT_EMPTY;
}

/* Handle a stop condition. Bytes that the master did not read are removed from the FIFO. */
static void take_stop(void)
{
    BUS_SCB->intr_s = SCB_INTR_I2C_STOP;
    forget_unsent();
    if (is_selected) {
        is_selected = false;
        i2c_slave_on_stop();
    }
}

/* Handle an address match: acknowledge it if the program returns true. For a read, the FIFO is filled before the
 * acknowledge. */
static void take_address(void)
{
    const bool reading = (BUS_SCB->i2c_status & SCB_I2C_STATUS_S_READ) != 0;
    BUS_SCB->intr_s = SCB_INTR_S_ADDR_MATCH;
    forget_unsent();
    const bool acknowledge = i2c_slave_on_address(reading);
    is_selected = acknowledge;
    if (acknowledge && reading) {
        fill(); /* before the acknowledge releases the master */
        BUS_SCB->intr_tx_mask = SCB_INTR_TX_TRIGGER;
    }
    BUS_SCB->i2c_s_cmd = acknowledge ? SCB_I2C_S_CMD_ACK : SCB_I2C_S_CMD_NACK;
}

/* The events are handled in the only order in which they can occur: SCL is held low after an address and after a
 * byte, so no further event occurs before the acknowledge. */
void bus_handler(void);
/* Handle the interrupt of the I2C slave. The order of the events matters: a byte and a stop condition of the last
 * transfer precede a new address. */
void bus_handler(void)
{
    const uint32_t events = BUS_SCB->intr_s_masked;
    if (events & ERRORS) {
        off();
        i2c_slave_on_bus_error();
        i2c_slave_on();
        return;
    }
    take_byte();
    if (events & SCB_INTR_I2C_STOP) {
        take_stop();
    }
    if (events & SCB_INTR_S_ADDR_MATCH) {
        take_address();
    }
    if (BUS_SCB->intr_tx_masked) {
        fill();
    }
}
