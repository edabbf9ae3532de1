/* Transfers of an I2C adapter of Linux (Documentation/i2c/dev-interface.rst), as the bus of a linux_hub. */
#ifndef LINUX_HUB_I2C_DEV_H
#define LINUX_HUB_I2C_DEV_H

#include "linux_hub/linux_hub.h"

/* `failure`: error number after which the adapter is not usable any more, 0 before. `probe_reads`: the adapter rejects
 * transfers without data; a probe then reads one byte. */
struct i2c_dev {
    int fd;
    int failure;
    bool probe_reads;
};

/* Prepare the open adapter `fd` for the transfers of a hub at `scl_hz`: time limit, no repetitions by the kernel. */
void i2c_dev_init(struct i2c_dev *device, int fd, uint32_t scl_hz);
/* Restore the kernel's time limit of the adapter. The file stays open. */
void i2c_dev_release(const struct i2c_dev *device);

/* Functions of struct linux_hub_bus; `context`: struct i2c_dev. */
int i2c_dev_transfer(void *context, uint8_t address, const uint8_t *write_bytes, size_t write_size, uint8_t *read_bytes,
                     size_t read_size, uint32_t timeout_us);
uint64_t i2c_dev_clock_us(void *context);

#endif
