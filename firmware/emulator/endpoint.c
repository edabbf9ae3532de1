#define _GNU_SOURCE
#include "emulator/endpoint.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <pty.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

volatile sig_atomic_t endpoint_stop_waiting;

/* Print an error message with the name of the endpoint (terminal, socket or file) to stderr. Returns -1. */
static int report_error(const char *target, const char *message)
{
    fprintf(stderr, "endpoint %s: %s\n", target, message);
    return -1;
}

/* Make reads and writes of the file descriptor return at once. Returns 0, or -1 on an error. */
static int set_nonblocking(int fd)
{
    const int flags = fcntl(fd, F_GETFL);
    return flags < 0 ? -1 : fcntl(fd, F_SETFL, flags | O_NONBLOCK);
}

/* Open a pseudo-terminal for a host. Returns 0, or -1 on an error. The slave side is set to raw mode before a client
 * opens it, because otherwise the terminal would echo the first bytes. The emulator then closes its own descriptor of
 * the slave side, so that POLLHUP reports that the client has closed its end. */
static int open_pty(struct endpoint *endpoint)
{
    struct termios settings;
    int slave;
    if (openpty(&endpoint->fd, &slave, endpoint->pty_name, NULL, NULL)) {
        return report_error("pty", strerror(errno));
    }
    if (tcgetattr(slave, &settings)) {
        return report_error("pty", strerror(errno));
    }
    cfmakeraw(&settings);
    tcsetattr(slave, TCSANOW, &settings);
    close(slave);
    return set_nonblocking(endpoint->fd);
}

/* Write the `size` low bytes of a value, least significant byte first. */
static void put_le(uint8_t *bytes, uint64_t value, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        bytes[i] = (uint8_t)(value >> (8u * i));
    }
}

/* Open a capture file (format: protocol/SPEC.md) for writing and write its header. baud: rate of the UART in bit/s.
 * Returns 0, or -1 after an error line on stderr. */
static int open_capture(struct endpoint *endpoint, const char *path, double baud)
{
    char header[64];
    const int size = snprintf(header, sizeof header, "{\"source\": \"emulator\", \"baud\": %.0f}", baud);
    uint8_t start[16] = "TAXELCAP";
    endpoint->capture = fopen(path, "wb");
    if (!endpoint->capture) {
        return report_error(path, strerror(errno));
    }
    put_le(start + 8, 1, 2); /* version of the format */
    put_le(start + 12, (uint64_t)size, 4);
    fwrite(start, sizeof start, 1, endpoint->capture);
    fwrite(header, (size_t)size, 1, endpoint->capture);
    return 0;
}

/* Open the host's end of the UART: none, pty (pseudo-terminal), fd:N, capture:FILE or memory. `baud` is written to a
 * capture. Returns 0, or -1 after an error line on stderr. */
int endpoint_open(struct endpoint *endpoint, const char *target, double baud)
{
    memset(endpoint, 0, sizeof *endpoint);
    endpoint->fd = -1;
    if (strcmp(target, "none") == 0) {
        return 0;
    }
    if (strcmp(target, "pty") == 0) {
        endpoint->kind = ENDPOINT_PTY;
        return open_pty(endpoint);
    }
    if (strncmp(target, "fd:", 3) == 0) {
        endpoint->kind = ENDPOINT_FD;
        char *end = NULL;
        const long fd = strtol(target + 3, &end, 10);
        if (end == target + 3 || *end || fd < 0 || fd > INT_MAX) {
            return report_error(target, "expected fd:NUMBER with the number of an open file descriptor");
        }
        endpoint->fd = (int)fd;
        return set_nonblocking(endpoint->fd) ? report_error(target, strerror(errno)) : 0;
    }
    if (strncmp(target, "capture:", 8) == 0) {
        endpoint->kind = ENDPOINT_CAPTURE;
        return open_capture(endpoint, target + 8, baud);
    }
    if (strcmp(target, "memory") == 0) {
        endpoint->kind = ENDPOINT_MEMORY;
        endpoint->memory = malloc(ENDPOINT_MEMORY_SIZE);
        return endpoint->memory ? 0 : report_error(target, "out of memory");
    }
    return report_error(target, "expected none, pty, fd:N, capture:FILE or memory");
}

/* Close the endpoint and free its memory. */
void endpoint_close(struct endpoint *endpoint)
{
    if (endpoint->capture) {
        fclose(endpoint->capture);
    }
    if (endpoint->fd >= 0) {
        close(endpoint->fd);
    }
    free(endpoint->memory);
}

/* Append bytes to the memory of the endpoint. Returns the number of bytes for which there was space. */
static size_t store_in_memory(struct endpoint *endpoint, const uint8_t *bytes, size_t size)
{
    const size_t space = ENDPOINT_MEMORY_SIZE - endpoint->memory_fill;
    const size_t stored = size < space ? size : space;
    memcpy(endpoint->memory + endpoint->memory_fill, bytes, stored);
    endpoint->memory_fill += stored;
    return stored;
}

/* Remove up to `size` bytes from a memory endpoint; returns their number. */
size_t endpoint_read_memory(struct endpoint *endpoint, uint8_t *bytes, size_t size)
{
    const size_t count = size < endpoint->memory_fill ? size : endpoint->memory_fill;
    if (!count) {
        return 0;
    }
    memcpy(bytes, endpoint->memory, count);
    endpoint->memory_fill -= count;
    memmove(endpoint->memory, endpoint->memory + count, endpoint->memory_fill);
    return count;
}

/* Append a record to the capture file: time in nanoseconds, length, bytes. */
static void write_capture_record(struct endpoint *endpoint, const uint8_t *bytes, size_t size, vtime now)
{
    uint8_t head[12];
    put_le(head, now / VTIME_NS, 8);
    put_le(head + 8, size, 4);
    fwrite(head, sizeof head, 1, endpoint->capture);
    fwrite(bytes, size, 1, endpoint->capture);
}

/* Return whether a host has opened the other side of the pseudo-terminal or socket. */
static bool has_client(const struct endpoint *endpoint)
{
    struct pollfd state = {.fd = endpoint->fd, .events = POLLOUT};
    return poll(&state, 1, 0) >= 0 && !(state.revents & POLLHUP);
}

/* Write bytes to the file descriptor without blocking; returns the number accepted. With `wait_for_reader` (emulation
 * faster than real time) the call waits until the reader has accepted all bytes. */
static size_t send_to_fd(struct endpoint *endpoint, const uint8_t *bytes, size_t size)
{
    size_t sent = 0;
    while (sent < size) {
        const ssize_t n = write(endpoint->fd, bytes + sent, size - sent);
        if (n > 0) {
            sent += (size_t)n;
        } else if (n < 0 && errno == EINTR) {
            continue;
        } else if (n < 0 && errno == EAGAIN && endpoint->wait_for_reader && !endpoint_stop_waiting) {
            struct pollfd writable = {.fd = endpoint->fd, .events = POLLOUT};
            (void)poll(&writable, 1, 1000);
        } else {
            endpoint->has_client_left = endpoint->kind == ENDPOINT_FD && n < 0 && errno != EAGAIN;
            break;
        }
    }
    return sent;
}

/* Deliver bytes to the host at virtual time `now`; returns the number accepted. Bytes to a muted endpoint or to a
 * pseudo-terminal without a client are not accepted. */
size_t endpoint_send(struct endpoint *endpoint, const uint8_t *bytes, size_t size, vtime now)
{
    size_t sent = size;
    if (endpoint->is_muted || (endpoint->kind == ENDPOINT_PTY && !has_client(endpoint))) {
        return 0;
    }
    if (endpoint->kind == ENDPOINT_CAPTURE) {
        write_capture_record(endpoint, bytes, size, now);
    } else if (endpoint->kind == ENDPOINT_MEMORY) {
        sent = store_in_memory(endpoint, bytes, size);
    } else if (endpoint->kind != ENDPOINT_NONE) {
        sent = send_to_fd(endpoint, bytes, size);
    }
    endpoint->bytes_delivered += sent;
    return sent;
}

/* Read up to `size` bytes from the host without waiting; returns their number. */
size_t endpoint_receive(struct endpoint *endpoint, uint8_t *bytes, size_t size)
{
    if (endpoint->fd < 0 || !size) {
        return 0;
    }
    const ssize_t n = read(endpoint->fd, bytes, size);
    if (n == 0 && endpoint->kind == ENDPOINT_FD) {
        endpoint->has_client_left = true;
    }
    return n > 0 ? (size_t)n : 0;
}
