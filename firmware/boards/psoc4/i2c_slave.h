/* Serial block of the bus as an I2C slave. Addresses and received bytes are acknowledged by software, one interrupt
 * each, with SCL held low until then; bytes to be sent go through the transmit FIFO. */
#ifndef PSOC4_I2C_SLAVE_H
#define PSOC4_I2C_SLAVE_H

#include <stdbool.h>
#include <stdint.h>

void i2c_slave_init(uint8_t address);

/* Switch the slave off, so that its address is not acknowledged; called with interrupts off. Returns false during a
 * transfer with this slave: the caller enables interrupts and tries again. */
bool i2c_slave_try_off(void);
void i2c_slave_on(void);

/* Return block and pins to their state after a reset. */
void i2c_slave_end(void);

/* Defined by the image, and called from the interrupt. */
bool i2c_slave_on_address(bool reading);
bool i2c_slave_on_write(uint8_t byte);
uint8_t i2c_slave_on_read(void);
void i2c_slave_on_stop(void);
void i2c_slave_on_bus_error(void);

#endif
