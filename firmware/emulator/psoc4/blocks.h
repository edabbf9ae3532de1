/* State of each peripheral block. Registers have the names of boards/psoc4200/part. */
#ifndef PSOC4_BLOCKS_H
#define PSOC4_BLOCKS_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/base/vtime.h"

#define PSOC_PORTS 5u
#define PSOC_FIFO 8u
#define PSOC_NEVER UINT64_MAX /* cycles */

struct psoc_clocks {
    uint32_t divider_a[3], divider_b[3], divider_c[3];
    uint32_t select[16];
};

/* Dividers of a PSoC 4100S. */
#define PSOC_PERI_DIVIDERS 6u
#define PSOC_PERI_CLOCKS 13u
struct psoc_peri {
    uint32_t select[PSOC_PERI_CLOCKS], divider_16[PSOC_PERI_DIVIDERS];
    bool is_running[PSOC_PERI_DIVIDERS];
};

struct psoc_cpuss {
    uint32_t config, sysreq, sysarg, flash_ctl;
    uint8_t latch[128];      /* the ROM's page latch */
    bool clock_is_for_flash; /* a ROM call has set the clocks for a write */
};

struct psoc_gpio {
    struct {
        uint32_t data, mode, input_disable;
    } port[PSOC_PORTS];
    uint32_t select[PSOC_PORTS];     /* HSIOM */
    bool scl_low, sda_low, rts_high; /* levels driven by software at the last update of the wires */
};

struct psoc_csd {
    uint32_t config, idac, trim1, intr;
    uint32_t counter;    /* when idle: result of the last conversion */
    uint64_t begin, end; /* cycles; PSOC_NEVER: no conversion active */
    uint32_t period, sense, sample;
    bool loses_end; /* the present or next conversion ends without an interrupt */
};

#define PSOC_CSD_WORDS 209u /* registers of the converter of a PSoC 4100S, from CONFIG to SEQ_START */

struct psoc_srss {
    uint32_t select, ilo_config, imo_config;
    uint32_t match, wdt_config, wdt_control;
    uint32_t cause;
    uint32_t bg_trim4, bg_trim5, imo_trim1, imo_trim2;
    uint64_t reset_cycle; /* cycle of the watchdog reset; PSOC_NEVER: disabled */
    vtime begin;          /* of the watchdog's counter, for a PSoC 4100S: the last reset */
    uint32_t imo_select, imo_trim3;
};

struct psoc_fifo {
    uint8_t bytes[PSOC_FIFO];
    unsigned first, count;
};

enum psoc_scb_state {
    PSOC_SCB_IDLE,
    PSOC_SCB_SLAVE_ADDRESSED, /* SCL is held low until the address is acknowledged or refused */
    PSOC_SCB_SLAVE_RECEIVING,
    PSOC_SCB_SLAVE_BYTE_RECEIVED, /* SCL is held low until the byte is acknowledged or refused */
    PSOC_SCB_SLAVE_SENDING,
    PSOC_SCB_MASTER_STARTING, /* start commanded, address byte not written yet */
    PSOC_SCB_MASTER_BUSY,     /* a byte or a bus condition is being transferred */
    PSOC_SCB_MASTER_HOLDING,  /* SCL is held low until a command or a byte */
};

struct psoc_scb {
    unsigned number;
    uint32_t ctrl, uart_ctrl, uart_tx_ctrl, uart_rx_ctrl, i2c_ctrl, i2c_cfg;
    uint32_t tx_ctrl, tx_fifo_ctrl, rx_ctrl, rx_fifo_ctrl, rx_match;
    struct psoc_fifo tx, rx;
    uint32_t intr_m, intr_m_mask, intr_s, intr_s_mask, intr_tx, intr_tx_mask, intr_rx, intr_rx_mask;
    bool line; /* level of its interrupt */
    enum psoc_scb_state state;
    bool reading;         /* direction of the transfer: read by the master */
    bool acknowledged;    /* as slave: last acknowledge sent; as master: last acknowledge received */
    uint64_t reply_cycle; /* cycle of `acknowledged` */
    bool shift_full;      /* the shift register contains a byte to send */
    uint8_t shift;
    vtime shift_begin, shift_filled; /* earliest start of the byte, and time at which the byte was available */
};

#endif
