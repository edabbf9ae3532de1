/* SCB as I2C master. After each acknowledge and each byte the master holds SCL low until a command or a byte to send. A
 * byte written to the transmit FIFO is then data, unless a start was commanded before.
 *
 * With M_READY_DATA_ACK the master acknowledges received bytes automatically and continues reading. The byte that fills
 * the receive FIFO is acknowledged, with SCL held low, once there is space or a command. (confirm) that setting the bit
 * also acknowledges a byte that is already waiting. */
#include "emulator/psoc4/internal.h"
#include "emulator/psoc4/scb_registers.h"

/* Return whether the serial block is enabled as I2C master. */
static bool is_master(const struct psoc_scb *scb)
{
    return psoc_scb_is_i2c(scb) && scb->i2c_ctrl & SCB_I2C_MASTER;
}

/* Return whether the block acknowledges a received byte itself: the program enabled this, and the receive FIFO has
 * space. */
static bool acknowledges_automatically(const struct psoc_scb *scb)
{
    return scb->i2c_ctrl & SCB_I2C_M_READY_DATA_ACK && scb->rx.count < PSOC_FIFO;
}

/* Return the period of the I2C clock SCL (picoseconds), from the clock divider and the settings of the block. */
static vtime bus_clock(const struct psoc *psoc, const struct psoc_scb *scb)
{
    /* clocks of the high and the low phase of SCL; each field of the register contains the number minus 1 */
    const uint32_t phases = (scb->i2c_ctrl & 15u) + (scb->i2c_ctrl >> 4 & 15u) + 2u;
    return (vtime)((double)(phases * psoc_family(psoc)->clock_divider(
                                         psoc, psoc_family(psoc)->clock_scb[psoc->config.part->bus_scb])) *
                   psoc->ps_per_cycle);
}

/* Send the next byte of the FIFO as address or data, if the state permits. */
static void send_next_byte(struct psoc *psoc, struct psoc_scb *scb, vtime now)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    const bool is_starting = scb->state == PSOC_SCB_MASTER_STARTING;
    if (!scb->tx.count ||
        !(is_starting || (scb->state == PSOC_SCB_MASTER_HOLDING && scb->acknowledged && !scb->reading))) {
        return;
    }
    const uint8_t byte = psoc_fifo_pop(&scb->tx);
    scb->state = PSOC_SCB_MASTER_BUSY;
    if (is_starting) {
        scb->reading = byte & 1u;
        scb->acknowledged = false;
        wires->i2c_start(wires->context, byte, bus_clock(psoc, scb), now);
    } else {
        wires->i2c_write(wires->context, byte, now);
    }
    psoc_end_run(psoc);
}

/* Execute a command that the program writes to I2C_M_CMD (start, stop, acknowledge) at a processor cycle. Returns
 * false for a command that is invalid in the current state. */
bool psoc_master_command(struct psoc *psoc, struct psoc_scb *scb, uint32_t command, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    const vtime now = psoc_time(psoc, cycle);
    const bool is_holding = scb->state == PSOC_SCB_MASTER_HOLDING;
    if (!is_master(scb) || !wires->i2c_start) {
        return false;
    }
    if (command & (SCB_M_START | SCB_M_START_ON_IDLE)) {
        if (scb->state != PSOC_SCB_IDLE && !is_holding) {
            return false;
        }
        scb->state = PSOC_SCB_MASTER_STARTING;
        send_next_byte(psoc, scb, now);
        return true;
    }
    if (!is_holding || !(command & (SCB_M_STOP | SCB_M_ACK))) {
        return false;
    }
    scb->state = PSOC_SCB_MASTER_BUSY;
    if (command & SCB_M_STOP) {
        wires->i2c_stop(wires->context, now);
    } else {
        wires->i2c_read(wires->context, now);
    }
    psoc_end_run(psoc);
    return true;
}

/* Let a master that holds SCL send the byte that was written into the TX FIFO. */
void psoc_master_tx_filled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (is_master(scb)) {
        send_next_byte(psoc, scb, psoc_time(psoc, cycle));
    }
}

/* Return whether a received byte waits for its acknowledge. */
static bool has_byte_waiting(const struct psoc_scb *scb)
{
    return scb->state == PSOC_SCB_MASTER_HOLDING && scb->reading && scb->acknowledged;
}

/* Let a master that acknowledges automatically read the next byte, after the RX FIFO has free space again. */
void psoc_master_rx_drained(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (is_master(scb) && has_byte_waiting(scb) && acknowledges_automatically(scb)) {
        const struct psoc_wires *wires = &psoc->config.wires;
        scb->state = PSOC_SCB_MASTER_BUSY;
        wires->i2c_read(wires->context, psoc_time(psoc, cycle));
        psoc_end_run(psoc);
    }
}

/* Continue after the address or a data byte was acknowledged: read the first byte, or send the next byte of the TX
 * FIFO. */
static void handle_acknowledge(struct psoc *psoc, struct psoc_scb *scb, vtime now)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    scb->intr_m |= SCB_ACK;
    scb->acknowledged = true;
    if (scb->reading) {
        wires->i2c_read(wires->context, now); /* the first byte is read without a command */
        return;
    }
    scb->state = PSOC_SCB_MASTER_HOLDING;
    send_next_byte(psoc, scb, now);
}

/* Report an event of the bus to the I2C master, at virtual time `now`. byte: received byte of the event PSOC_I2C_BYTE.
 * Sets the interrupt cause and holds SCL until the firmware gives the next command, unless the transfer has ended or
 * the block continues by itself. */
void psoc_i2c_on_event(struct psoc *psoc, vtime now, enum psoc_i2c_event event, uint8_t byte)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    struct psoc_scb *scb = psoc_bus_scb(psoc);
    if (!psoc->powered || scb->state != PSOC_SCB_MASTER_BUSY) {
        return;
    }
    switch (event) {
    case PSOC_I2C_ACK:
        handle_acknowledge(psoc, scb, now);
        break;
    case PSOC_I2C_NACK:
        scb->intr_m |= SCB_NACK;
        scb->acknowledged = false;
        scb->state = PSOC_SCB_MASTER_HOLDING;
        break;
    case PSOC_I2C_BYTE:
        psoc_fifo_push(&scb->rx, byte);
        if (acknowledges_automatically(scb)) {
            wires->i2c_read(wires->context, now);
        } else {
            scb->state = PSOC_SCB_MASTER_HOLDING;
        }
        break;
    case PSOC_I2C_STOP:
        scb->intr_m |= SCB_STOPPED;
        scb->state = PSOC_SCB_IDLE;
        break;
    default:
        scb->intr_m |= event == PSOC_I2C_ARBITRATION_LOST ? SCB_ARB_LOST : SCB_BUS_ERROR;
        scb->state = PSOC_SCB_IDLE;
        break;
    }
    psoc_scb_update(psoc, scb);
}

/* Abort the transfer of a master whose serial block was disabled, without a stop condition. */
void psoc_master_disabled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    if (wires->i2c_abort && is_master(scb) && scb->state >= PSOC_SCB_MASTER_STARTING) {
        wires->i2c_abort(wires->context, psoc_time(psoc, cycle));
        psoc_end_run(psoc);
    }
}
