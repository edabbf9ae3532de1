#include "emulator/skin/field.h"

#include <stdlib.h>
#include <string.h>

#include "emulator/physics/layer.h"
#include "emulator/geometry/contact.h"

#define NEGLIGIBLE_PA 1.0 /* about a hundredth of a count; the pressure of a film decays without a limit */

/* Return whether the world requests an effect that acts on the cells of the skin (4 x 4 equal parts of the skin above
 * each taxel). Otherwise forces act on the front ends directly, without a model of cells. */
bool field_effects_are_on(const struct effects *effects)
{
    return spread_is_on(&effects->spread) || rheology_is_on(&effects->rheology) || indent_is_on(&effects->indent) ||
           proximity_is_on(&effects->proximity) || moisture_is_on(&effects->moisture) ||
           modulus_is_on(&effects->modulus);
}

/* Return whether the response of the skin changes with time while the load is constant. */
bool field_effects_are_dynamic(const struct effects *effects)
{
    return rheology_is_on(&effects->rheology) || indent_is_on(&effects->indent) ||
           (moisture_is_on(&effects->moisture) && effects->moisture.form == MOISTURE_DRYING);
}

/* Allocate the arrays of a load for one board and set the load to zero. Returns 0, or -1 if out of memory. */
int field_load_init(struct field_load *load, const struct patch *patch)
{
    load->pressure = malloc(patch->cell_count * sizeof *load->pressure);
    load->gap = malloc(patch->cell_count * sizeof *load->gap);
    load->force = malloc(patch->taxel_count * sizeof *load->force);
    load->is_loaded = malloc(patch->taxel_count * sizeof *load->is_loaded);
    if (!load->pressure || !load->gap || !load->force || !load->is_loaded) {
        return -1;
    }
    load->is_unloaded = false;
    load->object = -1;
    field_load_clear(load, patch);
    return 0;
}

/* Free the arrays of a load (pressures, gaps and forces on one board) and clear the struct. */
void field_load_free(struct field_load *load)
{
    free(load->pressure);
    free(load->gap);
    free(load->force);
    free(load->is_loaded);
    memset(load, 0, sizeof *load);
}

/* Set a load to zero: no pressure, no force, every gap beyond the range of contact. A load that is already zero is not
 * written again. */
void field_load_clear(struct field_load *load, const struct patch *patch)
{
    if (load->is_unloaded) {
        return;
    }
    memset(load->pressure, 0, patch->cell_count * sizeof *load->pressure);
    memset(load->force, 0, patch->taxel_count * sizeof *load->force);
    memset(load->is_loaded, 0, patch->taxel_count * sizeof *load->is_loaded);
    for (size_t i = 0; i < patch->cell_count; i++) {
        load->gap[i] = CONTACT_FAR_M;
    }
    load->is_unloaded = true;
}

/* Copy the load `from` (pressures and gaps per cell, forces per taxel) to `load`. Both belong to the board with
 * the cells `patch`. */
void field_load_copy(struct field_load *load, const struct field_load *from, const struct patch *patch)
{
    memcpy(load->pressure, from->pressure, patch->cell_count * sizeof *load->pressure);
    memcpy(load->gap, from->gap, patch->cell_count * sizeof *load->gap);
    memcpy(load->force, from->force, patch->taxel_count * sizeof *load->force);
    memcpy(load->is_loaded, from->is_loaded, patch->taxel_count * sizeof *load->is_loaded);
    load->is_unloaded = from->is_unloaded;
}

/* Allocate field->moisture and compute it: the share of the patch's water (0 to 1) in each cell. Called only for the
 * board with the moist patch. Returns 0, or -1 if out of memory. */
static int init_moisture(struct field *field)
{
    field->moisture = malloc(field->patch->cell_count * sizeof *field->moisture);
    if (!field->moisture) {
        return -1;
    }
    moisture_fill(&field->effects->moisture, field->patch, field->moisture);
    return 0;
}

/* Allocate the state of the skin effects of one board and prepare their tables; arrays of inactive effects stay NULL.
 * Returns 0, or -1 if out of memory. */
int field_init(struct field *field, const struct world_description *description, size_t index,
               const struct patch *patch)
{
    const struct effects *effects = &description->effects;
    const bool has_rheology = rheology_is_on(&effects->rheology), has_indent = indent_is_on(&effects->indent);
    const bool has_moisture = moisture_is_on(&effects->moisture) && effects->moisture.board == index;
    memset(field, 0, sizeof *field);
    field->effects = effects;
    field->patch = patch;
    field->proximity_reach_m = proximity_reach(&effects->proximity);
    field->has_history = calloc(patch->taxel_count, sizeof *field->has_history);
    field->rheology = has_rheology ? calloc(patch->cell_count, sizeof *field->rheology) : NULL;
    field->indent = has_indent ? calloc(patch->cell_count, sizeof *field->indent) : NULL;
    if (!field->has_history || (has_rheology && !field->rheology) || (has_indent && !field->indent) ||
        (has_moisture && init_moisture(field)) || spread_init(&field->spread, &effects->spread, patch)) {
        return -1;
    }
    if (proximity_is_on(&effects->proximity)) {
        proximity_prepare(&field->proximity, &effects->proximity, description->layer_thickness);
    }
    if (modulus_is_on(&effects->modulus)) {
        field->stiffness = calloc(patch->taxel_count, sizeof *field->stiffness);
        if (!field->stiffness) {
            return -1;
        }
        modulus_fill(&effects->modulus, description->parts_seed, &description->boards[index], field->stiffness);
    }
    return 0;
}

/* Free the state of the skin effects of a board; the struct may be initialised again. */
void field_free(struct field *field)
{
    spread_free(&field->spread);
    free(field->stiffness);
    free(field->moisture);
    free(field->rheology);
    free(field->indent);
    free(field->has_history);
    memset(field, 0, sizeof *field);
}

/* Complete a load whose cell pressures are set: smooth the pressure by the film, sum the forces on the taxels, and
 * divide the pressure by the relative stiffness, because pillars of k times the modulus shorten under p as nominal
 * pillars do under p / k. */
static void finish_load(struct field *field, struct field_load *load)
{
    const struct patch *patch = field->patch;
    spread_pressure(&field->spread, &field->effects->spread, patch, load->pressure);
    for (size_t taxel = 0; taxel < patch->taxel_count; taxel++) {
        const size_t first = taxel * CELLS_PER_TAXEL;
        double force = 0.0;
        bool is_loaded = false;
        for (size_t i = first; i < first + CELLS_PER_TAXEL; i++) {
            force += load->pressure[i] * patch->cells[i].area;
            is_loaded = is_loaded || load->pressure[i] > NEGLIGIBLE_PA || load->gap[i] < field->proximity_reach_m;
        }
        load->force[taxel] = force;
        load->is_loaded[taxel] = is_loaded;
        for (size_t i = first; field->stiffness && i < first + CELLS_PER_TAXEL; i++) {
            load->pressure[i] /= field->stiffness[taxel];
        }
    }
    load->is_unloaded = false;
}

/* Compute a load from the compression (metres) of each cell: the pillars extend the compression laterally, and
 * `pressure_law` converts it to pressure (pascal). For a contact the law is that of pillars and sheet together; for
 * prescribed forces it is the law of the pillars alone. */
static void load_from_contact(struct field *field, bool is_touching, double (*pressure_law)(double),
                              double *compression, struct field_load *load)
{
    if (is_touching) {
        spread_compression(&field->spread, &field->effects->spread, field->patch, compression);
    }
    for (size_t i = 0; i < field->patch->cell_count; i++) {
        load->pressure[i] = compression[i] > 0.0 ? pressure_law(compression[i]) : 0.0;
    }
    finish_load(field, load);
}

/* Compute a load from the compression (metres) of each cell in a contact. The array `compression` is overwritten.
 * is_touching: whether any cell is compressed. The caller has set the gaps of the load. */
void field_load_contact(struct field *field, bool is_touching, double *compression, struct field_load *load)
{
    load_from_contact(field, is_touching, layer_contact_pressure, compression, load);
}

/* Compute a load from a force (newtons) on each taxel, distributed evenly over the cells of the taxel. If pillars
 * spread the contact, the pressure is first converted to a compression, because spreading acts on compressions.
 * compression: work array with one value for each cell, which is overwritten. */
void field_load_forces(struct field *field, const float *force, double *compression, struct field_load *load)
{
    const bool spreads_by_pillars =
        spread_is_on(&field->effects->spread) && field->effects->spread.form == SPREAD_PILLARS;
    for (size_t taxel = 0; taxel < field->patch->taxel_count; taxel++) {
        const double pressure =
            (double)force[taxel] / (CELLS_PER_TAXEL * field->patch->cells[taxel * CELLS_PER_TAXEL].area);
        const double depth = spreads_by_pillars ? layer_compression(pressure) : 0.0;
        for (size_t i = taxel * CELLS_PER_TAXEL; i < (taxel + 1) * CELLS_PER_TAXEL; i++) {
            load->pressure[i] = pressure;
            load->gap[i] = pressure > 0.0 ? 0.0 : CONTACT_FAR_M;
            compression[i] = depth;
        }
    }
    if (spreads_by_pillars) {
        load_from_contact(field, true, layer_pressure, compression, load);
    } else {
        finish_load(field, load);
    }
}

/* Return whether fields may change although no load touches the board: a cell has load history, or its moisture
 * dries. */
bool field_has_history(const struct field *field, double time)
{
    const struct moisture_effect *moisture = &field->effects->moisture;
    return field->any_has_history ||
           (field->moisture && moisture->form == MOISTURE_DRYING && moisture_water(moisture, time) > 0.0);
}

/* Return the linear interpolation of element i between two arrays, exact at both ends. */
static double interpolate(const double *before, const double *after, size_t i, double fraction)
{
    return fraction == 0.0 ? before[i] : fraction == 1.0 ? after[i] : before[i] + fraction * (after[i] - before[i]);
}

/* Values of a time step that are common to all taxels. */
struct step {
    const struct field_load *before, *after;
    double fraction, water, decay;
    struct rheology_span span;
};

/* Compute the relative rise of the permittivity in each cell of a taxel, with load history. The field of an electrode
 * extends across its cells, so every cell responds to the mean pressure; the history of a cell adds the deviation of
 * its compression from the elastic value. Advances the history of the cells. */
static void compute_layer_rise(struct field *field, const struct step *step, size_t taxel, double rise[CELLS_PER_TAXEL])
{
    const size_t first = taxel * CELLS_PER_TAXEL;
    double pressure[CELLS_PER_TAXEL], mean = 0.0;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        pressure[i] = interpolate(step->before->pressure, step->after->pressure, first + i, step->fraction);
        mean += pressure[i] / CELLS_PER_TAXEL;
    }
    const double mean_rise = layer_rise_at_pressure(mean);
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        rise[i] = mean_rise;
    }
    if (!field->rheology && !field->indent) {
        return;
    }
    double compression[CELLS_PER_TAXEL], elastic[CELLS_PER_TAXEL];
    bool has_history = false;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        compression[i] = elastic[i] = layer_compression(pressure[i]);
    }
    if (field->rheology) {
        has_history = rheology_advance(&field->effects->rheology, &step->span, field->rheology + first, CELLS_PER_TAXEL,
                                       compression);
    }
    if (field->indent) {
        has_history |=
            indent_advance(&field->effects->indent, step->decay, field->indent + first, CELLS_PER_TAXEL, compression);
    }
    field->has_history[taxel] = has_history;
    field->any_has_history = field->any_has_history || has_history;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        if (compression[i] != elastic[i]) {
            rise[i] += layer_rise_at_compression(compression[i]) - layer_rise_at_compression(elastic[i]);
        }
    }
}

/* Return the field of one taxel at a time between two loads: mean over its cells of the relative rise of the
 * permittivity, after load history, moisture and proximity, and of the gap (metres); and the force (newtons). */
static struct taxel_field compute_taxel_field(struct field *field, const struct step *step, size_t taxel)
{
    struct taxel_field sum = {0.0, 0.0, interpolate(step->before->force, step->after->force, taxel, step->fraction)};
    double rise[CELLS_PER_TAXEL];
    compute_layer_rise(field, step, taxel, rise);
    for (size_t n = 0; n < CELLS_PER_TAXEL; n++) {
        const size_t i = taxel * CELLS_PER_TAXEL + n;
        const double gap = interpolate(step->before->gap, step->after->gap, i, step->fraction);
        if (step->water > 0.0 && field->moisture[i] > 0.0) {
            rise[n] = moisture_rise(step->water * field->moisture[i], rise[n]);
        }
        if (gap < field->proximity_reach_m) {
            rise[n] += proximity_rise(&field->proximity, gap);
        }
        sum.rise += rise[n] / CELLS_PER_TAXEL;
        sum.gap += gap / CELLS_PER_TAXEL;
    }
    return sum;
}

/* Compute the fields of all taxels of a board at a time between two loads, and advance the load history to that time.
 * Taxels without load, history and water are skipped. */
void field_advance(struct field *field, const struct field_load *before, const struct field_load *after,
                   const struct field_moment *moment, struct taxel_field *fields)
{
    struct step step = {.before = before, .after = after, .fraction = moment->fraction};
    step.water = field->moisture ? moisture_water(&field->effects->moisture, moment->time) : 0.0;
    if (field->rheology) {
        step.span = rheology_span(&field->effects->rheology, moment->seconds, moment->is_step);
    }
    if (field->indent) {
        step.decay = indent_decay(&field->effects->indent, moment->seconds);
    }
    field->any_has_history = false;
    for (size_t taxel = 0; taxel < field->patch->taxel_count; taxel++) {
        const bool is_loaded = before->is_loaded[taxel] || (moment->fraction > 0.0 && after->is_loaded[taxel]);
        if (is_loaded || field->has_history[taxel] || step.water > 0.0) {
            fields[taxel] = compute_taxel_field(field, &step, taxel);
        } else {
            const double force = interpolate(before->force, after->force, taxel, moment->fraction);
            fields[taxel] = (struct taxel_field){.rise = 0.0, .gap = CONTACT_FAR_M, .force = force};
        }
    }
}
