/* An SCB as I2C master, byte by byte: after each acknowledge and each byte it holds SCL low until a command, or a byte to send. A byte
 * that comes into the transmit FIFO then is data, unless a start was commanded before.
 *
 * With M_READY_DATA_ACK it acknowledges by itself what it receives, and reads on; the byte that fills the receive FIFO waits, SCL held,
 * until there is room, or a command. (confirm) that also a byte that waits when the bit is set is acknowledged. */
#include "emulator/psoc4200/internal.h"
#include "emulator/psoc4200/scb_registers.h"

#define PERI_SCB0 2u

static bool is_master(const struct psoc_scb *scb)
{
    return psoc_scb_is_i2c(scb) && scb->i2c_ctrl & SCB_I2C_MASTER;
}

static bool acknowledges_itself(const struct psoc_scb *scb)
{
    return scb->i2c_ctrl & SCB_I2C_M_READY_DATA_ACK && scb->rx.count < PSOC_FIFO;
}

/* One period of SCL, from the settings. */
static vtime bus_clock(const struct psoc *psoc, const struct psoc_scb *scb)
{
    const uint32_t phases = (scb->i2c_ctrl & 15u) + (scb->i2c_ctrl >> 4 & 15u) + 2u;
    return (vtime)((double)(phases * psoc_clock_divider(psoc, PERI_SCB0)) * psoc->ps_per_cycle);
}

/* What the FIFO's next byte is good for. */
static void use_byte(struct psoc *psoc, struct psoc_scb *scb, vtime now)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    const bool starts = scb->state == PSOC_SCB_MASTER_STARTS;
    if (!scb->tx.count || !(starts || (scb->state == PSOC_SCB_MASTER_HOLDS && scb->acknowledged && !scb->reading))) {
        return;
    }
    const uint8_t byte = psoc_fifo_pop(&scb->tx);
    scb->state = PSOC_SCB_MASTER_WAITS;
    if (starts) {
        scb->reading = byte & 1u;
        scb->acknowledged = false;
        wires->i2c_start(wires->context, byte, bus_clock(psoc, scb), now);
    } else {
        wires->i2c_write(wires->context, byte, now);
    }
    psoc_acts(psoc);
}

/* Returns false for a command that this state has no use for. */
bool psoc_master_command(struct psoc *psoc, struct psoc_scb *scb, uint32_t command, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    const vtime now = psoc_time(psoc, cycle);
    const bool holds = scb->state == PSOC_SCB_MASTER_HOLDS;
    if (!is_master(scb) || !wires->i2c_start) {
        return false;
    }
    if (command & (SCB_M_START | SCB_M_START_ON_IDLE)) {
        if (scb->state != PSOC_SCB_IDLE && !holds) {
            return false;
        }
        scb->state = PSOC_SCB_MASTER_STARTS;
        use_byte(psoc, scb, now);
        return true;
    }
    if (!holds || !(command & (SCB_M_STOP | SCB_M_ACK))) {
        return false;
    }
    scb->state = PSOC_SCB_MASTER_WAITS;
    if (command & SCB_M_STOP) {
        wires->i2c_stop(wires->context, now);
    } else {
        wires->i2c_read(wires->context, now);
    }
    psoc_acts(psoc);
    return true;
}

void psoc_master_filled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (is_master(scb)) {
        use_byte(psoc, scb, psoc_time(psoc, cycle));
    }
}

/* A byte that has come waits to be acknowledged. */
static bool has_byte_waiting(const struct psoc_scb *scb)
{
    return scb->state == PSOC_SCB_MASTER_HOLDS && scb->reading && scb->acknowledged;
}

void psoc_master_has_room(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    if (is_master(scb) && has_byte_waiting(scb) && acknowledges_itself(scb)) {
        const struct psoc_wires *wires = &psoc->config.wires;
        scb->state = PSOC_SCB_MASTER_WAITS;
        wires->i2c_read(wires->context, psoc_time(psoc, cycle));
        psoc_acts(psoc);
    }
}

static void acknowledged(struct psoc *psoc, struct psoc_scb *scb, vtime now)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    scb->intr_m |= SCB_ACK;
    scb->acknowledged = true;
    if (scb->reading) {
        wires->i2c_read(wires->context, now); /* the first byte comes without a command */
        return;
    }
    scb->state = PSOC_SCB_MASTER_HOLDS;
    use_byte(psoc, scb, now);
}

void psoc_i2c_event(struct psoc *psoc, vtime now, enum psoc_i2c_event event, uint8_t byte)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    struct psoc_scb *scb = &psoc->scb[0];
    if (!psoc->powered || scb->state != PSOC_SCB_MASTER_WAITS) {
        return;
    }
    switch (event) {
    case PSOC_I2C_ACK:
        acknowledged(psoc, scb, now);
        break;
    case PSOC_I2C_NACK:
        scb->intr_m |= SCB_NACK;
        scb->acknowledged = false;
        scb->state = PSOC_SCB_MASTER_HOLDS;
        break;
    case PSOC_I2C_BYTE:
        psoc_fifo_push(&scb->rx, byte);
        if (acknowledges_itself(scb)) {
            wires->i2c_read(wires->context, now);
        } else {
            scb->state = PSOC_SCB_MASTER_HOLDS;
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

void psoc_master_off(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    if (wires->i2c_abort && is_master(scb) && scb->state >= PSOC_SCB_MASTER_STARTS) {
        wires->i2c_abort(wires->context, psoc_time(psoc, cycle));
        psoc_acts(psoc);
    }
}
