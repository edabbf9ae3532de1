/* GPIO ports and the high-speed I/O matrix: connected sensor lines, I2C lines driven by software, and RTS. */
#include "emulator/psoc4/internal.h"

#define PORT_DATA 0x00u
#define PORT_STATE 0x04u
#define PORT_MODE 0x08u
#define PORT_INPUT_DISABLE 0x18u
#define PORT_SIZE 0x100u

#define FUNCTION_GPIO 0u
#define FUNCTION_SENSE 4u
#define FUNCTION_AMUX_A 6u
#define MODE_ANALOG 0u
#define MODE_OPEN_DRAIN 4u
#define MODE_STRONG 6u
#define SCL 0u
#define SDA 1u

/* Return the function of a pin that the pin multiplexer (HSIOM) selects, 0 to 15. */
static unsigned function_of(const struct psoc *psoc, unsigned port, unsigned number)
{
    return psoc->gpio.select[port] >> (4u * number) & 15u;
}

/* Return the drive mode of a pin in the port configuration register, 0 to 7. */
static unsigned mode_of(const struct psoc *psoc, unsigned port, unsigned number)
{
    return psoc->gpio.port[port].mode >> (3u * number) & 7u;
}

/* Return whether software drives this pin low. */
static bool pulls_low(const struct psoc *psoc, unsigned port, unsigned number)
{
    const unsigned mode = mode_of(psoc, port, number);
    return function_of(psoc, port, number) == FUNCTION_GPIO && (mode == MODE_OPEN_DRAIN || mode == MODE_STRONG) &&
           !(psoc->gpio.port[port].data >> number & 1u);
}

/* Return whether the program drives the pin high: function GPIO, push-pull mode and output bit 1. */
static bool is_high(const struct psoc *psoc, unsigned port, unsigned number)
{
    return function_of(psoc, port, number) == FUNCTION_GPIO && mode_of(psoc, port, number) == MODE_STRONG &&
           psoc->gpio.port[port].data >> number & 1u;
}

/* Pass a change of the manually driven lines SCL, SDA and RTS to the bus and the UART. */
static void update_wires(struct psoc *psoc, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    struct psoc_gpio *gpio = &psoc->gpio;
    const struct psoc_part *part = psoc->config.part;
    const bool scl_low = pulls_low(psoc, part->bus_port, SCL), sda_low = pulls_low(psoc, part->bus_port, SDA);
    const bool rts_high = part->has_rts && is_high(psoc, part->rts >> 4, part->rts & 7u);
    if (wires->i2c_drive && (scl_low != gpio->scl_low || sda_low != gpio->sda_low)) {
        wires->i2c_drive(wires->context, !scl_low, !sda_low);
        psoc_end_run(psoc);
    }
    if (wires->uart_hold && rts_high != gpio->rts_high) {
        wires->uart_hold(wires->context, rts_high, psoc_time(psoc, cycle));
        psoc_end_run(psoc);
    }
    gpio->scl_low = scl_low;
    gpio->sda_low = sda_low;
    gpio->rts_high = rts_high;
}

/* Return the levels of a port's pins (register PS): the levels that the program drives; for SCL and SDA, the levels of
 * the bus. */
static uint32_t state_of(const struct psoc *psoc, unsigned port, uint64_t cycle)
{
    const struct psoc_wires *wires = &psoc->config.wires;
    uint32_t state = psoc->gpio.port[port].data;
    if (port == psoc->config.part->bus_port && wires->i2c_scl) {
        const vtime now = psoc_time(psoc, cycle);
        state &= ~3u;
        state |= (uint32_t)wires->i2c_scl(wires->context, now) << SCL | (uint32_t)wires->i2c_sda(wires->context, now)
                                                                            << SDA;
    }
    return state;
}

/* Read a register of a GPIO port. Returns false if the emulator does not model the register. */
bool psoc_gpio_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const unsigned port = offset / PORT_SIZE;
    if (port >= PSOC_PORTS || access->size != 4u) {
        return false;
    }
    switch (offset % PORT_SIZE) {
    case PORT_DATA:
        access->value = psoc->gpio.port[port].data;
        return true;
    case PORT_STATE:
        access->value = state_of(psoc, port, access->cycle);
        return true;
    case PORT_MODE:
        access->value = psoc->gpio.port[port].mode;
        return true;
    case PORT_INPUT_DISABLE:
        access->value = psoc->gpio.port[port].input_disable;
        return true;
    default:
        return false;
    }
}

/* Write a register of a GPIO port. Returns false if the emulator does not model the register. */
bool psoc_gpio_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const unsigned port = offset / PORT_SIZE;
    if (port >= PSOC_PORTS || access->size != 4u) {
        return false;
    }
    switch (offset % PORT_SIZE) {
    case PORT_DATA:
        psoc->gpio.port[port].data = access->value;
        break;
    case PORT_MODE:
        psoc->gpio.port[port].mode = access->value;
        break;
    case PORT_INPUT_DISABLE:
        psoc->gpio.port[port].input_disable = access->value;
        return true;
    default:
        return false;
    }
    update_wires(psoc, access->cycle);
    return true;
}

/* Read the pin multiplexer (HSIOM). Returns false if the access is not modelled. */
bool psoc_hsiom_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const uint32_t stride = psoc_family(psoc)->hsiom_stride;
    if (offset / stride >= PSOC_PORTS || offset % stride || access->size != 4u) {
        return false;
    }
    access->value = psoc->gpio.select[offset / stride];
    return true;
}

/* Write the pin multiplexer (HSIOM): four bits per pin select its function. Returns false if the access is not
 * modelled. */
bool psoc_hsiom_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const uint32_t stride = psoc_family(psoc)->hsiom_stride;
    if (offset / stride >= PSOC_PORTS || offset % stride || access->size != 4u) {
        return false;
    }
    psoc->gpio.select[offset / stride] = access->value;
    update_wires(psoc, access->cycle);
    return true;
}

/* Return the index in `pins` of the only pin with the function `function`; -1 if no pin or several pins have it. A pin
 * is a byte: port in the upper four bits, number of the pin in the lower bits. */
static int single_pin_with_function(const struct psoc *psoc, const uint8_t *pins, unsigned count, unsigned function)
{
    int match = -1;
    for (unsigned i = 0; i < count; i++) {
        if (function_of(psoc, pins[i] >> 4, pins[i] & 7u) == function) {
            if (match >= 0) {
                return -1;
            }
            match = (int)i;
        }
    }
    return match;
}

/* Find the TX line that is connected to the sense clock and the RX line that is connected to the converter, as row and
 * column of the board; -1 for none or several. On a part with rx_per_row, the board has one TX line, and each group of
 * rx_per_row RX lines is a row. */
void psoc_connected_lines(const struct psoc *psoc, int *tx, int *rx)
{
    const struct psoc_part *part = psoc->config.part;
    *tx = single_pin_with_function(psoc, part->tx, part->tx_lines, FUNCTION_SENSE);
    *rx = single_pin_with_function(psoc, part->rx, part->rx_lines, FUNCTION_AMUX_A);
    if (part->rx_per_row && *tx == 0 && *rx >= 0) {
        *tx = *rx / part->rx_per_row;
        *rx %= part->rx_per_row;
    }
}

/* Return whether the pins of both integration capacitors are analog and have this function. Always true for a part with
 * one integration capacitor, because the model does not check the pin of this capacitor. */
bool psoc_has_capacitors(const struct psoc *psoc, unsigned function)
{
    const struct psoc_part *part = psoc->config.part;
    for (unsigned i = 0; part->has_two_capacitors && i < 2u; i++) {
        const uint8_t pin = part->capacitors[i];
        if (function_of(psoc, pin >> 4, pin & 7u) != function || mode_of(psoc, pin >> 4, pin & 7u) != MODE_ANALOG) {
            return false;
        }
    }
    return true;
}
