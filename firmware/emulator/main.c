#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "emulator/physics/layer.h"
#include "emulator/world.h"

#define REAL_TIME_STEP_MS 1
#define DURATION_MAX_S 1e7        /* below the 213 days that a vtime can represent */
#define FAST_STEP (2u * VTIME_MS) /* in fast mode, virtual time between two checks for bytes from the host */

/* Options of the command line. */
struct options {
    const char *world;
    const char *stimulus;
    const char *uart;
    const char *host_input;
    const char *statistics;
    double duration;
    unsigned long threads;
    bool fast;
    bool live;
};

static volatile sig_atomic_t stop_requested;

/* Request that the emulator writes its statistics and ends; signal handler. */
static void on_signal(int number)
{
    (void)number;
    stop_requested = 1;
    endpoint_stop_waiting = 1;
}

/* Print the usage and an error message to stderr. Returns -1. */
static int report_usage(const char *message)
{
    fprintf(stderr,
            "usage: taxel-emulator --world FILE [--stimulus FILE|fd:N] [--live] [--uart pty|fd:N|capture:FILE|none]\n"
            "                      [--host-input CAPTURE] [--fast] [--duration SECONDS] [--threads N]\n"
            "                      [--stats FILE]\n"
            "taxel-emulator: %s\n", /* in the last line, because callers show the last line */
            message);
    return -1;
}

/* Parse and check the command line. Returns 0, or -1 after a message on stderr. */
static int parse_options(struct options *options, int argc, char **argv)
{
    *options = (struct options){.uart = "pty", .duration = DURATION_MAX_S, .threads = 1};
    for (int i = 1; i < argc; i++) {
        const char *name = argv[i];
        if (strcmp(name, "--fast") == 0) {
            options->fast = true;
            continue;
        }
        if (strcmp(name, "--live") == 0) {
            options->live = true;
            continue;
        }
        if (i + 1 == argc) {
            return report_usage("an option is unknown or lacks its value");
        }
        const char *value = argv[++i];
        if (strcmp(name, "--world") == 0) {
            options->world = value;
        } else if (strcmp(name, "--stimulus") == 0) {
            options->stimulus = value;
        } else if (strcmp(name, "--uart") == 0) {
            options->uart = value;
        } else if (strcmp(name, "--host-input") == 0) {
            options->host_input = value;
        } else if (strcmp(name, "--stats") == 0) {
            options->statistics = value;
        } else if (strcmp(name, "--duration") == 0) {
            options->duration = strtod(value, NULL);
        } else if (strcmp(name, "--threads") == 0) {
            options->threads = strtoul(value, NULL, 10);
        } else {
            return report_usage("an option is unknown or lacks its value");
        }
    }
    if (!(options->duration > 0.0 && options->duration <= DURATION_MAX_S)) {
        return report_usage("--duration: expected a number of seconds from 0 to 1e7");
    }
    if (options->threads < 1 || options->threads > THREAD_POOL_THREADS_MAX) {
        return report_usage("--threads: expected a number from 1 to 16"); /* THREAD_POOL_THREADS_MAX */
    }
    return options->world ? 0 : report_usage("--world: expected the path of a world file");
}

/* Open the stimulus file, or a file descriptor given as fd:N. taxels: number of values per record. Returns 0, or -1
 * after an error line on stderr. */
static int open_stimulus(struct stimulus *stimulus, const struct options *options, size_t taxels)
{
    int fd = -1;
    if (options->stimulus && strncmp(options->stimulus, "fd:", 3) == 0) {
        char *end = NULL;
        const long number = strtol(options->stimulus + 3, &end, 10);
        if (end == options->stimulus + 3 || *end || number < 0 || number > INT_MAX) {
            return report_usage("--stimulus: expected fd:NUMBER with the number of an open file descriptor");
        }
        fd = (int)number;
    } else if (options->stimulus) {
        fd = open(options->stimulus, O_RDONLY | O_CLOEXEC);
        if (fd < 0) {
            fprintf(stderr, "stimulus %s: %s\n", options->stimulus, strerror(errno));
            return -1;
        }
    }
    return stimulus_open(stimulus, fd, options->stimulus ? options->stimulus : "none", taxels, options->live);
}

/* Return the time of the PC's monotonic clock in seconds. */
static double read_clock_s(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Suspend the emulator for the given time; a signal ends the sleep. */
static void sleep_ms(int milliseconds)
{
    (void)poll(NULL, 0, milliseconds);
}

/* Return whether virtual time may run faster than real time. With an interactive host, this is permitted only while the
 * hub streams: otherwise virtual time would advance without limit while the host prepares its next command. */
static bool can_run_fast(const struct options *options, const struct world *world)
{
    const bool interactive = world->endpoint->kind == ENDPOINT_FD || world->endpoint->kind == ENDPOINT_PTY;
    return options->fast && (!interactive || hub_node_is_streaming(&world->hub));
}

/* Run the world until its duration has passed, a signal arrives or the client leaves. In real time, each step lasts as
 * long as the wall clock has advanced. Returns 0, or -1 after an error. */
static int run(struct world *world, const struct options *options)
{
    const vtime end = (vtime)(options->duration * (double)VTIME_SECOND);
    double last_s = read_clock_s();
    while (world->now < end && !stop_requested && !world->endpoint->has_client_left) {
        vtime step = FAST_STEP;
        if (world_poll_inputs(world)) {
            return -1;
        }
        if (!can_run_fast(options, world)) {
            sleep_ms(REAL_TIME_STEP_MS);
            step = (vtime)((read_clock_s() - last_s) * (double)VTIME_SECOND);
        }
        last_s = read_clock_s();
        if (world_run(world, vtime_min(end, world->now + step))) {
            return -1;
        }
    }
    uart_flush_packet(&world->uart, world->now);
    return 0;
}

/* Run the command line taxel-emulator. Exit status: 0, 1 after an error, 2 for a wrong command line. */
int main(int argc, char **argv)
{
    static struct world_description description;
    static struct world world;
    static struct stimulus stimulus;
    static struct endpoint endpoint;
    static struct host_script script;
    static struct thread_pool thread_pool;
    struct options options;
    if (parse_options(&options, argc, argv)) {
        return 2;
    }
    signal(SIGPIPE, SIG_IGN);
    signal(SIGTERM, on_signal);
    signal(SIGINT, on_signal);
    layer_init();
    if (world_file_read(&description, options.world) ||
        open_stimulus(&stimulus, &options, world_taxel_count(&description)) ||
        endpoint_open(&endpoint, options.uart, description.baud) || host_script_open(&script, options.host_input)) {
        return 1;
    }
    endpoint.wait_for_reader = options.fast;
    if (world_init(&world, &description, &stimulus, &endpoint, &script) ||
        thread_pool_open(&thread_pool, options.threads)) {
        return 1;
    }
    world_use_thread_pool(&world, &thread_pool);
    if (endpoint.kind == ENDPOINT_PTY) {
        printf("%s\n", endpoint.pty_name);
        fflush(stdout);
    }
    const double start_s = read_clock_s();
    int result = run(&world, &options);
    if (options.statistics && world_write_statistics(&world, options.statistics, read_clock_s() - start_s)) {
        result = -1;
    }
    endpoint_close(&endpoint);
    stimulus_close(&stimulus);
    host_script_close(&script);
    world_free(&world);
    thread_pool_close(&thread_pool);
    world_file_free(&description);
    return result ? 1 : 0;
}
