#include "emulator/electronics.h"

#include <stdlib.h>
#include <string.h>

/* Return whether the effect `dead` applies to a taxel of board number `board`. */
static bool has_dead_taxel(const struct dead_effect *dead, size_t board)
{
    for (size_t i = 0; i < dead->count; i++) {
        if (dead->taxels[i].board == board) {
            return true;
        }
    }
    return false;
}

/* Return whether the effect `exchange` swaps two different lines of board number `board`. */
static bool has_exchanged_lines(const struct exchange_effect *exchange, size_t board)
{
    for (size_t i = 0; i < exchange->count; i++) {
        const struct exchange *one = &exchange->exchanges[i];
        if (one->lines && one->board == board && one->index != one->other) {
            return true;
        }
    }
    return false;
}

/* Return whether any effect of the world requires the detailed electronics for this board. Otherwise, the faster front
 * end alone computes the counts. */
bool electronics_are_needed(const struct world_description *world, size_t board)
{
    const struct effects *effects = &world->effects;
    return coupling_is_on(&effects->coupling, board) || noise_is_on(&effects->noise, board) ||
           drift_is_on(&effects->drift, board) || line_is_on(&effects->line, board) ||
           nonlinear_is_on(&effects->nonlinear, board) || has_dead_taxel(&effects->dead, board) ||
           has_exchanged_lines(&effects->exchange, board) || effects->saturation.board[board].strength > 0.0 ||
           effects->late.lag[board] > 0.0 || effects->stuck_bit.low[board] || effects->stuck_bit.high[board] ||
           droop_is_on(&effects->droop);
}

/* Set which electrode line each line of the firmware is wired to (effect `exchange`), the taxel at each crossing of
 * electrode lines (from the board's crossing map), and the sensitivity or constant count of dead taxels (effect
 * `dead`). */
static void init_wiring(struct electronics *electronics, const struct board_description *description)
{
    const struct effects *effects = electronics->effects;
    uint8_t taxel = 0;
    for (int line = 0; line < (int)TAXEL_LINES_MAX; line++) {
        electronics->tx_of[line] = exchange_source_line(&effects->exchange, electronics->board, 0, line);
        electronics->rx_of[line] = exchange_source_line(&effects->exchange, electronics->board, 1, line);
    }
    memset(electronics->taxel_at, ELECTRONICS_NO_TAXEL, sizeof electronics->taxel_at);
    for (int crossing = 0; crossing < description->rows * description->columns; crossing++) {
        if ((description->crossing_map[crossing >> 3] >> (crossing & 7)) & 1) {
            const int tx = crossing / description->columns, rx = crossing % description->columns;
            electronics->tx_at[taxel] = (uint8_t)tx;
            electronics->rx_at[taxel] = (uint8_t)rx;
            electronics->taxel_at[tx][rx] = taxel++;
        }
    }
    for (uint16_t i = 0; i < description->taxel_count; i++) {
        const struct dead_taxel *detached = dead_find_taxel(&effects->dead, electronics->board, i, false);
        const struct dead_taxel *stuck = dead_find_taxel(&effects->dead, electronics->board, i, true);
        electronics->sensitivity[i] = detached ? 1.0 - detached->strength : 1.0;
        electronics->stuck_count[i] = stuck ? stuck->value : -1;
    }
}

/* Update, for each taxel, the capacitance without contact and the capacitance that a relative rise of 1 adds (both in
 * farad), with the present drift of the board. */
static void update_rest_capacitances(struct electronics *electronics)
{
    for (uint16_t taxel = 0; taxel < electronics->front_end->taxel_count; taxel++) {
        const struct front_end_taxel *electrode = &electronics->front_end->taxels[taxel];
        electronics->rest_f[taxel] = electrode->fixed_f + electrode->fringe_f;
        electronics->swing_f[taxel] = electrode->fringe_f * electronics->sensitivity[taxel];
        if (electronics->has_drift) {
            electronics->rest_f[taxel] += drift_counts(&electronics->drift, taxel) * electronics->farad_per_count;
        }
    }
}

/* Create the electronics of board number `board` with the effects of the world. Changes the settings of the front end
 * to those of the world. Returns NULL if out of memory. */
struct electronics *electronics_open(const struct world_description *world, size_t board, struct front_end *front_end)
{
    struct electronics *electronics = calloc(1, sizeof *electronics);
    const struct board_description *description = &world->boards[board];
    const struct effects *effects = &world->effects;
    if (!electronics) {
        return NULL;
    }
    electronics->effects = effects;
    electronics->board = board;
    electronics->front_end = front_end;
    electronics->tx_count = description->rows;
    electronics->rx_count = description->columns;
    electronics->mutual_tx = -1;
    electronics->has_coupling = coupling_is_on(&effects->coupling, board);
    electronics->has_drift = drift_is_on(&effects->drift, board);
    electronics->has_noise = noise_is_on(&effects->noise, board);
    electronics->has_droop = droop_is_on(&effects->droop);
    electronics->has_line_faults = line_is_on(&effects->line, board);
    electronics->couples_crossings = electronics->has_line_faults || electronics->has_coupling;
    electronics->uses_capacitances =
        electronics->couples_crossings || electronics->has_drift || has_exchanged_lines(&effects->exchange, board);
    init_wiring(electronics, description);
    noise_open(&electronics->noise, &effects->noise, board, world->seed, description->address);
    drift_open(&electronics->drift, &effects->drift, board, world->seed, description->address);
    front_end_configure(front_end, &world->scan, 1.0);
    electronics->farad_per_count = 1.0 / front_end->counts_per_farad;
    update_rest_capacitances(electronics);
    electronics_configure(electronics);
    return electronics;
}

/* Update the crosstalk model after the front end was configured: the impedances of its line network at the new TX
 * frequency, and the calibration that keeps the mean count without contact unchanged. */
void electronics_configure(struct electronics *electronics)
{
    coupling_configure(&electronics->coupling, &electronics->effects->coupling.board[electronics->board],
                       electronics->tx_count, electronics->rx_count, electronics->front_end->tx_hz);
    if (electronics->has_coupling) {
        memset(electronics->mutual, 0, sizeof electronics->mutual);
        for (uint16_t taxel = 0; taxel < electronics->front_end->taxel_count; taxel++) {
            electronics->mutual[electronics->tx_at[taxel]][electronics->rx_at[taxel]] = electronics->rest_f[taxel];
        }
        coupling_calibrate(&electronics->coupling, electronics->mutual);
        electronics->mutual_tx = -1;
        electronics->mutual_is_constant = false;
    }
}

/* Compute the capacitances of all crossings at the time of this conversion. All conversions of TX line `tx` in this
 * scan use the result. */
static void compute_crossings(struct electronics *electronics, const struct electronics_conversion *conversion, int tx)
{
    double rise[TAXEL_TAXELS_MAX];
    electronics->mutual_tx = tx;
    electronics->mutual_is_constant = conversion->fields_are_constant;
    electronics->mutual_change_count = conversion->change_count;
    conversion->get_all_rises(conversion->rise_context, conversion->time, rise);
    if (electronics->has_line_faults) {
        memset(electronics->mutual, 0, sizeof electronics->mutual); /* joined lines set crossings without a taxel too */
    }
    for (uint16_t taxel = 0; taxel < electronics->front_end->taxel_count; taxel++) {
        electronics->mutual[electronics->tx_at[taxel]][electronics->rx_at[taxel]] =
            electronics->rest_f[taxel] + electronics->swing_f[taxel] * rise[taxel];
    }
    if (electronics->has_line_faults) {
        line_apply(&electronics->effects->line, electronics->board, electronics->tx_count, electronics->rx_count,
                   electronics->mutual);
    }
    if (electronics->has_coupling) {
        coupling_set_capacitances(&electronics->coupling, electronics->mutual);
    }
}

/* Return whether the capacitances of all crossings, computed for an earlier conversion, can be used for this conversion
 * of TX line `tx`: no field has changed since, or the earlier conversion belongs to the same TX line and scan. Drift
 * changes the capacitances at the start of every scan. */
static bool are_crossings_valid(const struct electronics *electronics, const struct electronics_conversion *conversion,
                                int tx)
{
    if (conversion->is_first_of_scan && electronics->has_drift) {
        return false;
    }
    if (conversion->fields_are_constant && electronics->mutual_is_constant &&
        conversion->change_count == electronics->mutual_change_count) {
        return true;
    }
    return electronics->mutual_tx == tx && !conversion->is_first_of_scan;
}

/* Return the capacitance (farad) that the converter measures at the crossing of electrode lines `tx` and `rx`; 0 for a
 * crossing without a taxel, unless crossings influence each other. */
static double sensed_capacitance(struct electronics *electronics, const struct electronics_conversion *conversion,
                                 int tx, int rx)
{
    if (!electronics->couples_crossings) {
        const uint8_t taxel = electronics->taxel_at[tx][rx];
        if (taxel == ELECTRONICS_NO_TAXEL) {
            return 0.0;
        }
        const double rise = conversion->get_rise(conversion->rise_context, taxel, conversion->time);
        return electronics->rest_f[taxel] + electronics->swing_f[taxel] * rise;
    }
    if (!are_crossings_valid(electronics, conversion, tx)) {
        compute_crossings(electronics, conversion, tx);
    }
    return electronics->has_coupling ? coupling_effective_capacitance(&electronics->coupling, tx, rx)
                                     : electronics->mutual[tx][rx];
}

/* Return the count before noise, saturation and quantisation. The function applies, in the order of the signal path,
 * the capacitance of the crossing with crosstalk, the droop of supply and reference, and the lag. seconds: virtual
 * time. */
static double hardware_count(struct electronics *electronics, const struct electronics_conversion *conversion,
                             double seconds)
{
    const struct effects *effects = electronics->effects;
    const int tx = electronics->tx_of[conversion->tx], rx = electronics->rx_of[conversion->rx];
    const uint8_t taxel = electronics->taxel_at[tx][rx];
    double count;
    if (electronics->uses_capacitances) {
        count = sensed_capacitance(electronics, conversion, tx, rx) * electronics->front_end->counts_per_farad;
    } else {
        const double rise =
            electronics->sensitivity[taxel] * conversion->get_rise(conversion->rise_context, taxel, conversion->time);
        count = front_end_hardware_count(electronics->front_end, taxel, rise);
    }
    if (electronics->has_droop) {
        if (conversion->is_first_of_scan || electronics->droop_tx != tx) {
            electronics->droop_tx = tx;
            electronics->droop =
                droop_factor(&effects->droop, electronics->board, conversion->loads, conversion->fraction,
                             electronics->front_end->tx_hz, seconds, &electronics->reference);
        }
        count *= electronics->droop;
    }
    if (effects->late.lag[electronics->board] > 0.0 && taxel != ELECTRONICS_NO_TAXEL) {
        count = first_order_step(&electronics->lag[taxel], seconds, count, effects->late.lag[electronics->board]);
    }
    return count;
}

/* Return the raw count of a conversion with all effects of the board, in the order of the signal path. Noise and a
 * constant count belong to the crossing that the firmware requests; the signal belongs to the crossing of the electrode
 * lines to which the requested lines are wired. */
uint16_t electronics_convert(struct electronics *electronics, const struct electronics_conversion *conversion)
{
    const struct effects *effects = electronics->effects;
    struct front_end *front_end = electronics->front_end;
    const size_t board = electronics->board;
    const double seconds = (double)conversion->time / (double)VTIME_SECOND;
    if (conversion->is_first_of_scan) {
        noise_begin_scan(&electronics->noise, seconds, front_end->taxel_count);
        if (electronics->has_drift) {
            drift_begin_scan(&electronics->drift, seconds, (double)conversion->power_on_time / (double)VTIME_SECOND);
            update_rest_capacitances(electronics);
        }
    }
    const uint8_t requested_taxel = electronics->taxel_at[conversion->tx][conversion->rx];
    const uint8_t measured_taxel =
        electronics->taxel_at[electronics->tx_of[conversion->tx]][electronics->rx_of[conversion->rx]];
    double count = hardware_count(electronics, conversion, seconds) + front_end_sample_noise(front_end);
    if (electronics->has_noise) {
        count += noise_counts(&electronics->noise, seconds, conversion->tx, conversion->rx, requested_taxel);
    }
    const double rest_count =
        measured_taxel == ELECTRONICS_NO_TAXEL ? 0.0 : front_end->taxels[measured_taxel].rest_hardware_count;
    count = saturation_limit(&effects->saturation.board[board], rest_count, count);
    if (nonlinear_is_on(&effects->nonlinear, board)) {
        count = nonlinear_count(&effects->nonlinear, board, front_end->max_count, count);
    }
    const int32_t stuck_count = electronics->stuck_count[requested_taxel];
    const uint16_t raw = stuck_count >= 0 ? (uint16_t)stuck_count : front_end_quantise(front_end, count);
    return stuck_bit_apply(&effects->stuck_bit, board, raw);
}
