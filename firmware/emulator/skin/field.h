/* From what presses one board's cells to its taxels' fields: the chain of effects, in the order in which things happen.
 *
 * At a record: compression of the cells -> (spread: pillars) -> pressure of the whole layer -> (spread: film)
 * -> (modulus) -> a load.
 * At any moment between two records: pressure of the loads, interpolated -> compression -> (rheology) -> (indent) -> rise of
 * the permittivity -> (moisture) -> (proximity, by the gap) -> mean over each taxel's cells. */
#ifndef EMULATOR_SKIN_FIELD_H
#define EMULATOR_SKIN_FIELD_H

#include "emulator/skin/patch.h"
#include "emulator/world_file.h"

struct taxel_field {
    double rise;  /* relative rise of what goes through the layer, of the whole taxel */
    double gap;   /* metres to the object before contact, mean over the cells; CONTACT_FAR_M where no effect asks for it */
    double force; /* newtons */
};

/* What acts on a board's cells at a record. */
struct field_load {
    double *pressure; /* [cells] pascal that shortens pillars of the layer's own modulus */
    double *gap;      /* [cells] metres; CONTACT_FAR_M without an object */
    double *force;    /* [taxels] newtons */
    bool *near;       /* [taxels] some cell is pressed for what counts can tell, or has a gap that matters */
    bool idle;        /* none is */
    bool repeats;     /* it is that of the record before */
    struct frame object_of_bracket; /* from which a contact was solved */
    long object;                    /* in that scene, -1 for none */
};

/* A moment between two loads. */
struct field_moment {
    double fraction; /* of the way from the one load to the other */
    double seconds;  /* since the last moment that was asked for */
    double time;     /* seconds since the world began */
    bool jump;       /* the load has changed all at once, not linearly */
};

struct field {
    const struct effects *effects;
    const struct patch *patch;
    struct spread_state spread;
    double *stiffness;              /* [taxels]; NULL without the effect */
    double *moisture;               /* [cells]; NULL unless this board is moist */
    struct rheology_cell *rheology; /* [cells]; NULL without the effect */
    struct indent_cell *indent;     /* [cells]; NULL without the effect */
    double gap_matters;             /* up to so many metres */
    struct proximity_curve proximity;
    bool *awake;                    /* [taxels] some cell remembers */
    bool any_awake;
};

/* Does any effect of the skin act in this world? Does one of them change the fields while no load changes? */
bool field_effects_are_on(const struct effects *effects);
bool field_effects_take_time(const struct effects *effects);

/* Return 0, or -1 without memory. `index`: the board in the description. */
int field_load_init(struct field_load *load, const struct patch *patch);
void field_load_free(struct field_load *load);
int field_init(struct field *field, const struct world_description *description, size_t index, const struct patch *patch);
void field_free(struct field *field);

/* Nothing presses. */
void field_load_clear(struct field_load *load, const struct patch *patch);

void field_load_copy(struct field_load *load, const struct field_load *from, const struct patch *patch);

/* A load from the compression [cells] of a contact, or from forces [taxels] in newtons; `compression` is overwritten. The
 * contact has filled in the gaps already; `touches`: some cell is compressed. */
void field_press(struct field *field, bool touches, double *compression, struct field_load *load);
void field_press_taxels(struct field *field, const float *force, double *compression, struct field_load *load);

/* Can the fields differ from what they were although neither load is near? */
bool field_is_awake(const struct field *field, double time);

/* The fields [taxels] at a moment. Moments must not go back. */
void field_advance(struct field *field, const struct field_load *before, const struct field_load *after,
                   const struct field_moment *moment, struct taxel_field *fields);

#endif
