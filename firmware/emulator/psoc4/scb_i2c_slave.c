/* SCB as I2C slave. An address and each received byte raise an interrupt, and SCL is held low until the firmware
 * replies. Bytes to send come from the transmit FIFO; SCL is held low while the FIFO is empty. */
#include "emulator/psoc4/internal.h"
#include "emulator/psoc4/scb_registers.h"

#define CLOCK_STRETCH_MAX (25u * VTIME_MS) /* maximum clock stretching of a slave: SMBus 2.0, table 1 */

/* Return whether the slave is on and this I2C address matches its address register under the mask. */
bool psoc_i2c_matches_address(const struct psoc *psoc, uint8_t address)
{
    const struct psoc_scb *scb = &psoc->scb[psoc->config.part->bus_scb];
    const uint32_t mask = scb->rx_match >> 16 & 0xFEu;
    return psoc->powered && !psoc->has_stopped && psoc_scb_is_i2c(scb) && scb->i2c_ctrl & SCB_I2C_SLAVE &&
           !(((uint32_t)address << 1 ^ scb->rx_match) & mask);
}

/* Set interrupt causes of the I2C slave (bits of INTR_S) and update the interrupt line. */
static void raise_slave(struct psoc *psoc, struct psoc_scb *scb, uint32_t bits)
{
    scb->intr_s |= bits;
    psoc_scb_update(psoc, scb);
}

/* Run the program until it has written its command (acknowledge or not), or until the end of the longest permitted
 * clock stretching. Writes to *acknowledge whether the program acknowledged. Returns the virtual time at which SCL is
 * released. */
static vtime wait_for_command(struct psoc *psoc, struct psoc_scb *scb, vtime now, bool *acknowledge)
{
    scb->acknowledged = false;
    psoc->has_replied = false;
    const bool in_time = psoc_run_until_reply(psoc, now + CLOCK_STRETCH_MAX);
    *acknowledge = in_time && scb->acknowledged;
    return in_time ? vtime_max(now, psoc_time(psoc, scb->reply_cycle)) : now + CLOCK_STRETCH_MAX;
}

/* Move the next byte of the TX FIFO to the shift register of the slave. If the FIFO is empty, the slave holds SCL at
 * the next read. */
static void load_shift_register(struct psoc *psoc, struct psoc_scb *scb, vtime time)
{
    scb->shift_begin = time;
    if (scb->tx.count) {
        scb->shift = psoc_fifo_pop(&scb->tx);
        scb->shift_full = true;
        scb->shift_filled = time;
        psoc_scb_update(psoc, scb);
    }
}

/* Report to the slave that it was addressed: raise the interrupt and run the firmware until it has acknowledged or
 * rejected the address. Returns the virtual time at which SCL is released. */
vtime psoc_i2c_on_address(struct psoc *psoc, vtime now, bool reading, bool *acknowledge)
{
    struct psoc_scb *scb = psoc_bus_scb(psoc);
    scb->state = PSOC_SCB_SLAVE_ADDRESSED;
    scb->reading = reading;
    scb->shift_full = false;
    raise_slave(psoc, scb, SCB_ADDR_MATCH);
    const vtime released = wait_for_command(psoc, scb, now, acknowledge);
    if (*acknowledge && reading) {
        load_shift_register(psoc, scb, released);
    }
    return released;
}

/* Report to the slave a byte that the master has written: run the firmware until it has acknowledged or rejected the
 * byte. Returns the virtual time at which SCL is released. */
vtime psoc_i2c_on_write(struct psoc *psoc, vtime now, uint8_t byte, bool *acknowledge)
{
    struct psoc_scb *scb = psoc_bus_scb(psoc);
    if (scb->state != PSOC_SCB_SLAVE_RECEIVING) {
        *acknowledge = false; /* the chip was reset during the transfer */
        return now;
    }
    scb->state = PSOC_SCB_SLAVE_BYTE_RECEIVED;
    psoc_fifo_push(&scb->rx, byte);
    psoc_scb_update(psoc, scb);
    return wait_for_command(psoc, scb, now, acknowledge);
}

/* Write the next byte that the slave sends to the master to *byte; 0xFF if the slave does not send. Returns the virtual
 * time at which the clocks of the byte end: `now`, or later if the byte was not available at the end of the previous
 * byte. */
vtime psoc_i2c_on_read(struct psoc *psoc, vtime now, uint8_t *byte)
{
    struct psoc_scb *scb = psoc_bus_scb(psoc);
    vtime released = now;
    *byte = 0xFF;
    if (scb->state != PSOC_SCB_SLAVE_SENDING) {
        return now;
    }
    if (!scb->shift_full) {
        psoc->has_replied = false;
        if (!psoc_run_until_reply(psoc, now + CLOCK_STRETCH_MAX)) {
            return now + CLOCK_STRETCH_MAX;
        }
    }
    if (scb->shift_full) {
        *byte = scb->shift;
        released = now + (scb->shift_filled - scb->shift_begin);
    }
    scb->shift_full = false;
    load_shift_register(psoc, scb, released);
    return released;
}

/* Report a stop condition: it ends the transfer of an addressed slave and raises its interrupt. */
void psoc_i2c_on_stop(struct psoc *psoc)
{
    struct psoc_scb *scb = psoc_bus_scb(psoc);
    if (psoc_scb_is_i2c(scb) && scb->state != PSOC_SCB_IDLE) {
        scb->state = PSOC_SCB_IDLE;
        scb->shift_full = false;
        raise_slave(psoc, scb, SCB_STOPPED);
    }
}

/* Report a bus error: it ends the transfer and raises the interrupt of the slave. */
void psoc_i2c_on_bus_error(struct psoc *psoc)
{
    struct psoc_scb *scb = psoc_bus_scb(psoc);
    if (psoc_scb_is_i2c(scb)) {
        scb->state = PSOC_SCB_IDLE;
        scb->shift_full = false;
        raise_slave(psoc, scb, SCB_BUS_ERROR);
    }
}

/* Record the command of the firmware for which the bus waits: acknowledge or not, at this processor cycle. */
static void reply(struct psoc *psoc, struct psoc_scb *scb, bool acknowledge, uint64_t cycle)
{
    scb->acknowledged = acknowledge;
    scb->reply_cycle = cycle;
    psoc_end_wait(psoc);
}

/* Execute a write to the register I2C_S_CMD: the firmware acknowledges the address or the byte just received, or
 * not. */
void psoc_slave_command(struct psoc *psoc, struct psoc_scb *scb, uint32_t command, uint64_t cycle)
{
    const bool acknowledge = command & SCB_S_ACK;
    if (scb->state == PSOC_SCB_SLAVE_ADDRESSED) {
        scb->state = !acknowledge ? PSOC_SCB_IDLE : scb->reading ? PSOC_SCB_SLAVE_SENDING : PSOC_SCB_SLAVE_RECEIVING;
        reply(psoc, scb, acknowledge, cycle);
    } else if (scb->state == PSOC_SCB_SLAVE_BYTE_RECEIVED) {
        scb->state = PSOC_SCB_SLAVE_RECEIVING;
        reply(psoc, scb, acknowledge, cycle);
    }
}

/* Let a slave that holds SCL because it had no byte send the byte that was written into the TX FIFO. */
void psoc_slave_tx_filled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (scb->state == PSOC_SCB_SLAVE_SENDING && !scb->shift_full && scb->tx.count) {
        scb->shift = psoc_fifo_pop(&scb->tx);
        scb->shift_full = true;
        scb->shift_filled = psoc_time(psoc, cycle);
        psoc_end_wait(psoc);
    }
}

/* End the transfer of an addressed slave whose serial block was disabled: it does not acknowledge. */
void psoc_slave_disabled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (scb->state >= PSOC_SCB_SLAVE_ADDRESSED && scb->state <= PSOC_SCB_SLAVE_SENDING) {
        reply(psoc, scb, false, cycle);
    }
}
