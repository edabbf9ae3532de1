/* Loads, stores, register lists and branches that the fast path does not finish. r[15] is the address of the
 * instruction. */
#include "emulator/cortex_m0/internal.h"

#define EXC_RETURN_FIRST 0xF0000000u

/* Return the number of bytes that a load or store operation accesses. */
static unsigned get_access_size(uint8_t kind)
{
    switch (kind) {
    case CORTEX_M0_OP_STRB_R:
    case CORTEX_M0_OP_STRB_I:
    case CORTEX_M0_OP_LDRB_R:
    case CORTEX_M0_OP_LDRB_I:
    case CORTEX_M0_OP_LDRSB_R:
        return 1;
    case CORTEX_M0_OP_STRH_R:
    case CORTEX_M0_OP_STRH_I:
    case CORTEX_M0_OP_LDRH_R:
    case CORTEX_M0_OP_LDRH_I:
    case CORTEX_M0_OP_LDRSH_R:
        return 2;
    default:
        return 4;
    }
}

/* Execute a load that the fast path does not finish: from an address outside RAM and flash, or from an unaligned
 * address. Takes two cycles plus the wait states of the bus. Returns the event of the access; after an event other than
 * CORTEX_M0_EVENT_NONE, registers and program counter are unchanged. */
enum cortex_m0_event cortex_m0_execute_load(struct cortex_m0 *cpu, struct cortex_m0_operation operation,
                                            uint32_t address)
{
    uint32_t value;
    const enum cortex_m0_event event = cortex_m0_read(cpu, address, get_access_size(operation.kind), true, &value);
    if (event) {
        return event;
    }
    if (operation.kind == CORTEX_M0_OP_LDRSB_R) {
        value = (uint32_t)(int8_t)value;
    } else if (operation.kind == CORTEX_M0_OP_LDRSH_R) {
        value = (uint32_t)(int16_t)value;
    }
    cpu->r[operation.a] = value;
    cpu->r[CORTEX_M0_PC] += 2u;
    cpu->cycle += 2u;
    return CORTEX_M0_EVENT_NONE;
}

/* Execute a store that the fast path does not finish: to an address outside RAM, or to an unaligned address. Takes two
 * cycles plus the wait states of the bus. Returns the event of the access; after an event other than
 * CORTEX_M0_EVENT_NONE, the program counter is unchanged. */
enum cortex_m0_event cortex_m0_execute_store(struct cortex_m0 *cpu, struct cortex_m0_operation operation,
                                             uint32_t address)
{
    const enum cortex_m0_event event =
        cortex_m0_write(cpu, address, get_access_size(operation.kind), true, cpu->r[operation.a]);
    if (event) {
        return event;
    }
    cpu->r[CORTEX_M0_PC] += 2u;
    cpu->cycle += 2u;
    return CORTEX_M0_EVENT_NONE;
}

/* Transfer the words of a register list between memory and registers, in order of register number, one per cycle. A
 * load also stores them in `words`; registers change only if every word could be read, so that the instruction can be
 * repeated. The bus may postpone only the first access, because a repeated instruction repeats all accesses. Returns
 * the event of the first access that fails. */
static enum cortex_m0_event move_list(struct cortex_m0 *cpu, struct cortex_m0_operation operation, uint32_t address,
                                      bool is_load, uint32_t words[])
{
    const uint64_t begin = cpu->cycle;
    uint32_t list = operation.value;
    for (unsigned i = 0; i < operation.c; i++, list &= list - 1u) {
        const unsigned number = list ? (unsigned)__builtin_ctz(list) : CORTEX_M0_PC; /* POP: PC comes last */
        const enum cortex_m0_event event = is_load ? cortex_m0_read(cpu, address + i * 4u, 4, i == 0, &words[i])
                                                   : cortex_m0_write(cpu, address + i * 4u, 4, i == 0, cpu->r[number]);
        if (event) {
            cpu->cycle = begin;
            return event;
        }
        cpu->cycle++;
    }
    cpu->cycle++;
    list = is_load ? operation.value : 0;
    for (unsigned i = 0; list; i++, list &= list - 1u) {
        cpu->r[__builtin_ctz(list)] = words[i]; /* NOLINT(clang-analyzer-core.uninitialized.Assign) */
    }
    return CORTEX_M0_EVENT_NONE;
}

/* Execute PUSH, POP, STM or LDM outside RAM, in one cycle per word and one more, then write back the base register. POP
 * with PC ends with a branch. Returns the event of the first access that fails, or of the branch. */
enum cortex_m0_event cortex_m0_execute_list(struct cortex_m0 *cpu, struct cortex_m0_operation operation,
                                            uint32_t address)
{
    const bool is_load = operation.kind != CORTEX_M0_OP_PUSH && operation.kind != CORTEX_M0_OP_STM;
    const uint32_t end = address + operation.c * 4u;
    uint32_t words[9]; /* eight low registers and PC */
    const enum cortex_m0_event event = move_list(cpu, operation, address, is_load, words);
    if (event) {
        return event;
    }
    cpu->progress = 0;
    cpu->r[CORTEX_M0_PC] += 2u;
    switch (operation.kind) {
    case CORTEX_M0_OP_PUSH:
        cortex_m0_set_sp(cpu, address);
        break;
    case CORTEX_M0_OP_POP:
        cpu->r[CORTEX_M0_SP] = end;
        break;
    case CORTEX_M0_OP_POP_PC:
        cpu->r[CORTEX_M0_SP] = end;
        cpu->cycle += cpu->config.timing.taken_branch;
        /* NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage): move_list() has read every word */
        return cortex_m0_branch(cpu, words[operation.c - 1u]);
    case CORTEX_M0_OP_LDM_KEEP:
        break;
    default:
        cpu->r[operation.b] = end;
        break;
    }
    return CORTEX_M0_EVENT_NONE;
}

/* Return the decoded code of the memory (flash or RAM) that contains `address`; NULL if neither does. */
struct cortex_m0_code *cortex_m0_code_at(struct cortex_m0 *cpu, uint32_t address)
{
    if (address - cpu->flash_code.base < cpu->flash_code.size) {
        return &cpu->flash_code;
    }
    return address - cpu->ram_code.base < cpu->ram_code.size ? &cpu->ram_code : NULL;
}

/* Set r[15] to the address of the next instruction and add the wait states of the fetch. */
void cortex_m0_set_fetch_address(struct cortex_m0 *cpu, uint32_t address)
{
    const struct cortex_m0_code *const code = cortex_m0_code_at(cpu, address);
    cpu->r[CORTEX_M0_PC] = address;
    cpu->cycle += code ? code->refill : 0;
}

/* Branch to an address in a register (BX, BLX) or from the stack (POP): bit 0 selects the Thumb state. In a handler,
 * a branch to one of the topmost addresses is an exception return: the function then stores the address in exit_value
 * and returns CORTEX_M0_EVENT_EXIT. Otherwise it returns CORTEX_M0_EVENT_NONE. */
enum cortex_m0_event cortex_m0_branch(struct cortex_m0 *cpu, uint32_t target)
{
    if (target >= EXC_RETURN_FIRST && cpu->ipsr) {
        cpu->exit_value = target;
        return CORTEX_M0_EVENT_EXIT;
    }
    cpu->thumb = target & 1u;
    cortex_m0_set_fetch_address(cpu, target & ~UINT32_C(1));
    return CORTEX_M0_EVENT_NONE;
}
