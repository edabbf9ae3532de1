/* A sensor board: scan and I2C run in two interrupts of the same priority; the main loop encodes compact snapshots,
 * feeds the watchdog while the scan advances, and confirms the image. */
#include <stdatomic.h>

#include "board_pins.h"
#include "boards/psoc4/clocks.h"
#include "boards/psoc4/fault.h"
#include "boards/psoc4/front_end.h"
#include "boards/psoc4/i2c_slave.h"
#include "boards/psoc4/kinds.h"
#include "boards/psoc4/regs/core.h"
#include "boards/psoc4/reset.h"
#include "boards/psoc4/self.h"
#include "boards/psoc4/standalone.h"
#include "boards/psoc4/ticks.h"
#include "boards/psoc4/watchdog.h"
#include "sensor/sensor.h"

/* scans after which an image on trial is confirmed, with one snapshot read (bootloader/DESIGN.md) */
#define CONFIRM_SCANS 10u

static struct taxel_sensor sensor;
static struct taxel_sensor_config config;
static uint8_t snapshots[3][TAXEL_SNAPSHOT_SIZE(BOARD_TAXELS_MAX)];
static taxel_compact_state compact_states[BOARD_TAXELS_MAX];
static uint8_t compact_residuals[BOARD_TAXELS_MAX];
static uint8_t compact_buffers[2][TAXEL_COMPACT_BUFFER_SIZE(BOARD_TAXELS_MAX)];

/* A board without a configuration measures one meaningless crossing, so that it responds on I2C and can be configured
 * and flashed. */
static const struct kind unknown_kind = {.rows = 1, .columns = 1, .taxels = 1, .crossing_map = {1}};

/* HAL function of the board: set up the capacitance converter with scan settings. */
static void on_configure(void *context, const struct taxel_scan_settings *settings)
{
    (void)context;
    front_end_configure(settings);
}

/* HAL function of the board: start the conversion of the crossing of TX line `tx` and RX line `rx`. */
static void on_start(void *context, uint8_t tx, uint8_t rx)
{
    (void)context;
    front_end_start(tx, rx);
}

/* HAL function of the board: return the time since the start of the board, in microseconds modulo 2^32. */
static uint32_t on_clock_us(void *context)
{
    (void)context;
    return ticks_us_32();
}

/* HAL function of the board: mask all interrupts and return the previous state of the mask. */
static uint32_t on_interrupts_disable(void *context)
{
    (void)context;
    return interrupts_mask();
}

/* HAL function of the board: restore the interrupt mask that on_interrupts_disable() returned. */
static void on_interrupts_restore(void *context, uint32_t state)
{
    (void)context;
    interrupts_unmask(state);
}

/* HAL function of the board: reset the processor. Does not return. */
static void on_restart(void *context)
{
    (void)context;
    reset_now();
}

/* HAL function of the board: reset the processor with the request that the bootloader keeps running. Does not
 * return. */
static void on_enter_bootloader(void *context)
{
    (void)context;
    reset_into_bootloader();
}

static const struct taxel_sensor_hal hal = {
    .front_end_configure = on_configure,
    .conversion_start = on_start,
    .clock_us = on_clock_us,
    .interrupts_disable = on_interrupts_disable,
    .interrupts_restore = on_interrupts_restore,
    .restart = on_restart,
    .enter_bootloader = on_enter_bootloader,
};

/* Pass the board's address, sent by the hub for reading or writing, to the register machine. Called by the I2C driver.
 * Returns whether to acknowledge. */
bool i2c_slave_on_address(bool reading)
{
    return taxel_sensor_on_address(&sensor, reading);
}

/* Pass a byte from the hub to the register machine. Called by the I2C driver. Returns whether to acknowledge the
 * byte. */
bool i2c_slave_on_write(uint8_t byte)
{
    return taxel_sensor_on_write(&sensor, byte);
}

/* Return the next byte of the register that the hub reads. Called by the I2C driver. */
uint8_t i2c_slave_on_read(void)
{
    return taxel_sensor_on_read(&sensor);
}

/* Pass a stop condition, at which written bytes take effect, to the register machine. Called by the I2C driver. */
void i2c_slave_on_stop(void)
{
    taxel_sensor_on_stop(&sensor);
}

/* Pass a start or stop condition at a wrong position to the register machine, which discards the bytes of this write.
 * Called by the I2C driver. */
void i2c_slave_on_bus_error(void)
{
    taxel_sensor_on_bus_error(&sensor);
}

/* Pass the raw count of a conversion that has ended to the scan sequencer, which starts the next conversion. Called by
 * the converter's driver. */
void front_end_on_conversion(uint16_t raw_count)
{
    taxel_sensor_on_conversion(&sensor, raw_count);
}

/* Return lines and crossing map of the kind of board (design) with this code; `unknown_kind` if the image contains no
 * such kind. */
static const struct kind *kind_of(uint8_t code)
{
    for (uint8_t i = 0; i < kind_count; i++) {
        if (kinds[i].code == code) {
            return &kinds[i];
        }
    }
    return &unknown_kind;
}

/* Fill the configuration of the sensor firmware from the stored configuration (NULL: none, default I2C address) and the
 * kind of board. */
static void configure(const uint8_t *configuration, const struct kind *kind)
{
    const struct taxel_scan_settings settings = BOARD_SCAN_SETTINGS;
    config.hal = &hal;
    config.address =
        configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS] : TAXEL_BOOT_DEFAULT_ADDRESS;
    config.kind = kind->code;
    config.reset_cause = reset_cause();
    config.fault_record = fault_record;
    memcpy(config.firmware_version, SELF_VERSION, sizeof config.firmware_version);
    reset_unique_id(config.unique_id);
    config.rows = kind->rows;
    config.columns = kind->columns;
    config.taxel_count = kind->taxels;
    config.crossing_map = kind->crossing_map;
    config.settings = settings;
    for (unsigned i = 0; i < 3u; i++) {
        config.snapshots[i] = snapshots[i];
    }
    config.compact = (struct taxel_compact_memory){
        .states = compact_states,
        .residuals = compact_residuals,
        .buffers = {compact_buffers[0], compact_buffers[1]},
    };
}

/* Start I2C slave, converter and scanning, with interrupts masked; configure() must have been called. Without a stored
 * configuration (NULL), no current codes are calibrated: the code of the scan settings applies to all RX lines. The
 * kind code 0 is that of `unknown_kind`, whose TX and RX lines are unknown: the converter is initialised with 0 lines.
 * The I2C slave is initialised before the converter, because it writes whole registers of its port, and this port also
 * has a pin of the converter (bus_pins.h). */
static void start(const uint8_t *configuration, const struct kind *kind)
{
    const uint32_t interrupts = interrupts_mask();
    i2c_slave_init(config.address);
    front_end_init(kind->code ? kind->rows : 0u, kind->code ? kind->columns : 0u,
                   configuration ? configuration + TAXEL_BOOT_CONFIGURATION_OFFSET_IDAC_CODES : NULL);
    taxel_scan_start(&sensor);
    interrupts_unmask(interrupts);
}

#ifndef IMAGE_STANDALONE
/* Return whether the application has shown that it works: it has completed CONFIRM_SCANS scans, and a snapshot was
 * read. */
static bool has_proven_itself(void)
{
    return sensor.scan.scans >= CONFIRM_SCANS && sensor.slave.snapshot_reads != 0;
}

/* Confirm the image between two scans, with the I2C slave off, because writing a flash row takes 20 ms. Returns false
 * if this is not possible at present: a scan is in progress, or a master addresses the board. */
static bool try_confirm(void)
{
    const uint32_t interrupts = interrupts_mask();
    const bool now = sensor.scan.taxel == 0 && i2c_slave_try_off();
    if (now) {
        self_confirm();
        i2c_slave_on();
    }
    interrupts_unmask(interrupts);
    return now;
}
#endif

/* Do the pending work of the compact snapshots: process acknowledgements, encode the newest scan, and exchange the
 * buffers; without such work, do nothing. Not inlined: its stack frame would add to the deepest call chain, the write
 * to flash. */
static __attribute__((noinline)) void process_compact_snapshots(void)
{
    taxel_sensor_run(&sensor);
}

/* Feed the watchdog once per SysTick period if the scan has advanced. A scan that stalls, for example after a missed
 * interrupt of the converter, is stored in the fault record; the watchdog then resets the board. A check after every
 * interrupt would take a sixth more cycles. */
static void watch_scan(void)
{
    static uint8_t checked_period;
    const uint8_t period = (uint8_t)ticks_periods();
    if (period == checked_period) {
        return;
    }
    checked_period = period;
    const enum taxel_scan_progress progress = taxel_scan_check(&sensor);
    if (progress == TAXEL_SCAN_ADVANCED) {
        watchdog_feed();
    } else if (progress == TAXEL_SCAN_STALLED) {
        fault_store_not_scanning();
    }
}

/* Run the application of a sensor board: start scanning and the I2C slave; the main loop encodes compact snapshots. An
 * image on trial confirms itself once it has worked. */
int main(void)
{
#ifdef IMAGE_STANDALONE
    reset_take_cause(); /* with a bootloader, the bootloader has stored the cause */
#endif
    clocks_init();
    watchdog_start();
    fault_init();
    ticks_init();
#ifdef IMAGE_STANDALONE
    const uint8_t *const configuration = standalone_configuration;
#else
    const uint8_t *const configuration = taxel_boot_configuration(&self_flash);
#endif
    const struct kind *const kind = kind_of(configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] : 0u);
    configure(configuration, kind);
    (void)taxel_sensor_init(&sensor, &config); /* tools check kinds, pins and settings when the image is built */
    start(configuration, kind);
#ifndef IMAGE_STANDALONE
    bool on_trial = self_is_on_trial();
#endif
    for (;;) {
        atomic_signal_fence(memory_order_acquire); /* reload the counters that interrupts change */
        watch_scan();
#ifndef IMAGE_STANDALONE
        if (on_trial && has_proven_itself()) {
            on_trial = !try_confirm();
        }
#endif
        process_compact_snapshots();
        wait_for_interrupt(); /* ends with the SysTick interrupt at the latest, within 4 ms */
    }
}
