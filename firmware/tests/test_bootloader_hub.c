/* A board is programmed through the hub's pass-through, while the hub polls the other boards, and probes and
 * identifies the board in its bootloader as a foreign device. */
#include "check.h"
#include "fake_hub.h"
#include "test_bootloader_bench.h"

#define BOARDS 3u
#define FIRST_ADDRESS 0x20u
#define TRIES 100u

static struct fake_hub fake;
static struct fake_sensor sensors[BOARDS];
static struct bench bench;
static struct bench_image old_image, new_image;
static uint64_t busy_until_us;
static unsigned foreign_writes, nacks_while_writing;

/* Execute a transfer to the bootloader's address; all others go to the simulated boards; script of the hub's bus. */
static int on_transfer(struct fake_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    if (transfer->address != TAXEL_BOOT_DEFAULT_ADDRESS) {
        return FAKE_PROCEED;
    }
    if (bench.running != BENCH_NO_SLOT || hub->now_us < busy_until_us) {
        nacks_while_writing += bench.running == BENCH_NO_SLOT;
        return TAXEL_I2C_NACK_ADDRESS;
    }
    if (transfer->write_size || !transfer->read_size) {
        if (!taxel_boot_i2c_on_address(&bench.i2c, false)) {
            return TAXEL_I2C_NACK_ADDRESS;
        }
        for (size_t i = 0; i < transfer->write_size; i++) {
            CHECK(taxel_boot_i2c_on_write(&bench.i2c, transfer->write_bytes[i]));
        }
        foreign_writes += transfer->write_size && transfer->write_bytes[0] != TAXEL_BOOT_PACKET_START;
    }
    if (transfer->read_size && !taxel_boot_i2c_on_address(&bench.i2c, true)) {
        return TAXEL_I2C_NACK_ADDRESS;
    }
    for (size_t i = 0; i < transfer->read_size; i++) {
        transfer->read_bytes[i] = taxel_boot_i2c_on_read(&bench.i2c);
    }
    taxel_boot_i2c_on_stop(&bench.i2c);
    const unsigned operations = bench.flash.operations;
    bench_run(&bench);
    if (bench.flash.operations != operations) {
        busy_until_us = hub->now_us + FAKE_FLASH_WRITE_US;
    }
    return TAXEL_I2C_OK;
}

/* Send bytes to the bootloader of a board through the hub's command I2C_TRANSFER, and read `read_length` bytes.
 * Returns the status of the reply. */
static int pass_through(const uint8_t *bytes, unsigned size, uint8_t read_length)
{
    uint8_t arguments[TAXEL_TRANSFER_ARGUMENTS_SIZE + TAXEL_TRANSFER_MAX] = {TAXEL_BOOT_DEFAULT_ADDRESS, read_length};
    memcpy(arguments + TAXEL_TRANSFER_ARGUMENTS_SIZE, bytes, size);
    return fake_hub_command(&fake, TAXEL_COMMAND_I2C_TRANSFER, arguments, TAXEL_TRANSFER_ARGUMENTS_SIZE + size);
}

/* Send a packet to the bootloader through the hub, then read until the first byte is that of a packet; NACK and FF mean
 * "not ready". Returns the size of the response; 0 without a response. */
static unsigned exchange(struct bench *board, const uint8_t *bytes, unsigned size, uint8_t *response)
{
    CHECK_EQUAL(pass_through(bytes, size, 0), TAXEL_REPLY_STATUS_OK);
    for (unsigned i = 0; i < TRIES && board->running == BENCH_NO_SLOT && bytes[1] != TAXEL_BOOT_COMMAND_EXIT; i++) {
        const int status = pass_through(bytes, 0, TAXEL_BOOT_PACKET_MAX);
        if (status == TAXEL_REPLY_STATUS_OK && fake.reply[0] == TAXEL_BOOT_PACKET_START) {
            memcpy(response, fake.reply, TAXEL_BOOT_PACKET_MAX);
            return TAXEL_BOOT_PACKET_OVERHEAD + taxel_get_u16(response + 2);
        }
        CHECK(status == TAXEL_REPLY_STATUS_OK || status == TAXEL_REPLY_STATUS_NACK);
        fake_hub_run(&fake, 1000);
    }
    return 0;
}

static void a_board_is_programmed_while_the_others_are_polled(void)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST_ADDRESS, BOARDS);
    fake.script = on_transfer;
    bench_init(&bench, &taxel_boot_layout_board, 6);
    bench_make_image(&old_image, &taxel_boot_layout_board, 0, 4, 1, 1);
    bench_make_image(&new_image, &taxel_boot_layout_board, 1, 4, 2, 2);
    bench_install(&bench, &old_image, true);
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    bench.wire = exchange;
    CHECK(fake_hub_start(&fake));

    CHECK_EQUAL(bench_program(&bench, &new_image), 0);
    CHECK_EQUAL(bench.running, 1);
    CHECK(bench_holds(&bench, &new_image));
    CHECK(foreign_writes > 0); /* the hub tried to identify the board */
    CHECK(nacks_while_writing > 0);
    for (uint8_t i = 0; i < BOARDS; i++) {
        const struct taxel_hub_slot *const slot = fake_hub_slot(&fake, (uint8_t)(FIRST_ADDRESS + i));
        CHECK_EQUAL(slot->state, TAXEL_BOARD_STATE_STREAMING);
        CHECK_EQUAL(slot->nacks + slot->timeouts + slot->crc_errors + slot->bus_errors + slot->dropped, 0);
        CHECK_BETWEEN(slot->forwarded, 20, 100000);
    }
    CHECK_EQUAL(fake.hub.bus_recoveries, 0);
    fake_hub_free_boards(&fake);
}

int main(void)
{
    RUN(a_board_is_programmed_while_the_others_are_polled);
    return check_summary();
}
