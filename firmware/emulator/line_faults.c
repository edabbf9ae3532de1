#include "emulator/line_faults.h"

bool line_faults_add(struct line_faults *line, const struct fault_description *fault, vtime now)
{
    const bool flips = fault->kind == FAULT_UP_FLIP || fault->kind == FAULT_DOWN_FLIP;
    if (fault->kind == FAULT_UP_DELAY || fault->kind == FAULT_DOWN_DELAY) {
        line->held_until = vtime_max(line->held_until, now + (vtime)(fault->value * (double)VTIME_MS));
        return true;
    }
    if (line->count == LINE_FAULTS_MAX) {
        return false;
    }
    line->waiting[line->count].kind = fault->kind;
    line->waiting[line->count].from = line->position + (uint64_t)fault->value;
    line->waiting[line->count].until =
        line->waiting[line->count].from + (flips || fault->second < 1.0 ? 1u : (uint64_t)fault->second);
    line->waiting[line->count].flip = (uint8_t)(flips ? 1u << ((unsigned)fault->second & 7u) : 0u);
    line->count++;
    return true;
}

static bool drops(enum fault_kind kind)
{
    return kind == FAULT_UP_DROP || kind == FAULT_DOWN_DROP;
}

size_t line_faults_pass(struct line_faults *line, uint8_t byte, uint8_t out[2], vtime now, struct fault_log *log)
{
    const uint64_t position = line->position++;
    size_t copies = 1, kept = 0;
    for (size_t i = 0; i < line->count; i++) {
        if (position >= line->waiting[i].from) {
            byte ^= line->waiting[i].flip;
            copies = drops(line->waiting[i].kind) ? 0 : copies && !line->waiting[i].flip ? 2 : copies;
            fault_log_add(log, now, line->waiting[i].kind, 0);
        }
        if (position + 1u < line->waiting[i].until) {
            line->waiting[kept++] = line->waiting[i];
        }
    }
    line->count = kept;
    out[0] = out[1] = byte;
    return copies;
}
