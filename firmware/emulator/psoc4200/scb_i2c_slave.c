/* An SCB as I2C slave. An address and a received byte raise an interrupt, and SCL is held low until the firmware has answered; bytes
 * to be sent come from the transmit FIFO, and SCL is held low while it is empty. */
#include "emulator/psoc4200/internal.h"
#include "emulator/psoc4200/scb_registers.h"

#define PATIENCE (25u * VTIME_MS) /* longer than that nobody holds a clock: SMBus 2.0, table 1, of a slave */

bool psoc_i2c_listens(const struct psoc *psoc, uint8_t address)
{
    const struct psoc_scb *scb = &psoc->scb[0];
    const uint32_t mask = scb->rx_match >> 16 & 0xFEu;
    return psoc->powered && !psoc->broken && psoc_scb_is_i2c(scb) && scb->i2c_ctrl & SCB_I2C_SLAVE &&
           !(((uint32_t)address << 1 ^ scb->rx_match) & mask);
}

static void raise_slave(struct psoc *psoc, struct psoc_scb *scb, uint32_t bits)
{
    scb->intr_s |= bits;
    psoc_scb_update(psoc, scb);
}

/* Run until the firmware has given its command. */
static vtime wait(struct psoc *psoc, struct psoc_scb *scb, vtime now, bool *acknowledge)
{
    scb->acknowledged = false;
    psoc->answered = false;
    const bool in_time = psoc_run_to_answer(psoc, now + PATIENCE);
    *acknowledge = in_time && scb->acknowledged;
    return in_time ? vtime_max(now, psoc_time(psoc, scb->answered)) : now + PATIENCE;
}

static void take_next(struct psoc *psoc, struct psoc_scb *scb, vtime time)
{
    scb->shift_begin = time;
    if (scb->tx.count) {
        scb->shift = psoc_fifo_pop(&scb->tx);
        scb->shift_full = true;
        scb->shift_filled = time;
        psoc_scb_update(psoc, scb);
    }
}

vtime psoc_i2c_address(struct psoc *psoc, vtime now, bool reading, bool *acknowledge)
{
    struct psoc_scb *scb = &psoc->scb[0];
    scb->state = PSOC_SCB_SLAVE_ADDRESSED;
    scb->reading = reading;
    scb->shift_full = false;
    raise_slave(psoc, scb, SCB_ADDR_MATCH);
    const vtime released = wait(psoc, scb, now, acknowledge);
    if (*acknowledge && reading) {
        take_next(psoc, scb, released);
    }
    return released;
}

vtime psoc_i2c_written(struct psoc *psoc, vtime now, uint8_t byte, bool *acknowledge)
{
    struct psoc_scb *scb = &psoc->scb[0];
    if (scb->state != PSOC_SCB_SLAVE_RECEIVES) {
        *acknowledge = false; /* it was reset in the middle of the transfer */
        return now;
    }
    scb->state = PSOC_SCB_SLAVE_TAKEN;
    psoc_fifo_push(&scb->rx, byte);
    psoc_scb_update(psoc, scb);
    return wait(psoc, scb, now, acknowledge);
}

/* The byte whose clocks end now, unless it could not begin when the one before had ended. */
vtime psoc_i2c_read(struct psoc *psoc, vtime now, uint8_t *byte)
{
    struct psoc_scb *scb = &psoc->scb[0];
    vtime released = now;
    *byte = 0xFF;
    if (scb->state != PSOC_SCB_SLAVE_SENDS) {
        return now;
    }
    if (!scb->shift_full) {
        psoc->answered = false;
        if (!psoc_run_to_answer(psoc, now + PATIENCE)) {
            return now + PATIENCE;
        }
    }
    if (scb->shift_full) {
        *byte = scb->shift;
        released = now + (scb->shift_filled - scb->shift_begin);
    }
    scb->shift_full = false;
    take_next(psoc, scb, released);
    return released;
}

void psoc_i2c_stopped(struct psoc *psoc)
{
    struct psoc_scb *scb = &psoc->scb[0];
    if (psoc_scb_is_i2c(scb) && scb->state != PSOC_SCB_IDLE) {
        scb->state = PSOC_SCB_IDLE;
        scb->shift_full = false;
        raise_slave(psoc, scb, SCB_STOPPED);
    }
}

void psoc_i2c_bus_error(struct psoc *psoc)
{
    struct psoc_scb *scb = &psoc->scb[0];
    if (psoc_scb_is_i2c(scb)) {
        scb->state = PSOC_SCB_IDLE;
        scb->shift_full = false;
        raise_slave(psoc, scb, SCB_BUS_ERROR);
    }
}

static void answer(struct psoc *psoc, struct psoc_scb *scb, bool acknowledge, uint64_t cycle)
{
    scb->acknowledged = acknowledge;
    scb->answered = cycle;
    psoc_answers(psoc);
}

void psoc_slave_command(struct psoc *psoc, struct psoc_scb *scb, uint32_t command, uint64_t cycle)
{
    const bool acknowledge = command & SCB_S_ACK;
    if (scb->state == PSOC_SCB_SLAVE_ADDRESSED) {
        scb->state = !acknowledge ? PSOC_SCB_IDLE : scb->reading ? PSOC_SCB_SLAVE_SENDS : PSOC_SCB_SLAVE_RECEIVES;
        answer(psoc, scb, acknowledge, cycle);
    } else if (scb->state == PSOC_SCB_SLAVE_TAKEN) {
        scb->state = PSOC_SCB_SLAVE_RECEIVES;
        answer(psoc, scb, acknowledge, cycle);
    }
}

void psoc_slave_filled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (scb->state == PSOC_SCB_SLAVE_SENDS && !scb->shift_full && scb->tx.count) {
        scb->shift = psoc_fifo_pop(&scb->tx);
        scb->shift_full = true;
        scb->shift_filled = psoc_time(psoc, cycle);
        psoc_answers(psoc);
    }
}

void psoc_slave_off(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (scb->state >= PSOC_SCB_SLAVE_ADDRESSED && scb->state <= PSOC_SCB_SLAVE_SENDS) {
        answer(psoc, scb, false, cycle);
    }
}
