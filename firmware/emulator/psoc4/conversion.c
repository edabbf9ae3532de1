/* End of a conversion of either converter: the board's front end computes the count, as for a native board. */
#include "emulator/psoc4/internal.h"

/* End the present conversion: write its times, TX line and RX line to `conversion`, and write the count of the board's
 * front end to *count. balances: whether the converter can balance the charge; otherwise *count is 0. Returns whether
 * the program sees the end of the conversion. A test bench can suppress the end (loses_end): the function then returns
 * false and leaves *count unchanged. */
bool psoc_finish_conversion(struct psoc *psoc, struct psoc_conversion *conversion, bool balances, uint32_t *count)
{
    struct psoc_csd *csd = &psoc->csd;
    const struct psoc_wires *wires = &psoc->config.wires;
    const bool is_lost = csd->loses_end;
    conversion->begin = psoc_time(psoc, csd->begin);
    conversion->end = psoc_time(psoc, csd->end);
    psoc_connected_lines(psoc, &conversion->tx, &conversion->rx);
    csd->end = PSOC_NEVER;
    csd->loses_end = false;
    if (!is_lost) {
        *count = balances && wires->convert ? wires->convert(wires->context, conversion) : 0u;
    }
    return !is_lost;
}
