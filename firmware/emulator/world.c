#include "emulator/world.h"

#include <errno.h>
#include <string.h>

#include "emulator/hub_original.h"
#include "emulator/power_cuts.h"
#include "emulator/world_fields.h"

/* with threads, all boards are advanced in parallel this often, ahead of reads that need it */
#define ADVANCE_STEP (4u * VTIME_MS)

/* Return the number of taxels of all boards in the description of a world. */
size_t world_taxel_count(const struct world_description *description)
{
    size_t taxels = 0;
    for (size_t i = 0; i < description->board_count; i++) {
        taxels += description->boards[i].taxel_count;
    }
    return taxels;
}

/* Return the index of a board's first taxel in the stimulus. */
static size_t find_first_taxel(const struct world_description *description, size_t board)
{
    size_t first = 0;
    for (size_t i = 0; i < board; i++) {
        first += description->boards[i].taxel_count;
    }
    return first;
}

/* Create the world: skin, boards, bus, UART and hub, all powered on at virtual time 0. Returns 0, or -1 after an error
 * line on stderr. */
int world_init(struct world *world, const struct world_description *description, struct stimulus *stimulus,
               struct endpoint *endpoint, struct host_script *script)
{
    memset(world, 0, sizeof *world);
    world->description = description;
    world->stimulus = stimulus;
    world->endpoint = endpoint;
    world->script = script;
    world->board_count = description->board_count;
    if (skin_init(&world->skin, description, stimulus)) {
        return -1;
    }
    for (size_t i = 0; i < world->board_count; i++) {
        const size_t source = exchange_source_board(&description->effects.exchange, i);
        if (board_node_init(&world->boards[i], &description->boards[i], description, stimulus, &world->skin, i,
                            find_first_taxel(description, source), &world->loads)) {
            return -1;
        }
        world->boards[i].log = &world->log;
    }
    world_fields_start(world, 0);
    bus_init(&world->bus, world->boards, world->board_count, description->scl_hz, &world->log);
    bus_wiring_init(&world->bus.wiring, &description->wiring, description->scl_hz, description->seed);
    world->bus.byte_hold = (vtime)(description->hub_byte_us * (double)VTIME_US);
    uart_init(&world->uart, endpoint, description, &world->log);
    if (hub_node_init(&world->hub, &world->bus, &world->uart, description)) {
        return -1;
    }
    hub_node_boot(&world->hub, 0, TAXEL_RESET_CAUSE_POWER_ON);
    return 0;
}

/* Let the world compute boards and skin in the threads of a pool; NULL: in the calling thread only. */
void world_use_thread_pool(struct world *world, struct thread_pool *thread_pool)
{
    world->thread_pool = world->skin.thread_pool = thread_pool;
}

/* Free boards, hub and skin of the world. The caller owns the struct itself. */
void world_free(struct world *world)
{
    for (size_t i = 0; i < world->board_count; i++) {
        board_node_free(&world->boards[i]);
    }
    hub_node_free(&world->hub);
    skin_free(&world->skin);
}

/* Return the virtual time of the next fault of the world file; VTIME_NEVER after the last fault. */
static vtime next_fault_time(const struct world *world)
{
    if (world->next_fault == world->description->fault_count) {
        return VTIME_NEVER;
    }
    return (vtime)(world->description->faults[world->next_fault].time_s * (double)VTIME_SECOND);
}

/* The kinds of event. Simultaneous events are processed in this order. */
enum event {
    EVENT_STIMULUS,
    EVENT_FAULT,
    EVENT_POWER,
    EVENT_SKIN,
    EVENT_SCRIPT,
    EVENT_RECEIVE,
    EVENT_BUS,
    EVENT_TRANSMIT,
    EVENT_PACKET,
    EVENT_HUB,
    EVENT_COUNT,
};

/* Write the virtual time of the next event of each kind; VTIME_NEVER if none is scheduled. */
static void list_event_times(const struct world *world, vtime times[EVENT_COUNT])
{
    times[EVENT_STIMULUS] = world->stimulus->until;
    times[EVENT_FAULT] = next_fault_time(world);
    times[EVENT_POWER] = world->has_power_cuts ? power_cuts_next_time(world) : VTIME_NEVER;
    times[EVENT_SKIN] = world->skin.next;
    times[EVENT_SCRIPT] = world->script->next;
    times[EVENT_RECEIVE] = world->uart.receive_next;
    times[EVENT_BUS] = world->bus.next;
    times[EVENT_TRANSMIT] = world->uart.transmit_next;
    times[EVENT_PACKET] = world->uart.packet_deadline;
    times[EVENT_HUB] = hub_node_next_time(&world->hub);
}

/* Return the kind and virtual time of the next event. Of several events at the same time, the first kind in the enum
 * has precedence, so that runs are reproducible. */
static enum event find_earliest_event(const struct world *world, vtime *time)
{
    vtime times[EVENT_COUNT];
    list_event_times(world, times);
    enum event first = EVENT_STIMULUS;
    for (enum event event = EVENT_FAULT; event < EVENT_COUNT; event++) {
        if (times[event] < times[first]) {
            first = event;
        }
    }
    *time = times[first];
    return first;
}

/* Return the virtual time up to which the bus or the hub (`running`) may run in one call: just before the next event of
 * another kind, at most `until`. The order of events matters, because the end of a transfer and a UART interrupt occupy
 * the same CPU of the hub. */
static vtime run_limit(const struct world *world, enum event running, vtime now, vtime until)
{
    vtime times[EVENT_COUNT];
    list_event_times(world, times);
    for (enum event event = EVENT_STIMULUS; event < EVENT_COUNT; event++) {
        if (event != running && times[event] <= until) {
            until = times[event] > now ? times[event] - 1u : now;
        }
    }
    return vtime_max(now, until);
}

/* Handle the end of a transfer, or of one command of a bytewise master. The result is passed on before the bus is
 * released, because the next transfer overwrites the result. */
static void end_transfer(struct world *world)
{
    const vtime end = world->bus.next;
    if (world->bus.phase == BUS_HELD) {
        world->bus.next = VTIME_NEVER;
        hub_node_on_i2c_done(&world->hub, end);
        return;
    }
    if (world->bus.master == BUS_HUB) {
        hub_node_on_i2c_done(&world->hub, end);
    } else {
        world->adapter.result = world->bus.result;
        world->adapter.is_done = true;
    }
    bus_release(&world->bus, end);
}

/* Execute one event at virtual time `now`. Bus and processor may run ahead until the next other event, at most to
 * `until`. Returns 0, or -1 after an error. */
static int handle_event(struct world *world, enum event event, vtime now, vtime until)
{
    switch (event) {
    case EVENT_STIMULUS:
        return world_fields_next_record(world, now);
    case EVENT_FAULT:
        return world_inject_fault(world, &world->description->faults[world->next_fault++]);
    case EVENT_POWER:
        power_cuts_run(world, now);
        return 0;
    case EVENT_SKIN:
        return world_fields_step(world, now);
    case EVENT_SCRIPT:
        (void)uart_send_from_host(&world->uart, world->script->bytes, world->script->size, now);
        return host_script_advance(world->script);
    case EVENT_RECEIVE:
        uart_deliver_to_hub(&world->uart, world->hub.is_powered);
        if (world->hub.is_powered) {
            hub_node_on_uart_received(&world->hub, now);
        }
        return 0;
    case EVENT_BUS:
        if (bus_run(&world->bus, run_limit(world, EVENT_BUS, now, until))) {
            end_transfer(world);
        }
        return 0;
    case EVENT_TRANSMIT:
        hub_node_on_uart_sent(&world->hub, now, uart_refill_transmitter(&world->uart));
        return 0;
    case EVENT_PACKET:
        uart_flush_packet(&world->uart, now);
        return 0;
    default:
        hub_node_run(&world->hub, world->hub.psoc ? run_limit(world, EVENT_HUB, now, until) : now);
        return 0;
    }
}

/* Execute all events until a virtual time. Returns 0, or -1 after an error. */
int world_run(struct world *world, vtime until)
{
    for (;;) {
        vtime time;
        const enum event event = find_earliest_event(world, &time);
        if (time > until) {
            break;
        }
        world->now = vtime_max(world->now, time);
        world->events++;
        if (world->thread_pool && time >= world->boards_advanced_until + ADVANCE_STEP) {
            world_advance_boards(world, time);
        }
        if (handle_event(world, event, time, until)) {
            return -1;
        }
    }
    world->now = vtime_max(world->now, until);
    return 0;
}

/* Set the force in newtons, or the raw count, of each taxel from the present virtual time on, in the order of the
 * boards. Returns 0, or -1 on an error. */
int world_set_stimulus(struct world *world, const float *values)
{
    return world_fields_set_live(world, values);
}

/* Take bytes from the host and live records of the stimulus at the current virtual time. Returns 0, or -1 after an
 * error. */
int world_poll_inputs(struct world *world)
{
    uint8_t bytes[512];
    const size_t space = uart_host_free_space(&world->uart);
    const size_t size = endpoint_receive(world->endpoint, bytes, space < sizeof bytes ? space : sizeof bytes);
    (void)uart_send_from_host(&world->uart, bytes, size, world->now);
    while (stimulus_receive_live(world->stimulus)) {
        if (world_fields_set_live(world, NULL)) {
            return -1;
        }
    }
    return 0;
}

/* Write a rise time in nanoseconds as a JSON value with this name; null for a line that does not become high. */
static void write_rise(FILE *file, const char *name, double rise_s)
{
    if (rise_s < 1.0) {
        fprintf(file, "\"%s\": %.3f", name, rise_s * 1e9);
    } else {
        fprintf(file, "\"%s\": null", name);
    }
}

/* Write the rise times and misread bits of the wiring, if the world describes branches. */
static void write_branches(const struct world *world, FILE *file)
{
    const struct bus_wiring *wiring = &world->bus.wiring;
    if (!wiring->description) {
        return;
    }
    const struct star *scl = &wiring->stars[WIRING_SCL], *sda = &wiring->stars[WIRING_SDA];
    fprintf(file, ",\n  \"wiring\": {");
    write_rise(file, "scl_rise_ns", scl->hub_rise_s);
    fprintf(file, ", ");
    write_rise(file, "sda_rise_ns", sda->hub_rise_s);
    fprintf(file, ", \"rise_limit_ns\": %.3f},\n  \"branches\": [", star_rise_limit_s(wiring->scl_hz) * 1e9);
    for (size_t i = 0; i < wiring->description->branch_count; i++) {
        fprintf(file, "%s\n    {\"name\": \"%s\", ", i ? "," : "", wiring->description->branches[i].name);
        write_rise(file, "scl_rise_ns", scl->branches[i].rise_s);
        fprintf(file, ", ");
        write_rise(file, "sda_rise_ns", sda->branches[i].rise_s);
        fprintf(file, ", \"misread_bits\": %llu}", (unsigned long long)wiring->misread_bits[i + 1u]);
    }
    fprintf(file, "\n  ]");
}

/* Write the counters of the run as a JSON object to a file. wall_seconds: elapsed time of the wall clock. Returns 0, or
 * -1 after an error line on stderr. */
int world_write_statistics(const struct world *world, const char *path, double wall_seconds)
{
    const double seconds = (double)world->now / (double)VTIME_SECOND;
    const struct taxel_outbox *outbox = &world->hub.hub.outbox;
    FILE *file = fopen(path, "w");
    if (!file) {
        fprintf(stderr, "statistics %s: %s\n", path, strerror(errno));
        return -1;
    }
    fprintf(file, "{\n  \"virtual_seconds\": %.9f,\n  \"wall_seconds\": %.6f,\n", seconds, wall_seconds);
    fprintf(file, "  \"events\": %llu,\n", (unsigned long long)world->events);
    fprintf(file, "  \"uart_bytes_sent\": %llu,\n", (unsigned long long)world->uart.bytes_sent);
    fprintf(file, "  \"bytes_delivered\": %llu,\n", (unsigned long long)world->endpoint->bytes_delivered);
    fprintf(file, "  \"frames_sent\": %u,\n  \"frames_dropped\": %u,\n", outbox->frames_sent, outbox->frames_dropped);
    fprintf(file, "  \"cycles\": %u,\n  \"cycle_time_us\": %u,\n", world->hub.hub.cycle.count,
            world->hub.hub.cycle.last_length_us);
    fprintf(file, "  \"bus_bytes\": %llu,\n  \"bus_busy\": %.6f,\n", (unsigned long long)world->bus.byte_count,
            seconds > 0.0 ? (double)world->bus.busy_time / (double)world->now : 0.0);
    if (world->hub.original) {
        hub_original_write_statistics(&world->hub, file);
    }
    fprintf(file, "  \"bus_recoveries\": %u,\n  \"boards\": [", world->hub.hub.bus_recoveries);
    for (size_t i = 0; i < world->board_count; i++) {
        const struct board_node *board = &world->boards[i];
        fprintf(file, "%s\n    {\"address\": %u, \"scans\": %u, \"conversions\": %llu, \"snapshot_reads\": %u}",
                i ? "," : "", board->description->address,
                board->original ? board->original->scans : board->sensor.scan.scans,
                (unsigned long long)board->conversions,
                board->original ? board->original->reads : board->sensor.slave.snapshot_reads);
    }
    fprintf(file, "\n  ]");
    write_branches(world, file);
    fprintf(file, "\n}\n");
    return fclose(file) ? -1 : 0;
}
