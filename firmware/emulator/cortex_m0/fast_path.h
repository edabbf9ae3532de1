/* Building blocks of the operations in execute.c. All macros use the local variables of cortex_m0_execute(). */
#ifndef CORTEX_M0_FAST_PATH_H
#define CORTEX_M0_FAST_PATH_H

#include "emulator/cortex_m0/internal.h"

#define UNLIKELY CORTEX_M0_UNLIKELY

#define RA r[ip->a]
#define RB r[ip->b]
#define RC r[ip->c]
#define PC (code->base + (uint32_t)(ip - code->operations) * 2u)

#define NEXT(cycles) \
    do { \
        ip++; \
        budget -= (cycles); \
        if (UNLIKELY(budget <= 0)) { \
            goto leave; \
        } \
        goto *labels[ip->kind]; \
    } while (0)

/* Branch within the memory. extra: cycles beyond those of a taken branch. */
#define JUMP(operations, extra) \
    do { \
        ip += (operations); \
        budget -= (int64_t)refill + taken + (extra); \
        if (UNLIKELY(budget <= 0)) { \
            goto leave; \
        } \
        goto *labels[ip->kind]; \
    } while (0)

#define BRANCH_IF(condition) \
    do { \
        if (condition) { \
            JUMP((int32_t)ip->value, 0); \
        } \
        NEXT(1); \
    } while (0)

/* Branch to an address with the Thumb bit set. Targets in another memory, or outside Thumb state, take the slow path.
 * extra: cycles beyond those of a taken branch. */
#define JUMP_TO_ADDRESS(address, extra) \
    do { \
        target = (address); \
        const uint32_t offset_from_base_ = target - 1u - code->base; \
        budget -= (int64_t)taken + (extra); \
        if (UNLIKELY(ROTATED(offset_from_base_, 1) >= code->size >> 1)) { \
            goto slow_branch; \
        } \
        ip = code->operations + (offset_from_base_ >> 1); \
        budget -= refill; \
        if (UNLIKELY(budget <= 0)) { \
            goto leave; \
        } \
        goto *labels[ip->kind]; \
    } while (0)

#define SET_NZ(result) (n = z = (result))

#define RESULT(value) \
    do { \
        const uint32_t result_ = (value); \
        SET_NZ(result_); \
        RA = result_; \
        NEXT(1); \
    } while (0)

/* x + y + carry with all flags; the result is in sum_. */
#define ADD_FLAGS(x, y, carry) \
    const uint32_t x_ = (x), y_ = (y); \
    const uint64_t sum_ = (uint64_t)x_ + y_ + (carry); \
    SET_NZ((uint32_t)sum_); \
    c = (uint32_t)(sum_ >> 32); \
    v = (x_ ^ (uint32_t)sum_) & (y_ ^ (uint32_t)sum_)

#define SUBTRACT_FLAGS(x, y) \
    const uint32_t x_ = (x), y_ = (y), sum_ = x_ - y_; \
    SET_NZ(sum_); \
    c = x_ >= y_; \
    v = (x_ ^ y_) & (x_ ^ sum_)

/* The rotation maps an aligned offset to a small number and any other offset to a huge number, so that one comparison
 * checks both alignment and bounds. */
#define ROTATED(offset, shift) ((shift) ? (offset) >> (shift) | (offset) << ((32 - (shift)) & 31) : (offset))

#define LOAD(type, extended, shift) \
    do { \
        type loaded_; \
        const uint32_t offset_ = address - ram_base; \
        if (!UNLIKELY(ROTATED(offset_, shift) >= ram_size >> (shift))) { \
            memcpy(&loaded_, ram + offset_, sizeof loaded_); \
        } else { \
            const uint32_t flash_offset_ = address - cpu->flash_code.base; \
            if (UNLIKELY(ROTATED(flash_offset_, shift) >= cpu->flash_code.size >> (shift))) { \
                goto slow_load; \
            } \
            memcpy(&loaded_, cpu->flash_code.bytes + flash_offset_, sizeof loaded_); \
            budget -= cpu->flash_code.refill; \
        } \
        RA = (uint32_t)(extended)loaded_; \
        NEXT(2); \
    } while (0)

#define STORE(type, shift) \
    do { \
        const type stored_ = (type)RA; \
        const uint32_t offset_ = address - ram_base; \
        if (UNLIKELY(ROTATED(offset_, shift) >= ram_size >> (shift))) { \
            goto slow_store; \
        } \
        memcpy(ram + offset_, &stored_, sizeof stored_); \
        if (UNLIKELY(offset_ >= cpu->ram_code.decoded_low && offset_ < cpu->ram_code.decoded_high)) { \
            cortex_m0_invalidate_code(&cpu->ram_code, offset_, sizeof stored_); \
        } \
        NEXT(2); \
    } while (0)

/* Register list of `ip->c` words in RAM from `address` on; other addresses take the slow path. If the budget ends
 * within the list, an interrupt abandons the instruction (DDI 0432C); otherwise the next run continues the list. */
#define LIST_IN_RAM \
    uint32_t offset_ = address - ram_base; \
    if (UNLIKELY(address % 4u || offset_ >= ram_size || offset_ + ip->c * 4u > ram_size)) { \
        goto slow_list; \
    } \
    const int64_t cycles_ = 1 + (int64_t)ip->c - cpu->progress; \
    if (UNLIKELY(budget < cycles_)) { \
        cpu->progress += (uint32_t)budget; \
        budget = 0; \
        goto leave; \
    } \
    cpu->progress = 0

#define LIST_REGISTERS(action) \
    for (uint32_t list_ = ip->value; list_; list_ &= list_ - 1u, offset_ += 4u) { \
        uint32_t *const register_ = &r[__builtin_ctz(list_)]; \
        action; \
    }

#define LOAD_LIST LIST_REGISTERS(memcpy(register_, ram + offset_, 4))
#define STORE_LIST \
    if (UNLIKELY(offset_ < cpu->ram_code.decoded_high && offset_ + ip->c * 4u > cpu->ram_code.decoded_low)) { \
        cortex_m0_invalidate_code(&cpu->ram_code, offset_, ip->c * 4u); \
    } \
    LIST_REGISTERS(memcpy(ram + offset_, register_, 4))

#define SAVE_STATE \
    do { \
        r[CORTEX_M0_PC] = PC; \
        cpu->n = n; \
        cpu->z = z; \
        cpu->c = c; \
        cpu->v = v; \
        cpu->cycle = cpu->deadline - (uint64_t)budget; \
    } while (0)

#endif
