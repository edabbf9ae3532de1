#include "emulator/electronics.h"

#include <stdlib.h>
#include <string.h>

static bool has_dead(const struct dead_effect *dead, size_t board)
{
    for (size_t i = 0; i < dead->count; i++) {
        if (dead->taxels[i].board == board) {
            return true;
        }
    }
    return false;
}

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

bool electronics_needed(const struct world_description *world, size_t board)
{
    const struct effects *effects = &world->effects;
    return coupling_is_on(&effects->coupling, board) || noise_is_on(&effects->noise, board) ||
           drift_is_on(&effects->drift, board) || line_is_on(&effects->line, board) ||
           nonlinear_is_on(&effects->nonlinear, board) || has_dead(&effects->dead, board) ||
           has_exchanged_lines(&effects->exchange, board) || effects->saturation.board[board].strength > 0.0 ||
           effects->late.lag[board] > 0.0 || effects->stuck_bit.low[board] || effects->stuck_bit.high[board] ||
           droop_is_on(&effects->droop);
}

static void wire(struct electronics *electronics, const struct board_description *description)
{
    const struct effects *effects = electronics->effects;
    uint8_t taxel = 0;
    for (int line = 0; line < (int)TAXEL_LINES_MAX; line++) {
        electronics->tx_of[line] = exchange_line(&effects->exchange, electronics->board, 0, line);
        electronics->rx_of[line] = exchange_line(&effects->exchange, electronics->board, 1, line);
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
        const struct dead_taxel *rest = dead_find(&effects->dead, electronics->board, i, false);
        const struct dead_taxel *stuck = dead_find(&effects->dead, electronics->board, i, true);
        electronics->answer[i] = rest ? 1.0 - rest->strength : 1.0;
        electronics->stuck_at[i] = stuck ? stuck->value : -1;
    }
}

static void set_rest(struct electronics *electronics)
{
    for (uint16_t taxel = 0; taxel < electronics->front_end->taxel_count; taxel++) {
        const struct front_end_taxel *cell = &electronics->front_end->taxels[taxel];
        electronics->rest_f[taxel] = cell->fixed_f + cell->fringe_f;
        electronics->swing_f[taxel] = cell->fringe_f * electronics->answer[taxel];
        if (electronics->drifting) {
            electronics->rest_f[taxel] += drift_counts(&electronics->drift, taxel) * electronics->farad_a_count;
        }
    }
}

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
    electronics->filled_tx = -1;
    electronics->coupled = coupling_is_on(&effects->coupling, board);
    electronics->drifting = drift_is_on(&effects->drift, board);
    electronics->noisy = noise_is_on(&effects->noise, board);
    electronics->drooping = droop_is_on(&effects->droop);
    electronics->broken = line_is_on(&effects->line, board);
    electronics->lines = electronics->broken || electronics->coupled;
    electronics->capacitive = electronics->lines || electronics->drifting || has_exchanged_lines(&effects->exchange, board);
    wire(electronics, description);
    noise_open(&electronics->noise, &effects->noise, board, world->seed, description->address);
    drift_open(&electronics->drift, &effects->drift, board, world->seed, description->address);
    front_end_configure(front_end, &world->scan, 1.0);
    electronics->farad_a_count = 1.0 / front_end->counts_per_farad;
    set_rest(electronics);
    electronics_configure(electronics);
    return electronics;
}

void electronics_configure(struct electronics *electronics)
{
    coupling_configure(&electronics->coupling, &electronics->effects->coupling.board[electronics->board],
                       electronics->tx_count, electronics->rx_count, electronics->front_end->tx_hz);
    if (electronics->coupled) {
        memset(electronics->mutual, 0, sizeof electronics->mutual);
        for (uint16_t taxel = 0; taxel < electronics->front_end->taxel_count; taxel++) {
            electronics->mutual[electronics->tx_at[taxel]][electronics->rx_at[taxel]] = electronics->rest_f[taxel];
        }
        coupling_calibrate(&electronics->coupling, electronics->mutual);
        electronics->filled_tx = -1;
        electronics->filled_still = false;
    }
}

/* The board's crossings as they are when a TX line's step begins. */
static void fill(struct electronics *electronics, const struct electronics_conversion *conversion, int tx)
{
    double rise[TAXEL_TAXELS_MAX];
    electronics->filled_tx = tx;
    electronics->filled_still = conversion->still;
    electronics->filled_fields = conversion->fields;
    conversion->rises(conversion->source, conversion->time, rise);
    if (electronics->broken) {
        memset(electronics->mutual, 0, sizeof electronics->mutual); /* joined lines carry more than their taxels */
    }
    for (uint16_t taxel = 0; taxel < electronics->front_end->taxel_count; taxel++) {
        electronics->mutual[electronics->tx_at[taxel]][electronics->rx_at[taxel]] =
            electronics->rest_f[taxel] + electronics->swing_f[taxel] * rise[taxel];
    }
    if (electronics->broken) {
        line_apply(&electronics->effects->line, electronics->board, electronics->tx_count, electronics->rx_count,
                   electronics->mutual);
    }
    if (electronics->coupled) {
        coupling_set(&electronics->coupling, electronics->mutual);
    }
}

static bool is_filled(const struct electronics *electronics, const struct electronics_conversion *conversion, int tx)
{
    if (conversion->begins_scan && electronics->drifting) {
        return false;
    }
    if (conversion->still && electronics->filled_still && conversion->fields == electronics->filled_fields) {
        return true;
    }
    return electronics->filled_tx == tx && !conversion->begins_scan;
}

static double sensed_farad(struct electronics *electronics, const struct electronics_conversion *conversion, int tx, int rx)
{
    if (!electronics->lines) {
        const uint8_t taxel = electronics->taxel_at[tx][rx];
        if (taxel == ELECTRONICS_NO_TAXEL) {
            return 0.0;
        }
        const double rise = conversion->rise(conversion->source, taxel, conversion->time);
        return electronics->rest_f[taxel] + electronics->swing_f[taxel] * rise;
    }
    if (!is_filled(electronics, conversion, tx)) {
        fill(electronics, conversion, tx);
    }
    return electronics->coupled ? coupling_effective(&electronics->coupling, tx, rx) : electronics->mutual[tx][rx];
}

static double hardware_count(struct electronics *electronics, const struct electronics_conversion *conversion, double seconds)
{
    const struct effects *effects = electronics->effects;
    const int tx = electronics->tx_of[conversion->tx], rx = electronics->rx_of[conversion->rx];
    const uint8_t taxel = electronics->taxel_at[tx][rx];
    double count;
    if (electronics->capacitive) {
        count = sensed_farad(electronics, conversion, tx, rx) * electronics->front_end->counts_per_farad;
    } else {
        const double rise = electronics->answer[taxel] * conversion->rise(conversion->source, taxel, conversion->time);
        count = front_end_hardware_count(electronics->front_end, taxel, rise);
    }
    if (electronics->drooping) {
        if (conversion->begins_scan || electronics->droop_tx != tx) {
            electronics->droop_tx = tx;
            electronics->droop = droop_factor(&effects->droop, electronics->board, conversion->loads, conversion->fraction,
                                              electronics->front_end->tx_hz, seconds, &electronics->reference);
        }
        count *= electronics->droop;
    }
    if (effects->late.lag[electronics->board] > 0.0 && taxel != ELECTRONICS_NO_TAXEL) {
        count = first_order_step(&electronics->lag[taxel], seconds, count, effects->late.lag[electronics->board]);
    }
    return count;
}

uint16_t electronics_convert(struct electronics *electronics, const struct electronics_conversion *conversion)
{
    const struct effects *effects = electronics->effects;
    struct front_end *front_end = electronics->front_end;
    const size_t board = electronics->board;
    const double seconds = (double)conversion->time / (double)VTIME_SECOND;
    if (conversion->begins_scan) {
        noise_begin_scan(&electronics->noise, seconds, front_end->taxel_count);
        if (electronics->drifting) {
            drift_begin_scan(&electronics->drift, seconds, (double)conversion->powered / (double)VTIME_SECOND);
            set_rest(electronics);
        }
    }
    const uint8_t asked = electronics->taxel_at[conversion->tx][conversion->rx];
    const uint8_t taxel = electronics->taxel_at[electronics->tx_of[conversion->tx]][electronics->rx_of[conversion->rx]];
    double count = hardware_count(electronics, conversion, seconds) + front_end_noise(front_end);
    if (electronics->noisy) {
        count += noise_counts(&electronics->noise, seconds, conversion->tx, conversion->rx, asked);
    }
    const double rest = taxel == ELECTRONICS_NO_TAXEL ? 0.0 : front_end->taxels[taxel].rest_hardware_count;
    count = saturation_limit(&effects->saturation.board[board], rest, count);
    if (nonlinear_is_on(&effects->nonlinear, board)) {
        count = nonlinear_count(&effects->nonlinear, board, front_end->largest_count, count);
    }
    const uint16_t raw =
        electronics->stuck_at[asked] >= 0 ? (uint16_t)electronics->stuck_at[asked] : front_end_quantise(front_end, count);
    return stuck_bit_apply(&effects->stuck_bit, board, raw);
}
