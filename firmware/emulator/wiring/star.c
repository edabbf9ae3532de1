#include "emulator/wiring/star.h"

#include <math.h>

#define PICO 1e-12
#define CONTACT_OHM 0.01 /* of a connection without series resistance or of a short, so that conductances are finite */
#define STEPS_PER_TAU 4000.0 /* steps of the transient per time constant; error of the rise time below 0.1 % */
#define STEP_GROWTH 2e-4     /* the step grows with the time, for branches much slower than the hub's node */
#define LEAKAGE_SIEMENS 1e-9 /* of a node to ground: a node without pull-up is low */

/* One node for the boards of a branch; conductances in siemens, levels as shares of the supply. */
struct node {
    double to_hub;
    double to_supply, to_ground;
    double farad;
    double level;
};

struct network {
    struct node hub; /* to_hub is unused */
    struct node branches[WIRING_BRANCHES_MAX];
    size_t count;
};

/* Return the conductance (siemens) of a resistor; a short is treated as a resistor of CONTACT_OHM. */
static double compute_conductance(double ohm)
{
    return 1.0 / fmax(ohm, CONTACT_OHM);
}

/* Return the conductance (siemens) of a pull-up resistor; 0 for 0 ohms, which means no resistor. */
static double pullup_conductance(double ohm)
{
    return ohm > 0.0 ? compute_conductance(ohm) : 0.0;
}

/* Return the circuit node that represents all boards of a branch: its conductances (siemens) to hub, supply and ground,
 * and its capacitance, with the faults of the line. An open line has no connection to the hub. */
static struct node make_branch(const struct branch_description *branch, const struct line_fault *fault)
{
    struct node node = {.to_hub = compute_conductance(branch->series_ohm + fault->added_series),
                        .to_supply = pullup_conductance(branch->pullup_ohm),
                        .to_ground = LEAKAGE_SIEMENS,
                        .farad = branch->capacitance_pf * PICO};
    if (fault->is_open) {
        node.to_hub = 0.0;
    }
    if (fault->has_short_to_ground) {
        node.to_ground += compute_conductance(fault->to_ground);
    }
    if (fault->has_short_to_supply) {
        node.to_supply += compute_conductance(fault->to_supply);
    }
    return node;
}

/* Compute the levels of all nodes (as shares of the supply voltage) after one implicit Euler step of `seconds` from
 * their present levels; with INFINITY, the final levels. Each branch is eliminated into the hub's node, which is
 * possible because the branches are connected only at the hub. */
static void step(struct network *network, double seconds)
{
    const struct node *hub = &network->hub;
    double diagonal = hub->to_supply + hub->to_ground + hub->farad / seconds;
    double current = hub->to_supply + hub->farad / seconds * hub->level;
    for (size_t i = 0; i < network->count; i++) {
        const struct node *node = &network->branches[i];
        const double own = node->to_supply + node->to_ground + node->farad / seconds;
        const double source = node->to_supply + node->farad / seconds * node->level;
        diagonal += node->to_hub * own / (node->to_hub + own);
        current += node->to_hub * source / (node->to_hub + own);
    }
    const double level = current / diagonal;
    network->hub.level = level;
    for (size_t i = 0; i < network->count; i++) {
        struct node *node = &network->branches[i];
        const double own = node->to_supply + node->to_ground + node->farad / seconds;
        const double source = node->to_supply + node->farad / seconds * node->level;
        node->level = (source + node->to_hub * level) / (own + node->to_hub);
    }
}

/* Return the levels of all nodes after a long time, while the driver at `driver` (NULL: none) pulls its node low. */
static struct network solve_levels(const struct network *network, const struct node *driver)
{
    struct network result = *network;
    if (driver == &network->hub) {
        result.hub.to_ground += compute_conductance(STAR_DRIVER_OHM);
    } else if (driver) {
        result.branches[driver - network->branches].to_ground += compute_conductance(STAR_DRIVER_OHM);
    }
    step(&result, INFINITY);
    return result;
}

/* Times at which a node passes STAR_LOW_LEVEL and STAR_HIGH_LEVEL. */
struct crossing {
    double low_s, high_s;
};

/* Record the times at which a node passed STAR_LOW_LEVEL or STAR_HIGH_LEVEL, between which the rise time is measured,
 * in the step from `before_s` to `after_s`. before, after: levels of the node at both times; a time is interpolated. */
static void record_crossing(struct crossing *crossing, double before, double after, double before_s, double after_s)
{
    if (before < STAR_LOW_LEVEL && after >= STAR_LOW_LEVEL) {
        crossing->low_s = before_s + (after_s - before_s) * (STAR_LOW_LEVEL - before) / (after - before);
    }
    if (before < STAR_HIGH_LEVEL && after >= STAR_HIGH_LEVEL) {
        crossing->high_s = before_s + (after_s - before_s) * (STAR_HIGH_LEVEL - before) / (after - before);
    }
}

/* Return the time constant (seconds) of the sum of all capacitances at the sum of all conductances to supply and
 * ground. */
static double compute_common_time_constant(const struct network *network)
{
    double farad = network->hub.farad, siemens = network->hub.to_supply + network->hub.to_ground;
    for (size_t i = 0; i < network->count; i++) {
        const struct node *node = &network->branches[i];
        farad += node->farad;
        siemens += node->to_supply + node->to_ground;
    }
    return farad / siemens;
}

/* Compute the rise times of all nodes, in seconds from STAR_LOW_LEVEL to STAR_HIGH_LEVEL, after a release at level 0:
 * [0] the hub, [1 + i] branch i; INFINITY for a node that stays low. The loop ends when every node that becomes high
 * (`rising`) has passed the high level. */
static void solve_rise(const struct network *network, double *rise_s)
{
    struct network final = solve_levels(network, NULL), present = *network;
    struct crossing crossings[WIRING_BRANCHES_MAX + 1u] = {{.low_s = 0.0}};
    size_t rising = 0;
    present.hub.level = 0.0;
    for (size_t i = 0; i < network->count; i++) {
        present.branches[i].level = 0.0;
    }
    for (size_t i = 0; i <= network->count; i++) {
        const double level = i ? final.branches[i - 1u].level : final.hub.level;
        rise_s[i] = level > STAR_HIGH_LEVEL ? 0.0 : INFINITY;
        rising += level > STAR_HIGH_LEVEL;
    }
    const double tau_s = fmax(compute_common_time_constant(network), PICO);
    for (double now_s = 0.0; rising;) {
        const struct network before = present;
        const double duration_s = tau_s / STEPS_PER_TAU + STEP_GROWTH * now_s;
        step(&present, duration_s);
        for (size_t i = 0; i <= network->count; i++) {
            const double old_level = i ? before.branches[i - 1u].level : before.hub.level;
            const double level = i ? present.branches[i - 1u].level : present.hub.level;
            record_crossing(&crossings[i], old_level, level, now_s, now_s + duration_s);
            if (rise_s[i] == 0.0 && level >= STAR_HIGH_LEVEL) {
                rise_s[i] = crossings[i].high_s - crossings[i].low_s;
                rising--;
            }
        }
        now_s += duration_s;
    }
}

/* Write the levels and rise times of a network to the star. Branch i of the network is branch `first` + i of the
 * star. */
static void read_network(struct star *star, const struct network *network, size_t first)
{
    double rise_s[WIRING_BRANCHES_MAX + 1u];
    const struct network released = solve_levels(network, NULL), hub_low = solve_levels(network, &network->hub);
    solve_rise(network, rise_s);
    star->hub_rise_s = rise_s[0];
    star->is_high = released.hub.level > STAR_HIGH_LEVEL;
    star->can_be_low = hub_low.hub.level <= STAR_LOW_LEVEL;
    for (size_t i = 0; i < network->count; i++) {
        const struct network board_low = solve_levels(network, &network->branches[i]);
        star->branches[first + i] = (struct star_branch){
            .rise_s = rise_s[i + 1u],
            .is_high = released.branches[i].level > STAR_HIGH_LEVEL,
            .hub_lows_arrive = hub_low.branches[i].level <= STAR_LOW_LEVEL,
            .board_lows_arrive = board_low.hub.level <= STAR_LOW_LEVEL,
        };
    }
}

/* Compute levels and rise times of one line of the star. With buffers, each branch is a network of its own. */
void star_solve(struct star *star, const struct wiring_description *wiring, const struct line_fault *faults)
{
    struct network network = {.hub = {.to_supply = pullup_conductance(wiring->hub_pullup_ohm),
                                      .to_ground = LEAKAGE_SIEMENS,
                                      .farad = wiring->hub_capacitance_pf * PICO}};
    if (!wiring->is_buffered) {
        network.count = wiring->branch_count;
        for (size_t i = 0; i < network.count; i++) {
            network.branches[i] = make_branch(&wiring->branches[i], &faults[i]);
        }
        read_network(star, &network, 0);
        return;
    }
    /* each buffer drives its branch as the hub drives its own node, and a fault stays in its branch */
    for (size_t i = 0; i < wiring->branch_count; i++) {
        const struct network segment = {.hub = {.to_ground = LEAKAGE_SIEMENS},
                                        .branches = {make_branch(&wiring->branches[i], &faults[i])},
                                        .count = 1};
        read_network(star, &segment, i);
        star->branches[i].rise_s = fmax(star->branches[i].rise_s, star->hub_rise_s);
        star->branches[i].hub_lows_arrive = star->branches[i].hub_lows_arrive && star->can_be_low;
        star->branches[i].is_high = star->branches[i].is_high && star->is_high;
    }
    read_network(star, &network, 0);
}

/* Limits of an I2C mode (UM10204, table 11). */
static const struct mode {
    double scl_hz, rise_s, setup_s;
} modes[] = {{100e3, 1000e-9, 250e-9}, {400e3, 300e-9, 100e-9}, {1e6, 120e-9, 50e-9}};

/* Return the limits of the slowest I2C mode that permits the clock rate; above 1 MHz, limits that fall with the
 * rate. */
static struct mode find_mode(double scl_hz)
{
    const size_t count = sizeof modes / sizeof modes[0];
    for (size_t i = 0; i < count; i++) {
        if (scl_hz <= modes[i].scl_hz) {
            return modes[i];
        }
    }
    const double ratio = modes[count - 1u].scl_hz / scl_hz;
    return (struct mode){scl_hz, modes[count - 1u].rise_s * ratio, modes[count - 1u].setup_s * ratio};
}

/* Return the largest rise time (seconds) that is permitted at the clock rate. */
double star_rise_limit_s(double scl_hz)
{
    return find_mode(scl_hz).rise_s;
}

/* Return the probability that a receiver misreads a rising bit: the share of the set-up time by which the rise time
 * exceeds its limit, between 0 and 1. */
double star_misread_probability(double rise_s, double scl_hz)
{
    const struct mode mode = find_mode(scl_hz);
    return fmin(1.0, fmax(0.0, rise_s - mode.rise_s) / mode.setup_s);
}
