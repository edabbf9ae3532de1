#include "emulator/effects/silent.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define SILENT_STREAM 0x73696C6500000000ull
#define UNLIMITED_S 1e30

/* Read the keys of an outage: a board that does not acknowledge its address from a start time on, for a duration or
 * without end (seconds). Returns 0, or -1 after an error line on stderr. */
static int read_from(struct effect_line *line, struct silent_effect *silent)
{
    double duration;
    const size_t n = silent->count;
    if (n == OUTAGES_MAX) {
        return effect_line_report_error(line, "more than 64 outages (form from)");
    }
    if (effect_line_board(line, &silent->outages[n].board) ||
        effect_line_number(line, "seconds", 0.0, 1e7, &silent->outages[n].from) ||
        effect_line_optional(line, "duration", 0.0, 1e7, UNLIMITED_S, &duration)) {
        return -1;
    }
    silent->outages[n].until = silent->outages[n].from + duration;
    silent->count++;
    return 0;
}

/* Read a world-file line `effect silent`: a scheduled outage of a board, or a loose contact that loses addressings with
 * probability p in bursts of a mean length. Returns 0, or -1 after an error line on stderr. */
int silent_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"from", "flaky", NULL};
    struct silent_effect *silent = &effects->silent;
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    double p, burst;
    if (form <= 0) {
        return form < 0 ? -1 : read_from(line, silent);
    }
    if (effect_line_boards(line, &boards) || effect_line_number(line, "p", 0.0, 0.99, &p) ||
        effect_line_optional(line, "burst", 1.0, 1e6, 4.0, &burst)) {
        return -1;
    }
    if (p > burst * (1.0 - p)) { /* p / (burst (1 - p)), the probability that a burst begins, would exceed 1 */
        return effect_line_report_error(line, "expected p <= burst / (1 + burst), found a larger p; raise burst=");
    }
    for (size_t i = boards.first; i < boards.end; i++) {
        silent->probability[i] = p;
        silent->burst[i] = burst;
    }
    return 0;
}

/* Initialise the loose contact of a board: its own random sequence, and its first state. The first state is bad (the
 * board does not acknowledge) with probability p, the stationary probability of the Markov chain. */
void silent_open(struct silent_contact *contact, const struct silent_effect *silent, size_t board, uint64_t seed,
                 uint8_t address)
{
    random_init(&contact->random, seed, SILENT_STREAM | address);
    contact->is_bad = random_uniform(&contact->random) < silent->probability[board];
}

/* Return whether a board fails to acknowledge its I2C address at `time` (seconds). Each call is one addressing and one
 * step of the two-state Markov chain (Gilbert and Elliott) of a loose contact. The transition probabilities give the
 * share p of lost addressings and a mean length of `burst` lost addressings in a row. */
bool silent_loses_addressing(const struct silent_effect *silent, size_t board, double time,
                             struct silent_contact *contact)
{
    const double p = silent->probability[board], burst = silent->burst[board];
    for (size_t i = 0; i < silent->count; i++) {
        if (silent->outages[i].board == board && time >= silent->outages[i].from && time < silent->outages[i].until) {
            return true;
        }
    }
    if (p == 0.0) {
        return false;
    }
    const double transition_probability = contact->is_bad ? 1.0 / burst : p / (burst * (1.0 - p));
    if (random_uniform(&contact->random) < transition_probability) {
        contact->is_bad = !contact->is_bad;
    }
    return contact->is_bad;
}
