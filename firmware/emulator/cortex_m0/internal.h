/* Declarations shared by the sources of the processor. */
#ifndef CORTEX_M0_INTERNAL_H
#define CORTEX_M0_INTERNAL_H

#include <string.h>

#include "emulator/cortex_m0/cortex_m0.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "image words are loaded with the byte order of the host");

#define CORTEX_M0_UNLIKELY(condition) __builtin_expect((condition), 0)

#define CORTEX_M0_SP 13u
#define CORTEX_M0_LR 14u
#define CORTEX_M0_PC 15u

#define CORTEX_M0_PRIORITY_THREAD 4
#define CORTEX_M0_PRIORITY_HARD_FAULT (-1)
#define CORTEX_M0_PRIORITY_NMI (-2)

#define CORTEX_M0_BIT(number) (UINT64_C(1) << (number))

/* Decoded operations, in the order of execute.c. Most are instructions of the manual; instructions that differ only in
 * the position of their operands share an operation. */
/* clang-format off */
#define CORTEX_M0_OPERATIONS(X) \
    X(DECODE) X(LEAVE) X(UNDEFINED) X(SPECIAL) X(NOP) \
    X(MOVE) X(LSL_I) X(LSR_I) X(ASR_I) X(LSR_32) X(ASR_32) X(ADD_R) X(SUB_R) X(ADD_I) X(SUB_I) X(MOV_I) X(CMP_I) \
    X(AND) X(EOR) X(LSL_R) X(LSR_R) X(ASR_R) X(ADC) X(SBC) X(ROR) X(TST) X(RSB) X(CMP_R) X(CMN) X(ORR) X(MUL) X(BIC) X(MVN) \
    X(ADD_ANY) X(MOV_ANY) X(BX) X(BLX) X(LOAD_CONSTANT) X(ADD_TO_REGISTER) X(SP_UP) X(SP_DOWN) \
    X(STR_R) X(STRH_R) X(STRB_R) X(LDRSB_R) X(LDR_R) X(LDRH_R) X(LDRB_R) X(LDRSH_R) \
    X(STR_I) X(LDR_I) X(STRB_I) X(LDRB_I) X(STRH_I) X(LDRH_I) X(LDR_PC) \
    X(SXTH) X(SXTB) X(UXTH) X(UXTB) X(REV) X(REV16) X(REVSH) \
    X(PUSH) X(POP) X(POP_PC) X(STM) X(LDM) X(LDM_KEEP) \
    X(B) X(BL) X(BEQ) X(BNE) X(BCS) X(BCC) X(BMI) X(BPL) X(BVS) X(BVC) X(BHI) X(BLS) X(BGE) X(BLT) X(BGT) X(BLE)
/* clang-format on */

enum cortex_m0_code_operation {
#define CORTEX_M0_OPERATION(name) CORTEX_M0_OP_##name,
    CORTEX_M0_OPERATIONS(CORTEX_M0_OPERATION)
#undef CORTEX_M0_OPERATION
};

/* One decoded halfword of memory. `kind` 0: not decoded yet. */
struct cortex_m0_operation {
    uint8_t kind;
    uint8_t a, b, c; /* register numbers, shifts or counts, see decode.c */
    uint32_t value;  /* constant; for branches: number of operations to skip (signed) */
};

/* Event that ended cortex_m0_execute(). */
enum cortex_m0_event {
    CORTEX_M0_EVENT_NONE,  /* deadline reached, or `attention` set */
    CORTEX_M0_EVENT_FAULT, /* described in cpu->fault; r[15] is the address of the instruction */
    CORTEX_M0_EVENT_SVC,
    CORTEX_M0_EVENT_EXIT, /* branch to EXC_RETURN in cpu->exit_value */
    CORTEX_M0_EVENT_BUS_RETRY,
    CORTEX_M0_EVENT_BREAKPOINT,
};

/* execute.c: execute from r[15] until the deadline or an event. */
enum cortex_m0_event cortex_m0_execute(struct cortex_m0 *cpu);
/* special_instructions.c: execute the instruction at r[15] if the fast path does not implement it. */
enum cortex_m0_event cortex_m0_execute_special(struct cortex_m0 *cpu);

/* slow_path.c: accesses and branches that the fast path does not finish. r[15] is the address of the instruction,
 * cpu->cycle the cycle in which it begins. */
enum cortex_m0_event cortex_m0_execute_load(struct cortex_m0 *cpu, struct cortex_m0_operation operation,
                                            uint32_t address);
enum cortex_m0_event cortex_m0_execute_store(struct cortex_m0 *cpu, struct cortex_m0_operation operation,
                                             uint32_t address);
enum cortex_m0_event cortex_m0_execute_list(struct cortex_m0 *cpu, struct cortex_m0_operation operation,
                                            uint32_t address);
enum cortex_m0_event cortex_m0_branch(struct cortex_m0 *cpu, uint32_t target);
void cortex_m0_set_fetch_address(struct cortex_m0 *cpu, uint32_t address);
struct cortex_m0_code *cortex_m0_code_at(struct cortex_m0 *cpu, uint32_t address); /* NULL: not executable */

/* decode.c: decode the operation at `index` and extend the decoded range. */
void cortex_m0_decode(struct cortex_m0_code *code, uint32_t index);
int cortex_m0_code_open(struct cortex_m0_code *code, const uint8_t *bytes, uint32_t base, uint32_t size);

/* memory.c: access of any size at any address. Returns EVENT_NONE, EVENT_FAULT or EVENT_BUS_RETRY and adds stalls to
 * cpu->cycle, which is the cycle before the data phase. `can_retry`: whether the callback may return CORTEX_M0_RETRY.
 */
enum cortex_m0_event cortex_m0_read(struct cortex_m0 *cpu, uint32_t address, unsigned size, bool can_retry,
                                    uint32_t *value);
enum cortex_m0_event cortex_m0_write(struct cortex_m0 *cpu, uint32_t address, unsigned size, bool can_retry,
                                     uint32_t value);
enum cortex_m0_event cortex_m0_record_fault(struct cortex_m0 *cpu, enum cortex_m0_fault_kind kind, uint32_t address);
/* Discard the operations decoded from [offset, offset + size). */
void cortex_m0_invalidate_code(struct cortex_m0_code *code, uint32_t offset, uint32_t size);

/* system.c: the system control space, 0xE000E000. */
uint32_t cortex_m0_system_read(struct cortex_m0 *cpu, uint32_t offset, uint64_t cycle);
void cortex_m0_system_write(struct cortex_m0 *cpu, uint32_t offset, uint64_t cycle, uint32_t value);

/* systick.c */
void cortex_m0_systick_settle(struct cortex_m0 *cpu, uint64_t cycle);
uint64_t cortex_m0_systick_due(const struct cortex_m0 *cpu); /* cycle in which it becomes pending; UINT64_MAX: never */
uint32_t cortex_m0_systick_control(const struct cortex_m0 *cpu);
void cortex_m0_systick_set_control(struct cortex_m0 *cpu, uint32_t value);
void cortex_m0_systick_pause(struct cortex_m0 *cpu, uint64_t cycles); /* stop its clock for `cycles` */

/* nvic.c */
void cortex_m0_reset_nvic(struct cortex_m0 *cpu);
void cortex_m0_set_pending(struct cortex_m0 *cpu, unsigned number, uint64_t cycle);
/* Return the next exception to be taken whose priority is higher (numerically lower) than `priority`; 0: none. */
unsigned cortex_m0_next_exception(const struct cortex_m0 *cpu, int priority);
int cortex_m0_priority_of(const struct cortex_m0 *cpu, unsigned number);
int cortex_m0_priority_unmasked(const struct cortex_m0 *cpu); /* execution priority with PRIMASK ignored */
void cortex_m0_update_priority(struct cortex_m0 *cpu);
void cortex_m0_set_level(struct cortex_m0 *cpu, unsigned number, unsigned level);
unsigned cortex_m0_level_of(const struct cortex_m0 *cpu, unsigned number);

/* exceptions.c */
void cortex_m0_begin_entry(struct cortex_m0 *cpu);
void cortex_m0_finish_entry(struct cortex_m0 *cpu);
enum cortex_m0_event cortex_m0_leave_exception(struct cortex_m0 *cpu);
void cortex_m0_take_fault(struct cortex_m0 *cpu);
void cortex_m0_lock_up(struct cortex_m0 *cpu);

/* registers.c */
void cortex_m0_use_stack(struct cortex_m0 *cpu, bool process);
bool cortex_m0_condition(const struct cortex_m0 *cpu, unsigned condition);

/* cortex_m0.c */
void cortex_m0_sleep(struct cortex_m0 *cpu, bool wakes_on_event);

/* account.c */
void cortex_m0_account_begin(struct cortex_m0 *cpu, unsigned number, uint64_t begin);
void cortex_m0_account_end(struct cortex_m0 *cpu, unsigned number, uint64_t end);

/* Set the stack pointer, whose bits 1:0 are always 0. */
static inline void cortex_m0_set_sp(struct cortex_m0 *cpu, uint32_t value)
{
    cpu->r[CORTEX_M0_SP] = value & ~UINT32_C(3);
    if (cpu->r[CORTEX_M0_SP] < cpu->lowest_sp) {
        cpu->lowest_sp = cpu->r[CORTEX_M0_SP];
    }
}

/* Sign-extend a two's complement number of `width` bits. */
static inline int32_t cortex_m0_sign_extend(uint32_t value, unsigned width)
{
    const uint32_t sign = 1u << (width - 1u);
    return (int32_t)((value ^ sign) - sign);
}

/* Return the offset of BL from its two halfwords: S, I1, I2 (J1 and J2, inverted where S is 0), imm10, imm11. */
static inline int32_t cortex_m0_link_offset(uint32_t half, uint32_t second)
{
    const uint32_t sign = half >> 10 & 1u, i1 = ~(second >> 13 ^ sign) & 1u, i2 = ~(second >> 11 ^ sign) & 1u;
    return cortex_m0_sign_extend(sign << 24 | i1 << 23 | i2 << 22 | (half & 0x3FFu) << 12 | (second & 0x7FFu) << 1, 25);
}

/* Return the halfword at `bytes`. */
static inline uint32_t cortex_m0_read_half(const uint8_t *bytes)
{
    uint16_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Return the word at `bytes`. */
static inline uint32_t cortex_m0_read_word(const uint8_t *bytes)
{
    uint32_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

#endif
