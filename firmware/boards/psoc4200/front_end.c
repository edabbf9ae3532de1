/* One conversion: the sense clock drives the TX line; the RX line is connected to analog bus A, as are comparator,
 * current source and integration capacitor; all other lines are held low. The block counts the sample clocks in
 * which the source was on. Over a period of (sub-conversions * sense divider) sample clocks:
 *
 *     hardware count = period * 2 C V f_tx / I     and the raw count is period - hardware count,
 *
 * so that contact, which raises C, lowers the raw count (sources: docs/psoc4200.md). */
#include "boards/psoc4/front_end.h"

#include "boards/psoc4/lines.h"
#include "boards/psoc4/regs/core.h"
#include "part/csd.h"
#include "part/peri_clk.h"
#include "part/sflash.h"
#include "board_pins.h"

#define SENSE_HALVES 2u  /* the block divides the sense clock by two, so that its duty cycle is 50 % */
#define LOOPS_MAX 10000u /* at least 2 ms: a block that does not start must not block the board */
#define CYCLES_PER_SETTLE_LOOP 4u

/* Between conversions the reference buffer keeps the capacitor charged. With one capacitor, the buffer is disconnected
 * during a conversion. With two capacitors it stays connected, as in the manufacturer's driver. */
#define CONFIG_AT_REST \
    (CSD_CONFIG_ENABLE | CSD_CONFIG_SENSE_COMP_EN | CSD_CONFIG_SENSE_COMP_BW_HIGH | CSD_CONFIG_MUTUAL_CAP | \
     CSD_CONFIG_SENSE_IN_AMUX_A | CSD_CONFIG_REFBUF_DRIVE_3 | CSD_CONFIG_REFBUF_EN)
#ifdef BOARD_PIN_CINT_A
#define CONFIG_CONVERTING \
    (CONFIG_AT_REST | CSD_CONFIG_SAMPLE_FILTER | CSD_CONFIG_TWO_CAPACITORS | CSD_CONFIG_SENSE_EN | \
     CSD_CONFIG_REFBUF_OUT_AMUX_B)
#else
#define CONFIG_CONVERTING \
    ((CONFIG_AT_REST & ~CSD_CONFIG_REFBUF_EN) | CSD_CONFIG_SENSE_EN | CSD_CONFIG_REFBUF_OUT_AMUX_B)
#endif

static struct {
    const uint8_t *idac_codes;
    uint16_t period;
    uint16_t settle_cycles;
    uint16_t early_count; /* counted before the sense clock ran, and therefore subtracted */
    uint8_t idac_code;
} front_end;

/* Initialise the capacitive sensing block (CSD): lines held low, clocks and trims. `idac_codes`: calibrated current
 * code of each RX line, or NULL; a code 0 selects the current code of the scan settings. */
void front_end_init(uint8_t tx_lines, uint8_t rx_lines, const uint8_t *idac_codes)
{
    front_end.idac_codes = idac_codes;
    lines_init(tx_lines, rx_lines);
#ifdef BOARD_PIN_CINT_A
    pin_connect(BOARD_PIN_CINT_A, PIN_MODE_ANALOG, PIN_AMUX_A);
    pin_connect(BOARD_PIN_CINT_B, PIN_MODE_ANALOG, PIN_AMUX_A);
#else
    pin_connect(BOARD_PIN_CMOD, PIN_MODE_ANALOG, PIN_AMUX_A);
#endif
    PERI_CLK->select[PERI_CLK_OF_CSD_SAMPLE] = PERI_CLK_SELECT_A(1u);
    PERI_CLK->select[PERI_CLK_OF_CSD_SENSE] = PERI_CLK_SELECT_B(1u);
    CSD_TRIM1 = SFLASH->csd_trim1;
    CSD->intr = CSD_INTR_CSD;
    CSD->config = CONFIG_AT_REST;
    interrupt_enable(IRQ_CSD);
}

/* Apply scan settings: clock dividers in CPU clocks, and the length of a conversion in sample clocks. The capacitance
 * converter itself halves the sense clock, so its divider is halved here. */
void front_end_configure(const struct taxel_scan_settings *settings)
{
    const uint32_t sense = settings->sense_clock_divider / SENSE_HALVES;
    PERI_CLK->divider_a[1] = (settings->modulator_clock_divider - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->divider_b[1] = (sense ? sense - 1u : 0u) | PERI_CLK_DIVIDER_CASCADE | PERI_CLK_DIVIDER_ENABLE;
    front_end.period = (uint16_t)(settings->sub_conversions * settings->sense_clock_divider);
    front_end.settle_cycles = settings->settle_cycles;
    front_end.idac_code = settings->idac_code;
}

/* Start a conversion on the connected lines. The counter is started first, then the sense clock, within a few sample
 * clocks; the count before the first clock edge is stored in early_count. */
static void convert(void)
{
    const uint32_t begin = CSD_COUNTER_PERIOD(front_end.period);
    CSD->counter = begin;
    for (unsigned i = 0; i < LOOPS_MAX && CSD->counter == begin; i++) {
    }
    CSD->config = CONFIG_CONVERTING;
    for (unsigned i = 0; i < LOOPS_MAX && !(CSD->status & (CSD_STATUS_SENSE | CSD_STATUS_SAMPLE)); i++) {
    }
    front_end.early_count = (uint16_t)(CSD->counter & CSD_COUNTER_COUNT);
}

/* Wait for the `settle_cycles` of the scan settings, in CPU clocks: 2 us by default, up to 1.4 ms, during which
 * other interrupts wait. */
static void settle(void)
{
    uint32_t loops = front_end.settle_cycles / CYCLES_PER_SETTLE_LOOP + 1u;
    __asm__ volatile("1: sub %0, #1\n\tbne 1b" : "+l"(loops)::"cc");
}

/* Start the conversion of the crossing of TX line `tx` and RX line `rx`, after the settling time. The CSD interrupt
 * follows at its end. */
void front_end_start(uint8_t tx, uint8_t rx)
{
    const uint8_t line = lines_connect(tx, rx);
    const uint8_t calibrated = front_end.idac_codes && line < BOARD_RX_LINES ? front_end.idac_codes[line] : 0;
    CSD->idac = CSD_IDAC_IDAC1_VARIABLE | (calibrated ? calibrated : front_end.idac_code);
    settle();
    const uint32_t interrupts = interrupts_mask();
    convert();
    interrupts_unmask(interrupts);
}

void csd_handler(void);
/* Handle the interrupt at the end of a conversion: pass the raw count to the program, which starts the next conversion.
 * The raw count is the period minus the clocks in which the current source was on, so that contact lowers it; 0 if
 * these clocks exceed the period. */
void csd_handler(void)
{
    const uint32_t counted = (CSD->counter & CSD_COUNTER_COUNT) - front_end.early_count;
    CSD->intr = CSD_INTR_CSD;
    CSD->config = CONFIG_AT_REST;
    front_end_on_conversion(counted < front_end.period ? (uint16_t)(front_end.period - counted) : 0u);
}
