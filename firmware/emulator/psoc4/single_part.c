#include "emulator/psoc4/single_part.h"

#include <stdlib.h>
#include <string.h>

#include "emulator/base/flash.h"
#include "emulator/psoc4/internal.h"
#include "emulator/psoc4/scb_registers.h"

#define HOST_BAUD 115200.0
#define BAUD_TOLERANCE 0.045 /* a receiver samples the last bit half a bit late at most */
#define BITS_PER_BYTE 10.0
#define CLOCKS_PER_BYTE 9u /* of I2C: eight bits and the acknowledge */
#define BUFFER 4096u
#define SUPPLY_V 3.3
#define IDAC_STEP_A 1.2e-6
#define NOISE_COUNTS 2u
#define CLOCK_PIN_PORT 1u
#define CLOCK_PIN_NUMBER 7u
#define POWER_ON 0u
#define SLICE (50u * VTIME_US) /* how often the clock pin is sampled */

static const struct psoc_part one_capacitor = {
    .name = "single",
    .family = &psoc_4200,
    .flash_size = 256u * FLASH_ROW_SIZE,
    .tx_lines = 1,
    .rx_lines = 1,
    .tx = {0x20},
    .rx = {0x22},
    .bus_port = 4,
};
static const uint8_t capacitor_pins[] = {0x36, 0x37}; /* CintA and CintB */

/* Ring buffer. */
struct bytes {
    uint8_t byte[BUFFER];
    size_t first, count;
};

struct single_part {
    struct psoc psoc;
    struct flash flash;
    struct psoc_part wiring;
    struct single_part_settings settings;
    struct bytes to_host, to_part;
    vtime sent_at, received_at; /* VTIME_NEVER: no byte is being transferred */
    uint8_t sending;
    vtime bus_at; /* time of the next event of the I2C bus */
    enum psoc_i2c_event bus_event;
    bool scl_driven, sda_driven;
    struct random_source random;
    bool clock_pin;
    vtime first_edge, last_edge;
    unsigned edges;
};

/* Append a byte; it is lost if the buffer is full. */
static void push(struct bytes *bytes, uint8_t byte)
{
    if (bytes->count < BUFFER) {
        bytes->byte[(bytes->first + bytes->count++) % BUFFER] = byte;
    }
}

/* Remove the oldest byte and return it. The buffer must not be empty. */
static uint8_t pop(struct bytes *bytes)
{
    const uint8_t byte = bytes->byte[bytes->first];
    bytes->first = (bytes->first + 1u) % BUFFER;
    bytes->count--;
    return byte;
}

/* Return the baud rate of the part's UART: its clock divided by the clocks of a bit; 0 without a clock. */
static double find_baud(const struct single_part *part)
{
    const struct psoc *psoc = &part->psoc;
    const uint32_t divider = psoc_family(psoc)->clock_divider(
        psoc, psoc_actual(psoc->config.deviations.clock_scb1, psoc_family(psoc)->clock_scb[1]));
    const uint32_t oversample = (psoc->scb[1].ctrl & SCB_OVERSAMPLE) + 1u;
    return divider ? (double)VTIME_SECOND / psoc->ps_per_cycle / divider / oversample : 0.0;
}

/* Return the byte as the receiver reads it: unchanged if the baud rates of both sides agree within the tolerance,
 * otherwise a random byte from 0x80 to 0xFF, which is wrong for every ASCII character. */
static uint8_t misread(struct single_part *part, uint8_t byte)
{
    const double error = find_baud(part) / HOST_BAUD - 1.0;
    const bool is_in_tolerance = error < BAUD_TOLERANCE && error > -BAUD_TOLERANCE;
    return is_in_tolerance ? byte : (uint8_t)(0x80u | random_u64(&part->random));
}

/* Begin to send the next byte of the UART, if none is being sent. */
static void send_next(struct single_part *part, vtime now)
{
    const double baud = find_baud(part);
    if (part->sent_at == VTIME_NEVER && baud > 0.0 && psoc_uart_take(&part->psoc, &part->sending)) {
        part->sent_at = now + (vtime)(BITS_PER_BYTE / baud * (double)VTIME_SECOND);
    }
}

/* Send the next byte if the UART is idle; callback of the chip. */
static void on_uart_kick(void *context, vtime now)
{
    send_next(context, now);
}

/* Schedule the event that ends a transfer of one byte or of a bus condition. No device acknowledges. */
static void schedule(struct single_part *part, vtime at, enum psoc_i2c_event event)
{
    const bool is_held = part->settings.sda_stuck != 0.0 || part->settings.scl_stuck != 0.0;
    part->bus_at = at;
    part->bus_event = is_held ? PSOC_I2C_BUS_ERROR : event;
}

/* Schedule the missing acknowledge of an address byte; callback of the chip. */
static void on_i2c_start(void *context, uint8_t address_byte, vtime clock, vtime now)
{
    (void)address_byte;
    schedule(context, now + CLOCKS_PER_BYTE * clock, PSOC_I2C_NACK);
}

/* Schedule the missing acknowledge of a byte after 100 us, about the duration of a byte at 100 kHz; callback of the
 * chip. */
static void on_i2c_write(void *context, uint8_t byte, vtime now)
{
    (void)byte;
    schedule(context, now + 100u * VTIME_US, PSOC_I2C_NACK);
}

/* Schedule the end of a byte that is read, after 100 us, about the duration of a byte at 100 kHz; callback of the
 * chip. */
static void on_i2c_read(void *context, vtime now)
{
    schedule(context, now + 100u * VTIME_US, PSOC_I2C_BYTE);
}

/* Schedule the end of a stop condition after 10 us, one clock at 100 kHz; callback of the chip. */
static void on_i2c_stop(void *context, vtime now)
{
    schedule(context, now + 10u * VTIME_US, PSOC_I2C_STOP);
}

/* Cancel the scheduled event; callback of the chip. */
static void on_i2c_abort(void *context, vtime now)
{
    struct single_part *part = context;
    (void)now;
    part->bus_at = VTIME_NEVER;
}

/* Store whether the chip pulls SCL and SDA low; callback of the chip. */
static void on_i2c_drive(void *context, bool scl_high, bool sda_high)
{
    struct single_part *part = context;
    part->scl_driven = !scl_high;
    part->sda_driven = !sda_high;
}

/* Return the level of SCL; callback of the chip. */
static bool get_scl(void *context, vtime now)
{
    const struct single_part *part = context;
    (void)now;
    return !part->scl_driven && part->settings.scl_stuck == 0.0 && part->settings.no_pull_ups == 0.0;
}

/* Return the level of SDA; callback of the chip. */
static bool get_sda(void *context, vtime now)
{
    const struct single_part *part = context;
    (void)now;
    return !part->sda_driven && part->settings.sda_stuck == 0.0 && part->settings.no_pull_ups == 0.0;
}

/* Return the count of a conversion: period x 2 C V f / I (boards/psoc4200/front_end.c), with capacitance C, supply V,
 * frequency f of the sense clock and current I, and with noise of up to 2 counts. 0 without a current, or if the only
 * TX line, the only RX line or the integration capacitors are not connected. */
static uint16_t convert(void *context, const struct psoc_conversion *conversion)
{
    struct single_part *part = context;
    const double hz = (double)VTIME_SECOND / part->psoc.ps_per_cycle;
    if (conversion->tx != 0 || conversion->rx != 0 || part->settings.capacitors == 0.0 || !conversion->idac_code) {
        return 0;
    }
    const double f = hz / conversion->sample / conversion->sense;
    const double current = conversion->idac_code * IDAC_STEP_A * part->settings.idac_gain;
    const double charge_a = 2.0 * part->settings.capacitance_pf * 1e-12 * SUPPLY_V * f;
    const double count =
        conversion->period * charge_a / current + (double)(random_u64(&part->random) % (NOISE_COUNTS + 1u));
    return (uint16_t)(count < conversion->period ? count : conversion->period);
}

/* Create a chip with an image in its flash and power it on. Returns NULL if out of memory. */
struct single_part *single_part_new(const uint8_t *image, size_t size, const struct single_part_settings *settings)
{
    struct single_part *part = calloc(1, sizeof *part);
    if (!part) {
        return NULL;
    }
    part->settings = *settings;
    part->wiring = one_capacitor;
    part->wiring.has_two_capacitors = settings->capacitors == 2.0;
    memcpy(part->wiring.capacitors, capacitor_pins, sizeof capacitor_pins);
    part->sent_at = part->received_at = part->bus_at = VTIME_NEVER;
    random_init(&part->random, 1, 0);
    flash_init(&part->flash, 256u * FLASH_ROW_SIZE, 1, 0);
    memcpy(part->flash.bytes, image, size < sizeof part->flash.bytes ? size : sizeof part->flash.bytes);
    const struct psoc_config config = {
        .name = "part",
        .flash = &part->flash,
        .part = &part->wiring,
        .unique_id = {1, 2, 3, 4, 5, 6, 7, 8},
        .clock_rate = settings->clock_rate,
        .seed = 1,
        .reset_time = VTIME_MS,
        .wires = {.context = part,
                  .convert = convert,
                  .i2c_start = on_i2c_start,
                  .i2c_write = on_i2c_write,
                  .i2c_read = on_i2c_read,
                  .i2c_stop = on_i2c_stop,
                  .i2c_abort = on_i2c_abort,
                  .i2c_drive = on_i2c_drive,
                  .i2c_scl = get_scl,
                  .i2c_sda = get_sda,
                  .uart_kick = on_uart_kick},
        .deviations = {.irq_scb0 = (uint8_t)settings->irq_scb0,
                       .irq_scb1 = (uint8_t)settings->irq_scb1,
                       .irq_csd = (uint8_t)settings->irq_csd,
                       .clock_scb1 = (uint8_t)settings->clock_scb1,
                       .clock_csd_sense = (uint8_t)settings->clock_csd_sense,
                       .clock_csd_sample = (uint8_t)settings->clock_csd_sample,
                       .keeps_no_ram = settings->keeps_no_ram != 0.0,
                       .writes_no_flash = settings->writes_no_flash != 0.0,
                       .has_no_ilo = settings->has_no_ilo != 0.0,
                       .tolerates_no_clock = true},
    };
    if (psoc_init(&part->psoc, &config)) {
        free(part);
        return NULL;
    }
    psoc_power_on(&part->psoc, 0, POWER_ON);
    return part;
}

/* Free a chip that single_part_new() has created; NULL is allowed. */
void single_part_free(struct single_part *part)
{
    if (part) {
        psoc_free(&part->psoc);
        free(part);
    }
}

/* Deliver the UART bytes of both directions whose transmission has ended, and report a due event of the I2C bus to the
 * chip. */
static void serve_wires(struct single_part *part, vtime now)
{
    if (part->sent_at <= now) {
        push(&part->to_host, misread(part, part->sending));
        part->sent_at = VTIME_NEVER;
        send_next(part, now);
    }
    if (part->received_at <= now) {
        psoc_uart_receive(&part->psoc, misread(part, pop(&part->to_part)));
        part->received_at = VTIME_NEVER;
    }
    if (part->received_at == VTIME_NEVER && part->to_part.count) {
        part->received_at = now + (vtime)(BITS_PER_BYTE / HOST_BAUD * (double)VTIME_SECOND);
    }
    if (part->bus_at <= now) {
        part->bus_at = VTIME_NEVER;
        psoc_i2c_on_event(&part->psoc, now, part->bus_event, 0);
    }
}

/* Count a change of the clock pin's level since the last call as an edge, with its time. */
static void watch_clock_pin(struct single_part *part, vtime now)
{
    const struct psoc_gpio *gpio = &part->psoc.gpio;
    const bool level = gpio->port[CLOCK_PIN_PORT].data >> CLOCK_PIN_NUMBER & 1u;
    const bool is_output = gpio->port[CLOCK_PIN_PORT].mode >> (3u * CLOCK_PIN_NUMBER) & 7u;
    if (is_output && level != part->clock_pin) {
        part->clock_pin = level;
        part->first_edge = part->edges ? part->first_edge : now;
        part->last_edge = now;
        part->edges++;
    }
}

/* Run the chip for a duration of virtual time, or until its processor stops. */
void single_part_run(struct single_part *part, double seconds)
{
    const vtime end = psoc_now(&part->psoc) + (vtime)(seconds * (double)VTIME_SECOND);
    for (vtime now = psoc_now(&part->psoc); now < end; now = psoc_now(&part->psoc)) {
        vtime next = vtime_min(vtime_min(end, now + SLICE), vtime_min(part->sent_at, part->received_at));
        next = vtime_min(next, part->bus_at);
        (void)psoc_run(&part->psoc, next > now ? next : now + 1u);
        if (part->psoc.has_stopped || psoc_now(&part->psoc) == now) {
            break; /* the processor executes nothing any more */
        }
        serve_wires(part, psoc_now(&part->psoc));
        watch_clock_pin(part, psoc_now(&part->psoc));
    }
}

/* Send bytes to the chip's UART. Returns the number of bytes for which the buffer had space. If the line is open
 * (rx_open), the chip receives no byte, and `count` is returned. */
size_t single_part_put(struct single_part *part, const uint8_t *bytes, size_t count)
{
    size_t sent = 0;
    if (part->settings.rx_open != 0.0) {
        return count;
    }
    for (; sent < count && part->to_part.count < BUFFER; sent++) {
        push(&part->to_part, bytes[sent]);
    }
    return sent;
}

/* Take bytes that the host has received. Returns their number. */
size_t single_part_take(struct single_part *part, uint8_t *bytes, size_t size)
{
    size_t taken = 0;
    while (taken < size && part->to_host.count) {
        bytes[taken++] = pop(&part->to_host);
    }
    return taken;
}

/* Return the frequency (Hz) of the clock pin from the edges since the last call, two of them per period; 0 with fewer
 * than three edges. The count of edges restarts. */
double single_part_measure_clock_pin(struct single_part *part)
{
    const double duration = (double)(part->last_edge - part->first_edge) / (double)VTIME_SECOND;
    const double hz = part->edges > 2u ? (part->edges - 1u) / duration / 2.0 : 0.0;
    part->edges = 0;
    return hz;
}
