/* CapSense block of the third generation (CSD version 2), with a sequencer and hardware for mutual capacitance. Sources:
 * manufacturer's register header for the addresses and bits; configuration values of the manufacturer's public CapSense
 * sources for mutual capacitance at a supply of 2 V and more. The order of the accesses, and the current of a code, are not
 * verified (confirm). */
#ifndef PART_CSD_H
#define PART_CSD_H

#include <stddef.h>
#include <stdint.h>

struct csd_regs {
    volatile uint32_t config;
    uint32_t a[51];
    volatile uint32_t result_1;
    uint32_t b[7];
    volatile uint32_t intr;
    uint32_t c;
    volatile uint32_t intr_mask;
    uint32_t d[35];
    volatile uint32_t refgen;
    volatile uint32_t csdcmp;
    uint32_t e[12];
    volatile uint32_t idac_a;
    uint32_t f[15];
    volatile uint32_t sense_period;
    volatile uint32_t sense_duty;
    uint32_t g[38];
    volatile uint32_t sw_cmp_p_sel;
    volatile uint32_t sw_cmp_n_sel;
    volatile uint32_t sw_refgen_sel;
    uint32_t h;
    volatile uint32_t sw_fw_mod_sel;
    volatile uint32_t sw_fw_tank_sel;
    uint32_t i[18];
    volatile uint32_t seq_time;
    uint32_t j[3];
    volatile uint32_t seq_init_count;
    volatile uint32_t seq_norm_count;
    uint32_t k[10];
    volatile uint32_t seq_start;
};

_Static_assert(offsetof(struct csd_regs, result_1) == 0x0D0, "CSD_RESULT_VAL1 is at 0x400C00D0");
_Static_assert(offsetof(struct csd_regs, intr) == 0x0F0, "CSD_INTR is at 0x400C00F0");
_Static_assert(offsetof(struct csd_regs, intr_mask) == 0x0F8, "CSD_INTR_MASK is at 0x400C00F8");
_Static_assert(offsetof(struct csd_regs, refgen) == 0x188, "CSD_REFGEN is at 0x400C0188");
_Static_assert(offsetof(struct csd_regs, csdcmp) == 0x18C, "CSD_CSDCMP is at 0x400C018C");
_Static_assert(offsetof(struct csd_regs, idac_a) == 0x1C0, "CSD_IDACA is at 0x400C01C0");
_Static_assert(offsetof(struct csd_regs, sense_period) == 0x200, "CSD_SENSE_PERIOD is at 0x400C0200");
_Static_assert(offsetof(struct csd_regs, sw_cmp_p_sel) == 0x2A0, "CSD_SW_CMP_P_SEL is at 0x400C02A0");
_Static_assert(offsetof(struct csd_regs, sw_fw_mod_sel) == 0x2B0, "CSD_SW_FW_MOD_SEL is at 0x400C02B0");
_Static_assert(offsetof(struct csd_regs, seq_time) == 0x300, "CSD_SEQ_TIME is at 0x400C0300");
_Static_assert(offsetof(struct csd_regs, seq_init_count) == 0x310, "CSD_SEQ_INIT_CNT is at 0x400C0310");
_Static_assert(offsetof(struct csd_regs, seq_start) == 0x340, "CSD_SEQ_START is at 0x400C0340");

#define CSD ((struct csd_regs *)0x400C0000u)

#define CSD_CONFIG_FILTER_DELAY_2 (2u << 4)
#define CSD_CONFIG_SENSE_EN (1u << 12)
#define CSD_CONFIG_MUTUAL_CAP (1u << 18)
#define CSD_CONFIG_TWO_COUNTERS (1u << 19) /* one for each edge of the sense clock */
#define CSD_CONFIG_ENABLE (1u << 31)

#define CSD_RESULT_COUNT 0xFFFFu /* modulator clocks in which the current source was on */
#define CSD_INTR_SAMPLE (1u << 1)

#define CSD_REFGEN_ENABLE (1u << 0)
#define CSD_CSDCMP_ENABLE (1u << 0)
#define CSD_CSDCMP_BOTH_PHASES (3u << 8)

/* Current source with a polarity that follows the sense clock, on until the comparator ends the balancing, both legs. */
#define CSD_IDAC_BALANCING 0x030F0F80u
#define CSD_IDAC_MEDIUM (1u << 22) /* 0.3 uA for each code from 0 to 127 (confirm, also that both legs are included) */
#define CSD_IDAC_HIGH (2u << 22)   /* 2.4 uA */
#define CSD_IDAC_CODE 0x7Fu

/* Switches of a measurement with two integration capacitors, CintA and CintB: each is connected during one phase of the
 * sense clock. */
#define CSD_SW_CMP_P_SEL_BOTH_PHASES 0x00000023u
#define CSD_SW_CMP_N_SEL_REFERENCE 0x01000000u
#define CSD_SW_REFGEN_SEL_REFERENCE 0x10000000u
#define CSD_SW_FW_MOD_SEL_CINT_A 0x00030201u
#define CSD_SW_FW_TANK_SEL_CINT_B 0x00002310u

#define CSD_SEQ_START_START (1u << 0)
#define CSD_SEQ_START_SKIP_AUTO_ZERO (3u << 8)

#endif
