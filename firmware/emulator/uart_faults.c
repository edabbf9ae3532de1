#include "emulator/uart_faults.h"

/* Return whether a UART fault of this kind inverts a bit. */
static bool is_flip(enum fault_kind kind)
{
    return kind == FAULT_UP_FLIP || kind == FAULT_DOWN_FLIP;
}

/* Return whether a UART fault of this kind removes bytes. */
static bool removes_byte(enum fault_kind kind)
{
    return kind == FAULT_UP_DROP || kind == FAULT_DOWN_DROP;
}

/* Schedule a fault of one direction of the UART: a delay of `value` milliseconds, or a change of the bytes from `value`
 * bytes after the current position on. `second_value` is the number of the bit to invert in one byte (flip), or the
 * number of bytes to remove or double. Returns false if too many faults are pending. */
bool uart_faults_add(struct uart_faults *line, const struct fault_description *fault, vtime now)
{
    if (fault->kind == FAULT_UP_DELAY || fault->kind == FAULT_DOWN_DELAY) {
        line->held_until = vtime_max(line->held_until, now + (vtime)(fault->value * (double)VTIME_MS));
        return true;
    }
    if (line->count == UART_FAULTS_MAX) {
        return false;
    }
    const bool flips = is_flip(fault->kind);
    const uint64_t from = line->position + (uint64_t)fault->value;
    line->pending[line->count].kind = fault->kind;
    line->pending[line->count].from = from;
    line->pending[line->count].until = from + (flips || fault->second_value < 1.0 ? 1u : (uint64_t)fault->second_value);
    line->pending[line->count].flip = (uint8_t)(flips ? 1u << ((unsigned)fault->second_value & 7u) : 0u);
    line->count++;
    return true;
}

/* Apply the pending faults to one byte. Returns the number of bytes in `out`: 0 (removed), 1 or 2 (doubled). */
size_t uart_faults_apply(struct uart_faults *line, uint8_t byte, uint8_t out[2], vtime now, struct fault_log *log)
{
    const uint64_t position = line->position++;
    size_t copies = 1, kept = 0;
    for (size_t i = 0; i < line->count; i++) {
        if (position >= line->pending[i].from) {
            byte ^= line->pending[i].flip;
            copies = removes_byte(line->pending[i].kind) ? 0 : copies && !line->pending[i].flip ? 2 : copies;
            fault_log_add(log, now, line->pending[i].kind, 0);
        }
        if (position + 1u < line->pending[i].until) {
            line->pending[kept++] = line->pending[i];
        }
    }
    line->count = kept;
    out[0] = out[1] = byte;
    return copies;
}
