#include "emulator/bench.h"

#include <stdlib.h>
#include <string.h>

#include "emulator/physics/layer.h"
#include "emulator/world.h"

#define HUB_ADDRESS 0u     /* selects the hub instead of a board */
#define HELD_STEP VTIME_US /* virtual time between two checks of a bus that an executed hub holds */
#define PTY_STEP VTIME_MS  /* virtual time between two reads from the pseudo-terminal */

#define RECOVERY_CLOCKS 9u
#define RECOVERY_HALF_CLOCK (5u * VTIME_US)

struct taxel_bench {
    struct world_description description;
    struct world world;
    struct stimulus stimulus;
    struct endpoint endpoint;
    struct host_script script;
};

/* Open an emulated hand for a test program. uart: how the host is connected: `pty` (pseudo-terminal), `memory` (buffer
 * in this process) or `none`. counts: the stimulus is in raw counts instead of newtons. Returns NULL after an error
 * line on stderr. */
struct taxel_bench *taxel_bench_open(const char *world_path, const char *uart, int counts)
{
    struct taxel_bench *bench = calloc(1, sizeof *bench);
    if (!bench) {
        return NULL;
    }
    layer_init();
    bench->endpoint.fd = bench->stimulus.fd = -1;
    if (world_file_read(&bench->description, world_path) ||
        stimulus_open(&bench->stimulus, -1, "bench", world_taxel_count(&bench->description), false) ||
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

/* Close the emulated hand and free its memory. NULL is permitted. */
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

/* Return the path of the pseudo-terminal to which a host connects; empty if the bench has no pseudo-terminal. */
const char *taxel_bench_pty_name(const struct taxel_bench *bench)
{
    return bench->endpoint.pty_name;
}

/* Return the number of taxels of all boards in the world file. */
size_t taxel_bench_taxel_count(const struct taxel_bench *bench)
{
    return world_taxel_count(&bench->description);
}

/* Return the virtual time of the world in picoseconds. */
uint64_t taxel_bench_now(const struct taxel_bench *bench)
{
    return bench->world.now;
}

/* Run the emulation until a virtual time. With a pseudo-terminal, input is read between short steps. Returns 0, or -1
 * after an error. */
int taxel_bench_run(struct taxel_bench *bench, uint64_t until)
{
    struct world *world = &bench->world;
    if (bench->endpoint.kind != ENDPOINT_PTY) {
        return world_run(world, until);
    }
    while (world->now < until) {
        if (world_poll_inputs(world) || world_run(world, vtime_min(until, world->now + PTY_STEP))) {
            return -1;
        }
    }
    return 0;
}

/* Send bytes from the host to the hub, from the present virtual time on. Returns the number of bytes that fit into
 * the adapter's buffer. */
size_t taxel_bench_send(struct taxel_bench *bench, const uint8_t *bytes, size_t size)
{
    return uart_send_from_host(&bench->world.uart, bytes, size, bench->world.now);
}

/* Copy up to `size` bytes that the hub has sent to the host to `bytes`, and remove them from the buffer. Returns their
 * number. */
size_t taxel_bench_receive(struct taxel_bench *bench, uint8_t *bytes, size_t size)
{
    return endpoint_read_memory(&bench->endpoint, bytes, size);
}

/* Return the number of bytes from the hub that the host's side has received so far. */
uint64_t taxel_bench_bytes_delivered(const struct taxel_bench *bench)
{
    return bench->endpoint.bytes_delivered;
}

/* Return 1 if the RTS output of the hub is wired in this world, otherwise 0. */
int taxel_bench_has_flow_control(const struct taxel_bench *bench)
{
    return bench->description.flow_control;
}

/* Set the force in newtons, or the raw count, of each taxel from the present virtual time on, in the order of the
 * boards. Returns 0, or -1 on an error. */
int taxel_bench_set_stimulus(struct taxel_bench *bench, const float *values)
{
    return world_set_stimulus(&bench->world, values);
}

/* Return the board with this I2C address in the world, or NULL. */
static const struct board_node *find_board(const struct taxel_bench *bench, uint8_t address)
{
    for (size_t i = 0; i < bench->description.board_count; i++) {
        if (bench->description.boards[i].address == address) {
            return &bench->world.boards[i];
        }
    }
    return NULL;
}

/* Inject the fault with this name and its parameters at once. address: used by faults of a board, a branch or a
 * transfer. Returns 0 or enum taxel_bench_error. */
int taxel_bench_inject_fault(struct taxel_bench *bench, const char *name, uint8_t address, double value,
                             double second_value)
{
    const struct fault_description fault = {
        .kind = fault_find_kind(name), .address = address, .value = value, .second_value = second_value};
    if (fault.kind == FAULT_KINDS) {
        return TAXEL_BENCH_UNKNOWN_FAULT;
    }
    if (fault_get_target(fault.kind) == FAULT_TARGET_BOARD && !find_board(bench, address)) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    if (fault_get_target(fault.kind) == FAULT_TARGET_BRANCH) {
        return world_inject_fault(&bench->world, &fault) ? TAXEL_BENCH_NO_SUCH_BRANCH : 0;
    }
    return world_inject_fault(&bench->world, &fault) ? TAXEL_BENCH_TOO_MANY_FAULTS : 0;
}

/* Execute an I2C transfer as a second master on the bus, and run the emulation until its end. Returns enum
 * taxel_i2c_result: TAXEL_I2C_TIMEOUT after the virtual time `timeout`, TAXEL_I2C_BUS_ERROR after an error of the
 * emulation. */
int taxel_bench_transfer_i2c(struct taxel_bench *bench, uint8_t address, const uint8_t *write_bytes, size_t write_size,
                             uint8_t *read_bytes, size_t read_size, uint64_t timeout)
{
    struct world *world = &bench->world;
    const vtime end = world->now + timeout;
    const struct taxel_i2c_transfer transfer = {
        .address = address,
        .write_bytes = write_bytes,
        .write_size = write_size,
        .read_bytes = read_bytes,
        .read_size = read_size,
    };
    world->adapter.is_done = false;
    bus_start_transfer(&world->bus, BUS_ADAPTER, &transfer, world->now);
    while (!world->adapter.is_done && world->now < end) {
        /* no next event of the bus: an emulated processor holds SCL, so the bus is checked in short steps */
        const vtime next = world->bus.next == VTIME_NEVER ? world->now + HELD_STEP : world->bus.next;
        if (world_run(world, vtime_min(end, next))) {
            return TAXEL_I2C_BUS_ERROR;
        }
    }
    if (!world->adapter.is_done) {
        bus_abort(&world->bus, BUS_ADAPTER, world->now);
        return TAXEL_I2C_TIMEOUT;
    }
    return world->adapter.result;
}

/* Drive the lines of the bus (true releases a line, false drives it low) and run the emulation for half a clock period
 * of the bus recovery. */
static void drive_half_clock(struct world *world, bool scl_high, bool sda_high)
{
    bus_drive_lines(&world->bus, scl_high, sda_high);
    (void)world_run(world, world->now + RECOVERY_HALF_CLOCK);
}

/* Free the bus as the driver of an adapter does: up to nine clocks until SDA is high, then a stop condition. */
void taxel_bench_recover_bus(struct taxel_bench *bench)
{
    struct world *world = &bench->world;
    if (!bus_is_scl_high(&world->bus, world->now)) {
        return;
    }
    for (unsigned clock = 0; clock < RECOVERY_CLOCKS && !bus_is_sda_high(&world->bus); clock++) {
        drive_half_clock(world, false, true);
        drive_half_clock(world, true, true);
    }
    drive_half_clock(world, false, true);
    drive_half_clock(world, false, false);
    drive_half_clock(world, true, false);
    drive_half_clock(world, true, true);
}

/* Copy up to `size` entries of the fault log from number `first` on. Returns how many were copied. *lost becomes the
 * number of entries from `first` on that had already been overwritten. */
size_t taxel_bench_read_fault_log(const struct taxel_bench *bench, uint64_t first, struct fault_log_entry *entries,
                                  size_t size, uint64_t *lost)
{
    const struct fault_log *log = &bench->world.log;
    const uint64_t oldest = log->count > FAULT_LOG_MAX ? log->count - FAULT_LOG_MAX : 0;
    size_t written = 0;
    *lost = first < oldest ? oldest - first : 0;
    for (uint64_t i = first < oldest ? oldest : first; i < log->count && written < size; i++) {
        entries[written++] = log->entries[i % FAULT_LOG_MAX];
    }
    return written;
}

/* Write the statistics of the world as a file at `path`. Returns 0, or -1 on an error. */
int taxel_bench_write_statistics(const struct taxel_bench *bench, const char *path)
{
    return world_write_statistics(&bench->world, path, 0.0);
}

/* Return the flash of the board with this I2C address, or of the hub (HUB_ADDRESS); NULL if there is no such board. */
static const struct flash *find_flash(const struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = find_board(bench, address);
    return board ? &board->boot->flash : address == HUB_ADDRESS ? &bench->world.hub.boot.flash : NULL;
}

/* Return the bytes of the flash of a board or of the hub (HUB_ADDRESS); 0 for an unknown address. */
uint32_t taxel_bench_flash_size(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = find_flash(bench, address);
    return flash ? flash->size : 0;
}

/* Return the content of the flash of a board or of the hub (HUB_ADDRESS); NULL for an unknown address. */
const uint8_t *taxel_bench_flash_bytes(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = find_flash(bench, address);
    return flash ? flash->bytes : NULL;
}

/* Return the number of writes of each flash row of a board or of the hub (HUB_ADDRESS); NULL for an unknown address. */
const uint32_t *taxel_bench_flash_wear(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = find_flash(bench, address);
    return flash ? flash->wear : NULL;
}

/* Return the number of flash row writes of a board or of the hub that a power cut interrupted. */
uint64_t taxel_bench_torn_writes(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = find_flash(bench, address);
    return flash ? flash->torn_count : 0;
}

/* Return the emulated chip of the board with this I2C address, or of the hub (HUB_ADDRESS); NULL if the firmware is
 * compiled natively. */
static struct psoc *find_processor(const struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = find_board(bench, address);
    return board ? board->psoc : address == HUB_ADDRESS ? bench->world.hub.psoc : NULL;
}

/* Return the emulated processor of a board or of the hub, advanced to the present time; NULL as for
 * find_processor(). */
static const struct psoc *find_current_processor(struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = find_board(bench, address);
    if (board) {
        board_advance(&bench->world.boards[board - bench->world.boards], bench->world.now);
    }
    return find_processor(bench, address);
}

/* Read the state of the emulated processor at an I2C address (HUB_ADDRESS: the hub): cycles, sleep time, faults, lowest
 * stack pointer. Returns 0, or TAXEL_BENCH_NO_SUCH_BOARD if no image is executed there. */
int taxel_bench_read_processor(struct taxel_bench *bench, uint8_t address, struct taxel_bench_processor *processor)
{
    const struct psoc *psoc = find_current_processor(bench, address);
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
        .broken = psoc->has_stopped,
        .asleep = cpu->asleep,
        .is_application = psoc_runs_application(psoc),
        .ram_end = PSOC_RAM_BASE + psoc->config.part->family->ram_size,
        .irq_scb0 = psoc->config.part->family->irq_scb[0],
        .irq_scb1 = psoc->config.part->family->irq_scb[1],
        .irq_csd = psoc->config.part->family->irq_csd,
    };
    return 0;
}

/* Read the measured cost of an exception handler of an emulated processor, in CPU cycles: without and with the handlers
 * that preempted it, and latency. Returns 0, or TAXEL_BENCH_NO_SUCH_BOARD if no image is executed there or the
 * exception does not exist. */
int taxel_bench_read_handler_cost(struct taxel_bench *bench, uint8_t address, unsigned exception,
                                  struct taxel_bench_cost *cost)
{
    const struct psoc *psoc = find_current_processor(bench, address);
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

/* Return the program that runs on a board or the hub (enum running_program), or -1 for an unknown address. */
int taxel_bench_running_program(const struct taxel_bench *bench, uint8_t address)
{
    const struct board_node *board = find_board(bench, address);
    const struct psoc *psoc = find_processor(bench, address);
    if (psoc) {
        const bool hangs = psoc->has_stopped || psoc_has_faulted(psoc);
        return hangs ? PROGRAM_HANGING : psoc_runs_application(psoc) ? PROGRAM_APPLICATION : PROGRAM_BOOTLOADER;
    }
    return board ? (int)board->program : address == HUB_ADDRESS ? (int)bench->world.hub.program : -1;
}

/* Plan a power cut of a board or of the hub (HUB_ADDRESS) during its flash write number `write_number`, `delay`
 * after the start of this write; the power returns after `off_time` (both in picoseconds). Returns 0 or a
 * TAXEL_BENCH_... error. */
int taxel_bench_plan_power_cut(struct taxel_bench *bench, uint8_t address, uint64_t write_number, uint64_t delay,
                               uint64_t off_time)
{
    const struct flash_cut_plan plan = {.write_number = write_number, .delay = delay, .off_time = off_time};
    const struct board_node *board = find_board(bench, address);
    if (!board && address != HUB_ADDRESS) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    /* NULL: the hub */
    struct board_node *const node = board ? &bench->world.boards[board - bench->world.boards] : NULL;
    return world_plan_power_cut(&bench->world, node, &plan) ? TAXEL_BENCH_TOO_MANY_FAULTS : 0;
}

/* Return the number of planned power cuts that have occurred on a board or on the hub. */
uint64_t taxel_bench_power_cut_count(const struct taxel_bench *bench, uint8_t address)
{
    const struct flash *flash = find_flash(bench, address);
    return flash ? flash->cut_count : 0;
}

/* Read the record of power cut `number` of a board or of the hub (HUB_ADDRESS): flash row, delay after the start
 * of the write in picoseconds, and the 128 bytes that were to be written. Returns 0, or TAXEL_BENCH_NO_SUCH_BOARD
 * if there is no such record. */
int taxel_bench_read_power_cut(const struct taxel_bench *bench, uint8_t address, uint64_t number, uint16_t *row,
                               uint64_t *delay, uint8_t *new_bytes)
{
    const struct flash *flash = find_flash(bench, address);
    if (!flash || number >= flash->cut_count || flash->cut_count - number > FLASH_CUTS_MAX) {
        return TAXEL_BENCH_NO_SUCH_BOARD;
    }
    const struct flash_cut_record *record = &flash->cut_records[number % FLASH_CUTS_MAX];
    *row = record->row;
    *delay = record->delay;
    memcpy(new_bytes, record->new_bytes, sizeof record->new_bytes);
    return 0;
}
