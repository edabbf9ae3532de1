/* Declarations shared by the blocks. A register function returns false for a register that is not modelled. */
#ifndef PSOC4_INTERNAL_H
#define PSOC4_INTERNAL_H

#include "emulator/psoc4/psoc.h"

/* Return what differs between the chips of the model. */
static inline const struct psoc_family *psoc_family(const struct psoc *psoc)
{
    return psoc->config.part->family;
}

/* Return a number of this part: the deviating number, or the assumed number if the deviation is 0. */
static inline unsigned psoc_actual(uint8_t deviating, unsigned assumed)
{
    return deviating ? deviating : assumed;
}

/* Return the serial block of the I2C bus. */
static inline struct psoc_scb *psoc_bus_scb(struct psoc *psoc)
{
    return &psoc->scb[psoc->config.part->bus_scb];
}

/* Return the serial block of the UART. */
static inline struct psoc_scb *psoc_uart_scb(struct psoc *psoc)
{
    return &psoc->scb[1u - psoc->config.part->bus_scb];
}

/* psoc.c */
vtime psoc_time(const struct psoc *psoc, uint64_t cycle);
uint64_t psoc_cycle(const struct psoc *psoc, vtime time);
void psoc_set_frequency(struct psoc *psoc, double hz, uint64_t cycle);
void psoc_set_line(struct psoc *psoc, unsigned irq, bool high);
/* Record an action on the wires or the flash, and end the run after the instruction. */
void psoc_end_run(struct psoc *psoc);
void psoc_end_wait(struct psoc *psoc); /* records that the bus has its reply and ends the wait */
/* Print one line with the PC and `address`, and stop the processor. `action`: "reads", "writes", ... */
void psoc_report_unmodelled(struct psoc *psoc, const char *action, uint32_t address);

/* bus_map.c: bus accesses outside flash and RAM, and the registers of each serial block. */
psoc_register_function psoc_scb0_read, psoc_scb0_write, psoc_scb1_read, psoc_scb1_write;
enum cortex_m0_bus_status psoc_on_read(void *context, struct cortex_m0_access *access);
enum cortex_m0_bus_status psoc_on_write(void *context, struct cortex_m0_access *access);

/* offset: from the first register of the block. access->value is set by a read and used by a write. */
bool psoc_cpuss_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);
bool psoc_cpuss_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);

bool psoc_gpio_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);
bool psoc_gpio_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);
bool psoc_hsiom_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);
bool psoc_hsiom_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);
void psoc_connected_lines(const struct psoc *psoc, int *tx, int *rx);
/* Return whether all integration capacitors that the part needs have the function `function` of the switch matrix. */
bool psoc_has_capacitors(const struct psoc *psoc, unsigned function);
/* Pass a conversion to the board's front end if `balances`, and return the count; 0 otherwise. tx, rx, begin and end of
 * `conversion` are filled in. The conversion ends. Returns whether the program sees its end, which a test bench can prevent. */
bool psoc_finish_conversion(struct psoc *psoc, struct psoc_conversion *conversion, bool balances, uint32_t *count);

bool psoc_sflash_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);

/* Execute the ROM call that a write to SYSREQ starts. Returns its duration in cycles. */
uint32_t psoc_srom_call(struct psoc *psoc, uint32_t opcode, uint64_t cycle);

bool psoc_scb_read(struct psoc *psoc, struct psoc_scb *scb, uint32_t offset, struct cortex_m0_access *access);
bool psoc_scb_write(struct psoc *psoc, struct psoc_scb *scb, uint32_t offset, struct cortex_m0_access *access);
void psoc_scb_update(struct psoc *psoc, struct psoc_scb *scb); /* update the interrupt level */
bool psoc_scb_is_i2c(const struct psoc_scb *scb);
void psoc_fifo_push(struct psoc_fifo *fifo, uint8_t byte);
uint8_t psoc_fifo_pop(struct psoc_fifo *fifo);

void psoc_slave_command(struct psoc *psoc, struct psoc_scb *scb, uint32_t command, uint64_t cycle);
/* Continue after the program has written a byte to the transmit FIFO. */
void psoc_slave_tx_filled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle);
void psoc_slave_disabled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle);
bool psoc_master_command(struct psoc *psoc, struct psoc_scb *scb, uint32_t command, uint64_t cycle);
void psoc_master_tx_filled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle);
/* Continue after the receive FIFO has got space, or automatic acknowledge was enabled. */
void psoc_master_rx_drained(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle);
void psoc_master_disabled(struct psoc *psoc, struct psoc_scb *scb, uint64_t cycle);

#endif
