/* Memory accesses outside the fast path: alignment check, system control space, the caller's bus, and faults. */
#include "emulator/cortex_m0/internal.h"

#define SYSTEM_CONTROL_SPACE 0xE000E000u
#define SYSTEM_CONTROL_SIZE 0x1000u

/* Store kind, address, PC and cycle of a fault in cpu->fault for the caller; HardFault is entered later. Returns
 * CORTEX_M0_EVENT_FAULT. */
enum cortex_m0_event cortex_m0_record_fault(struct cortex_m0 *cpu, enum cortex_m0_fault_kind kind, uint32_t address)
{
    cpu->fault =
        (struct cortex_m0_fault){.kind = kind, .pc = cpu->r[CORTEX_M0_PC], .address = address, .cycle = cpu->cycle};
    cpu->faults++;
    return CORTEX_M0_EVENT_FAULT;
}

/* Discard the decoded instructions in the bytes [offset, offset + size) of a memory; they are decoded again when
 * executed. */
void cortex_m0_invalidate_code(struct cortex_m0_code *code, uint32_t offset, uint32_t size)
{
    /* a 32-bit instruction may start one halfword earlier */
    const uint32_t first = offset >= 2u ? offset / 2u - 1u : 0u;
    const uint32_t last = (offset + size - 1u) / 2u;
    for (uint32_t i = first; i <= last; i++) {
        code->operations[i].kind = CORTEX_M0_OP_DECODE;
    }
}

/* Discard the decoded instructions in an address range; only the part of the memory that contains decoded instructions
 * is searched. */
static void invalidate_range(struct cortex_m0_code *code, uint32_t address, uint32_t size)
{
    const uint64_t first = (uint64_t)code->base + code->decoded_low, last = (uint64_t)code->base + code->decoded_high;
    const uint64_t end = address + (uint64_t)size, begin = address > first ? address : first;
    const uint64_t stop = end < last ? end : last;
    if (begin < stop) {
        cortex_m0_invalidate_code(code, (uint32_t)(begin - code->base), (uint32_t)(stop - begin));
    }
}

/* Discard decoded instructions of a memory range that the caller has changed: `size` bytes from `address`. */
void cortex_m0_memory_changed(struct cortex_m0 *cpu, uint32_t address, uint32_t size)
{
    invalidate_range(&cpu->flash_code, address, size);
    invalidate_range(&cpu->ram_code, address, size);
}

/* Return a pointer to the byte at `address` in this memory; NULL if the address lies outside it. */
static const uint8_t *memory_at(const struct cortex_m0_code *code, uint32_t address)
{
    return address - code->base < code->size ? code->bytes + (address - code->base) : NULL;
}

/* Pass an access outside flash and RAM to the bus function of the caller, and add its wait states to the cycle
 * counter. A missing function, an error, or a retry where none is allowed is a bus fault. Returns the event for the
 * instruction. */
static enum cortex_m0_event access_bus(struct cortex_m0 *cpu, cortex_m0_access_function *function,
                                       struct cortex_m0_access *access, bool can_retry)
{
    const enum cortex_m0_bus_status status = function ? function(cpu->config.context, access) : CORTEX_M0_ERROR;
    if (status == CORTEX_M0_RETRY && can_retry) {
        return CORTEX_M0_EVENT_BUS_RETRY;
    }
    if (status != CORTEX_M0_OK) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_BUS, access->address);
    }
    cpu->cycle += access->stall;
    return CORTEX_M0_EVENT_NONE;
}

/* Read `size` bytes (1, 2 or 4) at any address: flash, RAM, system control space or bus. can_retry: the bus may
 * postpone the access. Returns CORTEX_M0_EVENT_NONE, CORTEX_M0_EVENT_BUS_RETRY if the bus postponed the access, or
 * CORTEX_M0_EVENT_FAULT for an unaligned or invalid access. */
enum cortex_m0_event cortex_m0_read(struct cortex_m0 *cpu, uint32_t address, unsigned size, bool can_retry,
                                    uint32_t *value)
{
    if (address & (size - 1u)) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_UNALIGNED, address);
    }
    const uint8_t *const flash = memory_at(&cpu->flash_code, address), *const ram = memory_at(&cpu->ram_code, address);
    *value = 0;
    if (ram || flash) {
        memcpy(value, ram ? ram : flash, size);
        cpu->cycle += ram ? 0 : cpu->flash_code.refill;
        return CORTEX_M0_EVENT_NONE;
    }
    if (address - SYSTEM_CONTROL_SPACE < SYSTEM_CONTROL_SIZE) {
        if (size != 4u) {
            return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_BUS, address);
        }
        *value = cortex_m0_system_read(cpu, address - SYSTEM_CONTROL_SPACE, cpu->cycle + 1u);
        return CORTEX_M0_EVENT_NONE;
    }
    struct cortex_m0_access access = {.cycle = cpu->cycle + 1u, .address = address, .size = (uint8_t)size};
    const enum cortex_m0_event event = access_bus(cpu, cpu->config.read, &access, can_retry);
    *value = access.value & (UINT32_MAX >> (32u - 8u * size));
    return event;
}

/* Write `size` bytes (1, 2 or 4) at any address: RAM, system control space or bus; a store to flash goes to the bus. A
 * store to RAM discards the instructions that were decoded there. can_retry: the bus may postpone the access. Returns
 * CORTEX_M0_EVENT_NONE, CORTEX_M0_EVENT_BUS_RETRY if the bus postponed the access, or CORTEX_M0_EVENT_FAULT for an
 * unaligned or invalid access. */
enum cortex_m0_event cortex_m0_write(struct cortex_m0 *cpu, uint32_t address, unsigned size, bool can_retry,
                                     uint32_t value)
{
    if (address & (size - 1u)) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_UNALIGNED, address);
    }
    const uint32_t offset = address - cpu->ram_code.base;
    if (offset < cpu->ram_code.size) {
        memcpy(cpu->config.ram + offset, &value, size);
        cortex_m0_invalidate_code(&cpu->ram_code, offset, size);
        return CORTEX_M0_EVENT_NONE;
    }
    if (address - SYSTEM_CONTROL_SPACE < SYSTEM_CONTROL_SIZE) {
        if (size != 4u) {
            return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_BUS, address);
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
    return access_bus(cpu, cpu->config.write, &access, can_retry);
}
