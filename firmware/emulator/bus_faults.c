#include "emulator/bus_faults.h"

/* Schedule a fault of one byte of a future transfer: `value` is the byte's position in the transfer, address bytes
 * included; `second_value` is the parameter of the fault. Returns false if too many are pending. */
bool bus_faults_add(struct bus_faults *faults, const struct fault_description *fault)
{
    if (faults->count == BUS_FAULTS_MAX) {
        return false;
    }
    faults->pending[faults->count].kind = fault->kind;
    faults->pending[faults->count].address = fault->address;
    faults->pending[faults->count].position = (unsigned)fault->value;
    faults->pending[faults->count].value = fault->second_value;
    faults->count++;
    return true;
}

/* Add the effect of one fault to the damage of a byte. `value`: bit number, microseconds or milliseconds, depending on
 * the kind. */
static void add_damage(struct byte_damage *damage, enum fault_kind kind, double value)
{
    switch (kind) {
    case FAULT_NACK_AT:
        damage->nack = true;
        break;
    case FAULT_FLIP_AT:
        damage->flip ^= (uint8_t)(1u << ((unsigned)value & 7u));
        break;
    case FAULT_STRETCH_AT:
        damage->stretch += (vtime)(value * (double)VTIME_US);
        break;
    case FAULT_BROWN_OUT_AT:
        damage->brown_out = true;
        damage->off_time = (vtime)(value * (double)VTIME_MS);
        break;
    case FAULT_ARBITRATION_AT:
        damage->arbitration = true;
        break;
    default:
        damage->bus_error = true;
        break;
    }
}

/* Return the damage of the byte at `position` of a transfer with the board at `address`; a fault with address 0 applies
 * to any board. Faults that have applied are removed and logged. */
struct byte_damage bus_faults_apply(struct bus_faults *faults, uint8_t address, unsigned position, vtime now,
                                    struct fault_log *log)
{
    struct byte_damage damage = {.nack = false};
    size_t kept = 0;
    for (size_t i = 0; i < faults->count; i++) {
        const bool applies = faults->pending[i].position == position &&
                             (faults->pending[i].address == address || faults->pending[i].address == 0);
        if (applies) {
            add_damage(&damage, faults->pending[i].kind, faults->pending[i].value);
            fault_log_add(log, now, faults->pending[i].kind, address);
        } else {
            faults->pending[kept++] = faults->pending[i];
        }
    }
    faults->count = kept;
    return damage;
}
