/* Generated from protocol/taxel_protocol/bootloader.py by tools/codegen/bootloader_header.py. Do not edit. */
#ifndef TAXEL_BOOT_PROTOCOL_H
#define TAXEL_BOOT_PROTOCOL_H

#include "generated/taxel_protocol.h"

#define TAXEL_BOOT_VERSION 1u
#define TAXEL_BOOT_ROW_SIZE 128u
#define TAXEL_BOOT_SLOT_NONE 255u
#define TAXEL_BOOT_TRIES 3u
#define TAXEL_BOOT_DEFAULT_ADDRESS 119u
#define TAXEL_BOOT_LISTEN_US 0x000186A0u
#define TAXEL_BOOT_GAP_US 50000u
#define TAXEL_BOOT_PACKET_START 1u
#define TAXEL_BOOT_PACKET_END 23u
#define TAXEL_BOOT_PACKET_OVERHEAD 7u
#define TAXEL_BOOT_PACKET_MAX 64u
#define TAXEL_BOOT_KEY_SIZE 6u
#define TAXEL_BOOT_IMAGE_MAGIC 0x494C5854u
#define TAXEL_BOOT_METADATA_MAGIC 0x4D4C5854u
#define TAXEL_BOOT_CONFIGURATION_MAGIC 0x434C5854u

/* Constants of the part. TAXEL_BOOT_ONE_SLOT: a part with 16 KiB of flash, which has slot A only.
 * TAXEL_BOOT_64K: a part with 64 KiB of flash.
 *
 * TAXEL_BOOT_LAYOUTS: X(device, first row of slot A, first row of slot B, rows of a slot) */
#if defined TAXEL_BOOT_ONE_SLOT
#define TAXEL_BOOT_SLOTS 1u
#define TAXEL_BOOT_ROW_COUNT 128u
#define TAXEL_BOOT_BOOTLOADER_ROWS 32u
#define TAXEL_BOOT_CONFIGURATION_ROW 124u
#define TAXEL_BOOT_METADATA_ROW 126u
#define TAXEL_BOOT_SILICON_ID 0x04FA1193u
#define TAXEL_BOOT_LAYOUTS(X) \
    X(BOARD_16K, 32u, 32u, 92u)
#elif defined TAXEL_BOOT_64K
#define TAXEL_BOOT_SLOTS 2u
#define TAXEL_BOOT_ROW_COUNT 512u
#define TAXEL_BOOT_BOOTLOADER_ROWS 64u
#define TAXEL_BOOT_CONFIGURATION_ROW 508u
#define TAXEL_BOOT_METADATA_ROW 510u
#define TAXEL_BOOT_SILICON_ID 0x1B2511ABu
#define TAXEL_BOOT_LAYOUTS(X) \
    X(BOARD_64K, 64u, 286u, 222u) \
    X(HUB_64K, 64u, 286u, 222u)
#else
#define TAXEL_BOOT_SLOTS 2u
#define TAXEL_BOOT_ROW_COUNT 256u
#define TAXEL_BOOT_BOOTLOADER_ROWS 32u
#define TAXEL_BOOT_CONFIGURATION_ROW 252u
#define TAXEL_BOOT_METADATA_ROW 254u
#define TAXEL_BOOT_SILICON_ID 0x04C81193u
#define TAXEL_BOOT_LAYOUTS(X) \
    X(BOARD, 32u, 142u, 110u) \
    X(HUB, 32u, 142u, 110u)
#endif

enum taxel_boot_command {
    TAXEL_BOOT_COMMAND_VERIFY_APPLICATION = 0x31,
    TAXEL_BOOT_COMMAND_GET_FLASH_SIZE = 0x32,
    TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS = 0x33,
    TAXEL_BOOT_COMMAND_ERASE_ROW = 0x34,
    TAXEL_BOOT_COMMAND_SYNC = 0x35,
    TAXEL_BOOT_COMMAND_SET_ACTIVE = 0x36,
    TAXEL_BOOT_COMMAND_SEND_DATA = 0x37,
    TAXEL_BOOT_COMMAND_ENTER = 0x38,
    TAXEL_BOOT_COMMAND_PROGRAM_ROW = 0x39,
    TAXEL_BOOT_COMMAND_VERIFY_ROW = 0x3A,
    TAXEL_BOOT_COMMAND_EXIT = 0x3B,
    TAXEL_BOOT_COMMAND_GET_METADATA = 0x3C,
    TAXEL_BOOT_COMMAND_GET_INFO = 0x50,
    TAXEL_BOOT_COMMAND_SEARCH = 0x51,
    TAXEL_BOOT_COMMAND_READ_CONFIGURATION = 0x52,
    TAXEL_BOOT_COMMAND_WRITE_CONFIGURATION = 0x53,
};

enum taxel_boot_status {
    TAXEL_BOOT_STATUS_OK = 0x00,
    TAXEL_BOOT_STATUS_KEY = 0x01,
    TAXEL_BOOT_STATUS_VERIFY = 0x02,
    TAXEL_BOOT_STATUS_LENGTH = 0x03,
    TAXEL_BOOT_STATUS_DATA = 0x04,
    TAXEL_BOOT_STATUS_COMMAND = 0x05,
    TAXEL_BOOT_STATUS_DEVICE = 0x06,
    TAXEL_BOOT_STATUS_VERSION = 0x07,
    TAXEL_BOOT_STATUS_CHECKSUM = 0x08,
    TAXEL_BOOT_STATUS_ARRAY = 0x09,
    TAXEL_BOOT_STATUS_ROW = 0x0A,
    TAXEL_BOOT_STATUS_ROW_PROTECTED = 0x0B,
    TAXEL_BOOT_STATUS_APPLICATION = 0x0C,
    TAXEL_BOOT_STATUS_ACTIVE = 0x0D,
    TAXEL_BOOT_STATUS_CALLBACK = 0x0E,
    TAXEL_BOOT_STATUS_UNKNOWN = 0x0F,
};

enum taxel_boot_device {
    TAXEL_BOOT_DEVICE_BOARD = 0x01,
    TAXEL_BOOT_DEVICE_HUB = 0x02,
    TAXEL_BOOT_DEVICE_BOARD_16K = 0x03,
    TAXEL_BOOT_DEVICE_BOARD_64K = 0x04,
    TAXEL_BOOT_DEVICE_HUB_64K = 0x05,
};

enum taxel_boot_checksum {
    TAXEL_BOOT_CHECKSUM_SUM = 0x00,
    TAXEL_BOOT_CHECKSUM_CRC = 0x01,
    TAXEL_BOOT_CHECKSUM_ANY = 0x02,
};

enum taxel_boot_stay {
    TAXEL_BOOT_STAY_LISTENING = 0x00,
    TAXEL_BOOT_STAY_REQUESTED = 0x01,
    TAXEL_BOOT_STAY_NO_IMAGE = 0x02,
    TAXEL_BOOT_STAY_HOST = 0x03,
};

#define TAXEL_BOOT_IMAGE_HEADER_SIZE 32u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_MAGIC 0u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_HEADER_VERSION 4u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_DEVICE 5u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_KIND 6u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_SLOT 7u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR 8u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MINOR 9u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_PATCH 10u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_RESERVED_A 11u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_LENGTH 12u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_VECTORS 16u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_RESERVED_B 20u
#define TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32 28u
struct taxel_boot_image_header {
    uint32_t magic;
    uint8_t header_version;
    uint8_t device;
    uint8_t kind;
    uint8_t slot;
    uint8_t version_major;
    uint8_t version_minor;
    uint8_t version_patch;
    uint8_t reserved_a;
    uint32_t length;
    uint32_t vectors;
    uint8_t reserved_b[8];
    uint32_t crc32;
};
static inline void taxel_boot_image_header_pack(const struct taxel_boot_image_header *value, uint8_t *bytes)
{
    taxel_put_u32(bytes + 0, value->magic);
    taxel_put_u8(bytes + 4, value->header_version);
    taxel_put_u8(bytes + 5, value->device);
    taxel_put_u8(bytes + 6, value->kind);
    taxel_put_u8(bytes + 7, value->slot);
    taxel_put_u8(bytes + 8, value->version_major);
    taxel_put_u8(bytes + 9, value->version_minor);
    taxel_put_u8(bytes + 10, value->version_patch);
    taxel_put_u8(bytes + 11, value->reserved_a);
    taxel_put_u32(bytes + 12, value->length);
    taxel_put_u32(bytes + 16, value->vectors);
    memcpy(bytes + 20, value->reserved_b, 8);
    taxel_put_u32(bytes + 28, value->crc32);
}
static inline void taxel_boot_image_header_unpack(struct taxel_boot_image_header *value, const uint8_t *bytes)
{
    value->magic = taxel_get_u32(bytes + 0);
    value->header_version = taxel_get_u8(bytes + 4);
    value->device = taxel_get_u8(bytes + 5);
    value->kind = taxel_get_u8(bytes + 6);
    value->slot = taxel_get_u8(bytes + 7);
    value->version_major = taxel_get_u8(bytes + 8);
    value->version_minor = taxel_get_u8(bytes + 9);
    value->version_patch = taxel_get_u8(bytes + 10);
    value->reserved_a = taxel_get_u8(bytes + 11);
    value->length = taxel_get_u32(bytes + 12);
    value->vectors = taxel_get_u32(bytes + 16);
    memcpy(value->reserved_b, bytes + 20, 8);
    value->crc32 = taxel_get_u32(bytes + 28);
}

#define TAXEL_BOOT_RECORD_SIZE 128u
#define TAXEL_BOOT_RECORD_OFFSET_MAGIC 0u
#define TAXEL_BOOT_RECORD_OFFSET_SEQUENCE 4u
#define TAXEL_BOOT_RECORD_OFFSET_PAYLOAD 8u
#define TAXEL_BOOT_RECORD_OFFSET_CRC32 120u
#define TAXEL_BOOT_RECORD_OFFSET_BALANCE 124u
struct taxel_boot_record {
    uint32_t magic;
    uint32_t sequence;
    uint8_t payload[112];
    uint32_t crc32;
    uint32_t balance;
};
static inline void taxel_boot_record_pack(const struct taxel_boot_record *value, uint8_t *bytes)
{
    taxel_put_u32(bytes + 0, value->magic);
    taxel_put_u32(bytes + 4, value->sequence);
    memcpy(bytes + 8, value->payload, 112);
    taxel_put_u32(bytes + 120, value->crc32);
    taxel_put_u32(bytes + 124, value->balance);
}
static inline void taxel_boot_record_unpack(struct taxel_boot_record *value, const uint8_t *bytes)
{
    value->magic = taxel_get_u32(bytes + 0);
    value->sequence = taxel_get_u32(bytes + 4);
    memcpy(value->payload, bytes + 8, 112);
    value->crc32 = taxel_get_u32(bytes + 120);
    value->balance = taxel_get_u32(bytes + 124);
}

#define TAXEL_BOOT_METADATA_SIZE 4u
#define TAXEL_BOOT_METADATA_OFFSET_CONFIRMED 0u
#define TAXEL_BOOT_METADATA_OFFSET_PENDING 1u
#define TAXEL_BOOT_METADATA_OFFSET_TRIES 2u
struct taxel_boot_metadata {
    uint8_t confirmed;
    uint8_t pending;
    uint8_t tries[2];
};
static inline void taxel_boot_metadata_pack(const struct taxel_boot_metadata *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->confirmed);
    taxel_put_u8(bytes + 1, value->pending);
    memcpy(bytes + 2, value->tries, 2);
}
static inline void taxel_boot_metadata_unpack(struct taxel_boot_metadata *value, const uint8_t *bytes)
{
    value->confirmed = taxel_get_u8(bytes + 0);
    value->pending = taxel_get_u8(bytes + 1);
    memcpy(value->tries, bytes + 2, 2);
}

#define TAXEL_BOOT_CONFIGURATION_SIZE 36u
#define TAXEL_BOOT_CONFIGURATION_OFFSET_VERSION 0u
#define TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS 1u
#define TAXEL_BOOT_CONFIGURATION_OFFSET_KIND 2u
#define TAXEL_BOOT_CONFIGURATION_OFFSET_RESERVED 3u
#define TAXEL_BOOT_CONFIGURATION_OFFSET_SERIAL_NUMBER 4u
#define TAXEL_BOOT_CONFIGURATION_OFFSET_IDAC_CODES 20u
struct taxel_boot_configuration {
    uint8_t version;
    uint8_t address;
    uint8_t kind;
    uint8_t reserved;
    uint8_t serial_number[16];
    uint8_t idac_codes[16];
};
static inline void taxel_boot_configuration_pack(const struct taxel_boot_configuration *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->version);
    taxel_put_u8(bytes + 1, value->address);
    taxel_put_u8(bytes + 2, value->kind);
    taxel_put_u8(bytes + 3, value->reserved);
    memcpy(bytes + 4, value->serial_number, 16);
    memcpy(bytes + 20, value->idac_codes, 16);
}
static inline void taxel_boot_configuration_unpack(struct taxel_boot_configuration *value, const uint8_t *bytes)
{
    value->version = taxel_get_u8(bytes + 0);
    value->address = taxel_get_u8(bytes + 1);
    value->kind = taxel_get_u8(bytes + 2);
    value->reserved = taxel_get_u8(bytes + 3);
    memcpy(value->serial_number, bytes + 4, 16);
    memcpy(value->idac_codes, bytes + 20, 16);
}

#define TAXEL_BOOT_ENTER_REPLY_SIZE 8u
#define TAXEL_BOOT_ENTER_REPLY_OFFSET_SILICON_ID 0u
#define TAXEL_BOOT_ENTER_REPLY_OFFSET_REVISION 4u
#define TAXEL_BOOT_ENTER_REPLY_OFFSET_BOOTLOADER_VERSION 5u
struct taxel_boot_enter_reply {
    uint32_t silicon_id;
    uint8_t revision;
    uint8_t bootloader_version[3];
};
static inline void taxel_boot_enter_reply_pack(const struct taxel_boot_enter_reply *value, uint8_t *bytes)
{
    taxel_put_u32(bytes + 0, value->silicon_id);
    taxel_put_u8(bytes + 4, value->revision);
    memcpy(bytes + 5, value->bootloader_version, 3);
}
static inline void taxel_boot_enter_reply_unpack(struct taxel_boot_enter_reply *value, const uint8_t *bytes)
{
    value->silicon_id = taxel_get_u32(bytes + 0);
    value->revision = taxel_get_u8(bytes + 4);
    memcpy(value->bootloader_version, bytes + 5, 3);
}

#define TAXEL_BOOT_FLASH_SIZE_REPLY_SIZE 4u
#define TAXEL_BOOT_FLASH_SIZE_REPLY_OFFSET_FIRST_ROW 0u
#define TAXEL_BOOT_FLASH_SIZE_REPLY_OFFSET_LAST_ROW 2u
struct taxel_boot_flash_size_reply {
    uint16_t first_row;
    uint16_t last_row;
};
static inline void taxel_boot_flash_size_reply_pack(const struct taxel_boot_flash_size_reply *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->first_row);
    taxel_put_u16(bytes + 2, value->last_row);
}
static inline void taxel_boot_flash_size_reply_unpack(struct taxel_boot_flash_size_reply *value, const uint8_t *bytes)
{
    value->first_row = taxel_get_u16(bytes + 0);
    value->last_row = taxel_get_u16(bytes + 2);
}

#define TAXEL_BOOT_ROW_ADDRESS_SIZE 3u
#define TAXEL_BOOT_ROW_ADDRESS_OFFSET_ARRAY 0u
#define TAXEL_BOOT_ROW_ADDRESS_OFFSET_ROW 1u
struct taxel_boot_row_address {
    uint8_t array;
    uint16_t row;
};
static inline void taxel_boot_row_address_pack(const struct taxel_boot_row_address *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->array);
    taxel_put_u16(bytes + 1, value->row);
}
static inline void taxel_boot_row_address_unpack(struct taxel_boot_row_address *value, const uint8_t *bytes)
{
    value->array = taxel_get_u8(bytes + 0);
    value->row = taxel_get_u16(bytes + 1);
}

#define TAXEL_BOOT_STOCK_METADATA_SIZE 56u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_CHECKSUM 0u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_ENTRY 1u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_LAST_BOOTLOADER_ROW 5u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_RESERVED_A 7u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_LENGTH 9u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_RESERVED_B 13u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_ACTIVE 16u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_VERIFIED 17u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_BOOTLOADER_VERSION 18u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_APPLICATION_ID 20u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_APPLICATION_VERSION 22u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_CUSTOM_ID 24u
#define TAXEL_BOOT_STOCK_METADATA_OFFSET_RESERVED_C 28u
struct taxel_boot_stock_metadata {
    uint8_t checksum;
    uint32_t entry;
    uint16_t last_bootloader_row;
    uint8_t reserved_a[2];
    uint32_t length;
    uint8_t reserved_b[3];
    uint8_t active;
    uint8_t verified;
    uint16_t bootloader_version;
    uint16_t application_id;
    uint16_t application_version;
    uint32_t custom_id;
    uint8_t reserved_c[28];
};
static inline void taxel_boot_stock_metadata_pack(const struct taxel_boot_stock_metadata *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->checksum);
    taxel_put_u32(bytes + 1, value->entry);
    taxel_put_u16(bytes + 5, value->last_bootloader_row);
    memcpy(bytes + 7, value->reserved_a, 2);
    taxel_put_u32(bytes + 9, value->length);
    memcpy(bytes + 13, value->reserved_b, 3);
    taxel_put_u8(bytes + 16, value->active);
    taxel_put_u8(bytes + 17, value->verified);
    taxel_put_u16(bytes + 18, value->bootloader_version);
    taxel_put_u16(bytes + 20, value->application_id);
    taxel_put_u16(bytes + 22, value->application_version);
    taxel_put_u32(bytes + 24, value->custom_id);
    memcpy(bytes + 28, value->reserved_c, 28);
}
static inline void taxel_boot_stock_metadata_unpack(struct taxel_boot_stock_metadata *value, const uint8_t *bytes)
{
    value->checksum = taxel_get_u8(bytes + 0);
    value->entry = taxel_get_u32(bytes + 1);
    value->last_bootloader_row = taxel_get_u16(bytes + 5);
    memcpy(value->reserved_a, bytes + 7, 2);
    value->length = taxel_get_u32(bytes + 9);
    memcpy(value->reserved_b, bytes + 13, 3);
    value->active = taxel_get_u8(bytes + 16);
    value->verified = taxel_get_u8(bytes + 17);
    value->bootloader_version = taxel_get_u16(bytes + 18);
    value->application_id = taxel_get_u16(bytes + 20);
    value->application_version = taxel_get_u16(bytes + 22);
    value->custom_id = taxel_get_u32(bytes + 24);
    memcpy(value->reserved_c, bytes + 28, 28);
}

#define TAXEL_BOOT_INFO_SIZE 18u
#define TAXEL_BOOT_INFO_OFFSET_VERSION 0u
#define TAXEL_BOOT_INFO_OFFSET_DEVICE 1u
#define TAXEL_BOOT_INFO_OFFSET_STAY 2u
#define TAXEL_BOOT_INFO_OFFSET_TARGET 3u
#define TAXEL_BOOT_INFO_OFFSET_CONFIRMED 4u
#define TAXEL_BOOT_INFO_OFFSET_PENDING 5u
#define TAXEL_BOOT_INFO_OFFSET_TRIES 6u
#define TAXEL_BOOT_INFO_OFFSET_ADDRESS 8u
#define TAXEL_BOOT_INFO_OFFSET_KIND 9u
#define TAXEL_BOOT_INFO_OFFSET_UNIQUE_ID 10u
struct taxel_boot_info {
    uint8_t version;
    uint8_t device;
    uint8_t stay;
    uint8_t target;
    uint8_t confirmed;
    uint8_t pending;
    uint8_t tries[2];
    uint8_t address;
    uint8_t kind;
    uint8_t unique_id[8];
};
static inline void taxel_boot_info_pack(const struct taxel_boot_info *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->version);
    taxel_put_u8(bytes + 1, value->device);
    taxel_put_u8(bytes + 2, value->stay);
    taxel_put_u8(bytes + 3, value->target);
    taxel_put_u8(bytes + 4, value->confirmed);
    taxel_put_u8(bytes + 5, value->pending);
    memcpy(bytes + 6, value->tries, 2);
    taxel_put_u8(bytes + 8, value->address);
    taxel_put_u8(bytes + 9, value->kind);
    memcpy(bytes + 10, value->unique_id, 8);
}
static inline void taxel_boot_info_unpack(struct taxel_boot_info *value, const uint8_t *bytes)
{
    value->version = taxel_get_u8(bytes + 0);
    value->device = taxel_get_u8(bytes + 1);
    value->stay = taxel_get_u8(bytes + 2);
    value->target = taxel_get_u8(bytes + 3);
    value->confirmed = taxel_get_u8(bytes + 4);
    value->pending = taxel_get_u8(bytes + 5);
    memcpy(value->tries, bytes + 6, 2);
    value->address = taxel_get_u8(bytes + 8);
    value->kind = taxel_get_u8(bytes + 9);
    memcpy(value->unique_id, bytes + 10, 8);
}

#define TAXEL_BOOT_SEARCH_ARGUMENTS_SIZE 9u
#define TAXEL_BOOT_SEARCH_ARGUMENTS_OFFSET_BITS 0u
#define TAXEL_BOOT_SEARCH_ARGUMENTS_OFFSET_UNIQUE_ID 1u
struct taxel_boot_search_arguments {
    uint8_t bits;
    uint8_t unique_id[8];
};
static inline void taxel_boot_search_arguments_pack(const struct taxel_boot_search_arguments *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->bits);
    memcpy(bytes + 1, value->unique_id, 8);
}
static inline void taxel_boot_search_arguments_unpack(struct taxel_boot_search_arguments *value, const uint8_t *bytes)
{
    value->bits = taxel_get_u8(bytes + 0);
    memcpy(value->unique_id, bytes + 1, 8);
}

#define TAXEL_BOOT_SEARCH_REPLY_SIZE 16u
#define TAXEL_BOOT_SEARCH_REPLY_OFFSET_UNIQUE_ID 0u
#define TAXEL_BOOT_SEARCH_REPLY_OFFSET_COMPLEMENT 8u
struct taxel_boot_search_reply {
    uint8_t unique_id[8];
    uint8_t complement[8];
};
static inline void taxel_boot_search_reply_pack(const struct taxel_boot_search_reply *value, uint8_t *bytes)
{
    memcpy(bytes + 0, value->unique_id, 8);
    memcpy(bytes + 8, value->complement, 8);
}
static inline void taxel_boot_search_reply_unpack(struct taxel_boot_search_reply *value, const uint8_t *bytes)
{
    memcpy(value->unique_id, bytes + 0, 8);
    memcpy(value->complement, bytes + 8, 8);
}

#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_SIZE 44u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_UNIQUE_ID 0u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_VERSION 8u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_ADDRESS 9u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_KIND 10u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_RESERVED 11u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_SERIAL_NUMBER 12u
#define TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_IDAC_CODES 28u
struct taxel_boot_write_configuration_arguments {
    uint8_t unique_id[8];
    uint8_t configuration_version;
    uint8_t configuration_address;
    uint8_t configuration_kind;
    uint8_t configuration_reserved;
    uint8_t configuration_serial_number[16];
    uint8_t configuration_idac_codes[16];
};
static inline void taxel_boot_write_configuration_arguments_pack(const struct taxel_boot_write_configuration_arguments *value, uint8_t *bytes)
{
    memcpy(bytes + 0, value->unique_id, 8);
    taxel_put_u8(bytes + 8, value->configuration_version);
    taxel_put_u8(bytes + 9, value->configuration_address);
    taxel_put_u8(bytes + 10, value->configuration_kind);
    taxel_put_u8(bytes + 11, value->configuration_reserved);
    memcpy(bytes + 12, value->configuration_serial_number, 16);
    memcpy(bytes + 28, value->configuration_idac_codes, 16);
}
static inline void taxel_boot_write_configuration_arguments_unpack(struct taxel_boot_write_configuration_arguments *value, const uint8_t *bytes)
{
    memcpy(value->unique_id, bytes + 0, 8);
    value->configuration_version = taxel_get_u8(bytes + 8);
    value->configuration_address = taxel_get_u8(bytes + 9);
    value->configuration_kind = taxel_get_u8(bytes + 10);
    value->configuration_reserved = taxel_get_u8(bytes + 11);
    memcpy(value->configuration_serial_number, bytes + 12, 16);
    memcpy(value->configuration_idac_codes, bytes + 28, 16);
}

#endif
