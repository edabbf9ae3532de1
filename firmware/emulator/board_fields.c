#include "emulator/board_fields.h"

#include <string.h>

#include "emulator/layer.h"

#define MARGIN (VTIME_SECOND / 10u) /* more than a conversion lies before now */
#define QUIET 2u                    /* skin_board.quiet beyond which nothing is made anew */

/* `until` is VTIME_NEVER while the fields stay. */
struct interval {
    vtime from, until;
    bool holds; /* no change before `until` */
};

static struct interval present_interval(const struct board_fields *fields)
{
    const struct skin *skin = fields->skin;
    const struct stimulus *stimulus = fields->stimulus;
    struct interval interval = {.from = stimulus->from, .until = stimulus->until, .holds = stimulus->step};
    if (skin->boards) {
        interval = (struct interval){.from = skin->from, .until = skin->until, .holds = skin->jump};
    }
    interval.holds = interval.holds || interval.until == VTIME_NEVER;
    return interval;
}

double board_fields_fraction(const struct board_fields *fields, vtime time)
{
    const struct interval interval = present_interval(fields);
    if (interval.holds || time <= interval.from) {
        return 0.0;
    }
    return (double)(time - interval.from) / (double)(interval.until - interval.from);
}

static double rise_of_force(double force)
{
    return force > 0.0 ? layer_permittivity_rise(force) : 0.0;
}

/* Forces are remembered without what they do to the layer. */
static double past_rise(const struct board_fields *fields, const struct late_span *span, size_t taxel, vtime from)
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
    return fields->skin->boards ? before->rise + span->fraction * (after.rise - before->rise)
                                : rise_of_force(before->force + span->fraction * (after.force - before->force));
}

static void past_rises(const struct board_fields *fields, const struct late_span *span, vtime from, double *rise)
{
    const struct taxel_field *before = span->before, *after = span->fraction != 0.0 ? span->after : span->before;
    if (!fields->skin->boards || !after) { /* forces; or fields that are not remembered yet */
        for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
            rise[taxel] = past_rise(fields, span, taxel, from);
        }
        return;
    }
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        rise[taxel] = before[taxel].rise + span->fraction * (after[taxel].rise - before[taxel].rise);
    }
}

/* Is that time, put back by the delay, before what the skin knows by itself? */
static bool is_past(const struct board_fields *fields, vtime *time, struct late_span *span)
{
    if (!fields->history) {
        return false;
    }
    const vtime from = present_interval(fields).from;
    *time -= vtime_min(*time, fields->history->delay);
    if (*time >= from || fields->history->count == 0) {
        return false;
    }
    *span = late_history_find(fields->history, *time, from);
    return true;
}

double board_fields_rise(const struct board_fields *fields, size_t taxel, vtime time)
{
    struct late_span span;
    if (is_past(fields, &time, &span)) {
        return past_rise(fields, &span, taxel, present_interval(fields).from);
    }
    if (fields->skin->boards) {
        return skin_field(fields->skin, fields->source, taxel, time).rise;
    }
    return layer_permittivity_rise(stimulus_value(fields->stimulus, fields->first_taxel + taxel, time));
}

static void present_rises(const struct board_fields *fields, vtime time, double *rise)
{
    const struct skin *skin = fields->skin;
    const double fraction = board_fields_fraction(fields, time);
    if (!skin->boards) {
        const float *before = fields->stimulus->before + fields->first_taxel;
        const float *after = fields->stimulus->after + fields->first_taxel;
        for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
            const double first = (double)before[taxel];
            rise[taxel] = rise_of_force(fraction == 0.0 ? first : first + fraction * ((double)after[taxel] - first));
        }
        return;
    }
    const struct taxel_field *before = skin->boards[fields->source].before, *after = skin->boards[fields->source].after;
    const double share = skin->until == VTIME_NEVER ? 1.0 : fraction;
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        rise[taxel] = before[taxel].rise + share * (after[taxel].rise - before[taxel].rise);
    }
}

void board_fields_rises(const struct board_fields *fields, vtime time, double *rise)
{
    struct late_span span;
    if (!is_past(fields, &time, &span)) {
        present_rises(fields, time, rise);
        return;
    }
    past_rises(fields, &span, present_interval(fields).from, rise);
}

bool board_fields_are_still(const struct board_fields *fields, vtime time)
{
    if (fields->history && time < fields->changed + fields->history->delay + MARGIN) {
        return false;
    }
    return fields->equal || present_interval(fields).holds;
}

double board_fields_load(const struct board_fields *fields, bool after, const double *fringe_f, size_t stride)
{
    const struct interval interval = present_interval(fields);
    double rise[TAXEL_TAXELS_MAX], farad = 0.0;
    present_rises(fields, after && !interval.holds ? interval.until : interval.from, rise);
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        farad += *(const double *)((const char *)fringe_f + taxel * stride) * rise[taxel];
    }
    return farad;
}

int board_fields_leave(struct board_fields *fields, vtime now)
{
    const struct interval interval = present_interval(fields);
    const struct skin *skin = fields->skin;
    if (!fields->history) {
        return 0;
    }
    struct taxel_field *remembered = late_history_add(fields->history, interval.from, interval.holds, now);
    if (!remembered) {
        return -1;
    }
    if (skin->boards) {
        const struct skin_board *board = &skin->boards[fields->source];
        memcpy(remembered, skin->until == VTIME_NEVER ? board->after : board->before, fields->taxels * sizeof *remembered);
        return 0;
    }
    for (size_t taxel = 0; taxel < fields->taxels; taxel++) {
        const double force = stimulus_value(fields->stimulus, fields->first_taxel + taxel, interval.from);
        remembered[taxel] = (struct taxel_field){.force = force};
    }
    return 0;
}

static bool ends_are_equal(const struct board_fields *fields)
{
    const struct stimulus *stimulus = fields->stimulus;
    if (fields->skin->boards) {
        return fields->skin->boards[fields->source].quiet > QUIET;
    }
    const float *before = stimulus->before + fields->first_taxel, *after = stimulus->after + fields->first_taxel;
    return stimulus->until != VTIME_NEVER && memcmp(before, after, fields->taxels * sizeof *before) == 0;
}

void board_fields_enter(struct board_fields *fields, vtime now)
{
    if (!fields->watched) {
        return;
    }
    const bool equal = ends_are_equal(fields);
    if (!equal || !fields->equal) {
        fields->number++;
        fields->changed = now;
    }
    fields->equal = equal;
}
