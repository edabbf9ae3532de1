#include "emulator/host_script.h"

#include <errno.h>
#include <string.h>

/* Print an error message with the path of the file of host bytes to stderr. Returns -1. */
static int report_error(const struct host_script *script, const char *message)
{
    fprintf(stderr, "host input %s: %s\n", script->path, message);
    return -1;
}

/* Read a little-endian number from `size` bytes, at most 8. */
static uint64_t get_le(const uint8_t *bytes, size_t size)
{
    uint64_t value = 0;
    for (size_t i = size; i-- > 0;) {
        value = (value << 8) | bytes[i];
    }
    return value;
}

/* Open a capture file whose records are sent to the hub at their recorded times. `path` NULL: nothing is sent. Returns
 * 0, or -1 after an error line on stderr. */
int host_script_open(struct host_script *script, const char *path)
{
    uint8_t start[16];
    memset(script, 0, sizeof *script);
    script->path = path;
    script->next = VTIME_NEVER;
    if (!path) {
        return 0;
    }
    script->file = fopen(path, "rb");
    if (!script->file) {
        return report_error(script, strerror(errno));
    }
    if (fread(start, sizeof start, 1, script->file) != 1 || memcmp(start, "TAXELCAP", 8) != 0) {
        return report_error(script, "expected a capture file that starts with TAXELCAP");
    }
    /* bytes 8 and 9: version; bytes 12 to 15: length of the JSON header, which is skipped */
    if (get_le(start + 8, 2) != 1u || fseek(script->file, (long)get_le(start + 12, 4), SEEK_CUR)) {
        return report_error(script, "the capture's version is unknown or its header is damaged; expected version 1");
    }
    return host_script_advance(script);
}

/* Read the next record: time in nanoseconds (8 bytes), length (4 bytes), data. `next` is VTIME_NEVER at the end of the
 * file. Returns 0, or -1 after an error line on stderr. */
int host_script_advance(struct host_script *script)
{
    uint8_t head[12];
    script->next = VTIME_NEVER;
    if (fread(head, sizeof head, 1, script->file) != 1) {
        return feof(script->file) ? 0 : report_error(script, "the file cannot be read");
    }
    const uint64_t size = get_le(head + 8, 4);
    if (size > sizeof script->bytes) {
        return report_error(script, "a record is longer than 4096 bytes, which is the maximum");
    }
    if (fread(script->bytes, 1, (size_t)size, script->file) != size) {
        return report_error(script, "the file is truncated: it ends inside a record");
    }
    script->size = (size_t)size;
    script->next = get_le(head, 8) * VTIME_NS;
    return 0;
}

/* Close the file of host bytes, if one is open. */
void host_script_close(struct host_script *script)
{
    if (script->file) {
        fclose(script->file);
    }
}
