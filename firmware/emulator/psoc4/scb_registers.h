/* Registers and bits of an SCB, as defined in boards/psoc4/regs/scb.h. */
#ifndef PSOC4_SCB_REGISTERS_H
#define PSOC4_SCB_REGISTERS_H

enum {
    SCB_CTRL = 0x000,
    SCB_UART_CTRL = 0x040,
    SCB_UART_TX_CTRL = 0x044,
    SCB_UART_RX_CTRL = 0x048,
    SCB_I2C_CTRL = 0x060,
    SCB_I2C_STATUS = 0x064,
    SCB_I2C_M_CMD = 0x068,
    SCB_I2C_S_CMD = 0x06C,
    SCB_I2C_CFG = 0x070,
    SCB_TX_CTRL = 0x200,
    SCB_TX_FIFO_CTRL = 0x204,
    SCB_TX_FIFO_STATUS = 0x208,
    SCB_TX_FIFO_WR = 0x240,
    SCB_RX_CTRL = 0x300,
    SCB_RX_FIFO_CTRL = 0x304,
    SCB_RX_FIFO_STATUS = 0x308,
    SCB_RX_MATCH = 0x310,
    SCB_RX_FIFO_RD = 0x340,
    SCB_INTR_M = 0xF00,
    SCB_INTR_S = 0xF40,
    SCB_INTR_TX = 0xF80,
    SCB_INTR_RX = 0xFC0,
};

#define SCB_OVERSAMPLE 15u
#define SCB_MODE (3u << 24)
#define SCB_MODE_I2C (0u << 24)
#define SCB_ENABLED (1u << 31)

#define SCB_I2C_SLAVE (1u << 30)
#define SCB_I2C_MASTER (1u << 31)
#define SCB_I2C_PHASES 0xFFu
#define SCB_I2C_M_READY_DATA_ACK (1u << 8)
#define SCB_I2C_GENERAL_IGNORE (1u << 11)
#define SCB_I2C_CTRL_MODELLED \
    (SCB_I2C_SLAVE | SCB_I2C_MASTER | SCB_I2C_PHASES | SCB_I2C_M_READY_DATA_ACK | SCB_I2C_GENERAL_IGNORE)

#define SCB_STATUS_BUS_BUSY (1u << 0)
#define SCB_STATUS_S_READ (1u << 4)

#define SCB_M_START (1u << 0)
#define SCB_M_START_ON_IDLE (1u << 1)
#define SCB_M_ACK (1u << 2)
#define SCB_M_NACK (1u << 3)
#define SCB_M_STOP (1u << 4)
#define SCB_S_ACK (1u << 0)

#define SCB_LEVEL 15u
#define SCB_CLEAR (1u << 16)

#define SCB_ARB_LOST (1u << 0)
#define SCB_NACK (1u << 1)
#define SCB_ACK (1u << 2)
#define SCB_STOPPED (1u << 4)
#define SCB_ADDR_MATCH (1u << 6)
#define SCB_BUS_ERROR (1u << 8)
#define SCB_TX_TRIGGER (1u << 0)
#define SCB_TX_EMPTY (1u << 4)
#define SCB_RX_TRIGGER (1u << 0)
#define SCB_RX_NOT_EMPTY (1u << 2)
#define SCB_RX_OVERFLOW (1u << 5)

#endif
