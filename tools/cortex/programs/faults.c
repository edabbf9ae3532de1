/* Raises every fault once and prints its frame: the address relative to the instruction, LR and xPSR; then returns from
 * the fault. */
#include "image.h"

struct frame {
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
};

static volatile uint32_t faults, return_address, hide_address;
static uint32_t word = 0x12345678u;

/* Print the frame that the processor stacked for a fault, then change it so that the handler returns to the instruction
 * after the faulting one, in Thumb state. */
__attribute__((used)) static void report(struct frame *frame, uint32_t exc_return)
{
    faults++;
    put_word("  r0", frame->r0);
    put_word("  r1", frame->r1);
    put_word("  address", hide_address ? 0 : frame->pc - (return_address & ~15u));
    put_word("  xPSR", frame->xpsr);
    put_word("  EXC_RETURN", exc_return);
    frame->pc = return_address;
    frame->xpsr |= 1u << 24;
}

/* HardFault handler: passes the stacked frame and EXC_RETURN to report(). Naked, because a compiled prologue would move
 * the stack pointer. */
__attribute__((naked)) void on_hard_fault(void)
{
    __asm__ volatile("mov r0, sp\n\t"
                     "mov r1, lr\n\t"
                     "push {r0, lr}\n\t"
                     "bl report\n\t"
                     "pop {r0, pc}");
}

/* The instruction lies at a multiple of 16. After the fault, execution continues at the end of the instruction. */
#define TRY(name, r0_value, instruction) \
    do { \
        register uint32_t r0 __asm__("r0") = (uint32_t)(r0_value); \
        register uint32_t r1 __asm__("r1") = 0x11111111u; \
        put_text(name "\n"); \
        r0 = (uint32_t)(r0_value); \
        r1 = 0x11111111u; \
        __asm__ volatile("ldr r2, =return_address\n\t" \
                         "ldr r3, =1f\n\t" \
                         "str r3, [r2]\n\t" \
                         "movs r2, #0\n\t" \
                         "b 2f\n\t" \
                         ".align 4\n\t" \
                         "2: " instruction "\n\t" \
                         "1: nop\n\t" \
                         "b 3f\n\t" \
                         ".ltorg\n\t" \
                         "3:" \
                         : "+r"(r0), "+r"(r1) \
                         : \
                         : "r2", "r3", "lr", "cc", "memory"); \
        put_word("  after r0", r0); \
        put_word("  after r1", r1); \
    } while (0)

/* Execute each kind of instruction that can fault, once, and print the resulting frames for comparison with QEMU. */
int main(void)
{
    const uint32_t address = (uint32_t)&word;
    TRY("no fault", address, "ldr r1, [r0]");
    TRY("LDR at 1", address + 1, "ldr r1, [r0]");
    TRY("LDR at 2", address + 2, "ldr r1, [r0]");
    TRY("LDRH at 1", address + 1, "ldrh r1, [r0]");
    TRY("LDRSH at 3", address + 3, "ldrsh r1, [r0, r2]");
    TRY("STR at 1", address + 1, "str r1, [r0]");
    TRY("STRH at 1", address + 1, "strh r1, [r0]");
    TRY("LDM at 2", address + 2, "ldm r0!, {r1}");
    TRY("STM at 2", address + 2, "stm r0!, {r1}");
    TRY("LDR from an unmapped address", 0x70000000u, "ldr r1, [r0]");
    TRY("STRB to an unmapped address", 0x70000000u, "strb r1, [r0]");
    TRY("UDF", 0, "udf #0");
    TRY("UDF.W", 0, ".hword 0xF7F0, 0xA000");
    TRY("MOVW", 0, ".hword 0xF240, 0x0000");
    TRY("MLA", 0, ".hword 0xFB00, 0x0000");
    TRY("B.W", 0, ".hword 0xF000, 0xB800");
    TRY("LDR.W", address, ".hword 0xF8D0, 0x1000");
    TRY("undefined 16 bit", 0, ".hword 0xB800");
    hide_address = 1; /* the manual specifies the address of the SVC, QEMU reports the following address */
    TRY("masked SVC", 0, "cpsid i\n\tsvc #0");
    __asm__ volatile("cpsie i");
    put_word("faults", faults);
    put_word("word", word);
    return 0;
}
