/* The host's end of the UART: a pseudo-terminal, a file descriptor, a capture file or a memory buffer. */
#ifndef EMULATOR_ENDPOINT_H
#define EMULATOR_ENDPOINT_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "emulator/base/vtime.h"

enum endpoint_kind {
    ENDPOINT_NONE,
    ENDPOINT_PTY,
    ENDPOINT_FD,
    ENDPOINT_CAPTURE,
    ENDPOINT_MEMORY,
};

#define ENDPOINT_MEMORY_SIZE (1u << 20) /* when this many bytes are unread, the hub is blocked */

struct endpoint {
    enum endpoint_kind kind;
    int fd;
    FILE *capture;
    bool wait_for_reader; /* stop virtual time while the reader is slower; otherwise block the hub */
    bool has_client_left; /* the other end of the file descriptor was closed */
    bool is_muted;        /* fault: the host does not read */
    char pty_name[128];
    uint8_t *memory; /* [ENDPOINT_MEMORY_SIZE] */
    size_t memory_fill;
    uint64_t bytes_delivered;
};

/* Set by a signal handler: stop waiting for a reader. */
extern volatile sig_atomic_t endpoint_stop_waiting;

/* Open the host's end of the UART. target: none, pty, fd:N, capture:FILE or memory. baud: stored in the header of a
 * capture. Returns 0, or -1 after one error line on stderr. */
int endpoint_open(struct endpoint *endpoint, const char *target, double baud);
void endpoint_close(struct endpoint *endpoint);

/* Send bytes to the host. Returns the number of bytes accepted, which is less than `size` while the host does not
 * read. */
size_t endpoint_send(struct endpoint *endpoint, const uint8_t *bytes, size_t size, vtime now);

/* Read bytes that the host has sent, without waiting. Returns their number. */
size_t endpoint_receive(struct endpoint *endpoint, uint8_t *bytes, size_t size);

/* Remove the oldest bytes that were sent to a memory endpoint, and copy them to `bytes`. Returns their number. */
size_t endpoint_read_memory(struct endpoint *endpoint, uint8_t *bytes, size_t size);

#endif
