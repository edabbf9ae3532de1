/* A slave that missed a clock may hold SDA low indefinitely. Nine clocks let it finish its byte and receive a NACK;
 * a stop condition then frees the bus (I2C specification UM10204, section 3.1.16). */
#include "hub/internal.h"

#define HALF_CLOCK_US 5u /* 100 kHz: slow enough for every device */
#define CLOCKS 9u

/* Free an I2C bus whose SDA is held low by a slave: up to nine clocks at 100 kHz, then start and stop condition.
 * Returns SCL_STUCK or SDA_STUCK if a line stays low, otherwise TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_recover_bus(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    hub->bus_recoveries++;
    if (hal->i2c_recover) {
        return hal->i2c_recover(hal->context);
    }
    hal->i2c_drive(hal->context, true, true);
    hal->delay_us(hal->context, HALF_CLOCK_US);
    if (!hal->i2c_scl(hal->context)) {
        /* no clock can be generated: the slave must release SCL itself, or be power-cycled */
        return TAXEL_BOARD_FAULT_SCL_STUCK;
    }
    for (unsigned clock = 0; clock < CLOCKS && !hal->i2c_sda(hal->context); clock++) {
        hal->i2c_drive(hal->context, false, true);
        hal->delay_us(hal->context, HALF_CLOCK_US);
        hal->i2c_drive(hal->context, true, true);
        hal->delay_us(hal->context, HALF_CLOCK_US);
    }
    /* One line at a time: a falling SDA while SCL is high would be a start condition. */
    hal->i2c_drive(hal->context, false, true);
    hal->delay_us(hal->context, HALF_CLOCK_US);
    hal->i2c_drive(hal->context, false, false);
    hal->delay_us(hal->context, HALF_CLOCK_US);
    hal->i2c_drive(hal->context, true, false);
    hal->delay_us(hal->context, HALF_CLOCK_US);
    hal->i2c_drive(hal->context, true, true);
    hal->delay_us(hal->context, HALF_CLOCK_US);
    return hal->i2c_sda(hal->context) ? TAXEL_BOARD_FAULT_NONE : TAXEL_BOARD_FAULT_SDA_STUCK;
}
