#include "emulator/bench.h"

#include <stdlib.h>
#include <string.h>

#include "emulator/layer.h"
#include "emulator/world.h"

#define HUB 0u /* in place of a board's address */
#define HELD_STEP VTIME_US /* how often a bus is looked at that an executed hub holds */
#define PTY_STEP VTIME_MS /* how often the pseudo-terminal is asked for bytes */

struct taxel_bench {
    struct world_description description;
    struct world world;
    struct stimulus stimulus;
    struct endpoint endpoint;
    struct host_script script;
};

struct taxel_bench *taxel_bench_open(const char *world_path, const char *uart, int counts)
{
    struct taxel_bench *bench = calloc(1, sizeof *bench);
    if (!bench) {
        return NULL;
    }
    layer_init();
    bench->endpoint.fd = bench->stimulus.fd = -1;
    if (world_file_read(&bench->description, world_path) ||
        stimulus_open(&bench->stimulus, -1, "bench", world_taxels(&bench->description), false) ||
        endpoint_open(&bench->endpoint, uart, bench->description.baud) || host_script_open(&bench->script, NULL)) {
        taxel_bench_close(bench);
        return NULL;
    }
    bench->stimulus.kind = counts ? STIMULUS_COUNTS : STIMULUS_FORCE;
    if (world_init(&bench->world, &bench->description, &bench->stimulus, &bench->endpoint, &bench->script)) {
        taxel_bench_close(bench);
        return NULL;
    }
    return bench;
}

void taxel_bench_close(struct taxel_bench *bench)
{
    if (bench) {
        world_free(&bench->world);
        endpoint_close(&bench->endpoint);
        stimulus_close(&bench->stimulus);
        world_file_free(&bench->description);
        free(bench);
    }
}

const char *taxel_bench_pty(const struct taxel_bench *bench)
{
    return bench->endpoint.pty_name;
}

size_t taxel_bench_taxels(const struct taxel_bench *bench)
{
    return world_taxels(&bench->description);
}

uint64_t taxel_bench_now(const struct taxel_bench *bench)
{
    return bench->world.now;
}

int taxel_bench_run(struct taxel_bench *bench, uint64_t until)
{
    struct world *world = &bench->world;
    if (bench->endpoint.kind != ENDPOINT_PTY) {
        return world_run(world, until);
    }
    while (world->now < until) {
        if (world_poll(world) || world_run(world, vtime_min(until, world->now + PTY_STEP))) {
            return -1;
        }
    }
    return 0;
}

size_t taxel_bench_send(struct taxel_bench *bench, const uint8_t *bytes, size_t size)
{
    return uart_host_sends(&bench->world.uart, bytes, size, bench->world.now);
}

size_t taxel_bench_receive(struct taxel_bench *bench, uint8_t *bytes, size_t size)
{
    return endpoint_take(&bench->endpoint, bytes, size);
}

uint64_t taxel_bench_delivered(const struct taxel_bench *bench)
{
    return bench->endpoint.bytes_delivered;
}

int taxel_bench_holds_back(const struct taxel_bench *bench)
{
    return bench->description.flow_control;
}

int taxel_bench_press(struct taxel_bench *bench, const float *values)
{
    return world_press(&bench->world, values);
}

static const struct board_node *board_of(const struct taxel_bench *bench, uint8_t address)
{
    for (size_t i = 0; i < bench->description.board_count; i++) {
        if (bench->description.boards[i].address == address) {
            return &bench->world.boards[i];
        }
    }
    return NULL;
}

int taxel_bench_inject(struct taxel_bench *bench, const char *name, uint8_t address, double value, double second)
{
    const struct fault_description fault = {
        .kind = fault_named(name), .address = address, .value = value, .second = second};
    if (fault.kind == FAULT_KINDS) {
        return TAXEL_BENCH_UNKNOWN_FAULT;
    }
    if (fault_target_of(fault.kind) == FAULT_TARGET_BOARD && !board_of(bench, address)) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    return world_inject(&bench->world, &fault) ? TAXEL_BENCH_TOO_MANY_FAULTS : 0;
}

int taxel_bench_transfer(struct taxel_bench *bench, uint8_t address, const uint8_t *write_bytes, size_t write_size,
                         uint8_t *read_bytes, size_t read_size, uint64_t patience)
{
    struct world *world = &bench->world;
    const vtime end = world->now + patience;
    const struct taxel_i2c_transfer transfer = {
        .address = address,
        .write_bytes = write_bytes,
        .write_size = write_size,
        .read_bytes = read_bytes,
        .read_size = read_size,
    };
    world->adapter.done = false;
    bus_start(&world->bus, BUS_ADAPTER, &transfer, world->now);
    while (!world->adapter.done && world->now < end) {
        const vtime next = world->bus.next == VTIME_NEVER ? world->now + HELD_STEP : world->bus.next;
        if (world_run(world, vtime_min(end, next))) {
            return TAXEL_I2C_BUS_ERROR;
        }
    }
    if (!world->adapter.done) {
        bus_abort(&world->bus, BUS_ADAPTER, world->now);
        return TAXEL_I2C_TIMEOUT;
    }
    return world->adapter.result;
}

size_t taxel_bench_strikes(const struct taxel_bench *bench, uint64_t first, struct fault_strike *strikes, size_t size,
                           uint64_t *lost)
{
    const struct fault_log *log = &bench->world.log;
    const uint64_t oldest = log->count > FAULT_LOG_MAX ? log->count - FAULT_LOG_MAX : 0;
    size_t written = 0;
    *lost = first < oldest ? oldest - first : 0;
    for (uint64_t i = first < oldest ? oldest : first; i < log->count && written < size; i++) {
        strikes[written++] = log->strikes[i % FAULT_LOG_MAX];
    }
    return written;
}

int taxel_bench_statistics(const struct taxel_bench *bench, const char *path)
{
    return world_write_statistics(&bench->world, path, 0.0);
}

static const struct flash *flash_of(const struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = board_of(bench, address);
    return board ? &board->boot->flash : address == HUB ? &bench->world.hub.boot.flash : NULL;
}

const uint8_t *taxel_bench_flash(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = flash_of(bench, address);
    return flash ? flash->bytes : NULL;
}

const uint32_t *taxel_bench_wear(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = flash_of(bench, address);
    return flash ? flash->wear : NULL;
}

uint64_t taxel_bench_torn(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = flash_of(bench, address);
    return flash ? flash->torn : 0;
}

static struct psoc *processor_of(const struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = board_of(bench, address);
    return board ? board->psoc : address == HUB ? bench->world.hub.psoc : NULL;
}

/* A board runs only when it has to. */
static const struct psoc *up_to_date(struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = board_of(bench, address);
    if (board) {
        board_advance(&bench->world.boards[board - bench->world.boards], bench->world.now);
    }
    return processor_of(bench, address);
}

int taxel_bench_processor(struct taxel_bench *bench, uint8_t address, struct taxel_bench_processor *processor)
{
    const struct psoc *psoc = up_to_date(bench, address);
    if (!psoc) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    const struct cortex_m0 *cpu = &psoc->cpu;
    *processor = (struct taxel_bench_processor){
        .resets = psoc->resets,
        .cycles = cpu->cycle,
        .slept = cpu->sleep_cycles,
        .faults = cpu->faults,
        .fault_kind = cpu->fault.kind,
        .fault_pc = cpu->fault.pc,
        .fault_address = cpu->fault.address,
        .lowest_stack = cortex_m0_lowest_msp(cpu),
        .pc = cpu->r[15],
        .broken = psoc->broken,
        .asleep = cpu->asleep,
        .is_application = psoc_runs_application(psoc),
    };
    return 0;
}

int taxel_bench_cost(struct taxel_bench *bench, uint8_t address, unsigned exception, struct taxel_bench_cost *cost)
{
    const struct psoc *psoc = up_to_date(bench, address);
    if (!psoc || exception >= CORTEX_M0_EXCEPTIONS) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    const struct cortex_m0_cost *measured = &psoc->account.cost[exception];
    *cost = (struct taxel_bench_cost){
        .count = measured->count,
        .own = measured->exclusive,
        .own_min = measured->exclusive_min,
        .own_max = measured->exclusive_max,
        .inclusive = measured->inclusive,
        .inclusive_max = measured->inclusive_max,
        .latency = measured->latency,
        .latency_max = measured->latency_max,
    };
    return 0;
}

int taxel_bench_runs(const struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = board_of(bench, address);
    const struct psoc *psoc = processor_of(bench, address);
    if (psoc) {
        return psoc->broken || psoc_has_faulted(psoc) ? RUNS_NOTHING : psoc_runs_application(psoc) ? RUNS_APPLICATION : RUNS_BOOTLOADER;
    }
    return board ? (int)board->runs : address == HUB ? (int)bench->world.hub.runs : -1;
}

int taxel_bench_plan_cut(struct taxel_bench *bench, uint8_t address, uint64_t operation, uint64_t after, uint64_t off)
{
    const struct flash_cut_plan plan = {.operation = operation, .after = after, .off = off};
    const struct board_node *board = board_of(bench, address);
    if (!board && address != HUB) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    struct board_node *const chosen = board ? &bench->world.boards[board - bench->world.boards] : NULL;
    return world_plan_power_cut(&bench->world, chosen, &plan) ? TAXEL_BENCH_TOO_MANY_FAULTS : 0;
}

uint64_t taxel_bench_cuts(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = flash_of(bench, address);
    return flash ? flash->made_count : 0;
}

int taxel_bench_cut(const struct taxel_bench *bench, uint8_t address, uint64_t number, uint16_t *row, uint64_t *after,
                    uint8_t *wanted)
{
    const struct flash *flash = flash_of(bench, address);
    if (!flash || number >= flash->made_count || flash->made_count - number > FLASH_CUTS_MAX) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    const struct flash_cut_made *made = &flash->made[number % FLASH_CUTS_MAX];
    *row = made->row;
    *after = made->after;
    memcpy(wanted, made->wanted, sizeof made->wanted);
    return 0;
}
