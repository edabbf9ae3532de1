/* Serial block of the bus as an I2C master: one transfer at a time. One interrupt per byte, except for long reads,
 * which are collected in the FIFO. */
#ifndef PSOC4_I2C_MASTER_H
#define PSOC4_I2C_MASTER_H

#include <stdbool.h>

#include "hal/hub_hal.h"

void i2c_master_init(void);

/* Start a transfer. i2c_master_on_done() is called at its end, possibly before this function returns. The struct is
 * copied, the bytes to which it points are not. */
void i2c_master_start(const struct taxel_i2c_transfer *transfer);
void i2c_master_abort(void);
bool i2c_master_is_idle(void);

/* Drive both lines manually, until the next start of a transfer, and read their levels. */
void i2c_master_drive(bool scl_high, bool sda_high);
bool i2c_master_scl(void);
bool i2c_master_sda(void);

/* Defined by the image. Called from the interrupt, or from i2c_master_start(). */
void i2c_master_on_done(int8_t result);

#endif
