/* Decoder from halfwords to operations. Instructions that are undefined or unpredictable in ARMv6-M (ARM DDI 0419)
 * become UNDEFINED. */
#include <stdlib.h>

#include "emulator/cortex_m0/internal.h"

#define OPERATION(name, ...) ((struct cortex_m0_operation){CORTEX_M0_OP_##name, __VA_ARGS__})
#define UNDEFINED OPERATION(UNDEFINED, 0, 0, 0, 0)
#define SPECIAL OPERATION(SPECIAL, 0, 0, 0, 0)

/* Return the field of `count` bits of `word` that begins at bit `low`. */
static uint8_t bits(uint32_t word, unsigned low, unsigned count)
{
    return (uint8_t)((word >> low) & ((1u << count) - 1u));
}

/* Return the number of registers in the register list of an instruction (one bit per register). */
static uint32_t registers_in(uint32_t list)
{
    return (uint32_t)__builtin_popcount(list);
}

/* Decode the 16-bit instructions that begin with 000 or 001: LSL, LSR, ASR by a constant; ADD and SUB of three
 * operands; MOV, CMP, ADD, SUB with an 8-bit constant. A shift by the encoded constant 0 is MOV or a shift by 32.
 * d, m: destination and first operand; wide_d: register of an instruction with an 8-bit constant; third: operand that
 * is a register or a constant. */
static struct cortex_m0_operation decode_arithmetic(uint32_t half)
{
    const uint8_t d = bits(half, 0, 3), m = bits(half, 3, 3), shift = bits(half, 6, 5), third = bits(half, 6, 3);
    const uint8_t wide_d = bits(half, 8, 3);
    switch (half >> 11) {
    case 0:
        return shift ? OPERATION(LSL_I, d, m, shift, 0) : OPERATION(MOVE, d, m, 0, 0);
    case 1:
        return shift ? OPERATION(LSR_I, d, m, shift, 0) : OPERATION(LSR_32, d, m, 0, 0);
    case 2:
        return shift ? OPERATION(ASR_I, d, m, shift, 0) : OPERATION(ASR_32, d, m, 0, 0);
    case 3:
        switch (bits(half, 9, 2)) {
        case 0:
            return OPERATION(ADD_R, d, m, third, 0);
        case 1:
            return OPERATION(SUB_R, d, m, third, 0);
        case 2:
            return OPERATION(ADD_I, d, m, 0, third);
        default:
            return OPERATION(SUB_I, d, m, 0, third);
        }
    case 4:
        return OPERATION(MOV_I, wide_d, 0, 0, half & 0xFFu);
    case 5:
        return OPERATION(CMP_I, 0, wide_d, 0, half & 0xFFu);
    case 6:
        return OPERATION(ADD_I, wide_d, wide_d, 0, half & 0xFFu);
    default:
        return OPERATION(SUB_I, wide_d, wide_d, 0, half & 0xFFu);
    }
}

/* Decode a data-processing instruction with two low registers (0100 00xx): the 4-bit opcode selects the operation, the
 * first operand is also the destination. */
static struct cortex_m0_operation decode_two_registers(uint32_t half)
{
    static const uint8_t kinds[16] = {
        CORTEX_M0_OP_AND,   CORTEX_M0_OP_EOR, CORTEX_M0_OP_LSL_R, CORTEX_M0_OP_LSR_R,
        CORTEX_M0_OP_ASR_R, CORTEX_M0_OP_ADC, CORTEX_M0_OP_SBC,   CORTEX_M0_OP_ROR,
        CORTEX_M0_OP_TST,   CORTEX_M0_OP_RSB, CORTEX_M0_OP_CMP_R, CORTEX_M0_OP_CMN,
        CORTEX_M0_OP_ORR,   CORTEX_M0_OP_MUL, CORTEX_M0_OP_BIC,   CORTEX_M0_OP_MVN,
    };
    const uint8_t d = bits(half, 0, 3), m = bits(half, 3, 3);
    return (struct cortex_m0_operation){kinds[bits(half, 6, 4)], d, d, m, 0};
}

/* Decode ADD, CMP and MOV with any of the 16 registers, BX and BLX. ADD and MOV that write PC or SP or read PC are
 * SPECIAL. */
static struct cortex_m0_operation decode_any_registers(uint32_t half)
{
    const uint8_t d = (uint8_t)(bits(half, 0, 3) | (half >> 4 & 8u)), m = bits(half, 3, 4);
    const bool uses_general_registers = d != CORTEX_M0_SP && d != CORTEX_M0_PC && m != CORTEX_M0_PC;
    switch (bits(half, 8, 2)) {
    case 0:
        if (d == CORTEX_M0_PC && m == CORTEX_M0_PC) {
            return UNDEFINED;
        }
        return uses_general_registers ? OPERATION(ADD_ANY, d, m, 0, 0) : SPECIAL;
    case 1:
        if ((d < 8 && m < 8) || d == CORTEX_M0_PC || m == CORTEX_M0_PC) {
            return UNDEFINED;
        }
        return OPERATION(CMP_R, 0, d, m, 0);
    case 2:
        return uses_general_registers ? OPERATION(MOV_ANY, d, m, 0, 0) : SPECIAL;
    default:
        if (m == CORTEX_M0_PC || bits(half, 0, 3)) {
            return UNDEFINED;
        }
        return bits(half, 7, 1) ? OPERATION(BLX, 0, m, 0, 0) : OPERATION(BX, 0, m, 0, 0);
    }
}

/* Decode LDR, STR and their byte and halfword forms with a register offset, an immediate offset or an SP-relative
 * offset. */
static struct cortex_m0_operation decode_load_store(uint32_t half)
{
    const uint8_t t = bits(half, 0, 3), n = bits(half, 3, 3), m = bits(half, 6, 3), offset = bits(half, 6, 5);
    const uint8_t wide_t = bits(half, 8, 3);
    const uint32_t wide_offset = (half & 0xFFu) * 4u;
    if (half >> 12 == 5) {
        return (struct cortex_m0_operation){(uint8_t)(CORTEX_M0_OP_STR_R + bits(half, 9, 3)), t, n, m, 0};
    }
    switch (half >> 11) {
    case 12:
        return OPERATION(STR_I, t, n, 0, offset * 4u);
    case 13:
        return OPERATION(LDR_I, t, n, 0, offset * 4u);
    case 14:
        return OPERATION(STRB_I, t, n, 0, offset);
    case 15:
        return OPERATION(LDRB_I, t, n, 0, offset);
    case 16:
        return OPERATION(STRH_I, t, n, 0, offset * 2u);
    case 17:
        return OPERATION(LDRH_I, t, n, 0, offset * 2u);
    case 18:
        return OPERATION(STR_I, wide_t, CORTEX_M0_SP, 0, wide_offset);
    default:
        return OPERATION(LDR_I, wide_t, CORTEX_M0_SP, 0, wide_offset);
    }
}

/* Decode NOP, YIELD, WFE, WFI and SEV. The encodings of IT, which ARMv6-M does not have, are undefined. */
static struct cortex_m0_operation decode_hint(uint32_t half)
{
    if (half & 0xFu) {
        return UNDEFINED; /* IT */
    }
    const uint8_t hint = bits(half, 4, 4);
    return hint >= 2 && hint <= 4 ? SPECIAL : OPERATION(NOP, 0, 0, 0, 0); /* WFE, WFI, SEV */
}

/* Decode PUSH and POP; bit 8 adds LR to a PUSH and PC to a POP. An empty register list is unpredictable. */
static struct cortex_m0_operation decode_push_pop(uint32_t half)
{
    const bool special = bits(half, 8, 1);
    const uint32_t list = half & 0xFFu;
    const uint8_t count = (uint8_t)(registers_in(list) + special);
    if (!count) {
        return UNDEFINED;
    }
    if (!bits(half, 11, 1)) {
        return OPERATION(PUSH, 0, 0, count, list | (special ? 1u << CORTEX_M0_LR : 0u));
    }
    return special ? OPERATION(POP_PC, 0, 0, count, list) : OPERATION(POP, 0, 0, count, list);
}

/* Decode the instructions that begin with 1011: SP adjustment, sign and zero extension, byte reversal, PUSH and POP,
 * CPS, BKPT and hints. */
static struct cortex_m0_operation decode_miscellaneous(uint32_t half)
{
    static const uint8_t extend[4] = {CORTEX_M0_OP_SXTH, CORTEX_M0_OP_SXTB, CORTEX_M0_OP_UXTH, CORTEX_M0_OP_UXTB};
    static const uint8_t reverse[4] = {CORTEX_M0_OP_REV, CORTEX_M0_OP_REV16, CORTEX_M0_OP_UNDEFINED,
                                       CORTEX_M0_OP_REVSH};
    const uint8_t d = bits(half, 0, 3), m = bits(half, 3, 3);
    switch (bits(half, 8, 4)) {
    case 0x0:
        return bits(half, 7, 1) ? OPERATION(SP_DOWN, 0, 0, 0, (half & 0x7Fu) * 4u)
                                : OPERATION(SP_UP, 0, 0, 0, (half & 0x7Fu) * 4u);
    case 0x2:
        return (struct cortex_m0_operation){extend[bits(half, 6, 2)], d, m, 0, 0};
    case 0x4:
    case 0x5:
    case 0xC:
    case 0xD:
        return decode_push_pop(half);
    case 0x6:
        return (half & ~0x10u) == 0xB662u ? SPECIAL : UNDEFINED; /* CPS */
    case 0xA:
        return (struct cortex_m0_operation){reverse[bits(half, 6, 2)], d, m, 0, 0};
    case 0xE:
        return SPECIAL; /* BKPT */
    case 0xF:
        return decode_hint(half);
    default:
        return UNDEFINED;
    }
}

/* Decode LDM and STM of a register list. LDM does not write back a base register that is in the list. */
static struct cortex_m0_operation decode_multiple(uint32_t half)
{
    const uint8_t n = bits(half, 8, 3);
    const uint32_t list = half & 0xFFu;
    const uint8_t count = (uint8_t)registers_in(list);
    if (!count) {
        return UNDEFINED;
    }
    if (!bits(half, 11, 1)) {
        return OPERATION(STM, 0, n, count, list);
    }
    return list >> n & 1u ? OPERATION(LDM_KEEP, 0, n, count, list) : OPERATION(LDM, 0, n, count, list);
}

/* Return the branch operation (number `kind`) to a target within the same memory, as a number of operations to skip.
 * Other targets become SPECIAL, which handles branches out of the memory. index: halfword number of the branch. offset:
 * bytes from the branch plus 4. */
static struct cortex_m0_operation decode_branch(const struct cortex_m0_code *code, uint32_t index, uint8_t kind,
                                                int32_t offset)
{
    const int64_t target = (int64_t)index * 2 + 4 + offset;
    if (target < 0 || target >= code->size) {
        return SPECIAL;
    }
    return (struct cortex_m0_operation){kind, 0, 0, 0, (uint32_t)(target / 2 - index)};
}

/* Decode a 32-bit instruction from both halfwords: BL, MSR, MRS and the barriers are the only ones of ARMv6-M. */
static struct cortex_m0_operation decode_wide(const struct cortex_m0_code *code, uint32_t index, uint32_t half)
{
    if (index * 2u + 4u > code->size) {
        return OPERATION(LEAVE, 0, 0, 0, 0); /* the second halfword lies outside the memory */
    }
    const uint32_t second = cortex_m0_read_half(code->bytes + index * 2u + 2u);
    if (half >> 11 != 0x1Eu || second < 0x8000u) {
        return UNDEFINED;
    }
    if ((second & 0xD000u) == 0xD000u) {
        return decode_branch(code, index, CORTEX_M0_OP_BL, cortex_m0_link_offset(half, second));
    }
    const bool msr = (half & 0xFFF0u) == 0xF380u && (second & 0xFF00u) == 0x8800u;
    const bool mrs = half == 0xF3EFu && (second & 0xF000u) == 0x8000u;
    const bool barrier = half == 0xF3BFu && second >= 0x8F40u && second < 0x8F70u; /* 0x8F4x DSB, 5x DMB, 6x ISB */
    return msr || mrs || barrier ? SPECIAL : UNDEFINED;
}

/* Decode the instruction whose first halfword is `half`, at halfword number `index` of the memory, by its top four bits
 * (ARM DDI 0419, A5.2). */
static struct cortex_m0_operation decode_half(const struct cortex_m0_code *code, uint32_t index, uint32_t half)
{
    const uint8_t d = bits(half, 8, 3);
    const uint32_t offset = (half & 0xFFu) * 4u, pc = (code->base + index * 2u + 4u) & ~UINT32_C(3);
    switch (half >> 12) {
    case 0x0:
    case 0x1:
    case 0x2:
    case 0x3:
        return decode_arithmetic(half);
    case 0x4:
        if (bits(half, 11, 1)) {
            return OPERATION(LDR_PC, d, 0, 0, pc + offset);
        }
        return bits(half, 10, 1) ? decode_any_registers(half) : decode_two_registers(half);
    case 0xA:
        return bits(half, 11, 1) ? OPERATION(ADD_TO_REGISTER, d, CORTEX_M0_SP, 0, offset)
                                 : OPERATION(LOAD_CONSTANT, d, 0, 0, pc + offset);
    case 0xB:
        return decode_miscellaneous(half);
    case 0xC:
        return decode_multiple(half);
    case 0xD:
        if (bits(half, 8, 4) >= 14) {
            return bits(half, 8, 1) ? SPECIAL : UNDEFINED; /* SVC, UDF */
        }
        return decode_branch(code, index, (uint8_t)(CORTEX_M0_OP_BEQ + bits(half, 8, 4)),
                             cortex_m0_sign_extend(half & 0xFFu, 8) * 2);
    case 0xE:
        if (!bits(half, 11, 1)) {
            return decode_branch(code, index, CORTEX_M0_OP_B, cortex_m0_sign_extend(half & 0x7FFu, 11) * 2);
        }
        return decode_wide(code, index, half);
    case 0xF:
        return decode_wide(code, index, half);
    default:
        return decode_load_store(half);
    }
}

/* Decode the instruction at halfword number `index` and extend the range of decoded instructions, which a later store
 * must invalidate. */
void cortex_m0_decode(struct cortex_m0_code *code, uint32_t index)
{
    const uint32_t offset = index * 2u;
    code->operations[index] = decode_half(code, index, cortex_m0_read_half(code->bytes + offset));
    const uint32_t word = offset & ~UINT32_C(3), end = offset + 4u < code->size ? offset + 4u : code->size;
    /* a word store may begin at the lower halfword */
    code->decoded_low = word < code->decoded_low ? word : code->decoded_low;
    code->decoded_high = end > code->decoded_high ? end : code->decoded_high; /* as if the instruction had 32 bits */
}

/* Allocate one operation per halfword of an executable memory, all still to be decoded, and a last operation that
 * leaves the memory. Returns -1 if out of memory or if base or size is not a multiple of 4. */
int cortex_m0_code_open(struct cortex_m0_code *code, const uint8_t *bytes, uint32_t base, uint32_t size)
{
    if (size % 4u || base % 4u || (size && !bytes)) {
        return -1;
    }
    const size_t count = size / 2u;
    *code = (struct cortex_m0_code){.bytes = bytes, .base = base, .size = size, .decoded_low = UINT32_MAX};
    code->operations = calloc(count + 1u, sizeof *code->operations);
    if (!code->operations) {
        return -1;
    }
    code->operations[count].kind = CORTEX_M0_OP_LEAVE;
    return 0;
}
