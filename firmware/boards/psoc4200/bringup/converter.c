#include "boards/psoc4200/bringup/converter.h"

#include "board_pins.h"
#include "boards/psoc4200/bringup/cycles.h"
#include "part/csd.h"
#include "part/peri_clk.h"
#include "part/sflash.h"

#define MODULATOR_DIVIDER 4u
#define SENSE_DIVIDER 40u
#define SENSE_HALVES 2u
#define TIMEOUT (20u * CYCLES_PER_MS) /* a conversion takes 0.33 ms */
#define START_LOOPS 10000u
#define SETTLE_CYCLES (CYCLES_PER_MS / 100u)
#define SEARCH_CODE 32u
#define LARGEST_SELECT 15u
#define NO_CLOCK 0xFFu
/* Duration of a conversion whose sample clock is the intended one: 4,000 sample clocks of 4 cycles, and its start.
 * Another divider takes much longer. */
#define CYCLES_MIN 15500u
#define CYCLES_MAX 17500u
#define CLEAR_COUNT 50u /* noise of the comparator counts less */
#define AT_REST \
    (CSD_CONFIG_ENABLE | CSD_CONFIG_SENSE_COMP_EN | CSD_CONFIG_SENSE_COMP_BW_HIGH | CSD_CONFIG_MUTUAL_CAP | \
     CSD_CONFIG_SENSE_IN_AMUX_A | CSD_CONFIG_REFBUF_DRIVE_3 | CSD_CONFIG_REFBUF_EN)
#define WITH_ONE ((AT_REST & ~CSD_CONFIG_REFBUF_EN) | CSD_CONFIG_SENSE_EN | CSD_CONFIG_REFBUF_OUT_AMUX_B)
#define WITH_TWO \
    (AT_REST | CSD_CONFIG_SAMPLE_FILTER | CSD_CONFIG_TWO_CAPACITORS | CSD_CONFIG_SENSE_EN | \
     CSD_CONFIG_REFBUF_OUT_AMUX_B)

static uint8_t sample_clock, sense_clock; /* numbers of the peripheral clocks in use */

/* Connect the clock inputs of the converter to their dividers. Each peripheral clock input of the chip has a number and
 * a register select[number]. Input `sample_clock` receives the modulator clock (divider A1), input `sense_clock`
 * (unless NO_CLOCK) the sense clock (divider B1). All other inputs from PERI_CLK_OF_SCB1 + 1 on receive no clock. */
static void select_clocks(void)
{
    for (unsigned i = PERI_CLK_OF_SCB1 + 1u; i <= LARGEST_SELECT; i++) {
        PERI_CLK->select[i] = 0;
    }
    PERI_CLK->select[sample_clock] = PERI_CLK_SELECT_A(1u);
    if (sense_clock != NO_CLOCK && sense_clock != sample_clock) {
        PERI_CLK->select[sense_clock] = PERI_CLK_SELECT_B(1u);
    }
}

/* Set up the capacitance converter (CSD): modulator and sense clock dividers, trim, TX and RX pin. The converter itself
 * halves the sense clock, so the divider of this clock is halved here. */
void converter_init(void)
{
    sample_clock = PERI_CLK_OF_CSD_SAMPLE;
    sense_clock = PERI_CLK_OF_CSD_SENSE;
    PERI_CLK->divider_a[1] = (MODULATOR_DIVIDER - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->divider_b[1] = (SENSE_DIVIDER / SENSE_HALVES - 1u) | PERI_CLK_DIVIDER_CASCADE | PERI_CLK_DIVIDER_ENABLE;
    select_clocks();
    CSD_TRIM1 = SFLASH->csd_trim1;
    pin_connect(BOARD_PIN_TX, PIN_MODE_STRONG, PIN_CSD_SENSE);
    pin_connect(BOARD_PIN_RX, PIN_MODE_ANALOG, PIN_AMUX_A);
}

/* Connect the integration capacitors of one variant of the circuit (CintA and CintB, or CMOD) to the analog bus, and
 * disconnect those of the other one. */
static void connect_capacitors(bool two_capacitors)
{
    pin_connect(BOARD_PIN_CMOD, PIN_MODE_ANALOG, two_capacitors ? PIN_GPIO : PIN_AMUX_A);
    pin_connect(BOARD_PIN_CINT_A, PIN_MODE_ANALOG, two_capacitors ? PIN_AMUX_A : PIN_GPIO);
    pin_connect(BOARD_PIN_CINT_B, PIN_MODE_ANALOG, two_capacitors ? PIN_AMUX_A : PIN_GPIO);
}

/* Run one conversion of the known capacitor with the current code `code` (converter.h). Returns the number of sample
 * clocks in which the current source was on; CONVERTER_NONE after a timeout. `cycles` receives the duration. */
uint32_t converter_run(bool two_capacitors, uint8_t code, uint32_t *cycles)
{
    const uint32_t begin_count = CSD_COUNTER_PERIOD(CONVERTER_PERIOD);
    connect_capacitors(two_capacitors);
    CSD->config = AT_REST;
    CSD->idac = CSD_IDAC_IDAC1_VARIABLE | code;
    CSD->intr = CSD_INTR_CSD;
    for (uint32_t settling = cycles_now(); cycles_since(settling) < SETTLE_CYCLES;) {
    }
    const uint32_t begin = cycles_now();
    CSD->counter = begin_count;
    for (unsigned i = 0; i < START_LOOPS && CSD->counter == begin_count; i++) {
    }
    CSD->config = two_capacitors ? WITH_TWO : WITH_ONE;
    for (unsigned i = 0; i < START_LOOPS && !(CSD->status & (CSD_STATUS_SENSE | CSD_STATUS_SAMPLE)); i++) {
    }
    const uint32_t early = CSD->counter & CSD_COUNTER_COUNT; /* counted before the sense clock ran */
    while (!(CSD->intr & CSD_INTR_CSD)) {
        if (cycles_since(begin) > TIMEOUT) {
            CSD->config = 0; /* ends a conversion without a clock */
            return CONVERTER_NONE;
        }
    }
    *cycles = cycles_since(begin);
    const uint32_t count = (CSD->counter & CSD_COUNTER_COUNT) - early;
    CSD->config = AT_REST;
    return count;
}

/* Return the clock number to try in step `step` (0 to STEPS - 1) of a search: the assumed one, then 4 to 15, then 0 and
 * 1. The numbers of the serial blocks (2 and 3) are in use. */
static uint8_t select_at(unsigned step, uint8_t assumed)
{
    return (uint8_t)(step ? (step + PERI_CLK_OF_SCB1) & LARGEST_SELECT : assumed);
}

#define STEPS 15u /* the assumed number, 4 to 15, 0 and 1 */

/* Find the number of the clock input for the sample clock: the first number with which a conversion has the expected
 * duration. Returns the number, which stays selected; CONVERTER_NONE if no number fits, with the assumed number
 * selected. */
uint32_t converter_find_sample_clock(void)
{
    uint32_t cycles;
    for (unsigned step = 0; step < STEPS; step++) {
        sense_clock = NO_CLOCK; /* otherwise it could be the sample clock under another number */
        sample_clock = select_at(step, PERI_CLK_OF_CSD_SAMPLE);
        select_clocks();
        const bool has_ended = converter_run(false, SEARCH_CODE, &cycles) != CONVERTER_NONE;
        if (has_ended && cycles >= CYCLES_MIN && cycles <= CYCLES_MAX) {
            const uint32_t found = sample_clock;
            sense_clock = PERI_CLK_OF_CSD_SENSE;
            select_clocks();
            return found;
        }
    }
    sample_clock = PERI_CLK_OF_CSD_SAMPLE;
    sense_clock = PERI_CLK_OF_CSD_SENSE;
    select_clocks();
    return CONVERTER_NONE;
}

/* Find the number of the clock input for the sense clock: the first number with which the count of a conversion is
 * clearly larger than noise. Returns the number, which stays selected; CONVERTER_NONE if no number fits, with the
 * assumed number selected. */
uint32_t converter_find_sense_clock(bool two_capacitors)
{
    uint32_t cycles;
    for (unsigned step = 0; step < STEPS; step++) {
        sense_clock = select_at(step, PERI_CLK_OF_CSD_SENSE);
        select_clocks();
        const uint32_t count = converter_run(two_capacitors, SEARCH_CODE, &cycles);
        if (sense_clock != sample_clock && count != CONVERTER_NONE && count > CLEAR_COUNT) {
            return sense_clock;
        }
    }
    sense_clock = PERI_CLK_OF_CSD_SENSE;
    select_clocks();
    return CONVERTER_NONE;
}
