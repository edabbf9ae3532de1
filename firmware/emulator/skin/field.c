#include "emulator/skin/field.h"

#include <stdlib.h>
#include <string.h>

#include "emulator/layer.h"
#include "emulator/skin/contact.h"

#define NEGLIGIBLE_PA 1.0 /* some hundredth of a count; a film's pressure fades for ever */

bool field_effects_are_on(const struct effects *effects)
{
    return spread_is_on(&effects->spread) || rheology_is_on(&effects->rheology) || indent_is_on(&effects->indent) ||
           proximity_is_on(&effects->proximity) || moisture_is_on(&effects->moisture) || modulus_is_on(&effects->modulus);
}

bool field_effects_take_time(const struct effects *effects)
{
    return rheology_is_on(&effects->rheology) || indent_is_on(&effects->indent) ||
           (moisture_is_on(&effects->moisture) && effects->moisture.form == MOISTURE_DRYING);
}

int field_load_init(struct field_load *load, const struct patch *patch)
{
    load->pressure = malloc(patch->cell_count * sizeof *load->pressure);
    load->gap = malloc(patch->cell_count * sizeof *load->gap);
    load->force = malloc(patch->taxel_count * sizeof *load->force);
    load->near = malloc(patch->taxel_count * sizeof *load->near);
    if (!load->pressure || !load->gap || !load->force || !load->near) {
        return -1;
    }
    load->idle = false;
    load->object = -1;
    field_load_clear(load, patch);
    return 0;
}

void field_load_free(struct field_load *load)
{
    free(load->pressure);
    free(load->gap);
    free(load->force);
    free(load->near);
    memset(load, 0, sizeof *load);
}

void field_load_clear(struct field_load *load, const struct patch *patch)
{
    if (load->idle) {
        return;
    }
    memset(load->pressure, 0, patch->cell_count * sizeof *load->pressure);
    memset(load->force, 0, patch->taxel_count * sizeof *load->force);
    memset(load->near, 0, patch->taxel_count * sizeof *load->near);
    for (size_t i = 0; i < patch->cell_count; i++) {
        load->gap[i] = CONTACT_FAR_M;
    }
    load->idle = true;
}

void field_load_copy(struct field_load *load, const struct field_load *from, const struct patch *patch)
{
    memcpy(load->pressure, from->pressure, patch->cell_count * sizeof *load->pressure);
    memcpy(load->gap, from->gap, patch->cell_count * sizeof *load->gap);
    memcpy(load->force, from->force, patch->taxel_count * sizeof *load->force);
    memcpy(load->near, from->near, patch->taxel_count * sizeof *load->near);
    load->idle = from->idle;
}

static int init_moisture(struct field *field)
{
    field->moisture = malloc(field->patch->cell_count * sizeof *field->moisture);
    if (!field->moisture) {
        return -1;
    }
    moisture_fill(&field->effects->moisture, field->patch, field->moisture);
    return 0;
}

int field_init(struct field *field, const struct world_description *description, size_t index, const struct patch *patch)
{
    const struct effects *effects = &description->effects;
    const bool flows = rheology_is_on(&effects->rheology), sets = indent_is_on(&effects->indent);
    const bool moist = moisture_is_on(&effects->moisture) && effects->moisture.board == index;
    memset(field, 0, sizeof *field);
    field->effects = effects;
    field->patch = patch;
    field->gap_matters = proximity_far(&effects->proximity);
    field->awake = calloc(patch->taxel_count, sizeof *field->awake);
    field->rheology = flows ? calloc(patch->cell_count, sizeof *field->rheology) : NULL;
    field->indent = sets ? calloc(patch->cell_count, sizeof *field->indent) : NULL;
    if (!field->awake || (flows && !field->rheology) || (sets && !field->indent) || (moist && init_moisture(field)) ||
        spread_init(&field->spread, &effects->spread, patch)) {
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

void field_free(struct field *field)
{
    spread_free(&field->spread);
    free(field->stiffness);
    free(field->moisture);
    free(field->rheology);
    free(field->indent);
    free(field->awake);
    memset(field, 0, sizeof *field);
}

/* After the cells' own pressures are known. */
static void finish_load(struct field *field, struct field_load *load)
{
    const struct patch *patch = field->patch;
    spread_pressure(&field->spread, &field->effects->spread, patch, load->pressure);
    for (size_t taxel = 0; taxel < patch->taxel_count; taxel++) {
        const size_t first = taxel * CELLS_PER_TAXEL;
        double force = 0.0;
        bool near = false;
        for (size_t i = first; i < first + CELLS_PER_TAXEL; i++) {
            force += load->pressure[i] * SKIN_CELL_AREA_M2;
            near = near || load->pressure[i] > NEGLIGIBLE_PA || load->gap[i] < field->gap_matters;
        }
        load->force[taxel] = force;
        load->near[taxel] = near;
        for (size_t i = first; field->stiffness && i < first + CELLS_PER_TAXEL; i++) {
            load->pressure[i] /= field->stiffness[taxel];
        }
    }
    load->idle = false;
}

static void press(struct field *field, bool touches, double (*law)(double), double *compression, struct field_load *load)
{
    if (touches) {
        spread_compression(&field->spread, &field->effects->spread, field->patch, compression);
    }
    for (size_t i = 0; i < field->patch->cell_count; i++) {
        load->pressure[i] = compression[i] > 0.0 ? law(compression[i]) : 0.0;
    }
    finish_load(field, load);
}

void field_press(struct field *field, bool touches, double *compression, struct field_load *load)
{
    press(field, touches, layer_contact_pressure, compression, load);
}

void field_press_taxels(struct field *field, const float *force, double *compression, struct field_load *load)
{
    const bool shapes = spread_is_on(&field->effects->spread) && field->effects->spread.form == SPREAD_PILLARS;
    for (size_t taxel = 0; taxel < field->patch->taxel_count; taxel++) {
        const double pressure = (double)force[taxel] / (CELLS_PER_TAXEL * SKIN_CELL_AREA_M2);
        const double depth = shapes ? layer_compression(pressure) : 0.0;
        for (size_t i = taxel * CELLS_PER_TAXEL; i < (taxel + 1) * CELLS_PER_TAXEL; i++) {
            load->pressure[i] = pressure;
            load->gap[i] = pressure > 0.0 ? 0.0 : CONTACT_FAR_M;
            compression[i] = depth;
        }
    }
    if (shapes) {
        press(field, true, layer_pressure, compression, load);
    } else {
        finish_load(field, load);
    }
}

bool field_is_awake(const struct field *field, double time)
{
    const struct moisture_effect *moisture = &field->effects->moisture;
    return field->any_awake || (field->moisture && moisture->form == MOISTURE_DRYING && moisture_water(moisture, time) > 0.0);
}

static double between(const double *before, const double *after, size_t i, double fraction)
{
    return fraction == 0.0 ? before[i] : fraction == 1.0 ? after[i] : before[i] + fraction * (after[i] - before[i]);
}

/* What is the same for every taxel at a moment. */
struct passage {
    const struct field_load *before, *after;
    double fraction, water, decay;
    struct rheology_span span;
};

/* Rise of the layer alone in a taxel's cells, with what they remember. The field of an electrode runs across its cells, so
 * that all of them answer to the mean pressure; what a cell remembers is added as its own departure from that. */
static void rise_of_layer(struct field *field, const struct passage *passage, size_t taxel, double rise[CELLS_PER_TAXEL])
{
    const size_t first = taxel * CELLS_PER_TAXEL;
    double pressure[CELLS_PER_TAXEL], mean = 0.0;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        pressure[i] = between(passage->before->pressure, passage->after->pressure, first + i, passage->fraction);
        mean += pressure[i] / CELLS_PER_TAXEL;
    }
    const double common = layer_pressure_rise(mean);
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        rise[i] = common;
    }
    if (!field->rheology && !field->indent) {
        return;
    }
    double compression[CELLS_PER_TAXEL], elastic[CELLS_PER_TAXEL];
    bool awake = false;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        compression[i] = elastic[i] = layer_compression(pressure[i]);
    }
    if (field->rheology) {
        awake = rheology_advance(&field->effects->rheology, &passage->span, field->rheology + first, CELLS_PER_TAXEL,
                                 compression);
    }
    if (field->indent) {
        awake |= indent_advance(&field->effects->indent, passage->decay, field->indent + first, CELLS_PER_TAXEL, compression);
    }
    field->awake[taxel] = awake;
    field->any_awake = field->any_awake || awake;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        if (compression[i] != elastic[i]) {
            rise[i] += layer_compression_rise(compression[i]) - layer_compression_rise(elastic[i]);
        }
    }
}

static struct taxel_field field_of(struct field *field, const struct passage *passage, size_t taxel)
{
    struct taxel_field sum = {0.0, 0.0, between(passage->before->force, passage->after->force, taxel, passage->fraction)};
    double rise[CELLS_PER_TAXEL];
    rise_of_layer(field, passage, taxel, rise);
    for (size_t n = 0; n < CELLS_PER_TAXEL; n++) {
        const size_t i = taxel * CELLS_PER_TAXEL + n;
        const double gap = between(passage->before->gap, passage->after->gap, i, passage->fraction);
        if (passage->water > 0.0 && field->moisture[i] > 0.0) {
            rise[n] = moisture_rise(passage->water * field->moisture[i], rise[n]);
        }
        if (gap < field->gap_matters) {
            rise[n] += proximity_rise(&field->proximity, gap);
        }
        sum.rise += rise[n] / CELLS_PER_TAXEL;
        sum.gap += gap / CELLS_PER_TAXEL;
    }
    return sum;
}

void field_advance(struct field *field, const struct field_load *before, const struct field_load *after,
                   const struct field_moment *moment, struct taxel_field *fields)
{
    struct passage passage = {.before = before, .after = after, .fraction = moment->fraction};
    passage.water = field->moisture ? moisture_water(&field->effects->moisture, moment->time) : 0.0;
    if (field->rheology) {
        passage.span = rheology_span(&field->effects->rheology, moment->seconds, moment->jump);
    }
    if (field->indent) {
        passage.decay = indent_decay(&field->effects->indent, moment->seconds);
    }
    field->any_awake = false;
    for (size_t taxel = 0; taxel < field->patch->taxel_count; taxel++) {
        const bool near = before->near[taxel] || (moment->fraction > 0.0 && after->near[taxel]);
        if (near || field->awake[taxel] || passage.water > 0.0) {
            fields[taxel] = field_of(field, &passage, taxel);
        } else {
            const double force = between(before->force, after->force, taxel, moment->fraction);
            fields[taxel] = (struct taxel_field){.rise = 0.0, .gap = CONTACT_FAR_M, .force = force};
        }
    }
}
