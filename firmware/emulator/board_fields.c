#include "emulator/board_fields.h"

#include <string.h>

#include "emulator/geometry/patch.h"
#include "emulator/physics/layer.h"

#define CONVERSION_MARGIN (VTIME_SECOND / 10u) /* longer than a conversion */
#define UNCHANGED_STEPS_MAX 2u                 /* beyond it, the skin does not compute the fields of a board again */

/* Time between two samples of the fields. `until` is VTIME_NEVER while no change of the fields is scheduled. */
struct interval {
    vtime from, until;
    bool is_constant; /* the fields do not change before `until` */
};

/* Return the time interval that the current pair of field samples (relative rises of the taxels' capacitances) covers,
 * and whether the fields are constant in it. */
static struct interval get_present_interval(const struct board_fields *fields)
{
    const struct skin *skin = fields->skin;
    const struct stimulus *stimulus = fields->stimulus;
    struct interval interval = {.from = stimulus->from, .until = stimulus->until, .is_constant = stimulus->is_step};
    if (skin->boards) { /* the skin computes the fields; otherwise the stimulus states them directly */
        interval = (struct interval){.from = skin->from, .until = skin->until, .is_constant = skin->is_step};
    }
    interval.is_constant = interval.is_constant || interval.until == VTIME_NEVER;
    return interval;
}

/* Return the position of a virtual time in the present interval, which lies between two successive samples of the
 * taxels' fields: 0 at its start to 1 at its end; 0 while the fields are constant. */
double board_fields_fraction(const struct board_fields *fields, vtime time)
{
    const struct interval interval = get_present_interval(fields);
    if (interval.is_constant || time <= interval.from) {
        return 0.0;
    }
    return (double)(time - interval.from) / (double)(interval.until - interval.from);
}

/* Return the relative rise of a taxel's capacitance under a force in newtons; 0 without force. The rise depends on the
 * pressure, so the force is scaled to the area of a nominal taxel. */
static double compute_rise_at_force(const struct board_fields *fields, size_t taxel, double force)
{
    if (force <= 0.0) {
        return 0.0;
    }
    const struct board_description *board = &fields->skin->description->boards[fields->source];
    const double *size = board->taxel_poses ? board->taxel_poses[taxel].size : NULL;
    const double area = size && size[0] > 0.0 ? size[0] * size[1] : TAXEL_PITCH_M * TAXEL_PITCH_M;
    return layer_rise_at_force(force * (TAXEL_PITCH_M * TAXEL_PITCH_M / area));
}

/* Return the relative capacitance rise of one taxel at a past time, for effects that delay the response. span: the two
 * fields of the history before and after the past time, and the position between them (0 to 1). The history of a
 * stimulus of forces contains forces, which are converted; other histories contain rises. from: start of the present
 * interval; the field after the past time is the field at `from` if the history does not contain it (`span->after` is
 * NULL). */
static double compute_past_rise(const struct board_fields *fields, const struct late_span *span, size_t taxel,
                                vtime from)
{
    const struct taxel_field *before = &span->before[taxel];
    struct taxel_field after = *before;
    if (span->fraction != 0.0 && span->after) {
        after = span->after[taxel];
    } else if (span->fraction != 0.0 && fields->skin->boards) {
        after = skin_field(fields->skin, fields->source, taxel, from);
    } else if (span->fraction != 0.0) {
        after.force = stimulus_value(fields->stimulus, fields->first_taxel + taxel, from);
    }
    return fields->skin->boards
               ? before->rise + span->fraction * (after.rise - before->rise)
               : compute_rise_at_force(fields, taxel, before->force + span->fraction * (after.force - before->force));
}

/* Compute the relative capacitance rises of all taxels at a past time, for effects that delay the response. span: the
 * two fields of the history before and after the past time, and the position between them (0 to 1). from: start of the
 * present interval. */
static void compute_past_rises(const struct board_fields *fields, const struct late_span *span, vtime from,
                               double *rise)
{
    const struct taxel_field *before = span->before, *after = span->fraction != 0.0 ? span->after : span->before;
    if (!fields->skin->boards || !after) { /* forces, or fields that are not in the history yet */
        for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
            rise[taxel] = compute_past_rise(fields, span, taxel, from);
        }
        return;
    }
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        rise[taxel] = before[taxel].rise + span->fraction * (after[taxel].rise - before[taxel].rise);
    }
}

/* Subtract the delay of the board's response (effect `late`) from *time. Returns whether the result precedes the
 * present interval between two samples of the fields; `span` then contains the recorded fields before and after the
 * result. */
static bool find_past_span(const struct board_fields *fields, vtime *time, struct late_span *span)
{
    if (!fields->history) {
        return false;
    }
    const vtime from = get_present_interval(fields).from;
    *time -= vtime_min(*time, fields->history->delay);
    if (*time >= from || fields->history->count == 0) {
        return false;
    }
    *span = late_history_span_at(fields->history, *time, from);
    return true;
}

/* Return the relative rise of the capacitance of one taxel at a virtual time. The source is the history if the board's
 * response is delayed to before the present interval, otherwise the skin model or the force of the stimulus. */
double board_fields_rise(const struct board_fields *fields, size_t taxel, vtime time)
{
    struct late_span span;
    if (find_past_span(fields, &time, &span)) {
        return compute_past_rise(fields, &span, taxel, get_present_interval(fields).from);
    }
    if (fields->skin->boards) {
        return skin_field(fields->skin, fields->source, taxel, time).rise;
    }
    return compute_rise_at_force(fields, taxel, stimulus_value(fields->stimulus, fields->first_taxel + taxel, time));
}

/* Compute the relative capacitance rises of all taxels at a time in the present interval, interpolated linearly in
 * force (stimulus) or in rise (skin model). */
static void compute_present_rises(const struct board_fields *fields, vtime time, double *rise)
{
    const struct skin *skin = fields->skin;
    const double fraction = board_fields_fraction(fields, time);
    if (!skin->boards) {
        const float *before = fields->stimulus->before + fields->first_taxel;
        const float *after = fields->stimulus->after + fields->first_taxel;
        for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
            const double first = (double)before[taxel];
            const double force = fraction == 0.0 ? first : first + fraction * ((double)after[taxel] - first);
            rise[taxel] = compute_rise_at_force(fields, taxel, force);
        }
        return;
    }
    const struct taxel_field *before = skin->boards[fields->source].before, *after = skin->boards[fields->source].after;
    const double weight = skin->until == VTIME_NEVER ? 1.0 : fraction; /* no change is scheduled: `after` */
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        rise[taxel] = before[taxel].rise + weight * (after[taxel].rise - before[taxel].rise);
    }
}

/* Compute the relative capacitance rises of all taxels of the board at a virtual time. */
void board_fields_all_rises(const struct board_fields *fields, vtime time, double *rise)
{
    struct late_span span;
    if (!find_past_span(fields, &time, &span)) {
        compute_present_rises(fields, time, rise);
        return;
    }
    compute_past_rises(fields, &span, get_present_interval(fields).from, rise);
}

/* Return whether the fields that the board measures (relative rises of its taxels' capacitances) do not change around
 * this virtual time. The fields of a board with a delayed response (effect `late`) change until the delay after the
 * last change has elapsed. */
bool board_fields_are_constant(const struct board_fields *fields, vtime time)
{
    if (fields->history && time < fields->last_change + fields->history->delay + CONVERSION_MARGIN) {
        return false;
    }
    return fields->are_equal || get_present_interval(fields).is_constant;
}

/* Return the capacitance (farad) that contacts add to all taxels together, at the start or the end of the present
 * interval: the sum of fringe capacitance times relative rise. `fringe_f`: fringe capacitance of the first taxel; the
 * values of successive taxels are `stride` bytes apart, because they are members of an array of structs. */
double board_fields_added_capacitance_f(const struct board_fields *fields, bool at_end, const double *fringe_f,
                                        size_t stride)
{
    const struct interval interval = get_present_interval(fields);
    double rise[TAXEL_TAXELS_MAX], farad = 0.0;
    compute_present_rises(fields, at_end && !interval.is_constant ? interval.until : interval.from, rise);
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        farad += *(const double *)((const char *)fringe_f + taxel * stride) * rise[taxel];
    }
    return farad;
}

/* Add the fields (relative rises of the taxels' capacitances) at the start of the present interval to the history,
 * if an effect needs one. Returns 0, or -1 without memory. */
int board_fields_remember(struct board_fields *fields, vtime now)
{
    const struct interval interval = get_present_interval(fields);
    const struct skin *skin = fields->skin;
    if (!fields->history) {
        return 0;
    }
    struct taxel_field *stored = late_history_add(fields->history, interval.from, interval.is_constant, now);
    if (!stored) {
        return -1;
    }
    if (skin->boards) {
        const struct skin_board *board = &skin->boards[fields->source];
        /* while no change is scheduled, the present fields are `after` */
        memcpy(stored, skin->until == VTIME_NEVER ? board->after : board->before, fields->taxels * sizeof *stored);
        return 0;
    }
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        const double force = stimulus_value(fields->stimulus, fields->first_taxel + taxel, interval.from);
        stored[taxel] = (struct taxel_field){.force = force};
    }
    return 0;
}

/* Return whether the fields (relative rises of the taxels' capacitances) are the same at both ends of the present
 * interval, so that unchanged conversions need no new computation. */
static bool ends_are_equal(const struct board_fields *fields)
{
    const struct stimulus *stimulus = fields->stimulus;
    if (fields->skin->boards) {
        return fields->skin->boards[fields->source].unchanged_steps > UNCHANGED_STEPS_MAX;
    }
    const float *before = stimulus->before + fields->first_taxel, *after = stimulus->after + fields->first_taxel;
    return stimulus->until != VTIME_NEVER && memcmp(before, after, fields->taxels * sizeof *before) == 0;
}

/* Update, at the start of a new interval, the count of changes of the board's fields (relative rises of its
 * taxels' capacitances). Conversions of unchanged fields reuse earlier results. */
void board_fields_update(struct board_fields *fields, vtime now)
{
    if (!fields->tracks_changes) {
        return;
    }
    const bool are_equal = ends_are_equal(fields);
    if (!are_equal || !fields->are_equal) {
        fields->change_count++;
        fields->last_change = now;
    }
    fields->are_equal = are_equal;
}
