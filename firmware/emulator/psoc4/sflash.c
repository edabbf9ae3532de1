/* Supervisory flash with the factory data of the die. */
#include "emulator/psoc4/internal.h"

/* Read the supervisory flash, which contains the values of the factory calibration. Returns false if the content is not
 * modelled. */
bool psoc_sflash_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    uint8_t value;
    access->value = 0;
    for (unsigned i = 0; i < access->size; i++) {
        if (!psoc_family(psoc)->sflash_byte(psoc, offset + i, &value)) {
            return false;
        }
        access->value |= (uint32_t)value << (8u * i);
    }
    return true;
}
