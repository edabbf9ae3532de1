/* Where the UART's bytes leave the emulator: a pseudo-terminal, a file descriptor that was handed over, a capture
 * file, or memory. */
#ifndef EMULATOR_ENDPOINT_H
#define EMULATOR_ENDPOINT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <signal.h>
#include <stdio.h>

#include "emulator/vtime.h"

enum endpoint_kind {
    ENDPOINT_NONE,
    ENDPOINT_PTY,
    ENDPOINT_FD,
    ENDPOINT_CAPTURE,
    ENDPOINT_MEMORY,
};

#define ENDPOINT_MEMORY_SIZE (1u << 20) /* bytes that nobody has taken yet: then the hub is held back */

struct endpoint {
    enum endpoint_kind kind;
    int fd;
    FILE *capture;
    bool wait_for_reader; /* virtual time stands still rather than hold the hub back */
    bool client_gone;     /* a handed-over descriptor was closed at the other end */
    bool muted;           /* a fault: the host does not read */
    char pty_name[128];
    uint8_t *memory; /* [ENDPOINT_MEMORY_SIZE] */
    size_t memory_fill;
    uint64_t bytes_delivered;
};

/* Set in a signal handler: do not wait for a reader any longer. */
extern volatile sig_atomic_t endpoint_stop_waiting;

/* `what`: none, pty, fd:N, capture:FILE or memory; `baud` is noted in a capture. Returns 0, or -1 after one line on stderr. */
int endpoint_open(struct endpoint *endpoint, const char *what, double baud);
void endpoint_close(struct endpoint *endpoint);

/* Bytes taken: fewer than `size` when nobody reads. */
size_t endpoint_send(struct endpoint *endpoint, const uint8_t *bytes, size_t size, vtime now);

/* Bytes that the host has sent, without waiting. */
size_t endpoint_receive(struct endpoint *endpoint, uint8_t *bytes, size_t size);

/* Memory only: take what has arrived. */
size_t endpoint_take(struct endpoint *endpoint, uint8_t *bytes, size_t size);

#endif
