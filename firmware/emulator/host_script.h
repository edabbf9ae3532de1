/* Bytes that a scripted host sends at given virtual times, read from a capture file (format: protocol/SPEC.md). */
#ifndef EMULATOR_HOST_SCRIPT_H
#define EMULATOR_HOST_SCRIPT_H

#include <stdint.h>
#include <stdio.h>

#include "emulator/base/vtime.h"

#define HOST_SCRIPT_RECORD_MAX 4096u

struct host_script {
    FILE *file; /* NULL: no script */
    const char *path;
    vtime next; /* when the current record is sent; VTIME_NEVER: no record is left */
    uint8_t bytes[HOST_SCRIPT_RECORD_MAX];
    size_t size;
};

/* Open a capture file as script; `path` NULL: no script. Returns 0, or -1 after one error line on stderr. */
int host_script_open(struct host_script *script, const char *path);

/* Read the next record. Returns 0, or -1 after one error line on stderr. */
int host_script_advance(struct host_script *script);
void host_script_close(struct host_script *script);

#endif
