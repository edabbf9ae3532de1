/* Rubber that does not come back to what it was.
 *
 * Form `set`: compression set: a cell that was compressed by more than threshold_m keeps a part of the excess and gives it
 * back over minutes: depth = max(depth exp(-t / recovery_s), fraction (c - threshold_m)). Its pillars are that much shorter at
 * rest, and a pressure shortens the rest of them in proportion: out = depth + c (1 - depth / pillar height). So the rest
 * count is lower afterwards, and a press starts from there on the layer's curve: it answers more to a light press, where the
 * curve is still steepening, and less to a hard one.
 *
 * Form `bedding`: the first presses of a session flatten the pillars' moulded tips, which then carry more at once. The work
 * that has gone into a cell (joule a square metre, each loading counted) says how far: out = c (1 - fraction (1 -
 * exp(-work / work_j_m2))). It does not return.
 *
 * c: compression that goes in, metres; out: what the field sees. */
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

/* What a cell remembers. */
struct indent_cell {
    double depth;      /* set, metres */
    double work, last; /* bedding: joule a square metre; compression at the last moment, metres */
    double bedded;     /* exp(-work / work_j_m2) - 1 */
    double stored;     /* the layer's work at `last` ... */
    bool rising;       /* ... if this holds */
};

int indent_read(struct effect_line *line, struct effects *effects);
bool indent_is_on(const struct indent_effect *indent);

/* What is left of a set after `seconds`, as a share. */
double indent_decay(const struct indent_effect *indent, double seconds);

/* That time has passed; compression [count] goes in and out as above. Returns whether one of these cells is indented at rest, or
 * still pressed. */
bool indent_advance(const struct indent_effect *indent, double decay, struct indent_cell *cells, size_t count,
                    double *compression);

#endif
