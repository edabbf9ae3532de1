/* A board or hub with the bootloader on a simulated flash, and a host that uses it like a stock tool. */
#ifndef TEST_BOOTLOADER_BENCH_H
#define TEST_BOOTLOADER_BENCH_H

#include "bootloader/bootloader.h"
#include "fake_flash.h"

#define BENCH_IMAGE_MAX (110u * TAXEL_BOOT_ROW_SIZE)
#define BENCH_NO_SLOT 0xFF
#define BENCH_NO_REPLY 0x100
#define BENCH_NOT_A_PACKET 0x101

struct bench_image {
    uint8_t slot;
    unsigned size; /* whole rows */
    uint8_t bytes[BENCH_IMAGE_MAX];
};

struct bench {
    struct fake_flash flash;
    struct taxel_boot_hal hal;
    struct taxel_boot_config config;
    struct taxel_boot boot;
    struct taxel_boot_i2c i2c;
    struct taxel_boot_uart uart;
    bool over_uart;
    /* alternative transport */
    unsigned (*wire)(struct bench *bench, const uint8_t *bytes, unsigned size, uint8_t *response);
    bool refuses_i2c_writes; /* an address was not acknowledged although it should have been */
    uint32_t clock_us;
    uint8_t reset_cause;
    bool stay_flag;
    bool restart_requested;
    unsigned restarts;
    uint8_t running; /* slot, or BENCH_NO_SLOT while the bootloader runs */
    uint8_t unique_id[8];
    uint8_t checksum;  /* used by the host */
    uint8_t confirmed; /* slot that must not be written; BENCH_NO_SLOT: none */
    unsigned forbidden_writes;
    uint8_t reply[TAXEL_BOOT_PACKET_MAX]; /* data of the last response */
    unsigned reply_size;
};

void bench_init(struct bench *bench, const struct taxel_boot_layout *layout, uint64_t seed);
/* Reset the processor, and run the bootloader's first pass. */
void bench_reset(struct bench *bench, uint8_t cause);
/* Run the bootloader's main loop until its listening time is over. */
void bench_settle(struct bench *bench);
void bench_run(struct bench *bench);

/* Send raw bytes to the bootloader. Returns the size of the response, 0 if there is none. */
unsigned bench_exchange(struct bench *bench, const uint8_t *bytes, unsigned size, uint8_t *response);
/* Send a packet. Returns the status of the response, BENCH_NO_REPLY without a response, or BENCH_NOT_A_PACKET if the
 * response is malformed. */
unsigned bench_send(struct bench *bench, uint8_t command, const void *data, unsigned size);
/* Build a packet. Returns its size. */
unsigned bench_packet(const struct bench *bench, uint8_t command, const void *data, unsigned size, uint8_t *bytes);

/* Build a valid image of `rows` rows (the last one not full) for a slot, with random content from `seed`. */
void bench_make_image(struct bench_image *image, const struct taxel_boot_layout *layout, uint8_t slot, unsigned rows,
                      uint8_t version, uint64_t seed);
/* Write an image to the flash as a programmer in the factory does; if `confirmed`, also confirm it as a running
 * application does. */
void bench_install(struct bench *bench, const struct bench_image *image, bool confirmed);
bool bench_holds(const struct bench *bench, const struct bench_image *image);

unsigned bench_program_row(struct bench *bench, uint16_t row, const uint8_t *bytes);
/* Flash an image like a stock tool with a .cyacd file: commands 38, 32, three packets and a check per row, 31, 3B.
 * Returns the first status that is not OK, or OK; BENCH_NO_SLOT + 1 if checksums or sizes differ from the expected
 * ones. */
unsigned bench_program(struct bench *bench, const struct bench_image *image);

#endif
