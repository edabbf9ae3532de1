#include "emulator/effects/indent.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/physics/layer.h"

#define NEGLIGIBLE_M 1e-8 /* about a hundredth of a count */

/* Read a world-file line `effect indent`: compression set (`set`: fraction, threshold in metres, recovery in seconds)
 * or permanent bedding of the pillar tips (`bedding`: fraction, work in J/m2). Returns 0, or -1 after an error line on
 * stderr. */
int indent_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[INDENT_SET] = "set", [INDENT_BEDDING] = "bedding", NULL};
    struct indent_effect *indent = &effects->indent;
    const int form = effect_line_form_index(line, forms);
    if (form < 0) {
        return -1;
    }
    *indent = (struct indent_effect){.form = (enum indent_form)form};
    if (effect_line_number(line, "fraction", 0.0, 0.9, &indent->fraction)) {
        return -1;
    }
    if (form == INDENT_BEDDING) {
        return effect_line_number(line, "work_j_m2", 0.01, 1e4, &indent->work_j_m2);
    }
    return effect_line_number(line, "threshold_m", 0.0, LAYER_PILLAR_HEIGHT_M, &indent->threshold_m) ||
                   effect_line_number(line, "recovery_s", 1.0, 1e6, &indent->recovery_s)
               ? -1
               : 0;
}

/* Return whether the world file requests the effect `indent` (permanent deformation of the layer): its fraction is not
 * 0. */
bool indent_is_on(const struct indent_effect *indent)
{
    return indent->fraction != 0.0;
}

/* Return the share of a compression set (temporary shortening of the pillars) that remains after `seconds` of recovery;
 * 1 for the form `bedding`, the permanent deformation. */
double indent_decay(const struct indent_effect *indent, double seconds)
{
    return indent->form == INDENT_SET ? exp(-seconds / indent->recovery_s) : 1.0;
}

/* Update the compression set of one cell (one of the 4 x 4 parts of a taxel) under the compression `c` (metres): the
 * larger of the old set times `decay` (share that remains after the time step) and a fraction of the compression above
 * the threshold. Returns the compression with the set: set + c (1 - set / pillar height), because pressure shortens
 * only the remaining pillar. */
static double apply_set(const struct indent_effect *indent, double decay, struct indent_state *cell, double c)
{
    const double recovered = cell->depth * decay, added = indent->fraction * (c - indent->threshold_m);
    const double depth = recovered > added ? recovered : added;
    cell->depth = depth > NEGLIGIBLE_M ? depth : 0.0;
    return cell->depth + c * (1.0 - cell->depth / LAYER_PILLAR_HEIGHT_M);
}

/* Return the compression (metres) of a cell whose pillar tips bed in with the work done on them: c (1 - fraction (1 -
 * exp(-work / work_j_m2))). Only increases of the compression `c` add work. While the load increases, the layer's work
 * at the previous compression is kept from call to call, so that it is not computed again. */
static double apply_bedding(const struct indent_effect *indent, struct indent_state *cell, double c)
{
    if (c > cell->last_compression) {
        const double previous_work = cell->is_loading ? cell->loading_work : layer_work(cell->last_compression);
        cell->loading_work = layer_work(c);
        cell->work += cell->loading_work - previous_work;
        cell->bedding = expm1(-cell->work / indent->work_j_m2);
    }
    cell->is_loading = c > cell->last_compression || (cell->is_loading && c == cell->last_compression);
    cell->last_compression = c;
    return c * (1.0 + indent->fraction * cell->bedding);
}

/* Replace the compression (metres) of each cell by the compression with its permanent deformation, and update this
 * deformation. decay: share of a compression set that remains after the time step. Returns whether a cell is deformed
 * or, for bedding, was compressed in this step, so that the next step must not skip the cells. */
bool indent_advance(const struct indent_effect *indent, double decay, struct indent_state *cells, size_t count,
                    double *compression)
{
    bool is_active = false;
    for (size_t i = 0; i < count; i++) {
        struct indent_state *cell = &cells[i];
        if (compression[i] > 0.0 || cell->depth > 0.0 || cell->last_compression > 0.0) {
            const double c = compression[i];
            compression[i] =
                indent->form == INDENT_SET ? apply_set(indent, decay, cell, c) : apply_bedding(indent, cell, c);
            is_active = is_active || cell->depth > 0.0 || cell->last_compression > 0.0;
        }
    }
    return is_active;
}
