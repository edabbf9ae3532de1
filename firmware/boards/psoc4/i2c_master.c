#include "boards/psoc4/i2c_master.h"

#include "boards/psoc4/bus_clock.h"
#include "boards/psoc4/bus_pins.h"
#include "boards/psoc4/regs/core.h"
#include "boards/psoc4/regs/scb.h"
#include "boards/psoc4/serial_blocks.h"

#define MASTER_EVENTS \
    (SCB_INTR_I2C_ARB_LOST | SCB_INTR_I2C_NACK | SCB_INTR_I2C_ACK | SCB_INTR_I2C_STOP | SCB_INTR_I2C_BUS_ERROR)

#define CONTROL (SCB_I2C_CTRL_MASTER | SCB_I2C_CTRL_LOW_PHASE(BUS_LOW_PHASE) | SCB_I2C_CTRL_HIGH_PHASE(BUS_HIGH_PHASE))
#define DRAIN_ABOVE 4u /* bytes in the FIFO: three more can arrive before the bus has to wait */

enum state { IDLE, ADDRESS_TO_WRITE, ADDRESS_TO_READ, WRITING, READING, STOPPING };

static struct {
    struct taxel_i2c_transfer transfer; /* pointers and sizes advance with the bytes */
    volatile uint8_t state;
    int8_t result;
    bool is_manual;
} master;

/* Switch the block off and on, which resets the state machines, empties the FIFOs, releases the lines and clears all
 * events. */
static void reset(void)
{
    BUS_SCB->ctrl = SCB_CTRL_MODE_I2C;
    BUS_SCB->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    BUS_SCB->rx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    BUS_SCB->tx_fifo_ctrl = 0;
    BUS_SCB->rx_fifo_ctrl = 0;
    BUS_SCB->intr_m = SCB_INTR_ALL;
    BUS_SCB->intr_rx = SCB_INTR_ALL;
    BUS_SCB->ctrl = SCB_CTRL_MODE_I2C | SCB_CTRL_ENABLED;
    master.state = IDLE;
}

/* Set up the serial block of the bus as the I2C master. */
void i2c_master_init(void)
{
    bus_clock_init();
    bus_pins_release();
    BUS_SCB->i2c_ctrl = CONTROL;
    BUS_SCB->tx_ctrl = SCB_DATA_WIDTH(8u) | SCB_MSB_FIRST;
    BUS_SCB->rx_ctrl = SCB_DATA_WIDTH(8u) | SCB_MSB_FIRST | SCB_RX_CTRL_MEDIAN;
    BUS_SCB->intr_s_mask = 0;
    BUS_SCB->intr_tx_mask = 0;
    BUS_SCB->intr_m_mask = MASTER_EVENTS;
    BUS_SCB->intr_rx_mask = SCB_INTR_RX_TRIGGER;
    reset();
    bus_pins_connect(PIN_I2C);
    interrupt_enable(BUS_IRQ);
}

/* Return whether no I2C transfer is in progress. */
bool i2c_master_is_idle(void)
{
    return master.state == IDLE;
}

/* Return whether the I2C clock line is high. */
bool i2c_master_scl(void)
{
    return (BUS_PORT->state & BUS_SCL) != 0;
}

/* Return whether the I2C data line is high. */
bool i2c_master_sda(void)
{
    return (BUS_PORT->state & BUS_SDA) != 0;
}

/* Drive SCL and SDA manually (true: released), for bus recovery. */
void i2c_master_drive(bool scl_high, bool sda_high)
{
    bus_pins_drive(scl_high, sda_high);
    if (!master.is_manual) {
        master.is_manual = true;
        bus_pins_connect(PIN_GPIO);
    }
}

/* Return whether the serial block (SCB) acknowledges the remaining bytes of a read itself: at least SCB_FIFO_SIZE bytes
 * remain, and their number is known. The block acknowledges until its FIFO is full, and then holds SCL, so that no
 * byte is lost if the interrupt is late. The last bytes stay in the FIFO and fill it, and the very last byte is not
 * acknowledged. Assumed, to be confirmed on hardware: the byte that fills the FIFO waits for its acknowledge; the
 * manufacturer's driver relies on this behaviour. */
static bool collects(void)
{
    return !master.transfer.length_prefixed && master.transfer.read_size >= SCB_FIFO_SIZE;
}

/* Let the serial block acknowledge by itself if collects() permits it, and set the FIFO level, the number of bytes
 * above which the receive interrupt occurs. The last SCB_FIFO_SIZE bytes are taken together, when the FIFO is full. */
static void collect_if_long(void)
{
    const bool is_long = collects();
    const uint32_t level = master.transfer.read_size == SCB_FIFO_SIZE ? SCB_FIFO_SIZE - 1u : DRAIN_ABOVE;
    BUS_SCB->i2c_ctrl = is_long ? CONTROL | SCB_I2C_CTRL_M_READY_DATA_ACK : CONTROL;
    BUS_SCB->rx_fifo_ctrl = SCB_FIFO_CTRL_LEVEL(is_long ? level : 0u);
}

/* Send the address: for reading, or for writing and probes. */
static void send_address(bool reading)
{
    master.state = reading ? ADDRESS_TO_READ : ADDRESS_TO_WRITE;
    if (reading) {
        collect_if_long();
    }
    BUS_SCB->tx_fifo_wr = ((uint32_t)master.transfer.address << 1) | reading;
}

/* Start a transfer. If a line is low, the transfer ends at once with TAXEL_I2C_BUSY. After manual control of the lines,
 * the pins are first given back to the serial block. */
void i2c_master_start(const struct taxel_i2c_transfer *transfer)
{
    if (master.is_manual) {
        master.is_manual = false;
        bus_pins_release();
        reset();
        bus_pins_connect(PIN_I2C);
    }
    if (!i2c_master_scl() || !i2c_master_sda()) {
        i2c_master_on_done(TAXEL_I2C_BUSY);
        return;
    }
    master.transfer = *transfer;
    send_address(transfer->write_size == 0 && transfer->read_size != 0);
    BUS_SCB->i2c_m_cmd = SCB_I2C_M_CMD_START_ON_IDLE;
}

/* Abort the transfer: a reset of the serial block releases both lines. */
void i2c_master_abort(void)
{
    const uint32_t interrupts = interrupts_mask();
    reset();
    interrupts_unmask(interrupts);
}

/* End the transfer in progress and report its result (enum taxel_i2c_result) to the program. */
static void end(int8_t result)
{
    master.state = IDLE;
    i2c_master_on_done(result);
}

/* Send a stop condition, with `command` (NACK of the last byte, or 0); the transfer then ends with `result`. */
static void stop(uint32_t command, int8_t result)
{
    master.state = STOPPING;
    master.result = result;
    BUS_SCB->i2c_m_cmd = command | SCB_I2C_M_CMD_STOP;
}

/* Return whether an address has been sent and not acknowledged yet, or bytes are being written to the slave. */
static bool is_sending(void)
{
    return master.state >= ADDRESS_TO_WRITE && master.state <= WRITING;
}

/* Continue after the slave has acknowledged the address or a byte: send the next byte, a repeated start for reading, or
 * the stop condition. */
static void take_acknowledge(void)
{
    struct taxel_i2c_transfer *const transfer = &master.transfer;
    if (master.state == ADDRESS_TO_READ) {
        master.state = READING;
    } else if (transfer->write_size) {
        transfer->write_size--;
        master.state = WRITING;
        BUS_SCB->tx_fifo_wr = *transfer->write_bytes++;
    } else if (transfer->read_size) {
        /* before the address: while SCL is held, a byte in the FIFO would be sent as data */
        BUS_SCB->i2c_m_cmd = SCB_I2C_M_CMD_START;
        send_address(true);
    } else {
        stop(0, TAXEL_I2C_OK);
    }
}

/* Move `count` received bytes from the RX FIFO to the transfer's buffer. */
static void take_bytes(size_t count)
{
    uint8_t *bytes = master.transfer.read_bytes;
    master.transfer.read_size -= count;
    master.transfer.read_bytes += count;
    while (count--) {
        *bytes++ = (uint8_t)BUS_SCB->rx_fifo_rd;
    }
}

/* Take received bytes while the serial block acknowledges by itself. The last SCB_FIFO_SIZE bytes fill the FIFO, which
 * stops the automatic acknowledge before the final NACK. */
static void take_collected(void)
{
    const size_t count = BUS_SCB->rx_fifo_status & SCB_FIFO_STATUS_USED;
    const size_t spare = master.transfer.read_size - SCB_FIFO_SIZE;
    if (spare) {
        take_bytes(count < spare ? count : spare);
        if (master.transfer.read_size == SCB_FIFO_SIZE) {
            collect_if_long();
        }
    } else if (count == SCB_FIFO_SIZE) {
        BUS_SCB->i2c_ctrl = CONTROL; /* first, because free space in the FIFO would cause an acknowledge */
        stop(SCB_I2C_M_CMD_NACK, TAXEL_I2C_OK);
        take_bytes(SCB_FIFO_SIZE);
    }
}

/* Take one received byte and acknowledge it, or end the transfer after the last byte with a NACK. The first byte of a
 * length-prefixed transfer sets the number of bytes that follow. */
static void take_byte(void)
{
    struct taxel_i2c_transfer *const transfer = &master.transfer;
    const uint8_t byte = (uint8_t)BUS_SCB->rx_fifo_rd;
    if (master.state != READING) {
        return;
    }
    if (transfer->length_prefixed) {
        transfer->length_prefixed = false;
        transfer->read_size = 1u + taxel_i2c_bytes_after_length(transfer, byte);
    }
    transfer->read_size--;
    if (transfer->read_size) {
        BUS_SCB->i2c_m_cmd = SCB_I2C_M_CMD_ACK; /* first, because SCL is held until then */
        collect_if_long();
    } else {
        stop(SCB_I2C_M_CMD_NACK, TAXEL_I2C_OK);
    }
    *transfer->read_bytes++ = byte;
}

/* Take the received bytes in the FIFO, if there are any. In the state ADDRESS_TO_READ the bytes stay in the FIFO: the
 * acknowledge of the address arrived during this interrupt and must be handled first. */
static void take_bytes_if_any(void)
{
    if (!BUS_SCB->intr_rx_masked || master.state == ADDRESS_TO_READ) {
        return;
    }
    if (master.state == READING && collects()) {
        take_collected();
    } else {
        take_byte();
    }
    BUS_SCB->intr_rx = SCB_INTR_RX_TRIGGER;
}

/* SCL is held low after each acknowledge and after each byte that the SCB does not acknowledge itself, until a
 * command or a byte to send is written: events occur one at a time. */
void bus_handler(void);
/* Handle the interrupt of the I2C master: events of the bus, and received bytes. */
void bus_handler(void)
{
    const uint32_t events = BUS_SCB->intr_m_masked;
    if (!events) { /* the most frequent case: one byte was received, and the bus waits */
        take_bytes_if_any();
        return;
    }
    BUS_SCB->intr_m = events;
    if (events & (SCB_INTR_I2C_ARB_LOST | SCB_INTR_I2C_BUS_ERROR)) {
        const bool was_idle = i2c_master_is_idle();
        reset();
        if (!was_idle) {
            end(events & SCB_INTR_I2C_BUS_ERROR ? TAXEL_I2C_BUS_ERROR : TAXEL_I2C_ARBITRATION_LOST);
        }
        return;
    }
    if (is_sending() && (events & SCB_INTR_I2C_NACK)) {
        BUS_SCB->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
        BUS_SCB->tx_fifo_ctrl = 0;
        stop(0, master.state == WRITING ? TAXEL_I2C_NACK_DATA : TAXEL_I2C_NACK_ADDRESS);
    } else if (is_sending() && (events & SCB_INTR_I2C_ACK)) {
        take_acknowledge();
    }
    take_bytes_if_any();
    if ((events & SCB_INTR_I2C_STOP) && master.state == STOPPING) {
        end(master.result);
    }
}
