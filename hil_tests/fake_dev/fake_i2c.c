/* An emulated /dev/i2c-N: open() and ioctl() of the path in FAKE_I2C ("/dev/i2c-7=/run/bench.sock") use a socket.
 *
 * cc -shared -fPIC -o libfake_i2c.so fake_i2c.c -ldl; LD_PRELOAD=libfake_i2c.so FAKE_I2C=... program
 *
 * Request: u32 number of messages; for each message u16 address, u16 flags, u16 length and, for a write, its bytes.
 * Reply: i32 errno (0: success), then the bytes of all reads. Flags and structures are those of linux/i2c.h and
 * linux/i2c-dev.h. PEC is not supported. With FAKE_I2C_SMBUS_ONLY in the environment, the adapter states that it has no
 * plain I2C transfers. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define FDS_MAX 1024

static struct {
    int is_emulated;
    uint16_t address;
} fds[FDS_MAX];

/* Connect to the bench if `path` is the emulated device, which the environment variable FAKE_I2C names together with
 * the bench's socket ("DEVICE=SOCKET"). Returns the socket, -1 with errno if the bench cannot be
 * reached, or -2 for any other file. */
static int connect_if_emulated(const char *path)
{
    const char *setting = getenv("FAKE_I2C");
    const char *equals = setting ? strchr(setting, '=') : NULL;
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    if (!equals || strlen(path) != (size_t)(equals - setting) || strncmp(path, setting, strlen(path)) != 0) {
        return -2;
    }
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    strncpy(name.sun_path, equals + 1, sizeof name.sun_path - 1);
    if (fd < 0 || fd >= FDS_MAX || connect(fd, (struct sockaddr *)&name, sizeof name)) {
        errno = ENODEV;
        return -1;
    }
    fds[fd].is_emulated = 1;
    return fd;
}

#define OPEN(function) \
    int function(const char *path, int flags, ...) \
    { \
        va_list arguments; \
        va_start(arguments, flags); \
        const mode_t mode = va_arg(arguments, mode_t); \
        va_end(arguments); \
        const int fd = connect_if_emulated(path); \
        int (*real)(const char *, int, ...) = (int (*)(const char *, int, ...))dlsym(RTLD_NEXT, #function); \
        return fd == -2 ? real(path, flags, mode) : fd; \
    }

OPEN(open)
OPEN(open64)

/* Send all bytes to the bench. Returns 0, or -1 if the connection is broken. */
static int send_all(int fd, const void *bytes, size_t size)
{
    return send(fd, bytes, size, MSG_NOSIGNAL) == (ssize_t)size ? 0 : -1;
}

/* Receive exactly `size` bytes from the bench. Returns 0, or -1 if the connection is broken. */
static int receive_all(int fd, void *bytes, size_t size)
{
    return !size || recv(fd, bytes, size, MSG_WAITALL) == (ssize_t)size ? 0 : -1;
}

/* Execute an I2C transfer of `count` messages on the bench: send address, flags, length and written bytes of each
 * message, then receive the error number and the read bytes. Returns 0, or -1 with errno as the kernel. */
static int transfer(int fd, struct i2c_msg *messages, uint32_t count)
{
    int32_t error = EIO;
    int broken = send_all(fd, &count, sizeof count);
    for (uint32_t i = 0; i < count; i++) {
        const uint16_t head[3] = {messages[i].addr, messages[i].flags, messages[i].len};
        broken |= send_all(fd, head, sizeof head);
        broken |= messages[i].flags & I2C_M_RD || !head[2] ? 0 : send_all(fd, messages[i].buf, head[2]);
    }
    broken |= receive_all(fd, &error, sizeof error);
    for (uint32_t i = 0; i < count && !broken && !error; i++) {
        broken |= messages[i].flags & I2C_M_RD ? receive_all(fd, messages[i].buf, messages[i].len) : 0;
    }
    errno = broken ? ENODEV : error; /* the bench has ended: the adapter is unplugged */
    return errno ? -1 : 0;
}

/* Execute an SMBus request as plain I2C messages. Returns 0, or -1 with errno; block transfers with a length byte and
 * PEC are not supported. */
static int smbus(int fd, const struct i2c_smbus_ioctl_data *request_data)
{
    uint8_t bytes[2 + I2C_SMBUS_BLOCK_MAX] = {request_data->command};
    const int is_read = request_data->read_write == I2C_SMBUS_READ;
    size_t size = 0; /* number of data bytes after the command byte */
    switch (request_data->size) {
    case I2C_SMBUS_QUICK: {
        struct i2c_msg quick = {.addr = fds[fd].address, .flags = is_read ? I2C_M_RD : 0, .len = 0, .buf = bytes};
        return transfer(fd, &quick, 1);
    }
    case I2C_SMBUS_BYTE: {
        struct i2c_msg byte = {.addr = fds[fd].address, .flags = is_read ? I2C_M_RD : 0, .len = 1, .buf = bytes};
        const int result = transfer(fd, &byte, 1);
        if (!result && is_read) {
            request_data->data->byte = bytes[0];
        }
        return result;
    }
    case I2C_SMBUS_BYTE_DATA:
        size = 1;
        break;
    case I2C_SMBUS_WORD_DATA:
        size = 2;
        break;
    case I2C_SMBUS_I2C_BLOCK_DATA:
        size = request_data->data->block[0];
        break;
    default:
        errno = EOPNOTSUPP;
        return -1;
    }
    uint8_t *const data =
        request_data->size == I2C_SMBUS_I2C_BLOCK_DATA ? request_data->data->block + 1 : request_data->data->block;
    if (size > I2C_SMBUS_BLOCK_MAX) {
        errno = EINVAL;
        return -1;
    }
    if (!is_read) {
        memcpy(bytes + 1, data, size);
    }
    struct i2c_msg write_read[2] = {{.addr = fds[fd].address, .len = (uint16_t)(is_read ? 1 : 1 + size), .buf = bytes},
                                    {.addr = fds[fd].address, .flags = I2C_M_RD, .len = (uint16_t)size, .buf = data}};
    return transfer(fd, write_read, is_read ? 2 : 1);
}

/* Replace ioctl() for emulated devices; other files are passed to the C library. */
int ioctl(int fd, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    if (fd < 0 || fd >= FDS_MAX || !fds[fd].is_emulated) {
        int (*real)(int, unsigned long, ...) = (int (*)(int, unsigned long, ...))dlsym(RTLD_NEXT, "ioctl");
        return real(fd, request, argument);
    }
    switch (request) {
    case I2C_SLAVE:
    case I2C_SLAVE_FORCE:
        fds[fd].address = (uint16_t)(uintptr_t)argument;
        return 0;
    case I2C_FUNCS:
        *(unsigned long *)argument =
            (getenv("FAKE_I2C_SMBUS_ONLY") ? 0 : I2C_FUNC_I2C) | (I2C_FUNC_SMBUS_EMUL & ~I2C_FUNC_SMBUS_PEC);
        return 0;
    case I2C_TIMEOUT:
    case I2C_RETRIES:
        return 0; /* the bench has a time limit of its own */
    case I2C_RDWR: {
        const struct i2c_rdwr_ioctl_data *request_data = argument;
        return transfer(fd, request_data->msgs, request_data->nmsgs);
    }
    case I2C_SMBUS:
        return smbus(fd, argument);
    default:
        errno = ENOTTY;
        return -1;
    }
}

/* Replace close(): forget an emulated device before the C library closes the file. */
int close(int fd)
{
    if (fd >= 0 && fd < FDS_MAX) {
        fds[fd].is_emulated = 0;
    }
    return ((int (*)(int))dlsym(RTLD_NEXT, "close"))(fd);
}
