/* Permanent deformation of the layer.
 *
 * Form `set`: compression set. A cell that was compressed by more than threshold_m keeps a fraction of the excess and
 * recovers over minutes: depth = max(depth exp(-t / recovery_s), fraction (c - threshold_m)). Its pillars are shorter
 * by depth at rest, and a pressure shortens the remainder in proportion: out = depth + c (1 - depth / pillar height).
 * The rest count is lower afterwards, and the next contact starts at this point of the layer's curve: the response is
 * larger to a light contact, where the curve still steepens, and smaller to a strong one.
 *
 * Form `bedding`: the first contacts of a session flatten the moulded tips of the pillars, which then carry more load.
 * The effect depends on the work done on a cell (joule per square metre, every loading counted): out = c (1 - fraction
 * (1 - exp(-work / work_j_m2))). It is permanent.
 *
 * c: compression from the layer's curve, metres; out: compression that determines the field. */
#ifndef EMULATOR_EFFECTS_INDENT_H
#define EMULATOR_EFFECTS_INDENT_H

#include <stdbool.h>
#include <stddef.h>

struct effect_line;
struct effects;

enum indent_form {
    INDENT_SET,
    INDENT_BEDDING,
};

struct indent_effect {
    enum indent_form form;
    double fraction;
    double threshold_m, recovery_s; /* set */
    double work_j_m2;               /* bedding */
};

/* State of a cell. */
struct indent_state {
    double depth;                  /* compression set, metres */
    double work, last_compression; /* bedding: joule per square metre; compression at the last call, metres */
    double bedding;                /* exp(-work / work_j_m2) - 1 */
    double loading_work;           /* layer work at `last_compression`; valid only if is_loading */
    bool is_loading;               /* the compression of the cell increases */
};

int indent_read(struct effect_line *line, struct effects *effects);
bool indent_is_on(const struct indent_effect *indent);

/* Return the share of a compression set that remains after `seconds` of recovery; 1 for the form `bedding`, which is
 * permanent. */
double indent_decay(const struct indent_effect *indent, double seconds);

/* Advance the state of `count` cells by one time step. decay: result of indent_decay() for the step. compression
 * [count], metres: c on entry, out on return (see above). Returns whether a cell is deformed or was compressed in this
 * step, so that the next step must not skip the cells. */
bool indent_advance(const struct indent_effect *indent, double decay, struct indent_state *cells, size_t count,
                    double *compression);

#endif
