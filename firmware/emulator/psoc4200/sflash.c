/* Supervisory flash with the factory data of the die. The trim values are arbitrary constants, because the model does
 * not use them. */
#include "emulator/psoc4200/internal.h"

#define CSD_TRIM1 0x162u
#define CSD_TRIM2 0x163u
#define DIE 0x178u
#define IMO_ABS4 0x1CCu
#define IMO_TMPCO4 0x1CDu
#define IMO_TRIM 0x1D0u
#define IMO_TRIMS 46u

/* Look up the byte of the supervisory flash at an offset: unique id, and trims of oscillator and CSD. Returns false if
 * the content is not modelled. */
static bool byte_at(const struct psoc *psoc, uint32_t offset, uint8_t *value)
{
    if (offset - DIE < 8u) {
        *value = psoc->config.unique_id[offset - DIE];
    } else if (offset - IMO_TRIM < IMO_TRIMS) {
        *value = (uint8_t)(0x60u + offset - IMO_TRIM);
    } else if (offset == CSD_TRIM1 || offset == CSD_TRIM2) {
        *value = 0x88u;
    } else if (offset == IMO_ABS4 || offset == IMO_TMPCO4) {
        *value = 0x20u;
    } else {
        return false;
    }
    return true;
}

/* Read the supervisory flash, which contains the values of the factory calibration. Returns false if the content is not
 * modelled. */
bool psoc_sflash_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    uint8_t value;
    access->value = 0;
    for (unsigned i = 0; i < access->size; i++) {
        if (!byte_at(psoc, offset + i, &value)) {
            return false;
        }
        access->value |= (uint32_t)value << (8u * i);
    }
    return true;
}
