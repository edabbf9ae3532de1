/* The state of each block: the registers that are modelled, by their names in boards/psoc4200/regs. */
#ifndef PSOC4200_BLOCKS_H
#define PSOC4200_BLOCKS_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/vtime.h"

#define PSOC_PORTS 5u
#define PSOC_FIFO 8u
#define PSOC_NEVER UINT64_MAX /* cycles */

struct psoc_clocks {
    uint32_t divider_a[3], divider_b[3], divider_c[3];
    uint32_t select[16];
};

struct psoc_cpuss {
    uint32_t config, sysreq, sysarg;
    uint8_t latch[128]; /* the ROM's page latch */
};

struct psoc_gpio {
    struct {
        uint32_t data, mode, input_disable;
    } port[PSOC_PORTS];
    uint32_t select[PSOC_PORTS]; /* HSIOM */
    bool scl_low, sda_low, rts_high; /* by hand, as the wires were told */
};

struct psoc_csd {
    uint32_t config, idac, trim1, intr;
    uint32_t counter;   /* at rest: what the last conversion left */
    uint64_t begin, end; /* cycles; PSOC_NEVER: none under way */
    uint32_t period, sense, sample;
    int tx, rx;
};

struct psoc_srss {
    uint32_t select, ilo_config, imo_config;
    uint32_t match, wdt_config, wdt_control;
    uint32_t cause;
    uint32_t bg_trim4, bg_trim5, imo_trim1, imo_trim2;
    uint64_t bites; /* cycle; PSOC_NEVER: it sleeps */
};

struct psoc_fifo {
    uint8_t bytes[PSOC_FIFO];
    unsigned first, count;
};

enum psoc_scb_state {
    PSOC_SCB_IDLE,
    PSOC_SCB_SLAVE_ADDRESSED, /* SCL is held until the address is answered */
    PSOC_SCB_SLAVE_RECEIVES,
    PSOC_SCB_SLAVE_TAKEN, /* a byte waits to be acknowledged, SCL is held */
    PSOC_SCB_SLAVE_SENDS,
    PSOC_SCB_MASTER_STARTS,  /* a start was commanded; its address has not come */
    PSOC_SCB_MASTER_WAITS,   /* a byte or a condition is under way */
    PSOC_SCB_MASTER_HOLDS,   /* SCL low, until a command or a byte comes */
};

struct psoc_scb {
    unsigned number;
    uint32_t ctrl, uart_ctrl, uart_tx_ctrl, uart_rx_ctrl, i2c_ctrl, i2c_cfg;
    uint32_t tx_ctrl, tx_fifo_ctrl, rx_ctrl, rx_fifo_ctrl, rx_match;
    struct psoc_fifo tx, rx;
    uint32_t intr_m, intr_m_mask, intr_s, intr_s_mask, intr_tx, intr_tx_mask, intr_rx, intr_rx_mask;
    bool line; /* its interrupt */
    enum psoc_scb_state state;
    bool reading;      /* the master reads */
    bool acknowledged; /* as slave: its last answer; as master: the last it got */
    uint64_t answered; /* the cycle of it */
    bool shift_full;   /* a byte to be sent is on its way out */
    uint8_t shift;
    vtime shift_begin, shift_filled; /* when the byte could begin, and when there was one */
};

#endif
