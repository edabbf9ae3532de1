#include "linux_hub/i2c_dev.h"

#include <errno.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>

/* The time limit of an adapter is a multiple of 10 ms, and applies to whole transfers. */
#define TIMEOUT_UNIT_US 10000u
/* The kernel's time limit for adapters whose driver sets none (i2c_register_adapter), in the same unit. */
#define KERNEL_TIMEOUT 100ul
/* Clocks of the longest snapshot with its address bytes, twice (a slow board may stretch the clock), and the hub's
 * constant for clock stretching. */
#define LONGEST_CLOCKS (2u * 9u * (TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXEL_TAXELS_MAX + 3u))
#define STRETCH_US 5000u

/* Prepare an open adapter: time limit of the longest transfer, and no repetition after a lost arbitration, which the
 * hub's counters would not contain. Adapters without these settings are used as they are. */
void i2c_dev_init(struct i2c_dev *device, int fd, uint32_t scl_hz)
{
    const uint64_t longest_us = STRETCH_US + (uint64_t)LONGEST_CLOCKS * 1000000u / scl_hz;
    *device = (struct i2c_dev){.fd = fd};
    (void)ioctl(fd, I2C_TIMEOUT, (unsigned long)(longest_us / TIMEOUT_UNIT_US + 1u));
    (void)ioctl(fd, I2C_RETRIES, 0ul);
}

/* Restore the kernel's time limit, because it belongs to the adapter and not to the open file. */
void i2c_dev_release(const struct i2c_dev *device)
{
    (void)ioctl(device->fd, I2C_TIMEOUT, KERNEL_TIMEOUT);
}

/* Return the time of the monotonic clock in microseconds. `context` is not used. */
uint64_t i2c_dev_clock_us(void *context)
{
    struct timespec now;
    (void)context;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

/* Convert an error number of the kernel (Documentation/i2c/fault-codes.rst) to a result (enum taxel_i2c_result).
 * Drivers use different numbers for one fault. `has_written`: the transfer contained bytes that a board may have
 * rejected. An error after which the adapter is unusable is stored in device->failure. */
static int result_of(struct i2c_dev *device, int error, bool has_written)
{
    switch (error) {
    case ENXIO:
        return TAXEL_I2C_NACK_ADDRESS;
    case EREMOTEIO:
    case ENODATA:
        return has_written ? TAXEL_I2C_NACK_DATA : TAXEL_I2C_NACK_ADDRESS;
    case ETIMEDOUT:
    case ETIME:
        return TAXEL_I2C_TIMEOUT;
    case EAGAIN:
        return TAXEL_I2C_ARBITRATION_LOST;
    case EBUSY:
        return TAXEL_I2C_BUSY;
    case EIO:
    case EPROTO:
    case EBADMSG:
    case EINTR:
        return TAXEL_I2C_BUS_ERROR;
    default: /* ENODEV, ESHUTDOWN: the adapter is gone; EOPNOTSUPP, EINVAL: it rejects every transfer of this form */
        device->failure = error;
        return TAXEL_I2C_BUS_ERROR;
    }
}

/* Execute one or two messages in one I2C transfer. Returns 0 or an error number of the kernel. */
static int execute(const struct i2c_dev *device, struct i2c_msg *messages, uint32_t count)
{
    struct i2c_rdwr_ioctl_data request = {.msgs = messages, .nmsgs = count};
    return ioctl(device->fd, I2C_RDWR, &request) < 0 ? errno : 0;
}

/* Address a board without data. An adapter that rejects such a transfer reads one byte instead, now and in all later
 * probes. Returns enum taxel_i2c_result. */
static int probe(struct i2c_dev *device, uint8_t address)
{
    uint8_t byte = 0;
    struct i2c_msg message = {.addr = address, .buf = &byte};
    if (!device->probe_reads) {
        const int error = execute(device, &message, 1);
        if (error != EOPNOTSUPP && error != EINVAL) {
            return error ? result_of(device, error, false) : TAXEL_I2C_OK;
        }
        device->probe_reads = true;
    }
    message.flags = I2C_M_RD;
    message.len = 1;
    const int error = execute(device, &message, 1);
    return error ? result_of(device, error, false) : TAXEL_I2C_OK;
}

/* Execute a transfer of the hub: write, read, write and read, or (both sizes 0) a probe. The adapter's own time limit
 * applies instead of `timeout_us`. Returns enum taxel_i2c_result. */
int i2c_dev_transfer(void *context, uint8_t address, const uint8_t *write_bytes, size_t write_size, uint8_t *read_bytes,
                     size_t read_size, uint32_t timeout_us)
{
    struct i2c_dev *device = context;
    uint8_t written[UINT8_MAX]; /* the kernel's structure has no pointer to constant bytes */
    (void)timeout_us;
    if (!write_size && !read_size) {
        return probe(device, address);
    }
    if (write_size > sizeof written) {
        return TAXEL_I2C_NACK_DATA; /* longer than any command of the host */
    }
    if (write_size) {
        memcpy(written, write_bytes, write_size);
    }
    struct i2c_msg messages[2] = {{.addr = address, .len = (uint16_t)write_size, .buf = written},
                                  {.addr = address, .flags = I2C_M_RD, .len = (uint16_t)read_size, .buf = read_bytes}};
    const uint32_t count = (write_size ? 1u : 0u) + (read_size ? 1u : 0u);
    const int error = execute(device, write_size ? messages : messages + 1, count);
    return error ? result_of(device, error, write_size > 0) : TAXEL_I2C_OK;
}
