/* One conversion: the sense clock drives the TX line; the RX line is on analog bus A, which the block
 * connects to one of two integration capacitors in each phase of the sense clock.
 * The sequencer of the block charges the capacitors for SETTLED_PERIODS, then counts for the sub-conversions of the scan
 * settings the modulator clocks in which the current source was on:
 *
 *     hardware count = sub-conversions * 2 C V / I * f_modulator     and the raw count is period - hardware count,
 *
 * so that contact, which raises C, lowers the raw count. Sources: part/csd.h. */
#include "boards/psoc4/front_end.h"

#include "boards/psoc4/lines.h"
#include "boards/psoc4/regs/core.h"
#include "part/csd.h"
#include "part/peri_clk.h"
#include "board_pins.h"

#define SETTLED_PERIODS 5u /* sense clocks of the sequencer's initialisation */
#define CYCLES_PER_SETTLE_LOOP 4u
#define MEDIUM_CODES_MAX 31u /* of the scan settings: 1.2 uA each, as on a PSoC 4200 */
#define MEDIUM_STEPS 4u      /* 0.3 uA each */

#define CONFIG \
    (CSD_CONFIG_ENABLE | CSD_CONFIG_FILTER_DELAY_2 | CSD_CONFIG_SENSE_EN | CSD_CONFIG_MUTUAL_CAP | \
     CSD_CONFIG_TWO_COUNTERS)

static struct {
    const uint8_t *idac_codes;
    uint16_t period;
    uint16_t settle_cycles;
    uint8_t idac_code;
} front_end;

/* Initialise the capacitive sensing block: lines held low, capacitors and switches, reference. `idac_codes`: calibrated
 * current code of each RX line, or NULL; a code 0 selects the current code of the scan settings. */
void front_end_init(uint8_t tx_lines, uint8_t rx_lines, const uint8_t *idac_codes)
{
    front_end.idac_codes = idac_codes;
    lines_init(tx_lines, rx_lines);
    /* The switches of the block reach the pads of the capacitors without the analog bus (confirm). */
    pin_connect(BOARD_PIN_CINT_A, PIN_MODE_ANALOG, PIN_GPIO);
    pin_connect(BOARD_PIN_CINT_B, PIN_MODE_ANALOG, PIN_GPIO);
    CSD->config = CSD_CONFIG_ENABLE;
    CSD->refgen = CSD_REFGEN_ENABLE;
    CSD->csdcmp = CSD_CSDCMP_ENABLE | CSD_CSDCMP_BOTH_PHASES;
    CSD->sense_duty = 0; /* half of the period */
    CSD->sw_cmp_p_sel = CSD_SW_CMP_P_SEL_BOTH_PHASES;
    CSD->sw_cmp_n_sel = CSD_SW_CMP_N_SEL_REFERENCE;
    CSD->sw_refgen_sel = CSD_SW_REFGEN_SEL_REFERENCE;
    CSD->sw_fw_mod_sel = CSD_SW_FW_MOD_SEL_CINT_A;
    CSD->sw_fw_tank_sel = CSD_SW_FW_TANK_SEL_CINT_B;
    CSD->seq_time = 0;
    CSD->seq_init_count = SETTLED_PERIODS;
    CSD->config = CONFIG;
    CSD->intr = CSD_INTR_SAMPLE;
    CSD->intr_mask = CSD_INTR_SAMPLE;
    interrupt_enable(IRQ_CSD);
}

/* Apply scan settings. The period of the modulator clock is in CPU clocks. The period of the sense clock and the length
 * of a conversion (`period`) are in modulator clocks. */
void front_end_configure(const struct taxel_scan_settings *settings)
{
    peri_clk_start(PERI_CLK_DIVIDER_OF_CSD, PERI_CLK_OF_CSD, settings->modulator_clock_divider);
    CSD->sense_period = settings->sense_clock_divider - 1u;
    CSD->seq_norm_count = settings->sub_conversions;
    front_end.period = (uint16_t)(settings->sub_conversions * settings->sense_clock_divider);
    front_end.settle_cycles = settings->settle_cycles;
    front_end.idac_code = settings->idac_code;
}

/* Return the setting of the current source for a code of 1.2 uA steps: exact up to MEDIUM_CODES_MAX, above in steps of
 * 2.4 uA. */
static uint32_t current_of(uint8_t code)
{
    return code <= MEDIUM_CODES_MAX ? CSD_IDAC_BALANCING | CSD_IDAC_MEDIUM | (code * MEDIUM_STEPS)
                                    : CSD_IDAC_BALANCING | CSD_IDAC_HIGH | ((code >> 1) & CSD_IDAC_CODE);
}

/* Wait for the `settle_cycles` of the scan settings, in CPU clocks: 2 us by default, up to 1.4 ms, during which
 * other interrupts wait. */
static void settle(void)
{
    uint32_t loops = front_end.settle_cycles / CYCLES_PER_SETTLE_LOOP + 1u;
    __asm__ volatile("1: sub %0, #1\n\tbne 1b" : "+l"(loops)::"cc");
}

/* Start the conversion of the crossing of TX line `tx` and RX line `rx`, after the settling time. The current code is
 * the calibrated code of the RX line, or the code of the scan settings if the calibrated code is 0. The CSD interrupt
 * follows at the end of the conversion. */
void front_end_start(uint8_t tx, uint8_t rx)
{
    const uint8_t line = lines_connect(tx, rx);
    const uint8_t calibrated = front_end.idac_codes && line < BOARD_RX_LINES ? front_end.idac_codes[line] : 0;
    CSD->idac_a = current_of(calibrated ? calibrated : front_end.idac_code);
    settle();
    CSD->seq_start = CSD_SEQ_START_START | CSD_SEQ_START_SKIP_AUTO_ZERO;
}

void csd_handler(void);
/* Handle the interrupt at the end of a conversion: pass the raw count to the program, which starts the next conversion.
 * The raw count is the period minus the clocks in which the current source was on, so that contact lowers it; 0 if
 * these clocks exceed the period. */
void csd_handler(void)
{
    const uint32_t counted = CSD->result_1 & CSD_RESULT_COUNT;
    CSD->intr = CSD_INTR_SAMPLE;
    (void)CSD->intr; /* the write has reached the block before the handler ends */
    front_end_on_conversion(counted < front_end.period ? (uint16_t)(front_end.period - counted) : 0u);
}
