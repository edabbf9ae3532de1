/* Packets, images and records built by the Python definitions (test_bootloader_vectors.h). */
#include "bootloader/internal.h"
#include "check.h"
#include "test_bootloader_bench.h"
#include "test_bootloader_vectors.h"

static struct bench bench;

/* Check that a packet is parsed, and that building it again from its parts gives the same bytes. */
static void check_packet(const uint8_t *bytes, unsigned size, uint8_t checksum)
{
    uint8_t built[TAXEL_BOOT_PACKET_MAX];
    struct taxel_boot_packet packet = {0};
    CHECK_EQUAL(taxel_boot_packet_parse(&packet, bytes, size, checksum), TAXEL_BOOT_STATUS_OK);
    CHECK_EQUAL(packet.command, bytes[1]);
    CHECK_EQUAL(packet.length + TAXEL_BOOT_PACKET_OVERHEAD, size);
    memcpy(built + 4, packet.data, packet.length);
    CHECK_EQUAL(taxel_boot_packet_build(built, packet.command, packet.length, checksum), size);
    CHECK_BYTES(built, bytes, size);
    bench.checksum = checksum;
    CHECK_EQUAL(bench_packet(&bench, packet.command, packet.data, packet.length, built), size);
    CHECK_BYTES(built, bytes, size);
}

#define PACKET(kind, index) check_packet(packet_##kind##_##index, sizeof packet_##kind##_##index, checksum)

static void packets_built_in_python_are_parsed_and_rebuilt_identically(void)
{
    uint8_t checksum = TAXEL_BOOT_CHECKSUM_SUM;
    PACKET(sum, 0);
    PACKET(sum, 1);
    PACKET(sum, 2);
    PACKET(sum, 3);
    PACKET(sum, 4);
    checksum = TAXEL_BOOT_CHECKSUM_CRC;
    PACKET(crc, 0);
    PACKET(crc, 1);
    PACKET(crc, 2);
    PACKET(crc, 3);
    PACKET(crc, 4);
}

static void both_checksums_have_their_published_values(void)
{
    const uint8_t digits[] = "123456789";
    /* CRC-16/X-25 is 0x906E; its bytes are swapped */
    CHECK_EQUAL(taxel_boot_packet_checksum(digits, 9, TAXEL_BOOT_CHECKSUM_CRC), 0x6E90);
    CHECK_EQUAL(taxel_boot_packet_checksum(digits, 9, TAXEL_BOOT_CHECKSUM_SUM), 0xFE23);
}

static void images_built_in_python_start(void)
{
    bench_init(&bench, &taxel_boot_layout_board, 1);
    memcpy(bench.flash.bytes + 32u * 128u, image_a, sizeof image_a);
    memcpy(bench.flash.bytes + 252u * 128u, configuration_row, sizeof configuration_row); /* with the image's kind */
    bench_settle(&bench);
    CHECK_EQUAL(bench.running, 0);
    bench_init(&bench, &taxel_boot_layout_hub, 1);
    memcpy(bench.flash.bytes + 142u * 128u, image_b, sizeof image_b);
    bench_settle(&bench);
    CHECK_EQUAL(bench.running, 1);
}

/* The metadata row is damaged before the rewrite, so that the new record gets the other row and no previous sequence
 * number. */
static void records_built_in_python_are_read_and_rewritten_identically(void)
{
    struct taxel_boot_metadata metadata;
    bench_init(&bench, &taxel_boot_layout_board, 1);
    memcpy(bench.flash.bytes + 255u * 128u, metadata_row, sizeof metadata_row);
    memcpy(bench.flash.bytes + 252u * 128u, configuration_row, sizeof configuration_row);
    taxel_boot_metadata_read(&bench.config.flash, &metadata);
    CHECK(metadata.confirmed == 1 && metadata.pending == 0 && metadata.tries[0] == 2 && metadata.tries[1] == 3);
    CHECK_BYTES(taxel_boot_configuration(&bench.config.flash), configuration, sizeof configuration);
    CHECK_EQUAL(taxel_boot_i2c_address(&bench.config.flash), 0x23);
    taxel_put_u32(bench.flash.bytes + 255u * 128u + TAXEL_BOOT_RECORD_OFFSET_SEQUENCE, 0); /* now invalid */
    bench.flash.bytes[255u * 128u] ^= 1u;
    CHECK_EQUAL(taxel_boot_metadata_write(&bench.config.flash, &metadata), 0);
    CHECK_BYTES(bench.flash.bytes + 254u * 128u + 8, metadata_row + 8, TAXEL_BOOT_METADATA_SIZE);
}

int main(void)
{
    RUN(packets_built_in_python_are_parsed_and_rebuilt_identically);
    RUN(both_checksums_have_their_published_values);
    RUN(images_built_in_python_start);
    RUN(records_built_in_python_are_read_and_rewritten_identically);
    return check_summary();
}
