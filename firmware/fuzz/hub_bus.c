/* The devices on the bench's simulated I2C bus. */
#include "fuzz/hub_bench.h"

#define FOREIGN_BYTE 0x33u

/* A configuration of the hub's memory with the devices on its I2C bus. */
struct bus {
    uint8_t slot_capacity; /* number of boards that the hub can manage */
    size_t buffer_size;    /* of one of the two transfer buffers, in bytes */
    size_t ring_size;      /* of the transmit ring, in bytes */
    struct {
        uint8_t address, taxel_count;
        bool foreign; /* not a sensor board */
    } devices[BENCH_BOARDS];
};

#define RING_SIZE 256u
#define LARGEST (TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXEL_TAXELS_MAX)

static const struct bus buses[BENCH_BUSES] = {
    {4, LARGEST, RING_SIZE, {{0x20, 2, false}}},
    {8, LARGEST, RING_SIZE, {{0x10, 2, false}, {0x20, 63, false}, {0x30, 5, false}}},
    {4, LARGEST, RING_SIZE, {{0x08, 123, false}, {0x20, 3, false}, {0x21, 4, false}, {0x77, 12, false}}},
    {4, LARGEST, 236, {{0x20, 20, false}, {0x21, 1, false}, {0x50, 0, true}}}, /* the smallest allowed ring */
    {1, 112, 400, {{0}}},
    {2, LARGEST, RING_SIZE, {{0x20, 4, false}, {0x40, 0, true}, {0x41, 0, true}}}, /* more devices than slots */
    {32,
     LARGEST,
     RING_SIZE,
     {{0x11, 7, false}, {0x12, 7, false}, {0x13, 7, false}, {0x14, 7, false}, {0x15, 7, false}, {0x16, 7, false}}},
    /* one board is too large for the buffers */
    {3, 112, 500, {{0x20, 51, false}, {0x21, 52, false}, {0x22, 5, false}}},
};

/* Set the boards, as after power-on, and the sizes of the hub's memory for bus number `bus` (index of `buses`). */
void bench_populate(unsigned bus)
{
    /* 160 sub-conversions, clock dividers 40 and 1, IDAC code 16, 96 settle cycles (struct taxel_scan_settings) */
    static const uint8_t settings[TAXEL_SCAN_SETTINGS_SIZE] = {160, 0, 40, 0, 1, 16, 96, 0};
    const struct bus *source = &buses[bus];
    bench.config.slot_capacity = source->slot_capacity;
    bench.config.transfer_pool_size = 2u * TAXEL_HUB_BUFFER_SIZE(source->buffer_size);
    bench.config.transmit_ring_size = source->ring_size;
    for (size_t i = 0; i < BENCH_BOARDS; i++) {
        struct bench_board *board = &bench.boards[i];
        board->address = source->devices[i].address;
        board->taxel_count = source->devices[i].taxel_count;
        board->foreign = source->devices[i].foreign;
        board->map_version = TAXEL_REGISTER_MAP_VERSION;
        board->sequence = 0xFFF0; /* overflows after 16 snapshots */
        memcpy(board->settings, settings, sizeof settings);
    }
}

/* Return the connected board with this I2C address, or NULL if there is none. */
static struct bench_board *board_at(uint8_t address)
{
    for (size_t i = 0; i < BENCH_BOARDS; i++) {
        if (bench.boards[i].address == address && !bench.boards[i].unplugged) {
            return &bench.boards[i];
        }
    }
    return NULL;
}

/* Compute the CRC-32 over the board's I2C address and `bytes`. */
static uint32_t crc_with_address(const struct bench_board *board, const uint8_t *bytes, size_t size)
{
    return fuzz_crc32(fuzz_crc32(0, &board->address, 1), bytes, size);
}

/* Write the content of a board's identity register (struct taxel_identity) to `bytes`: TAXEL_IDENTITY_SIZE bytes with
 * CRC-32. The fields that the hub does not use are 0. */
static void read_identity(const struct bench_board *board, uint8_t *bytes)
{
    memset(bytes, 0, TAXEL_IDENTITY_SIZE);
    bytes[0] = TAXEL_WHO_AM_I;
    bytes[1] = board->map_version;
    bytes[6] = board->address;
    bytes[16] = 16; /* TX lines */
    bytes[17] = 16; /* RX lines */
    fuzz_put_u16(bytes + 18, board->taxel_count);
    fuzz_put_u16(bytes + 20, 10u + 2u * board->taxel_count);
    fuzz_put_u32(bytes + 54, fuzz_crc32(0, bytes, 54));
}

/* Write the next uncompressed snapshot of a board to `bytes` and advance its sequence number. A board that holds its
 * scan repeats the last sequence number. */
static void read_snapshot(struct bench_board *board, uint8_t *bytes)
{
    const size_t size = 10u + 2u * (size_t)board->taxel_count;
    board->sequence = (uint16_t)(board->sequence + !board->holds_scan);
    fuzz_put_u16(bytes, board->sequence);
    fuzz_put_u32(bytes + 2, (uint32_t)bench.now_us + board->clock_offset_us);
    memset(bytes + 6, board->sequence & 0xFF, size - 10);
    fuzz_put_u32(bytes + size - 4, crc_with_address(board, bytes, size - 4));
}

/* Write the content of a board's register COMPACT to `bytes` (length byte, compact snapshot with CRC-32) and return its
 * size. Delta frames and packed frames (16 bits per count) alternate: a delta frame follows each odd sequence
 * number. A board that holds its scan gives the single byte 0 (no new snapshot). The counts, and the 0 to 7 bytes of
 * coded counts in a delta frame, are arbitrary, because the hub checks only the CRC. */
static size_t read_compact(struct bench_board *board, uint8_t *bytes)
{
    const bool is_delta = board->sequence & 1u;
    const size_t size =
        is_delta ? 12u + board->taxel_count % 8u : (11u + 2u * (size_t)board->taxel_count + 3u) & ~(size_t)3u;
    if (board->holds_scan) {
        bytes[0] = 0;
        return 1;
    }
    board->sequence++;
    bytes[0] = (uint8_t)(size < 0x80u ? size : 0x80u + size / 4u);
    memset(bytes + 1, 0x55, size);
    fuzz_put_u16(bytes + 1, board->sequence);
    bytes[3] = is_delta ? 0 : 16;
    fuzz_put_u32(bytes + (is_delta ? 6 : 4), (uint32_t)bench.now_us + board->clock_offset_us);
    fuzz_put_u32(bytes + 1 + size - 4, crc_with_address(board, bytes + 1, size - 4));
    return 1u + size;
}

/* Fill `bytes` with the content of the register to which the board's register pointer points; 0xFF beyond the
 * register's end and for an undefined register. A device that is not a sensor board returns a constant byte. */
static void answer_read(struct bench_board *board, uint8_t *bytes, size_t size)
{
    /* a compact snapshot has a length byte and is padded to a multiple of four bytes */
    uint8_t registers[1u + LARGEST + 4u];
    size_t available = 0;
    if (board->foreign) {
        memset(bytes, FOREIGN_BYTE, size);
        return;
    }
    switch (board->pointer) {
    case 0x00:
        read_identity(board, registers);
        available = TAXEL_IDENTITY_SIZE;
        break;
    case 0x44: /* CLOCK */
        fuzz_put_u32(registers, (uint32_t)bench.now_us + board->clock_offset_us);
        available = 4;
        break;
    case 0x60: /* SETTINGS */
        memcpy(registers, board->settings, 8);
        fuzz_put_u32(registers + 8, crc_with_address(board, registers, 8));
        available = 12;
        break;
    case 0xA0:
        available = read_compact(board, registers);
        break;
    case 0x80:
        read_snapshot(board, registers);
        available = 10u + 2u * (size_t)board->taxel_count;
        break;
    default:
        break;
    }
    for (size_t i = 0; i < size; i++) {
        bytes[i] = i < available ? registers[i] : 0xFF;
    }
}

/* Execute a write of 8 bytes of settings and a CRC to a board's settings register. A wrong CRC, or a board that rejects
 * settings, leaves the settings unchanged. */
static void take_settings(struct bench_board *board, const uint8_t *bytes)
{
    uint8_t crc[4];
    fuzz_put_u32(crc, crc_with_address(board, bytes, 8));
    if (!board->rejects_settings && memcmp(crc, bytes + 8, sizeof crc) == 0) {
        memcpy(board->settings, bytes, sizeof board->settings);
    }
}

/* Execute a transfer of the hub on the simulated bus. Returns TAXEL_I2C_OK, or TAXEL_I2C_NACK_ADDRESS if no board has
 * the address. */
int8_t bench_transfer(const struct taxel_i2c_transfer *transfer)
{
    struct bench_board *board = board_at(transfer->address);
    if (!board) {
        return TAXEL_I2C_NACK_ADDRESS;
    }
    if (transfer->write_size) {
        board->pointer = transfer->write_bytes[0];
    }
    if (transfer->write_size == 13 && board->pointer == 0x60) {
        take_settings(board, transfer->write_bytes + 1);
    }
    if (transfer->read_size) {
        answer_read(board, transfer->read_bytes, transfer->read_size);
    }
    return TAXEL_I2C_OK;
}
