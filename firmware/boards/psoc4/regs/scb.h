/* Serial communication block, as I2C slave, I2C master and UART. Eight bytes of FIFO each way. Source: Registers TRM
 * (001-85847), chapter SCB, and Architecture TRM (001-85634), "Serial Communications Block"; values as in the
 * manufacturer's device header for this part. */
#ifndef PSOC4_REGS_SCB_H
#define PSOC4_REGS_SCB_H

#include <stddef.h>
#include <stdint.h>

#include "part/numbers.h"

struct scb_regs {
    volatile uint32_t ctrl;
    uint32_t a[15];
    volatile uint32_t uart_ctrl;
    volatile uint32_t uart_tx_ctrl;
    volatile uint32_t uart_rx_ctrl;
    uint32_t b[5];
    volatile uint32_t i2c_ctrl;
    volatile uint32_t i2c_status;
    volatile uint32_t i2c_m_cmd;
    volatile uint32_t i2c_s_cmd;
    volatile uint32_t i2c_cfg;
    uint32_t c[99];
    volatile uint32_t tx_ctrl;
    volatile uint32_t tx_fifo_ctrl;
    volatile uint32_t tx_fifo_status;
    uint32_t d[13];
    volatile uint32_t tx_fifo_wr;
    uint32_t e[47];
    volatile uint32_t rx_ctrl;
    volatile uint32_t rx_fifo_ctrl;
    volatile uint32_t rx_fifo_status;
    uint32_t f;
    volatile uint32_t rx_match;
    uint32_t g[11];
    volatile uint32_t rx_fifo_rd;
    uint32_t h[751];
    volatile uint32_t intr_m;
    volatile uint32_t intr_m_set;
    volatile uint32_t intr_m_mask;
    volatile uint32_t intr_m_masked;
    uint32_t i[12];
    volatile uint32_t intr_s;
    volatile uint32_t intr_s_set;
    volatile uint32_t intr_s_mask;
    volatile uint32_t intr_s_masked;
    uint32_t j[12];
    volatile uint32_t intr_tx;
    volatile uint32_t intr_tx_set;
    volatile uint32_t intr_tx_mask;
    volatile uint32_t intr_tx_masked;
    uint32_t k[12];
    volatile uint32_t intr_rx;
    volatile uint32_t intr_rx_set;
    volatile uint32_t intr_rx_mask;
    volatile uint32_t intr_rx_masked;
};

_Static_assert(offsetof(struct scb_regs, uart_ctrl) == 0x040, "SCB_UART_CTRL is at offset 0x0040");
_Static_assert(offsetof(struct scb_regs, i2c_ctrl) == 0x060, "SCB_I2C_CTRL is at offset 0x0060");
_Static_assert(offsetof(struct scb_regs, i2c_cfg) == 0x070, "SCB_I2C_CFG is at offset 0x0070");
_Static_assert(offsetof(struct scb_regs, tx_ctrl) == 0x200, "SCB_TX_CTRL is at offset 0x0200");
_Static_assert(offsetof(struct scb_regs, tx_fifo_wr) == 0x240, "SCB_TX_FIFO_WR is at offset 0x0240");
_Static_assert(offsetof(struct scb_regs, rx_ctrl) == 0x300, "SCB_RX_CTRL is at offset 0x0300");
_Static_assert(offsetof(struct scb_regs, rx_match) == 0x310, "SCB_RX_MATCH is at offset 0x0310");
_Static_assert(offsetof(struct scb_regs, rx_fifo_rd) == 0x340, "SCB_RX_FIFO_RD is at offset 0x0340");
_Static_assert(offsetof(struct scb_regs, intr_m) == 0xF00, "SCB_INTR_M is at offset 0x0F00");
_Static_assert(offsetof(struct scb_regs, intr_s) == 0xF40, "SCB_INTR_S is at offset 0x0F40");
_Static_assert(offsetof(struct scb_regs, intr_tx) == 0xF80, "SCB_INTR_TX is at offset 0x0F80");
_Static_assert(offsetof(struct scb_regs, intr_rx_masked) == 0xFCC, "SCB_INTR_RX_MASKED is at offset 0x0FCC");

#define SCB0 ((struct scb_regs *)SCB0_ADDRESS)
#define SCB1 ((struct scb_regs *)SCB1_ADDRESS)

#define SCB_FIFO_SIZE 8u

#define SCB_CTRL_OVERSAMPLE(cycles) ((cycles) - 1u) /* of a UART: clocks per bit */
#define SCB_CTRL_MODE_I2C (0u << 24)
#define SCB_CTRL_MODE_UART (2u << 24)
#define SCB_CTRL_ENABLED (1u << 31) /* 0: state machines reset, lines released; settings are kept */

#define SCB_UART_STOP_BITS_1 1u /* half bits minus 1, for UART_TX_CTRL and UART_RX_CTRL */

#define SCB_I2C_CTRL_HIGH_PHASE(cycles) ((cycles) - 1u) /* of a master: clocks for which SCL is high, and low */
#define SCB_I2C_CTRL_LOW_PHASE(cycles) (((cycles) - 1u) << 4)
/* bytes received by a master are acknowledged as long as the RX FIFO is not full */
#define SCB_I2C_CTRL_M_READY_DATA_ACK (1u << 8)
#define SCB_I2C_CTRL_S_GENERAL_IGNORE (1u << 11)
#define SCB_I2C_CTRL_SLAVE (1u << 30)
#define SCB_I2C_CTRL_MASTER (1u << 31)

#define SCB_I2C_STATUS_BUS_BUSY (1u << 0)
#define SCB_I2C_STATUS_S_READ (1u << 4) /* the master reads from this slave */

#define SCB_I2C_M_CMD_START (1u << 0)
#define SCB_I2C_M_CMD_START_ON_IDLE (1u << 1)
#define SCB_I2C_M_CMD_ACK (1u << 2)
#define SCB_I2C_M_CMD_NACK (1u << 3)
#define SCB_I2C_M_CMD_STOP (1u << 4)

#define SCB_I2C_S_CMD_ACK (1u << 0)
#define SCB_I2C_S_CMD_NACK (1u << 1)

#define SCB_DATA_WIDTH(bits) ((bits) - 1u) /* of TX_CTRL and RX_CTRL */
#define SCB_MSB_FIRST (1u << 8)            /* I2C; a UART is LSB first */
#define SCB_RX_CTRL_MEDIAN (1u << 9)

#define SCB_FIFO_CTRL_LEVEL(bytes) (bytes) /* TX: TRIGGER below it; RX: TRIGGER above it */
#define SCB_FIFO_CTRL_CLEAR (1u << 16)     /* while set, FIFO and shift register are cleared */
#define SCB_FIFO_STATUS_USED 0xFu

#define SCB_RX_MATCH_ADDRESS(address) ((uint32_t)(address) << 1) /* bits 1 to 7: the 7-bit address */
#define SCB_RX_MATCH_MASK (0xFEu << 16)                          /* which bits are compared */

#define SCB_INTR_I2C_ARB_LOST (1u << 0) /* INTR_M and INTR_S */
#define SCB_INTR_I2C_NACK (1u << 1)
#define SCB_INTR_I2C_ACK (1u << 2)
#define SCB_INTR_I2C_STOP (1u << 4)
#define SCB_INTR_S_ADDR_MATCH (1u << 6)
#define SCB_INTR_I2C_BUS_ERROR (1u << 8)
#define SCB_INTR_ALL 0xFFFFu

#define SCB_INTR_TX_TRIGGER (1u << 0)
#define SCB_INTR_TX_EMPTY (1u << 4)
#define SCB_INTR_RX_TRIGGER (1u << 0)
#define SCB_INTR_RX_NOT_EMPTY (1u << 2)
#define SCB_INTR_RX_OVERFLOW (1u << 5)

#endif
