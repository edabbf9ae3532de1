/* From the load on one board's cells to the fields of its taxels: the sequence of skin effects in physical order.
 *
 * At a record: compression of the cells -> (spread: pillars) -> pressure of the whole layer -> (spread: film) ->
 * (modulus) -> load. At any time between two records: interpolated pressure of the loads -> compression -> (rheology)
 * -> (indent) -> rise of the permittivity -> (moisture) -> (proximity, from the gap) -> mean over each taxel's cells.
 */
#ifndef EMULATOR_SKIN_FIELD_H
#define EMULATOR_SKIN_FIELD_H

#include "emulator/geometry/patch.h"
#include "emulator/geometry/taxel_field.h"
#include "emulator/world_file/world_file.h"

/* Load on the cells of one board at a record of the stimulus. */
struct field_load {
    double *pressure;                 /* [cells] pascal, equivalent pressure on pillars of nominal modulus */
    double *gap;                      /* [cells] metres; CONTACT_FAR_M without an object */
    double *force;                    /* [taxels] newtons */
    bool *is_loaded;                  /* [taxels] a cell has a measurable pressure, or a gap within proximity_reach_m */
    bool is_unloaded;                 /* no taxel is loaded */
    bool equals_previous;             /* equal to the load of the previous record */
    struct frame object_from_bracket; /* pose for which the contact was solved */
    long object;                      /* index of the object in the scene, -1: none */
};

/* A time between two loads, for which the fields are computed. */
struct field_moment {
    double fraction; /* interpolation fraction between the two loads */
    double seconds;  /* time since the previous call of field_advance() */
    double time;     /* seconds since the start of the world */
    bool is_step;    /* the load changed in a step, not linearly */
};

/* State of the skin effects of one board. */
struct field {
    const struct effects *effects;
    const struct patch *patch;
    struct spread_state spread;
    double *stiffness;               /* [taxels]; NULL without the effect */
    double *moisture;                /* [cells]; NULL unless this board has the effect */
    struct rheology_state *rheology; /* [cells]; NULL without the effect */
    struct indent_state *indent;     /* [cells]; NULL without the effect */
    double proximity_reach_m;        /* gaps up to this distance contribute, metres */
    struct proximity_curve proximity;
    bool *has_history; /* [taxels] a cell has load history */
    bool any_has_history;
};

/* Return whether an effect of the skin is active, and whether an active effect changes fields while no load changes. */
bool field_effects_are_on(const struct effects *effects);
bool field_effects_are_dynamic(const struct effects *effects);

/* Allocate a load, or the state of the skin effects. Both functions return 0, or -1 if out of memory. index: of the
 * board in the description. */
int field_load_init(struct field_load *load, const struct patch *patch);
void field_load_free(struct field_load *load);
int field_init(struct field *field, const struct world_description *description, size_t index,
               const struct patch *patch);
void field_free(struct field *field);

/* Set a load to zero. */
void field_load_clear(struct field_load *load, const struct patch *patch);

void field_load_copy(struct field_load *load, const struct field_load *from, const struct patch *patch);

/* Compute a load from the compression [cells, metres] of a contact, or from forces [taxels] in newtons; `compression`
 * is overwritten in both cases. For a contact, the caller has set the gaps of the load; is_touching: a cell is
 * compressed. */
void field_load_contact(struct field *field, bool is_touching, double *compression, struct field_load *load);
void field_load_forces(struct field *field, const float *force, double *compression, struct field_load *load);

/* Return whether fields may change although neither load touches the board. */
bool field_has_history(const struct field *field, double time);

/* Compute the fields [taxels] at a time between two loads, and advance the load history of the effects to this time.
 * Times must not decrease. */
void field_advance(struct field *field, const struct field_load *before, const struct field_load *after,
                   const struct field_moment *moment, struct taxel_field *fields);

#endif
