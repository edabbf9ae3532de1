#include "emulator/effects/noise.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define NOISE_STREAM 0x6E6F697300000000ull
#define SHORTEST_RELAXATION_S 0.020
#define STEPS_PER_RELAXATION 8.0

/* Read the keys of a noise line that exist only for its form: axis of line noise (0: TX line, 1: RX line, 2: whole
 * scan); whether the taxels share the 1/f noise; rate (Hz) and duration (ms) of impulses. Returns 0, or -1 after an
 * error line on stderr. */
static int read_form(struct effect_line *line, struct noise_slot *slot)
{
    long axis, shared = 0;
    if (slot->form == NOISE_LINE) {
        if (effect_line_integer(line, "axis", 0, 2, &axis)) {
            return -1;
        }
        slot->axis = (int)axis;
    }
    if (slot->form == NOISE_PINK && effect_line_has_key(line, "shared") &&
        effect_line_integer(line, "shared", 0, 1, &shared)) {
        return -1;
    }
    slot->shared = shared != 0;
    if (slot->form == NOISE_IMPULSE) {
        double duration_ms;
        if (effect_line_number(line, "rate_hz", 0.0, 1e4, &slot->rate_hz) ||
            effect_line_optional(line, "duration_ms", 0.001, 1e5, 5.0, &duration_ms)) {
            return -1;
        }
        slot->duration_s = duration_ms * 1e-3;
    }
    return 0;
}

/* Read a world-file line `effect noise`: the form of a noise source, its boards and its amplitude in counts. Returns 0,
 * or -1 after an error line on stderr. */
int noise_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {
        [NOISE_WHITE] = "white", [NOISE_LINE] = "line", [NOISE_PINK] = "pink", [NOISE_IMPULSE] = "impulse", NULL};
    struct noise_effect *noise = &effects->noise;
    struct noise_slot slot = {0};
    const int form = effect_line_form_index(line, forms);
    if (form < 0) {
        return -1;
    }
    if (noise->count == NOISE_SLOTS_MAX) {
        return effect_line_report_error(line, "more than 8 lines of noise");
    }
    slot.form = (enum noise_form)form;
    if (effect_line_boards(line, &slot.boards) || effect_line_number(line, "counts", 0.0, 65535.0, &slot.counts) ||
        read_form(line, &slot)) {
        return -1;
    }
    noise->slots[noise->count++] = slot;
    return 0;
}

/* Return whether one line of the effect `noise` has a nonzero amplitude (for impulses, also a nonzero rate) and applies
 * to board number `board`. */
static bool acts_on(const struct noise_slot *slot, size_t board)
{
    const bool is_off = slot->counts == 0.0 || (slot->form == NOISE_IMPULSE && slot->rate_hz == 0.0);
    return !is_off && effect_boards_contain(&slot->boards, board);
}

/* Return whether a noise source with a nonzero amplitude acts on this board. */
bool noise_is_on(const struct noise_effect *noise, size_t board)
{
    for (size_t i = 0; i < noise->count; i++) {
        if (acts_on(&noise->slots[i], board)) {
            return true;
        }
    }
    return false;
}

/* Start the random streams of all noise sources of a board. The stream number contains the index of the source and the
 * I2C address, so that adding a source does not change the samples of the others. */
void noise_open(struct noise_board *noise, const struct noise_effect *effect, size_t board, uint64_t seed,
                uint8_t address)
{
    noise->count = 0;
    noise->tx = -1;
    for (size_t i = 0; i < effect->count; i++) {
        if (acts_on(&effect->slots[i], board)) {
            struct noise_state *state = &noise->state[noise->count];
            random_init(&state->random, seed, NOISE_STREAM | (i << 8) | address);
            normal_source_init(&state->normals, seed, NOISE_STREAM | (i << 8) | address);
            noise->slot[noise->count++] = &effect->slots[i];
        }
    }
}

/* Return an approximately normal random number of variance 1: the standardised sum of the eight bytes of one random
 * number. The sum of many steps of a process is then sufficiently normal. `pairs` contains four 16-bit sums of two
 * bytes; the multiplication adds these four sums in the upper 16 bits. A sum of eight bytes has the mean 8 * 127.5. */
static double approximate_normal(struct random_source *random)
{
    const uint64_t low_bytes = 0x00FF00FF00FF00FFull;
    const uint64_t value = random_u64(random);
    const uint64_t pairs = (value & low_bytes) + ((value >> 8) & low_bytes);
    const uint64_t sum = (pairs * 0x0001000100010001ull) >> 48;
    return ((double)sum - 8.0 * 127.5) / 209.02153; /* sqrt(8 (256^2 - 1) / 12) */
}

/* Advance 1/f noise to `time` (seconds): the sum of eight relaxation processes with equal variance and time constants
 * one octave apart. A process steps only after an eighth of its time constant, which saves most samples. */
static void step_pink(const struct noise_slot *slot, struct noise_state *state, double time, size_t taxels)
{
    const double process_std = slot->counts / sqrt((double)NOISE_OCTAVES);
    const size_t count = slot->shared ? 1u : taxels;
    double relaxation = SHORTEST_RELAXATION_S;
    for (int octave = 0; octave < NOISE_OCTAVES; octave++, relaxation *= 2.0) {
        const double elapsed = time - state->step_time[octave];
        if (state->has_started && elapsed < relaxation / STEPS_PER_RELAXATION) {
            continue;
        }
        const double correlation = state->has_started ? exp(-elapsed / relaxation) : 0.0;
        const double innovation_std = process_std * sqrt(1.0 - correlation * correlation);
        double *const process = state->process[octave];
        state->step_time[octave] = time;
        for (size_t i = 0; i < count; i++) {
            const double value = correlation * process[i] + innovation_std * approximate_normal(&state->random);
            state->pink[i] += value - process[i];
            process[i] = value;
        }
    }
    state->has_started = true;
}

/* Sample the noise that is constant during a scan, which starts at `time` (seconds): 1/f noise, and line noise of each
 * RX line or of the whole scan. */
void noise_begin_scan(struct noise_board *noise, double time, size_t taxels)
{
    noise->tx = -1;
    for (size_t i = 0; i < noise->count; i++) {
        const struct noise_slot *slot = noise->slot[i];
        struct noise_state *state = &noise->state[i];
        if (slot->form == NOISE_PINK) {
            step_pink(slot, state, time, taxels);
        } else if (slot->form == NOISE_LINE && slot->axis == 1) {
            for (size_t rx = 0; rx < TAXEL_LINES_MAX; rx++) {
                state->rx_values[rx] = slot->counts * random_normal(&state->random);
            }
        } else if (slot->form == NOISE_LINE && slot->axis == 2) {
            state->common = slot->counts * random_normal(&state->random);
        }
    }
}

/* Sample the seconds until the next event of a Poisson process: exponentially distributed with mean 1 / rate_hz. */
static double sample_waiting_time(struct noise_state *state, double rate_hz)
{
    return -log(1.0 - random_uniform(&state->random)) / rate_hz;
}

/* Return the counts that impulsive noise adds at `time` (seconds): +counts or -counts during an event of a Poisson
 * process, otherwise 0. Times must not decrease from call to call. */
static double sample_impulse(const struct noise_slot *slot, struct noise_state *state, double time)
{
    if (!state->has_started) {
        state->has_started = true;
        state->next_event = sample_waiting_time(state, slot->rate_hz);
    }
    while (time >= state->next_event) {
        state->event_end = state->next_event + slot->duration_s;
        state->sign = random_u64(&state->random) >> 63 ? 1.0 : -1.0;
        state->next_event += sample_waiting_time(state, slot->rate_hz);
    }
    return time < state->event_end ? state->sign * slot->counts : 0.0;
}

/* Return the sum of the noise of all sources for the conversion of one crossing at `time` (seconds), in counts before
 * quantisation. Noise of a TX line is sampled again when `tx` differs from the TX line of the previous conversion. */
double noise_counts(struct noise_board *noise, double time, int tx, int rx, size_t taxel)
{
    const bool is_new_line = tx != noise->tx;
    double sum = 0.0;
    noise->tx = tx;
    for (size_t i = 0; i < noise->count; i++) {
        const struct noise_slot *slot = noise->slot[i];
        struct noise_state *state = &noise->state[i];
        switch (slot->form) {
        case NOISE_WHITE:
            sum += slot->counts * normal_source_sample(&state->normals);
            break;
        case NOISE_LINE:
            if (slot->axis == 0 && is_new_line) {
                state->common = slot->counts * random_normal(&state->random);
            }
            sum += slot->axis == 1 ? state->rx_values[rx] : state->common;
            break;
        case NOISE_PINK:
            sum += state->pink[slot->shared ? 0 : taxel];
            break;
        default:
            sum += sample_impulse(slot, state, time);
            break;
        }
    }
    return sum;
}
