/* Accesses off the fast path: alignment, the system control space, the caller's bus, and faults. */
#include "emulator/cortex_m0/parts.h"

#define SYSTEM_CONTROL_SPACE 0xE000E000u
#define SYSTEM_CONTROL_SIZE 0x1000u

enum cortex_m0_event cortex_m0_fail(struct cortex_m0 *cpu, enum cortex_m0_fault_kind kind, uint32_t address)
{
    cpu->fault = (struct cortex_m0_fault){.kind = kind, .pc = cpu->r[CORTEX_M0_PC], .address = address, .cycle = cpu->cycle};
    cpu->faults++;
    return CORTEX_M0_EVENT_FAULT;
}

void cortex_m0_forget_code(struct cortex_m0_code *code, uint32_t offset, uint32_t size)
{
    const uint32_t first = offset >= 2u ? offset / 2u - 1u : 0u; /* the second half of a wide one may have changed */
    const uint32_t last = (offset + size - 1u) / 2u;
    for (uint32_t i = first; i <= last; i++) {
        code->operations[i].kind = CORTEX_M0_OP_DECODE;
    }
}

/* Only what has been decoded has to be forgotten. */
static void changed(struct cortex_m0_code *code, uint32_t address, uint32_t size)
{
    const uint64_t first = (uint64_t)code->base + code->low, last = (uint64_t)code->base + code->high;
    const uint64_t end = address + (uint64_t)size, begin = address > first ? address : first;
    const uint64_t stop = end < last ? end : last;
    if (begin < stop) {
        cortex_m0_forget_code(code, (uint32_t)(begin - code->base), (uint32_t)(stop - begin));
    }
}

void cortex_m0_changed(struct cortex_m0 *cpu, uint32_t address, uint32_t size)
{
    changed(&cpu->flash_code, address, size);
    changed(&cpu->ram_code, address, size);
}

/* Where a whole access lies in flash or RAM; NULL: elsewhere. */
static const uint8_t *in(const struct cortex_m0_code *code, uint32_t address)
{
    return address - code->base < code->size ? code->bytes + (address - code->base) : NULL;
}

static enum cortex_m0_event on_bus(struct cortex_m0 *cpu, cortex_m0_access_function *function, struct cortex_m0_access *access,
                                   bool may_wait)
{
    const enum cortex_m0_answer answer = function ? function(cpu->config.context, access) : CORTEX_M0_ERROR;
    if (answer == CORTEX_M0_LATER && may_wait) {
        return CORTEX_M0_EVENT_WAITS;
    }
    if (answer != CORTEX_M0_OK) {
        return cortex_m0_fail(cpu, CORTEX_M0_FAULT_BUS, access->address);
    }
    cpu->cycle += access->stall;
    return CORTEX_M0_EVENT_NONE;
}

enum cortex_m0_event cortex_m0_read(struct cortex_m0 *cpu, uint32_t address, unsigned size, bool may_wait, uint32_t *value)
{
    if (address & (size - 1u)) {
        return cortex_m0_fail(cpu, CORTEX_M0_FAULT_UNALIGNED, address);
    }
    const uint8_t *const flash = in(&cpu->flash_code, address), *const ram = in(&cpu->ram_code, address);
    *value = 0;
    if (ram || flash) {
        memcpy(value, ram ? ram : flash, size);
        cpu->cycle += ram ? 0 : cpu->flash_code.refill;
        return CORTEX_M0_EVENT_NONE;
    }
    if (address - SYSTEM_CONTROL_SPACE < SYSTEM_CONTROL_SIZE) {
        if (size != 4u) {
            return cortex_m0_fail(cpu, CORTEX_M0_FAULT_BUS, address);
        }
        *value = cortex_m0_system_read(cpu, address - SYSTEM_CONTROL_SPACE, cpu->cycle + 1u);
        return CORTEX_M0_EVENT_NONE;
    }
    struct cortex_m0_access access = {.cycle = cpu->cycle + 1u, .address = address, .size = (uint8_t)size};
    const enum cortex_m0_event event = on_bus(cpu, cpu->config.read, &access, may_wait);
    *value = access.value & (UINT32_MAX >> (32u - 8u * size));
    return event;
}

enum cortex_m0_event cortex_m0_write(struct cortex_m0 *cpu, uint32_t address, unsigned size, bool may_wait, uint32_t value)
{
    if (address & (size - 1u)) {
        return cortex_m0_fail(cpu, CORTEX_M0_FAULT_UNALIGNED, address);
    }
    const uint32_t offset = address - cpu->ram_code.base;
    if (offset < cpu->ram_code.size) {
        memcpy(cpu->config.ram + offset, &value, size);
        cortex_m0_forget_code(&cpu->ram_code, offset, size);
        return CORTEX_M0_EVENT_NONE;
    }
    if (address - SYSTEM_CONTROL_SPACE < SYSTEM_CONTROL_SIZE) {
        if (size != 4u) {
            return cortex_m0_fail(cpu, CORTEX_M0_FAULT_BUS, address);
        }
        cortex_m0_system_write(cpu, address - SYSTEM_CONTROL_SPACE, cpu->cycle + 1u, value);
        return CORTEX_M0_EVENT_NONE;
    }
    struct cortex_m0_access access = {
        .cycle = cpu->cycle + 1u,
        .address = address,
        .value = value & (UINT32_MAX >> (32u - 8u * size)),
        .size = (uint8_t)size,
    };
    return on_bus(cpu, cpu->config.write, &access, may_wait);
}
