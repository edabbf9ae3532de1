/* The hub on Linux (linux_hub/): buffers, sizes of compact reads, addresses that are probed, and bus recovery. */
#include <string.h>

#include "check.h"
#include "linux_hub/byte_ring.h"
#include "linux_hub/linux_hub.h"
#include "linux_hub/predicted_read.h"

/* A simulated bus without boards, in virtual time. */
struct fake_adapter {
    uint64_t now_us;
    int result;
    unsigned probes[128];
    unsigned recoveries;
};

/* Count a transfer, which ends with the result that the test has selected; function of the bus. `context`:
 * fake_adapter. */
static int fail_transfer(void *context, uint8_t address, const uint8_t *write_bytes, size_t write_size,
                         uint8_t *read_bytes, size_t read_size, uint32_t timeout_us)
{
    struct fake_adapter *adapter = context;
    (void)write_bytes;
    (void)read_bytes;
    (void)timeout_us;
    adapter->now_us += 25u;
    if (address == LINUX_HUB_RECOVERY_ADDRESS) {
        adapter->recoveries++;
        return adapter->result;
    }
    adapter->probes[address] += !write_size && !read_size;
    return adapter->result;
}

/* Return the virtual time; function of the bus. */
static uint64_t read_clock(void *context)
{
    return ((struct fake_adapter *)context)->now_us;
}

/* Start a hub that probes the addresses `first` to `last`. The test frees it. */
static struct linux_hub *start_hub(struct fake_adapter *adapter, uint8_t first, uint8_t last)
{
    struct linux_hub_settings settings = {.scl_hz = 400000u, .unique_id = "TAXELI2C"};
    const struct linux_hub_bus bus = {.context = adapter, .transfer = fail_transfer, .clock_us = read_clock};
    for (uint8_t address = first; address <= last; address++) {
        settings.probed[address >> 3] |= (uint8_t)(1u << (address & 7u));
    }
    return linux_hub_create(&settings, &bus);
}

/* Run the hub until the virtual time `end_us`. */
static void run_until(struct linux_hub *hub, struct fake_adapter *adapter, uint64_t end_us)
{
    while (adapter->now_us < end_us) {
        const uint64_t due_us = linux_hub_pass(hub);
        linux_hub_execute(hub);
        if (due_us > adapter->now_us) {
            adapter->now_us = due_us < end_us ? due_us : end_us;
        }
    }
}

static void a_ring_returns_bytes_in_order_across_its_end(void)
{
    uint8_t memory[8], bytes[8];
    struct byte_ring ring = {.bytes = memory, .capacity = sizeof memory};
    CHECK(byte_ring_write(&ring, (const uint8_t *)"abcdef", 6) == 6);
    CHECK(byte_ring_read(&ring, bytes, 4) == 4 && memcmp(bytes, "abcd", 4) == 0);
    CHECK(byte_ring_write(&ring, (const uint8_t *)"ghijklmn", 8) == 6); /* all that fits */
    CHECK(byte_ring_space(&ring) == 0);
    CHECK(byte_ring_read(&ring, bytes, sizeof bytes) == 8 && memcmp(bytes, "efghijkl", 8) == 0);
    CHECK(byte_ring_read(&ring, bytes, sizeof bytes) == 0);
}

static void the_size_of_a_compact_read_follows_the_latest_sizes(void)
{
    static struct predicted_read prediction;
    uint8_t bytes[300] = {0};
    const struct taxel_i2c_transfer transfer = {.address = 0x1C, .read_bytes = bytes, .read_size = 300};
    CHECK(predicted_read_size(&prediction, &transfer) == 300); /* unknown board: the upper limit */
    bytes[0] = 40;
    CHECK(predicted_read_remainder(&prediction, &transfer, 300) == 0);
    CHECK(predicted_read_size(&prediction, &transfer) == 41 + PREDICTED_READ_MARGIN);
    bytes[0] = 60; /* longer than predicted: the snapshot is read again */
    CHECK(predicted_read_remainder(&prediction, &transfer, 41 + PREDICTED_READ_MARGIN) ==
          61 + PREDICTED_READ_MARGIN_AGAIN);
    CHECK(predicted_read_size(&prediction, &transfer) == 61 + PREDICTED_READ_MARGIN);
    bytes[0] = 0; /* no new snapshot */
    CHECK(predicted_read_remainder(&prediction, &transfer, 63) == 0);
    CHECK(predicted_read_size(&prediction, &transfer) == 61 + PREDICTED_READ_MARGIN);
    bytes[0] = 255; /* never more than the upper limit */
    CHECK(predicted_read_remainder(&prediction, &transfer, 63) == 300);
    CHECK(predicted_read_remainder(&prediction, &transfer, 300) == 0);
}

static void only_selected_addresses_are_probed(void)
{
    struct fake_adapter adapter = {.result = TAXEL_I2C_NACK_ADDRESS};
    struct linux_hub *hub = start_hub(&adapter, 0x1C, 0x1D);
    run_until(hub, &adapter, 1000000u);
    for (unsigned address = 0; address < 128u; address++) {
        CHECK((adapter.probes[address] > 0) == (address == 0x1C || address == 0x1D));
    }
    CHECK(adapter.recoveries == 0);
    linux_hub_free(hub);
}

static void failed_transfers_recover_the_bus_with_a_read_of_the_unused_address(void)
{
    struct fake_adapter adapter = {.result = TAXEL_I2C_TIMEOUT};
    struct linux_hub *hub = start_hub(&adapter, 0x1C, 0x1D);
    run_until(hub, &adapter, 100000u);
    CHECK(adapter.recoveries > 0);
    CHECK(adapter.recoveries < 25); /* a held bus is tried every 10 ms, not continuously */
    adapter.result = TAXEL_I2C_NACK_ADDRESS;
    const unsigned before = adapter.recoveries;
    run_until(hub, &adapter, 200000u);
    CHECK(adapter.recoveries - before <= 1u);
    linux_hub_free(hub);
}

static void bytes_of_the_host_wait_in_the_buffer_and_are_taken_in_pieces(void)
{
    struct fake_adapter adapter = {.result = TAXEL_I2C_NACK_ADDRESS};
    struct linux_hub *hub = start_hub(&adapter, 0x1C, 0x1D);
    uint8_t noise[3000], bytes[512];
    memset(noise, 0x55, sizeof noise);
    CHECK(linux_hub_send(hub, noise, sizeof noise) == sizeof noise);
    run_until(hub, &adapter, 100000u);
    CHECK(linux_hub_unread(hub) == 0);
    CHECK(linux_hub_waiting(hub) > 0); /* HUB_HANDSHAKE */
    CHECK(linux_hub_receive(hub, bytes, sizeof bytes) > 0);
    CHECK(linux_hub_waiting(hub) == 0);
    linux_hub_restart(hub, TAXEL_RESET_CAUSE_BROWN_OUT);
    run_until(hub, &adapter, 110000u);
    CHECK(linux_hub_waiting(hub) > 0); /* another HUB_HANDSHAKE */
    linux_hub_free(hub);
}

int main(void)
{
    RUN(a_ring_returns_bytes_in_order_across_its_end);
    RUN(the_size_of_a_compact_read_follows_the_latest_sizes);
    RUN(only_selected_addresses_are_probed);
    RUN(failed_transfers_recover_the_bus_with_a_read_of_the_unused_address);
    RUN(bytes_of_the_host_wait_in_the_buffer_and_are_taken_in_pieces);
    return check_summary();
}
