/* CPU subsystem: location of the vector table, and system calls into the supervisory ROM. */
#include "emulator/psoc4/internal.h"

#define CONFIG 0x0u
#define SYSREQ 0x4u
#define SYSARG 0x8u
#define FLASH_CTL 0x30u /* PSoC 4100S */
#define WAIT_STATES 3u
#define PREFETCH (1u << 4)
#define VECS_IN_RAM 1u
#define START (1u << 31)
#define OPCODE 0xFFFFu

/* Read a register of the CPU subsystem. Returns false if the emulator does not model the register. */
bool psoc_cpuss_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const struct psoc_cpuss *cpuss = &psoc->cpuss;
    switch (offset) {
    case CONFIG:
        access->value = cpuss->config;
        return true;
    case SYSREQ:
        access->value = cpuss->sysreq;
        return true;
    case SYSARG:
        access->value = cpuss->sysarg;
        return true;
    case FLASH_CTL:
        access->value = cpuss->flash_ctl;
        return psoc_family(psoc)->configures_flash_clock;
    default:
        return false;
    }
}

/* Write a register of the CPU subsystem: vector table in RAM (CONFIG), or a call of the ROM, which writes flash rows
 * (SYSREQ). Returns false if the access is not modelled. */
bool psoc_cpuss_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    struct psoc_cpuss *cpuss = &psoc->cpuss;
    switch (offset) {
    case CONFIG:
        if (access->value & ~VECS_IN_RAM) {
            return false;
        }
        cpuss->config = access->value;
        cortex_m0_set_vectors(&psoc->cpu, access->value & VECS_IN_RAM ? PSOC_RAM_BASE : 0u);
        return true;
    case SYSREQ:
        cpuss->sysreq = access->value & ~START;
        if (access->value & START) {
            access->stall = psoc_srom_call(psoc, access->value & OPCODE, access->cycle);
        }
        return true;
    case SYSARG:
        cpuss->sysarg = access->value;
        return true;
    case FLASH_CTL:
        if (!psoc_family(psoc)->configures_flash_clock || access->value & ~(WAIT_STATES | PREFETCH)) {
            return false;
        }
        cpuss->flash_ctl = access->value;
        cortex_m0_set_flash_wait(&psoc->cpu, (uint8_t)(access->value & WAIT_STATES));
        return true;
    default:
        return false;
    }
}
