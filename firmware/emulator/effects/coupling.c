#include "emulator/effects/coupling.h"

#include <string.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define PI 3.14159265358979323846
#define PICO 1e-12
#define OHM_MAX 1e5
#define CALIBRATION_MAX 8.0 /* the current source has steps down to one eighth */
#define GROUND_PF 8.0       /* trace of about 10 cm on a flexible board */
#define TRACES_OHM 1000.0   /* driver or multiplexer plus a line of silver ink */

/* Read a world-file line `effect coupling`: series resistance of the TX and RX lines (ohm; without a value 0 for form
 * `resistive` and TRACES_OHM for form `traces`), capacitance of a line to ground and, for form `traces`, between
 * neighbouring traces (pF). Returns 0, or -1 after an error line on stderr. */
int coupling_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"resistive", "traces", NULL};
    const int form = effect_line_form_index(line, forms);
    const double ohm = form == 1 ? TRACES_OHM : 0.0;
    struct effect_boards boards;
    struct coupling_board board = {0};
    double ground_pf, trace_pf = 0.0;
    if (form < 0 || effect_line_boards(line, &boards) ||
        effect_line_optional(line, "tx_ohm", 0.0, OHM_MAX, ohm, &board.tx_ohm) ||
        effect_line_optional(line, "rx_ohm", 0.0, OHM_MAX, ohm, &board.rx_ohm) ||
        effect_line_optional(line, "ground_pf", 0.0, 1000.0, GROUND_PF, &ground_pf) ||
        (form == 1 && effect_line_number(line, "picofarad", 0.0, 100.0, &trace_pf))) {
        return -1;
    }
    board.ground_f = ground_pf * PICO;
    board.trace_f = trace_pf * PICO;
    if (form == 1 && trace_pf == 0.0) { /* strength 0 of the form: the effect is off, whatever the resistances */
        board.tx_ohm = board.rx_ohm = 0.0;
    }
    for (size_t i = boards.first; i < boards.end; i++) {
        effects->coupling.board[i] = board;
    }
    return 0;
}

/* Return whether the effect `coupling` acts on board number `board`: TX or RX lines have a resistance. */
bool coupling_is_on(const struct coupling_effect *coupling, size_t board)
{
    return coupling->board[board].tx_ohm > 0.0 || coupling->board[board].rx_ohm > 0.0;
}

/* Set the electrical parameters of the line network of one board; `tx_hz` is the frequency of the TX excitation.
 * Incrementing the version invalidates the stored solutions of all TX lines. */
void coupling_configure(struct coupling_lines *lines, const struct coupling_board *board, int tx_count, int rx_count,
                        double tx_hz)
{
    struct network *network = &lines->network;
    network->tx_count = tx_count;
    network->rx_count = rx_count;
    network->tx_ohm = board->tx_ohm;
    network->rx_ohm = board->rx_ohm;
    network->ground_f = board->ground_f;
    network->trace_f = board->trace_f;
    network->omega = 2.0 * PI * tx_hz;
    network->is_changed = true;
    lines->version++;
}

/* Set the mutual capacitances [tx][rx] of the crossings (farad, 0 without a taxel); the stored solutions of all TX
 * lines become invalid. */
void coupling_set_capacitances(struct coupling_lines *lines, double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX])
{
    memcpy(lines->network.mutual, mutual_f, sizeof lines->network.mutual);
    lines->network.is_changed = true;
    lines->version++;
}

/* Choose the gain that restores the mean effective capacitance over all taxels to its ideal value, as firmware
 * calibrates its current source once at rest. `mutual_f`: capacitances at rest [tx][rx], farad, 0 without a taxel; the
 * gain is limited by the range of the current source. */
void coupling_calibrate(struct coupling_lines *lines, double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX])
{
    double ideal = 0.0, effective = 0.0;
    lines->calibration = 1.0;
    coupling_set_capacitances(lines, mutual_f);
    for (int tx = 0; tx < lines->network.tx_count; tx++) {
        for (int rx = 0; rx < lines->network.rx_count; rx++) {
            if (mutual_f[tx][rx] > 0.0) {
                ideal += mutual_f[tx][rx];
                effective += coupling_effective_capacitance(lines, tx, rx);
            }
        }
    }
    lines->calibration = effective * CALIBRATION_MAX > ideal ? ideal / effective : CALIBRATION_MAX;
}

/* Return the capacitance (farad) that the converter measures at a crossing, with crosstalk. The network is solved only
 * if a capacitance has changed since the last solution for this TX line. */
double coupling_effective_capacitance(struct coupling_lines *lines, int tx, int rx)
{
    if (lines->solved_version[tx] != lines->version) {
        (void)network_solve(&lines->network, tx, &lines->state[tx], lines->effective_f[tx]);
        lines->solved_version[tx] = lines->version;
    }
    return lines->calibration * lines->effective_f[tx][rx];
}
