#include "boards/psoc4/fault.h"

#include <stdint.h>

#include "boards/psoc4/regs/core.h"
#include "generated/taxel_protocol.h"

/* The fault record as a host reads it, in words, because a hub has little flash. This processor is little-endian. */
struct fault_memory {
    uint32_t head; /* code, exception, count */
    uint32_t program_counter;
    uint32_t link_register;
    uint32_t check; /* of the other members: after a power-on the content of RAM is undefined */
};

_Static_assert(TAXEL_FAULT_RECORD_OFFSET_CODE == 0u && TAXEL_FAULT_RECORD_OFFSET_EXCEPTION == 1u &&
                   TAXEL_FAULT_RECORD_OFFSET_COUNT == 2u,
               "the word `head` holds these fields");
_Static_assert(TAXEL_FAULT_RECORD_OFFSET_PROGRAM_COUNTER == 4u && TAXEL_FAULT_RECORD_OFFSET_LINK_REGISTER == 8u &&
                   TAXEL_FAULT_RECORD_SIZE == 12u,
               "the words follow each other");

/* At an address that neither the bootloader nor the start-up code of an application writes (image.ld.in). */
static struct fault_memory fault __attribute__((section(".noinit.fault"), used));

#define CHECK 0x5Au /* a number of 8 bits takes less code; neither zeros nor ones are a valid record */
#define COUNT_ONE 0x10000u
#define EXCEPTION_SHIFT 8u

/* registers that the processor stores on the stack at an exception: r0 to r3, r12, LR, PC, xPSR */
#define FRAME_LINK_REGISTER 5u
#define FRAME_PROGRAM_COUNTER 6u

/* Return the sum of the members of the record: CHECK if the record is valid. */
static uint32_t sum(void)
{
    return fault.head + fault.program_counter + fault.link_register + fault.check;
}

/* Store a fault in the record and count it (bits 16 and higher of `head`). `kind`: fault code, and the number of the
 * exception in bits 8 to 15; `program_counter` and `link_register`: registers of the interrupted code, or 0. */
static void store(uint32_t kind, uint32_t program_counter, uint32_t link_register)
{
    fault.head = (fault.head / COUNT_ONE + 1u) * COUNT_ONE + kind;
    fault.program_counter = program_counter;
    fault.link_register = link_register;
    fault.check += CHECK - sum(); /* makes sum() return CHECK, the mark of a valid record */
}

/* Check the record after a reset, and empty it if it is invalid, as after a power-on. */
void fault_init(void)
{
    if (sum() != CHECK) {
        fault = (struct fault_memory){.check = CHECK};
    }
}

void fault_store_not_scanning(void)
{
    store(TAXEL_FAULT_CODE_NOT_SCANNING, 0, 0);
}

void fault_take_exception(const uint32_t *frame);
/* Store an exception in the record and wait for the reset by the watchdog, after which the bootloader listens for a
 * host. `frame`: the stack at the entry of the handler. If the stack pointer does not point to RAM, the processor locks
 * up and resets at once; such a fault is visible only as the reset cause. */
__attribute__((used, noreturn)) void fault_take_exception(const uint32_t *frame)
{
    store(TAXEL_FAULT_CODE_EXCEPTION + (current_exception() << EXCEPTION_SHIFT), frame[FRAME_PROGRAM_COUNTER],
          frame[FRAME_LINK_REGISTER]);
    for (;;) {
    }
}
