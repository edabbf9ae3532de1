/* CapSense block with a sequencer. A start runs the initial sense clocks, then the normal ones, and counts the
 * modulator clocks in which the current source was on. The board's front end computes the count, as for a native
 * board. */
#include "emulator/psoc4/psoc4100s.h"

#define CONFIG 0x000u
#define RESULT_1 0x0D0u
#define INTR 0x0F0u
#define INTR_MASK 0x0F8u
#define REFGEN 0x188u
#define CSDCMP 0x18Cu
#define IDAC_A 0x1C0u
#define SENSE_PERIOD 0x200u
#define SENSE_DUTY 0x204u
#define SW_CMP_P_SEL 0x2A0u
#define SW_CMP_N_SEL 0x2A4u
#define SW_REFGEN_SEL 0x2A8u
#define SW_FW_MOD_SEL 0x2B0u
#define SW_FW_TANK_SEL 0x2B4u
#define SEQ_TIME 0x300u
#define SEQ_INIT_COUNT 0x310u
#define SEQ_NORM_COUNT 0x314u
#define SEQ_START 0x340u

#define CONFIG_ENABLE (1u << 31)
#define CONFIG_OF_MUTUAL \
    (1u << 31 | 1u << 19 | 1u << 18 | 1u << 12) /* on, two counters, mutual capacitance, sense clock */
#define ENABLED 1u
#define CSDCMP_BOTH_PHASES (3u << 8)
#define INTR_SAMPLE (1u << 1)
#define IDAC_MODE 0x033F0F80u /* bits that the manufacturer's driver sets as IDAC_BALANCING */
#define IDAC_BALANCING 0x030F0F80u
#define IDAC_CODE 0x7Fu
#define IDAC_MEDIUM 1u /* range: 0.3 uA for each code */
#define IDAC_HIGH 2u   /* 2.4 uA */
#define START 0x301u   /* without the two auto-zero states */
#define GPIO 0u        /* function of a pin that only its own pad of the converter uses */
#define CLOCK_CSD 3u

/* Values of the switches of a measurement with two integration capacitors. */
static const struct {
    uint32_t offset, value;
} switches[] = {
    {SW_CMP_P_SEL, 0x00000023u},  {SW_CMP_N_SEL, 0x01000000u},   {SW_REFGEN_SEL, 0x10000000u},
    {SW_FW_MOD_SEL, 0x00030201u}, {SW_FW_TANK_SEL, 0x00002310u},
};

/* Return the register at an offset. */
static uint32_t *word(struct psoc *psoc, uint32_t offset)
{
    return &psoc->csd_words[offset / 4u];
}

/* Return whether a register is modelled as storage. */
static bool is_stored(uint32_t offset)
{
    static const uint16_t offsets[] = {CONFIG,        INTR_MASK,      REFGEN,       CSDCMP,         IDAC_A,
                                       SENSE_PERIOD,  SENSE_DUTY,     SW_CMP_P_SEL, SW_CMP_N_SEL,   SW_REFGEN_SEL,
                                       SW_FW_MOD_SEL, SW_FW_TANK_SEL, SEQ_TIME,     SEQ_INIT_COUNT, SEQ_NORM_COUNT};
    for (unsigned i = 0; i < sizeof offsets / sizeof offsets[0]; i++) {
        if (offsets[i] == offset) {
            return true;
        }
    }
    return false;
}

/* Set the interrupt line to the state of the enabled interrupt cause. */
static void update_interrupt(struct psoc *psoc)
{
    psoc_set_line(psoc, psoc_family(psoc)->irq_csd, *word(psoc, INTR) & *word(psoc, INTR_MASK));
}

/* Return the current of the source as a number of steps of 1.2 uA, the step of a PSoC 4200; 0 for a current that is no
 * multiple of this step, or for another mode. */
static uint8_t idac_code(uint32_t idac)
{
    const uint32_t code = idac & IDAC_CODE;
    if ((idac & IDAC_MODE) != IDAC_BALANCING) {
        return 0;
    }
    switch (idac >> 22 & 3u) {
    case IDAC_MEDIUM:
        return code & 3u ? 0 : (uint8_t)(code / 4u); /* codes of 0.3 uA */
    case IDAC_HIGH:
        return (uint8_t)(code * 2u); /* codes of 2.4 uA */
    default:
        return 0;
    }
}

/* Start a conversion at a processor cycle. Returns false (access not modelled) if the block is off, its clock does not
 * run, its counts are 0, or a conversion is in progress. */
static bool start_conversion(struct psoc *psoc, uint64_t cycle)
{
    struct psoc_csd *csd = &psoc->csd;
    const uint32_t sense = (*word(psoc, SENSE_PERIOD) & 0xFFFu) + 1u;
    csd->sample = psoc4100s_clock_divider(psoc, CLOCK_CSD);
    csd->sense = sense;
    csd->period = *word(psoc, SEQ_NORM_COUNT) * sense;
    if (!(*word(psoc, CONFIG) & CONFIG_ENABLE) || !csd->sample || !csd->period || csd->end != PSOC_NEVER) {
        return false;
    }
    csd->begin = cycle + (uint64_t)*word(psoc, SEQ_INIT_COUNT) * sense * csd->sample;
    csd->end = csd->begin + (uint64_t)csd->period * csd->sample;
    cortex_m0_stop(&psoc->cpu); /* the conversion may end within this run */
    return true;
}

/* Return whether the registers have the values with which the current source balances the charge of both phases. */
static bool balances_charge(struct psoc *psoc)
{
    for (unsigned i = 0; i < sizeof switches / sizeof switches[0]; i++) {
        if (*word(psoc, switches[i].offset) != switches[i].value) {
            return false;
        }
    }
    return (*word(psoc, CONFIG) & CONFIG_OF_MUTUAL) == CONFIG_OF_MUTUAL && *word(psoc, REFGEN) & ENABLED &&
           *word(psoc, CSDCMP) & ENABLED && *word(psoc, CSDCMP) & CSDCMP_BOTH_PHASES &&
           idac_code(*word(psoc, IDAC_A)) && psoc_has_capacitors(psoc, GPIO);
}

/* End the conversion: store the count, and raise the interrupt. */
void psoc4100s_csd_end(struct psoc *psoc)
{
    struct psoc_csd *csd = &psoc->csd;
    struct psoc_conversion conversion = {
        .period = csd->period,
        .sense = csd->sense,
        .sample = csd->sample,
        .idac_code = idac_code(*word(psoc, IDAC_A)),
    };
    if (psoc_finish_conversion(psoc, &conversion, balances_charge(psoc), word(psoc, RESULT_1))) {
        *word(psoc, INTR) |= INTR_SAMPLE;
        update_interrupt(psoc);
    }
}

/* Read a register of the capacitive sensing block. Returns false if the emulator does not model the register. */
bool psoc4100s_csd_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    if (access->size != 4u || (!is_stored(offset) && offset != RESULT_1 && offset != INTR)) {
        return false;
    }
    access->value = *word(psoc, offset);
    return true;
}

/* Write a register of the capacitive sensing block; a write to SEQ_START starts a conversion. Returns false if the
 * access is not modelled. */
bool psoc4100s_csd_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    if (access->size != 4u) {
        return false;
    }
    if (offset == SEQ_START) {
        return access->value == START && start_conversion(psoc, access->cycle);
    }
    if (offset == INTR) {
        *word(psoc, INTR) &= ~access->value;
    } else if (is_stored(offset)) {
        *word(psoc, offset) = access->value;
    } else {
        return false;
    }
    update_interrupt(psoc);
    return true;
}
