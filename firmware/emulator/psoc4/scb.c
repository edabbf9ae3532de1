/* Serial communication block: FIFOs, four groups of interrupts, and the registers that its modes share. */
#include <string.h>

#include "emulator/psoc4/internal.h"
#include "emulator/psoc4/scb_registers.h"

/* Append a byte to a FIFO; a full FIFO loses it. */
void psoc_fifo_push(struct psoc_fifo *fifo, uint8_t byte)
{
    if (fifo->count < PSOC_FIFO) {
        fifo->bytes[(fifo->first + fifo->count++) % PSOC_FIFO] = byte;
    }
}

/* Remove the oldest byte of a FIFO and return it; 0 if the FIFO is empty. */
uint8_t psoc_fifo_pop(struct psoc_fifo *fifo)
{
    if (!fifo->count) {
        return 0;
    }
    const uint8_t byte = fifo->bytes[fifo->first];
    fifo->first = (fifo->first + 1u) % PSOC_FIFO;
    fifo->count--;
    return byte;
}

/* Return whether the serial block is enabled as I2C master or slave. */
bool psoc_scb_is_i2c(const struct psoc_scb *scb)
{
    return (scb->ctrl & (SCB_ENABLED | SCB_MODE)) == (SCB_ENABLED | SCB_MODE_I2C);
}

/* Update the interrupt causes of the FIFOs and the interrupt line of a serial block. Causes that state a fill
 * level are set again while their condition holds, even after they are cleared. */
void psoc_scb_update(struct psoc *psoc, struct psoc_scb *scb)
{
    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): every caller passes a block of the chip */
    if (scb->ctrl & SCB_ENABLED) {
        scb->intr_tx |= scb->tx.count < (scb->tx_fifo_ctrl & SCB_LEVEL) ? SCB_TX_TRIGGER : 0u;
        scb->intr_tx |= scb->tx.count ? 0u : SCB_TX_EMPTY;
        scb->intr_rx |= scb->rx.count ? SCB_RX_NOT_EMPTY : 0u;
        scb->intr_rx |= scb->rx.count > (scb->rx_fifo_ctrl & SCB_LEVEL) ? SCB_RX_TRIGGER : 0u;
    }
    const bool line = (scb->intr_m & scb->intr_m_mask) || (scb->intr_s & scb->intr_s_mask) ||
                      (scb->intr_tx & scb->intr_tx_mask) || (scb->intr_rx & scb->intr_rx_mask);
    if (line != scb->line) {
        scb->line = line;
        const struct psoc_deviations *deviations = &psoc->config.deviations;
        psoc_set_line(psoc,
                      psoc_actual(scb->number ? deviations->irq_scb1 : deviations->irq_scb0,
                                  psoc_family(psoc)->irq_scb[scb->number]),
                      line);
    }
}

/* Return the control register of a serial block (SCB) at an offset that only stores its value, or NULL. */
static uint32_t *register_at(struct psoc_scb *scb, uint32_t offset)
{
    switch (offset) {
    case SCB_CTRL:
        return &scb->ctrl;
    case SCB_UART_CTRL:
        return &scb->uart_ctrl;
    case SCB_UART_TX_CTRL:
        return &scb->uart_tx_ctrl;
    case SCB_UART_RX_CTRL:
        return &scb->uart_rx_ctrl;
    case SCB_I2C_CTRL:
        return &scb->i2c_ctrl;
    case SCB_I2C_CFG:
        return &scb->i2c_cfg;
    case SCB_TX_CTRL:
        return &scb->tx_ctrl;
    case SCB_TX_FIFO_CTRL:
        return &scb->tx_fifo_ctrl;
    case SCB_RX_CTRL:
        return &scb->rx_ctrl;
    case SCB_RX_FIFO_CTRL:
        return &scb->rx_fifo_ctrl;
    case SCB_RX_MATCH:
        return &scb->rx_match;
    default:
        return NULL;
    }
}

/* Causes and mask of one group of interrupts of a serial block. */
struct interrupt_group {
    uint32_t *raised, *mask;
};

/* Find the interrupt group (master, slave, TX or RX) to which a register offset belongs. Returns false if it belongs to
 * none. */
static bool interrupt_group_at(struct psoc_scb *scb, uint32_t offset, struct interrupt_group *group)
{
    switch (offset & ~15u) {
    case SCB_INTR_M:
        *group = (struct interrupt_group){&scb->intr_m, &scb->intr_m_mask};
        return true;
    case SCB_INTR_S:
        *group = (struct interrupt_group){&scb->intr_s, &scb->intr_s_mask};
        return true;
    case SCB_INTR_TX:
        *group = (struct interrupt_group){&scb->intr_tx, &scb->intr_tx_mask};
        return true;
    case SCB_INTR_RX:
        *group = (struct interrupt_group){&scb->intr_rx, &scb->intr_rx_mask};
        return true;
    default:
        return false;
    }
}

/* Return the value of the register I2C_STATUS: whether a transfer is in progress and whether the master reads. */
static uint32_t compute_i2c_status(const struct psoc_scb *scb)
{
    return (scb->state != PSOC_SCB_IDLE ? SCB_STATUS_BUS_BUSY : 0u) | (scb->reading ? SCB_STATUS_S_READ : 0u);
}

/* Read a register of a serial block (SCB). A read of the RX FIFO removes a byte and may let the master continue.
 * Returns false if the access is not modelled. */
bool psoc_scb_read(struct psoc *psoc, struct psoc_scb *scb, uint32_t offset, struct cortex_m0_access *access)
{
    struct interrupt_group group;
    const uint32_t *value_register = register_at(scb, offset);
    if (access->size != 4u) {
        return false;
    }
    if (value_register) {
        access->value = *value_register;
    } else if (interrupt_group_at(scb, offset, &group)) {
        const uint32_t raised = *group.raised, mask = *group.mask;
        const uint32_t values[4] = {raised, raised, mask, raised & mask}; /* INTR, INTR_SET, INTR_MASK, INTR_MASKED */
        access->value = values[offset >> 2 & 3u];
    } else if (offset == SCB_I2C_STATUS) {
        access->value = compute_i2c_status(scb);
    } else if (offset == SCB_TX_FIFO_STATUS) {
        access->value = scb->tx.count;
    } else if (offset == SCB_RX_FIFO_STATUS) {
        access->value = scb->rx.count;
    } else if (offset == SCB_RX_FIFO_RD) {
        access->value = psoc_fifo_pop(&scb->rx);
        psoc_master_rx_drained(psoc, scb, access->cycle);
        psoc_scb_update(psoc, scb);
    } else {
        return false;
    }
    return true;
}

/* Write the register CTRL: mode and enable. Disabling the block releases the bus and empties its FIFOs. Returns false
 * for settings that are not modelled. */
static bool set_ctrl(struct psoc *psoc, struct psoc_scb *scb, uint32_t value, uint64_t cycle)
{
    const bool was_on = scb->ctrl & SCB_ENABLED;
    if (value & ~(SCB_ENABLED | SCB_MODE | SCB_OVERSAMPLE) || (value & SCB_MODE) == SCB_MODE) {
        return false;
    }
    if (was_on && !(value & SCB_ENABLED)) {
        psoc_slave_disabled(psoc, scb, cycle);
        psoc_master_disabled(psoc, scb, cycle);
        scb->state = PSOC_SCB_IDLE;
        scb->shift_full = false;
        scb->tx.count = scb->rx.count = 0;
    }
    scb->ctrl = value;
    return true;
}

/* Write one register of an interrupt group: 0 clears events, 1 sets them, 2 is the mask. Returns false for the
 * read-only register. */
static bool write_interrupt_group(struct interrupt_group group, uint32_t register_index, uint32_t value)
{
    switch (register_index) {
    case 0:
        *group.raised &= ~value;
        return true;
    case 1:
        *group.raised |= value;
        return true;
    case 2:
        *group.mask = value;
        return true;
    default:
        return false;
    }
}

/* Write a byte into the TX FIFO, and let the slave, master or UART that waits for it continue. */
static void write_tx_fifo(struct psoc *psoc, struct psoc_scb *scb, uint8_t byte, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    psoc_fifo_push(&scb->tx, byte);
    if (!(scb->ctrl & SCB_ENABLED)) {
        return;
    }
    if (psoc_scb_is_i2c(scb)) {
        psoc_slave_tx_filled(psoc, scb, cycle);
        psoc_master_tx_filled(psoc, scb, cycle);
    } else if (wires->uart_kick) {
        wires->uart_kick(wires->context, psoc_time(psoc, cycle));
        psoc_end_run(psoc);
    }
}

/* Write a control register; the CLEAR bit of a FIFO's control register empties it. Returns false for settings that are
 * not modelled. */
static bool set_settings(struct psoc_scb *scb, uint32_t *value_register, uint32_t offset, uint32_t value)
{
    if (offset == SCB_I2C_CTRL && value & ~SCB_I2C_CTRL_MODELLED) {
        return false;
    }
    *value_register = value;
    if (offset == SCB_TX_FIFO_CTRL && value & SCB_CLEAR) {
        scb->tx.count = 0;
        scb->shift_full = false;
    } else if (offset == SCB_RX_FIFO_CTRL && value & SCB_CLEAR) {
        scb->rx.count = 0;
    }
    return true;
}

/* Write a register of a serial block (SCB). Returns false if the access is not modelled. */
bool psoc_scb_write(struct psoc *psoc, struct psoc_scb *scb, uint32_t offset, struct cortex_m0_access *access)
{
    struct interrupt_group group;
    uint32_t *value_register = register_at(scb, offset);
    const uint32_t value = access->value;
    bool is_modelled = access->size == 4u;
    if (offset == SCB_CTRL) {
        is_modelled &= set_ctrl(psoc, scb, value, access->cycle);
    } else if (value_register) {
        is_modelled &= set_settings(scb, value_register, offset, value);
        psoc_master_rx_drained(psoc, scb, access->cycle);
    } else if (interrupt_group_at(scb, offset, &group)) {
        is_modelled &= write_interrupt_group(group, offset >> 2 & 3u, value);
    } else if (offset == SCB_TX_FIFO_WR) {
        write_tx_fifo(psoc, scb, (uint8_t)value, access->cycle);
    } else if (offset == SCB_I2C_S_CMD) {
        psoc_slave_command(psoc, scb, value, access->cycle);
    } else if (offset == SCB_I2C_M_CMD) {
        is_modelled &= psoc_master_command(psoc, scb, value, access->cycle);
    } else {
        is_modelled = false;
    }
    psoc_scb_update(psoc, scb);
    return is_modelled;
}
