/* Image for the first board: each command, one byte at 115,200 baud, runs one test and prints its result as one line.
 * `taxel bringup` sends the commands; a terminal does too (docs/bring-up.md). The image uses no interrupt. */
#include <string.h>

#include "board_pins.h"
#include "boards/psoc4200/bringup/bus_test.h"
#include "boards/psoc4200/bringup/converter.h"
#include "boards/psoc4200/bringup/cycles.h"
#include "boards/psoc4200/bringup/text.h"
#include "boards/psoc4/clocks.h"
#include "boards/psoc4/flash_rows.h"
#include "part/csd.h"
#include "part/peri_clk.h"
#include "boards/psoc4/regs/scb.h"
#include "part/srss.h"
#include "boards/psoc4/reset.h"
#include "boards/psoc4/watchdog.h"
#include "generated/taxel_bootloader.h"

#define FREE_ROW 255u /* no image uses it */
#define RECORD 0x7A3C51E9u
#define INTERRUPTS 32u
#define NO_INTERRUPT 255u
#define TICKS 21u
#define TICK_MS 200u
#define ECHO_BYTES 16u
#define READY_MS 2000u
#define LED_MS 500u
#define WATCHDOG_MS 8000u
#define REPEATS 16u
#define REQUEST_CYCLES 480u /* 10 us from a request to the pending register */
#define SCB0_CLOCK_DIVIDER 4u
#define FEEDS 200u
#define PAINT 0xA5C3E187u /* of RAM, for the depth of the stack in a call of the ROM */
#define PAINT_GAP 64u     /* words for the variables of the function itself */
#define REPEATED_CODE 16u

static volatile uint32_t record
    __attribute__((section(".noinit.fault"), used)); /* where applications keep their fault record */

/* Wait for a number of milliseconds by polling the timer. */
static void wait_ms(uint32_t ms)
{
    while (ms--) {
        for (uint32_t begin = cycles_now(); cycles_since(begin) < CYCLES_PER_MS;) {
        }
    }
}

void fault_take_exception(const uint32_t *frame);
/* Print the exception that no test expects, with the program counter of the interrupted code, and restart the image.
 * `frame`: the stack at the entry of the handler. */
__attribute__((used, noreturn)) void fault_take_exception(const uint32_t *frame)
{
    const uint32_t pc = frame[6];
    const uint8_t bytes[4] = {(uint8_t)(pc >> 24), (uint8_t)(pc >> 16), (uint8_t)(pc >> 8), (uint8_t)pc};
    text_put("\r\nfault");
    text_number("exception", current_exception());
    text_hex("pc", bytes, sizeof bytes);
    text_end_line();
    wait_ms(10); /* until the last byte has been sent */
    reset_now();
    for (;;) {
    }
}

/* Print TICKS lines at equal intervals of TICK_MS; the host compares the intervals with its own clock. */
static void print_ticks(void)
{
    uint32_t begin = cycles_now();
    for (uint32_t tick = 0; tick < TICKS; tick++) {
        while (cycles_since(begin) < TICK_MS * CYCLES_PER_MS) {
        }
        begin = (begin + TICK_MS * CYCLES_PER_MS) & CYCLES_MASK;
        text_put("tick");
        text_number("n", tick);
        text_end_line();
    }
}

/* Print the bytes that the host sends next as one line in hexadecimal digits: ECHO_BYTES bytes, or those that arrive
 * within 300 ms. */
static void echo(void)
{
    uint8_t bytes[ECHO_BYTES];
    unsigned count = 0;
    for (uint32_t begin = cycles_now(); count < ECHO_BYTES && cycles_since(begin) < 300u * CYCLES_PER_MS;) {
        count += text_take(&bytes[count]) ? 1u : 0u;
    }
    text_put("echo");
    text_hex("bytes", bytes, count);
    text_end_line();
}

/* Return the set of pending interrupts (bit n: interrupt n). Earlier requests are cleared first, so that only
 * interrupts whose cause is still present are pending. */
static uint32_t read_pending(void)
{
    NVIC_PENDING_CLEAR = ~0u;
    for (uint32_t begin = cycles_now(); cycles_since(begin) < REQUEST_CYCLES;) {
    }
    return NVIC_PENDING_SET;
}

/* Return the number of the first interrupt of a set; NO_INTERRUPT if the set is empty. */
static uint32_t first_number(uint32_t pending)
{
    for (uint32_t number = 0; number < INTERRUPTS; number++) {
        if (pending >> number & 1u) {
            return number;
        }
    }
    return NO_INTERRUPT;
}

/* Return the interrupt number of a serial block: let its empty transmit FIFO request the interrupt, and find the
 * interrupt that becomes pending. NO_INTERRUPT if none does. `ctrl`: value of the block's register CTRL. */
static uint32_t find_serial_interrupt(struct scb_regs *scb, uint32_t ctrl)
{
    scb->tx_fifo_ctrl = SCB_FIFO_CTRL_LEVEL(1u);
    scb->ctrl = ctrl | SCB_CTRL_ENABLED;
    wait_ms(2); /* until the UART has sent its last byte */
    const uint32_t before = read_pending();
    scb->intr_tx_mask = SCB_INTR_TX_TRIGGER;
    const uint32_t pending = read_pending();
    scb->intr_tx_mask = 0;
    scb->intr_tx = SCB_INTR_TX_TRIGGER;
    return first_number(pending & ~before);
}

/* Find and print the interrupt numbers of both serial blocks and of the capacitance converter, the number of the
 * converter's sample clock, and the duration of a conversion in cycles. */
static void find_interrupts(void)
{
    uint32_t cycles = 0;
    PERI_CLK->divider_a[0] = (SCB0_CLOCK_DIVIDER - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->select[PERI_CLK_OF_SCB0] = PERI_CLK_SELECT_A(0u);
    const uint32_t scb0 = find_serial_interrupt(SCB0, SCB_CTRL_MODE_I2C);
    SCB0->ctrl = 0;
    const uint32_t scb1 = find_serial_interrupt(SCB1, SCB1->ctrl);
    const uint32_t sample = converter_find_sample_clock();
    CSD->intr = CSD_INTR_CSD;
    const uint32_t before = read_pending();
    const uint32_t ended = converter_run(false, REPEATED_CODE, &cycles);
    const uint32_t csd = ended == CONVERTER_NONE ? NO_INTERRUPT : first_number(read_pending() & ~before);
    CSD->intr = CSD_INTR_CSD;
    text_put("interrupts");
    text_number("scb0", scb0);
    text_number("scb1", scb1);
    text_number("csd", csd);
    text_end_line();
    text_put("converter");
    text_number("sample_clock", sample == CONVERTER_NONE ? NO_INTERRUPT : sample);
    text_number("cycles", cycles);
    text_end_line();
}

/* Measure the known capacitor with increasing current codes, print a line for each, then measure it REPEATS times with
 * the code REPEATED_CODE and print the lowest and highest count. `two_capacitors`: variant of the circuit
 * (converter.h). */
static void count_capacitor(bool two_capacitors)
{
    static const uint8_t codes[] = {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 255};
    uint32_t cycles, low = UINT32_MAX, high = 0;
    const uint32_t sense = converter_find_sense_clock(two_capacitors);
    for (unsigned i = 0; i < sizeof codes; i++) {
        const uint32_t count = converter_run(two_capacitors, codes[i], &cycles);
        text_put("count");
        text_number("capacitors", two_capacitors ? 2u : 1u);
        text_number("code", codes[i]);
        text_number("count", count == CONVERTER_NONE ? 0u : count);
        text_end_line();
    }
    for (unsigned i = 0; i < REPEATS; i++) {
        const uint32_t count = converter_run(two_capacitors, REPEATED_CODE, &cycles);
        low = count < low ? count : low;
        high = count != CONVERTER_NONE && count > high ? count : high;
    }
    text_put("repeats");
    text_number("capacitors", two_capacitors ? 2u : 1u);
    text_number("sense_clock", sense == CONVERTER_NONE ? NO_INTERRUPT : sense);
    text_number("low", low == UINT32_MAX ? 0u : low);
    text_number("high", high);
    text_end_line();
}

extern uint32_t bss_end[]; /* by the linker: first word above the variables */

/* Fill the free RAM, from the end of the variables up to `end` below the stack pointer, with a pattern. */
static void paint_stack(volatile uint32_t *end)
{
    for (volatile uint32_t *word = bss_end; word < end; word++) {
        *word = PAINT;
    }
}

/* Return the depth of the stack since paint_stack() in bytes: the bytes below `end` whose pattern was overwritten, plus
 * the PAINT_GAP words between `end` and the stack pointer. */
static uint32_t measure_stack(volatile uint32_t *end)
{
    volatile uint32_t *word = bss_end;
    while (word < end && *word == PAINT) {
        word++;
    }
    return (uint32_t)((uintptr_t)end - (uintptr_t)word) + PAINT_GAP * (uint32_t)sizeof *word;
}

/* Write two patterns to the free flash row and read each back. Prints the row, the number of wrong bytes, and the depth
 * of the stack, which the functions of the ROM use. */
static void test_flash_row(void)
{
    volatile uint32_t *const painted_end = (uint32_t *)__builtin_frame_address(0) - PAINT_GAP;
    const uint8_t *const row = (const uint8_t *)(FREE_ROW * TAXEL_BOOT_ROW_SIZE);
    uint8_t bytes[TAXEL_BOOT_ROW_SIZE];
    uint32_t wrong = 0;
    paint_stack(painted_end);
    for (unsigned pass = 0; pass < 2u; pass++) { /* the second pass also clears bits */
        for (unsigned i = 0; i < sizeof bytes; i++) {
            bytes[i] = (uint8_t)(i * 7u + (pass ? 0x35u : 0xCAu));
        }
        flash_rows_write(FREE_ROW, bytes);
        for (unsigned i = 0; i < sizeof bytes; i++) {
            wrong += ((const volatile uint8_t *)row)[i] != bytes[i] ? 1u : 0u;
        }
    }
    text_put("flash");
    text_number("row", FREE_ROW);
    text_number("wrong", wrong);
    text_number("stack", measure_stack(painted_end));
    text_end_line();
}

/* Feed the watchdog FEEDS times at intervals of 1 ms, as the main loops of the applications do; then stop feeding and
 * wait for its reset. Prints a line before the wait, and another one if no reset follows within WATCHDOG_MS. */
static void wait_for_watchdog(void)
{
    watchdog_start();
    for (unsigned i = 0; i < FEEDS; i++) {
        wait_ms(1);
        watchdog_feed();
    }
    text_put("watchdog waits");
    text_end_line();
    watchdog_feed();
    wait_ms(WATCHDOG_MS);
    text_put("watchdog none");
    text_end_line();
}

/* Print the start line: version, causes of the last reset, state of the watchdog, both words that survive a reset
 * (request for the bootloader, fault record), and the unique id. Then clear these causes and words and stop the
 * watchdog. */
static void print_start(void)
{
    uint8_t id[8];
    const uint8_t causes = (uint8_t)RES_CAUSE;
    const uint32_t watchdog = WDT->control & (WDT_CONTROL_ENABLE0 | WDT_CONTROL_ENABLED0);
    RES_CAUSE = RES_CAUSE_ALL;
    WDT->control = 0; /* a watchdog that a reset does not stop would reset the board during the tests */
    reset_unique_id(id);
    text_put("\r\ntaxel-bringup version=1");
    text_hex("causes", &causes, sizeof causes);
    text_number("watchdog", watchdog);
    text_number("stay", reset_stay_requested() ? 1u : 0u);
    text_number("record", record == RECORD ? 1u : 0u);
    text_hex("id", id, sizeof id);
    text_end_line();
    record = 0;
}

/* Run the test of a command, and print "done" if it returns. An unknown command has no effect. */
static void run_command(uint8_t command)
{
    switch (command) {
    case 't':
        print_ticks();
        break;
    case 'e':
        echo();
        break;
    case 'i':
        find_interrupts();
        break;
    case 'b':
        bus_test_run();
        break;
    case 'f':
        test_flash_row();
        break;
    case 'c':
        count_capacitor(false);
        count_capacitor(true);
        break;
    case 'm': /* the next start line contains the result */
        record = RECORD;
        reset_into_bootloader();
        break;
    case 'w': /* after the reset, the next start line contains the cause */
        wait_for_watchdog();
        break;
    default:
        return;
    }
    text_put("done");
    text_end_line();
}

/* Wait for a byte from the host and return it. Until then, output a 1 kHz square wave at the clock pin and a 1 Hz
 * square wave at the LED, and print "ready" every 2 s. */
static uint8_t wait_for_command(void)
{
    uint32_t half_ms = 0, begin = cycles_now();
    uint8_t command;
    while (!text_take(&command)) {
        if (cycles_since(begin) < CYCLES_PER_MS / 2u) {
            continue;
        }
        begin = (begin + CYCLES_PER_MS / 2u) & CYCLES_MASK;
        half_ms++;
        pin_drive(BOARD_PIN_CLOCK, half_ms & 1u);
        pin_drive(BOARD_PIN_LED, half_ms / (2u * LED_MS) & 1u);
        if (half_ms % (2u * READY_MS) == 0) {
            text_put("ready");
            text_end_line();
            begin = cycles_now();
        }
    }
    return command;
}

/* Set up clock, timer, UART and converter, print the start line, and execute commands. */
int main(void)
{
    (void)interrupts_mask();
    clocks_init();
    cycles_init();
    text_init();
    converter_init();
    pin_connect(BOARD_PIN_CLOCK, PIN_MODE_STRONG, PIN_GPIO);
    pin_connect(BOARD_PIN_LED, PIN_MODE_STRONG, PIN_GPIO);
    print_start();
    for (;;) {
        run_command(wait_for_command());
    }
}
