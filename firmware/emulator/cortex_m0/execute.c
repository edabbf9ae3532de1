/* Fast path: decoded operations, each of which jumps to the code of the next operation (labels as values, a GCC
 * extension).
 *
 * During execution the instruction pointer, the flags and the time are local variables. Time is the remaining budget of
 * cycles until the deadline, so that one subtraction both counts cycles and detects the end. Memory outside RAM and
 * flash, and branches out of a memory, leave through the labels at the end of the function. */
#include "emulator/cortex_m0/fast_path.h"

/* Execute instructions from r[15] until the deadline, until `attention` is set, or until an event occurs, and return
 * the event (CORTEX_M0_EVENT_NONE in the first two cases). Each decoded operation jumps directly to the code of the
 * next operation (labels as values); one function holds all operations so that flags and cycle budget stay in
 * registers. */
enum cortex_m0_event cortex_m0_execute(struct cortex_m0 *cpu)
{
    static const void *const labels[] = {
#define LABEL(name) &&op_##name,
        CORTEX_M0_OPERATIONS(LABEL)
#undef LABEL
    };
    uint32_t *const r = cpu->r;
    uint8_t *const ram = cpu->config.ram;
    const uint32_t ram_base = cpu->ram_code.base, ram_size = cpu->ram_code.size;
    struct cortex_m0_code *code;
    const struct cortex_m0_operation *ip;
    int64_t budget;
    /* Flags as words: bit 31 of n and v is the flag N and V, Z is set if z is 0, and c is 0 or 1. */
    uint32_t n, z, c, v, refill, address, target;
    const uint32_t taken = cpu->config.timing.taken_branch;
    enum cortex_m0_event event;

resume:
    if (cpu->attention || cpu->cycle >= cpu->deadline) {
        return CORTEX_M0_EVENT_NONE;
    }
    if (!cpu->thumb) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_STATE, r[CORTEX_M0_PC]);
    }
    code = cortex_m0_code_at(cpu, r[CORTEX_M0_PC]);
    if (!code) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_FETCH, r[CORTEX_M0_PC]);
    }
    ip = code->operations + (r[CORTEX_M0_PC] - code->base) / 2u;
    refill = code->refill;
    budget = (int64_t)(cpu->deadline - cpu->cycle);
    n = cpu->n;
    z = cpu->z;
    c = cpu->c;
    v = cpu->v;
    goto *labels[ip->kind];

op_DECODE:
    cortex_m0_decode(code, (uint32_t)(ip - code->operations));
    goto *labels[ip->kind];
op_LEAVE:
    SAVE_STATE;
    if (r[CORTEX_M0_PC] - code->base < code->size) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_FETCH, r[CORTEX_M0_PC] + 2u);
    }
    goto resume;
op_UNDEFINED:
    SAVE_STATE;
    return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_UNDEFINED, r[CORTEX_M0_PC]);
op_SPECIAL:
    SAVE_STATE;
    event = cortex_m0_execute_special(cpu);
    if (event) {
        return event;
    }
    goto resume;
op_NOP:
    NEXT(1);

op_MOVE:
    RESULT(RB);
op_LSL_I:
    c = RB >> (32u - ip->c) & 1u;
    RESULT(RB << ip->c);
op_LSR_I:
    c = RB >> (ip->c - 1u) & 1u;
    RESULT(RB >> ip->c);
op_ASR_I:
    c = RB >> (ip->c - 1u) & 1u;
    RESULT((uint32_t)((int32_t)RB >> ip->c));
op_LSR_32:
    c = RB >> 31;
    RESULT(0);
op_ASR_32:
    c = RB >> 31;
    RESULT(0u - c);
op_ADD_R:
    {
        ADD_FLAGS(RB, RC, 0u);
        RA = (uint32_t)sum_;
        NEXT(1);
    }
op_ADD_I:
    {
        ADD_FLAGS(RB, ip->value, 0u);
        RA = (uint32_t)sum_;
        NEXT(1);
    }
op_SUB_R:
    {
        SUBTRACT_FLAGS(RB, RC);
        RA = sum_;
        NEXT(1);
    }
op_SUB_I:
    {
        SUBTRACT_FLAGS(RB, ip->value);
        RA = sum_;
        NEXT(1);
    }
op_MOV_I:
    RESULT(ip->value);
op_CMP_I:
    {
        SUBTRACT_FLAGS(RB, ip->value);
        NEXT(1);
    }

op_AND:
    RESULT(RB & RC);
op_EOR:
    RESULT(RB ^ RC);
op_LSL_R:
    {
        const uint32_t shift = RC & 0xFFu;
        const uint64_t wide = shift < 64u ? (uint64_t)RB << shift : 0u;
        c = shift ? (uint32_t)(wide >> 32) & 1u : c;
        RESULT((uint32_t)wide);
    }
op_LSR_R:
    {
        const uint32_t shift = RC & 0xFFu;
        const uint64_t wide = shift < 64u ? (uint64_t)RB << 32 >> shift : 0u;
        c = shift ? (uint32_t)(wide >> 31) & 1u : c;
        RESULT((uint32_t)(wide >> 32));
    }
op_ASR_R:
    {
        const uint32_t shift = (RC & 0xFFu) < 32u ? RC & 0xFFu : 32u;
        const uint64_t wide = (uint64_t)((int64_t)((uint64_t)RB << 32) >> shift);
        c = shift ? (uint32_t)(wide >> 31) & 1u : c;
        RESULT((uint32_t)(wide >> 32));
    }
op_ROR:
    {
        const uint32_t shift = RC & 31u, rotated = RB >> shift | RB << ((32u - shift) & 31u);
        c = RC & 0xFFu ? rotated >> 31 : c;
        RESULT(rotated);
    }
op_ADC:
    {
        ADD_FLAGS(RB, RC, c);
        RA = (uint32_t)sum_;
        NEXT(1);
    }
op_SBC:
    {
        ADD_FLAGS(RB, ~RC, c);
        RA = (uint32_t)sum_;
        NEXT(1);
    }
op_RSB:
    {
        SUBTRACT_FLAGS(0u, RC);
        RA = sum_;
        NEXT(1);
    }
op_TST:
    SET_NZ(RB & RC);
    NEXT(1);
op_CMP_R:
    {
        SUBTRACT_FLAGS(RB, RC);
        NEXT(1);
    }
op_CMN:
    {
        ADD_FLAGS(RB, RC, 0u);
        NEXT(1);
    }
op_ORR:
    RESULT(RB | RC);
op_MUL:
    {
        const uint32_t product = RB * RC;
        SET_NZ(product);
        RA = product;
        NEXT(cpu->config.timing.multiply);
    }
op_BIC:
    RESULT(RB & ~RC);
op_MVN:
    RESULT(~RC);

op_ADD_ANY:
    RA += RB;
    NEXT(1);
op_MOV_ANY:
    RA = RB;
    NEXT(1);
op_LOAD_CONSTANT:
    RA = ip->value;
    NEXT(1);
op_ADD_TO_REGISTER:
    RA = RB + ip->value;
    NEXT(1);
op_SP_UP:
    r[CORTEX_M0_SP] += ip->value;
    NEXT(1);
op_SP_DOWN:
    cortex_m0_set_sp(cpu, r[CORTEX_M0_SP] - ip->value);
    NEXT(1);
op_SXTH:
    RA = (uint32_t)(int16_t)RB;
    NEXT(1);
op_SXTB:
    RA = (uint32_t)(int8_t)RB;
    NEXT(1);
op_UXTH:
    RA = (uint16_t)RB;
    NEXT(1);
op_UXTB:
    RA = (uint8_t)RB;
    NEXT(1);
op_REV:
    RA = __builtin_bswap32(RB);
    NEXT(1);
op_REV16:
    {
        const uint32_t swapped = __builtin_bswap32(RB);
        RA = swapped >> 16 | swapped << 16;
        NEXT(1);
    }
op_REVSH:
    RA = (uint32_t)(int16_t)__builtin_bswap16((uint16_t)RB);
    NEXT(1);

op_LDR_R:
    address = RB + RC;
    LOAD(uint32_t, uint32_t, 2);
op_LDRH_R:
    address = RB + RC;
    LOAD(uint16_t, uint16_t, 1);
op_LDRSH_R:
    address = RB + RC;
    LOAD(int16_t, int32_t, 1);
op_LDRB_R:
    address = RB + RC;
    LOAD(uint8_t, uint8_t, 0);
op_LDRSB_R:
    address = RB + RC;
    LOAD(int8_t, int32_t, 0);
op_LDR_I:
    address = RB + ip->value;
    LOAD(uint32_t, uint32_t, 2);
op_LDRH_I:
    address = RB + ip->value;
    LOAD(uint16_t, uint16_t, 1);
op_LDRB_I:
    address = RB + ip->value;
    LOAD(uint8_t, uint8_t, 0);
op_LDR_PC:
    address = ip->value;
    LOAD(uint32_t, uint32_t, 2);
op_STR_R:
    address = RB + RC;
    STORE(uint32_t, 2);
op_STRH_R:
    address = RB + RC;
    STORE(uint16_t, 1);
op_STRB_R:
    address = RB + RC;
    STORE(uint8_t, 0);
op_STR_I:
    address = RB + ip->value;
    STORE(uint32_t, 2);
op_STRH_I:
    address = RB + ip->value;
    STORE(uint16_t, 1);
op_STRB_I:
    address = RB + ip->value;
    STORE(uint8_t, 0);

op_PUSH:
    {
        address = r[CORTEX_M0_SP] - ip->c * 4u;
        LIST_IN_RAM;
        STORE_LIST
        cortex_m0_set_sp(cpu, address);
        NEXT(cycles_);
    }
op_POP:
    {
        address = r[CORTEX_M0_SP];
        LIST_IN_RAM;
        LOAD_LIST
        r[CORTEX_M0_SP] = address + ip->c * 4u;
        NEXT(cycles_);
    }
op_POP_PC:
    {
        address = r[CORTEX_M0_SP];
        LIST_IN_RAM;
        LOAD_LIST
        r[CORTEX_M0_SP] = address + ip->c * 4u;
        JUMP_TO_ADDRESS(cortex_m0_read_word(ram + offset_), cycles_);
    }
op_STM:
    {
        address = RB;
        LIST_IN_RAM;
        STORE_LIST
        RB = address + ip->c * 4u;
        NEXT(cycles_);
    }
op_LDM:
    {
        address = RB;
        LIST_IN_RAM;
        LOAD_LIST
        RB = address + ip->c * 4u;
        NEXT(cycles_);
    }
op_LDM_KEEP:
    {
        address = RB;
        LIST_IN_RAM;
        LOAD_LIST
        NEXT(cycles_);
    }

op_B:
    JUMP((int32_t)ip->value, 0);
op_BL:
    r[CORTEX_M0_LR] = (PC + 4u) | 1u;
    JUMP((int32_t)ip->value, 1);
op_BX:
    JUMP_TO_ADDRESS(RB, 0);
op_BLX:
    target = RB;
    r[CORTEX_M0_LR] = (PC + 2u) | 1u;
    JUMP_TO_ADDRESS(target, 0);
op_BEQ:
    BRANCH_IF(z == 0);
op_BNE:
    BRANCH_IF(z != 0);
op_BCS:
    BRANCH_IF(c);
op_BCC:
    BRANCH_IF(!c);
op_BMI:
    BRANCH_IF((int32_t)n < 0);
op_BPL:
    BRANCH_IF((int32_t)n >= 0);
op_BVS:
    BRANCH_IF((int32_t)v < 0);
op_BVC:
    BRANCH_IF((int32_t)v >= 0);
op_BHI:
    BRANCH_IF(c && z != 0);
op_BLS:
    BRANCH_IF(!c || z == 0);
op_BGE:
    BRANCH_IF((int32_t)(n ^ v) >= 0);
op_BLT:
    BRANCH_IF((int32_t)(n ^ v) < 0);
op_BGT:
    BRANCH_IF(z != 0 && (int32_t)(n ^ v) >= 0);
op_BLE:
    BRANCH_IF(z == 0 || (int32_t)(n ^ v) < 0);

slow_load:
    SAVE_STATE;
    event = cortex_m0_execute_load(cpu, *ip, address);
    if (event) {
        return event;
    }
    goto resume;
slow_store:
    SAVE_STATE;
    event = cortex_m0_execute_store(cpu, *ip, address);
    if (event) {
        return event;
    }
    goto resume;
slow_list:
    SAVE_STATE;
    event = cortex_m0_execute_list(cpu, *ip, address);
    if (event) {
        return event;
    }
    goto resume;
slow_branch:
    SAVE_STATE;
    event = cortex_m0_branch(cpu, target);
    if (event) {
        return event;
    }
    goto resume;
leave:
    SAVE_STATE;
    return CORTEX_M0_EVENT_NONE;
}
