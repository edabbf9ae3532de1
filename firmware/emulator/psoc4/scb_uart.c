/* SCB as UART: FIFOs to and from the wire. emulator/uart.h models the bits on the wire. */
#include "emulator/psoc4/internal.h"
#include "emulator/psoc4/scb_registers.h"

#define SCB_MODE_UART (2u << 24)

/* Return whether the chip is powered and the serial block is enabled as UART. */
static bool is_on(const struct psoc *psoc, const struct psoc_scb *scb)
{
    return psoc->powered && (scb->ctrl & (SCB_ENABLED | SCB_MODE)) == (SCB_ENABLED | SCB_MODE_UART);
}

/* Put a byte from the host into the RX FIFO; if the FIFO is full, the byte is lost and the overflow interrupt is
 * raised. Without effect while the UART is off. */
void psoc_uart_receive(struct psoc *psoc, uint8_t byte)
{
    struct psoc_scb *scb = psoc_uart_scb(psoc);
    if (!is_on(psoc, scb)) {
        return;
    }
    if (scb->rx.count == PSOC_FIFO) {
        scb->intr_rx |= SCB_RX_OVERFLOW;
    } else {
        psoc_fifo_push(&scb->rx, byte);
    }
    psoc_scb_update(psoc, scb);
}

/* Remove the next byte to transmit from the TX FIFO and write it to *byte. Returns false, without a byte, if the FIFO
 * is empty or the UART is off. */
bool psoc_uart_take(struct psoc *psoc, uint8_t *byte)
{
    struct psoc_scb *scb = psoc_uart_scb(psoc);
    if (!is_on(psoc, scb) || !scb->tx.count) {
        return false;
    }
    *byte = psoc_fifo_pop(&scb->tx);
    psoc_scb_update(psoc, scb);
    return true;
}
