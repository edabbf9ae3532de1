/* Serial blocks (SCB) of the I2C bus and of the UART. The silicon has SCB0 on P4.0 and P4.1, and SCB1 on P0.4 and P0.5
 * or on P3.0 and P3.1. The pins file selects the pins, and thereby the blocks: the original hub has its bus on SCB1
 * and its UART on SCB0. */
#ifndef PSOC4_SERIAL_BLOCKS_H
#define PSOC4_SERIAL_BLOCKS_H

#include "board_pins.h"
#include "boards/psoc4/regs/core.h"
#include "part/peri_clk.h"
#include "boards/psoc4/regs/scb.h"

#if BOARD_BUS_SCB == 1
#define BUS_SCB SCB1
#define BUS_IRQ IRQ_SCB1
#define BUS_PERI_CLK PERI_CLK_OF_SCB1
#define bus_handler scb1_handler
#define UART_SCB SCB0
#define UART_IRQ IRQ_SCB0
#define UART_PERI_CLK PERI_CLK_OF_SCB0
#define uart_handler scb0_handler
#else
#define BUS_SCB SCB0
#define BUS_IRQ IRQ_SCB0
#define BUS_PERI_CLK PERI_CLK_OF_SCB0
#define bus_handler scb0_handler
#define UART_SCB SCB1
#define UART_IRQ IRQ_SCB1
#define UART_PERI_CLK PERI_CLK_OF_SCB1
#define uart_handler scb1_handler
#endif

#endif
