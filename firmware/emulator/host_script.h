/* What a host sends, with the virtual times at which it sends it: a capture file with the host's bytes in it. */
#ifndef EMULATOR_HOST_SCRIPT_H
#define EMULATOR_HOST_SCRIPT_H

#include <stdint.h>
#include <stdio.h>

#include "emulator/vtime.h"

#define HOST_SCRIPT_RECORD_MAX 4096u

struct host_script {
    FILE *file; /* NULL: no script */
    const char *path;
    vtime next; /* when the pending record is sent; VTIME_NEVER: none is left */
    uint8_t bytes[HOST_SCRIPT_RECORD_MAX];
    size_t size;
};

int host_script_open(struct host_script *script, const char *path);
/* Read the next record. Returns 0, or -1 after one line on stderr. */
int host_script_advance(struct host_script *script);
void host_script_close(struct host_script *script);

#endif
