#include "emulator/effects/drift.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define DRIFT_STREAM 0x6472696600000000ull
#define BOARDS_LOG_STD 0.3
#define TAXEL_SHARE 0.3
#define LAYER_SLOWER 3.0

/* Read a world-file line `effect drift`: amplitude (counts), time constant (seconds), and relative standard deviation
 * between taxels (`share`) of a warm-up or a random ambient drift. Returns 0, or -1 after an error line on stderr. */
int drift_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"warm_up", "wander", NULL};
    struct drift_effect *drift = &effects->drift;
    struct drift_slot slot = {0};
    const int form = effect_line_form_index(line, forms);
    if (form < 0) {
        return -1;
    }
    if (drift->count == DRIFT_SLOTS_MAX) {
        return effect_line_report_error(line, "more than 8 lines of drift");
    }
    slot.is_random = form == 1;
    if (effect_line_boards(line, &slot.boards) || effect_line_number(line, "counts", -65535.0, 65535.0, &slot.counts) ||
        effect_line_number(line, "seconds", 0.1, 1e6, &slot.seconds) ||
        effect_line_optional(line, "share", 0.0, 2.0, TAXEL_SHARE, &slot.share)) {
        return -1;
    }
    drift->slots[drift->count++] = slot;
    return 0;
}

/* Return whether one line of the effect `drift` has a nonzero amplitude and applies to board number `board`. */
static bool acts_on(const struct drift_slot *slot, size_t board)
{
    return slot->counts != 0.0 && effect_boards_contain(&slot->boards, board);
}

/* Return whether any line of the effect `drift` acts on board number `board`. */
bool drift_is_on(const struct drift_effect *drift, size_t board)
{
    for (size_t i = 0; i < drift->count; i++) {
        if (acts_on(&drift->slots[i], board)) {
            return true;
        }
    }
    return false;
}

/* Sample the constant random numbers of all drifts that act on one board: the amplitude of the board (log-normal for a
 * warm-up) and the deviation of each taxel. Each drift has its own random stream. */
void drift_open(struct drift_board *drift, const struct drift_effect *effect, size_t board, uint64_t seed,
                uint8_t address)
{
    drift->count = 0;
    for (size_t i = 0; i < effect->count; i++) {
        const struct drift_slot *slot = &effect->slots[i];
        if (!acts_on(slot, board)) {
            continue;
        }
        const size_t n = drift->count++;
        drift->slot[n] = slot;
        random_init(&drift->state[n].random, seed, DRIFT_STREAM | (i << 8) | address);
        const double board_normal = random_normal(&drift->state[n].random);
        drift->state[n].amplitude = slot->counts * (slot->is_random ? 1.0 : exp(BOARDS_LOG_STD * board_normal));
        for (size_t taxel = 0; taxel < TAXEL_TAXELS_MAX; taxel++) {
            drift->state[n].taxel[taxel] = slot->share * random_normal(&drift->state[n].random);
        }
    }
}

/* Advance all drifts of a board to the start of a scan (`time`; `powered`: power-on time; seconds). A random drift is
 * an Ornstein-Uhlenbeck process with an exact update; a warm-up with the time constant s is 1 - exp(-t / s) for
 * the traces. For the layer, which the traces heat, it is the response of two lags in series, with the time constants
 * s and LAYER_SLOWER * s. */
void drift_begin_scan(struct drift_board *drift, double time, double powered)
{
    for (size_t i = 0; i < drift->count; i++) {
        const struct drift_slot *slot = drift->slot[i];
        const double amplitude = drift->state[i].amplitude;
        if (slot->is_random) {
            const bool has_started = drift->state[i].has_started;
            const double correlation = has_started ? exp(-(time - drift->state[i].step_time) / slot->seconds) : 0.0;
            const double innovation_std = amplitude * sqrt(1.0 - correlation * correlation);
            drift->state[i].common =
                correlation * drift->state[i].common + innovation_std * random_normal(&drift->state[i].random);
            drift->state[i].taxel_amplitude = drift->state[i].common;
            drift->state[i].step_time = time;
            drift->state[i].has_started = true;
        } else {
            const double board = exp(-(time - powered) / slot->seconds);
            const double layer = exp(-(time - powered) / (LAYER_SLOWER * slot->seconds));
            drift->state[i].common = amplitude * (1.0 - board);
            drift->state[i].taxel_amplitude = amplitude * (1.0 - (LAYER_SLOWER * layer - board) / (LAYER_SLOWER - 1.0));
        }
    }
}

/* Return the drift of one taxel during the current scan, in counts under the world's scan settings: the drift common to
 * the board plus the part that is proportional to the deviation of the taxel. */
double drift_counts(const struct drift_board *drift, size_t taxel)
{
    double sum = 0.0;
    for (size_t i = 0; i < drift->count; i++) {
        sum += drift->state[i].common + drift->state[i].taxel_amplitude * drift->state[i].taxel[taxel];
    }
    return sum;
}
