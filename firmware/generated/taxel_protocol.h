/* Generated from protocol/taxel_protocol by tools/codegen/c_header.py (make generate). Do not edit. */
#ifndef TAXEL_PROTOCOL_H
#define TAXEL_PROTOCOL_H

#include <stdint.h>
#include <string.h>

#define TAXEL_PROTOCOL_VERSION 3u
#define TAXEL_PROTOCOL_VERSION_MIN 1u
#define TAXEL_REGISTER_MAP_VERSION 2u
#define TAXEL_REGISTER_MAP_REVISION 1u
#define TAXEL_REGISTER_MAP_VERSION_MIN 1u
#define TAXEL_WHO_AM_I 84u
#define TAXEL_ADDRESS_MIN 8u
#define TAXEL_ADDRESS_MAX 119u
#define TAXEL_LINES_MAX 16u
#define TAXEL_TAXELS_MAX 240u
#define TAXEL_SMBUS_BLOCK 32u
#define TAXEL_CROSSING_MAP_SIZE 32u
#define TAXEL_SNAPSHOT_OVERHEAD 10u
#define TAXEL_COMPACT_OVERHEAD_PACKED 11u
#define TAXEL_COMPACT_OVERHEAD_DELTA 12u
#define TAXEL_COMPACT_TAXELS_MAX 238u
#define TAXEL_COMPACT_SIZE_MAX 488u
#define TAXEL_COMPACT_LENGTH_FINE 128u
#define TAXEL_COMPACT_LENGTH_STEP 4u
#define TAXEL_COMPACT_WIDTH_MASK 31u
#define TAXEL_COMPACT_START_MASK 96u
#define TAXEL_COMPACT_START_SHIFT 5u
#define TAXEL_COMPACT_KEY_FRAME 128u
#define TAXEL_ACKNOWLEDGE_FORGET 128u
#define TAXEL_ACKNOWLEDGE_MAX 22u
#define TAXEL_TRANSFER_MAX 64u
#define TAXEL_BOOTLOADER_KEY 1414483778u
#define TAXEL_LOG_TEXT_MAX 64u
#define TAXEL_FRAME_HEADER_SIZE 5u
#define TAXEL_FRAME_CRC_SIZE 4u
#define TAXEL_PAYLOAD_MAX 498u
#define TAXEL_BODY_MAX 507u
#define TAXEL_ENCODED_MAX 509u
#define TAXEL_WHITENING_SEED 165u
#define TAXEL_WHITENING_FACTOR 5u
#define TAXEL_WHITENING_INCREMENT 107u
#define TAXEL_REGISTER_IDENTITY 0u
#define TAXEL_REGISTER_STATUS 64u
#define TAXEL_REGISTER_CLOCK 68u
#define TAXEL_REGISTER_SETTINGS 96u
#define TAXEL_REGISTER_COMMAND 112u
#define TAXEL_REGISTER_SNAPSHOT 128u
#define TAXEL_REGISTER_SNAPSHOT_LAST 143u
#define TAXEL_REGISTER_FAULT 144u
#define TAXEL_REGISTER_COMPACT 160u
#define TAXEL_COMPACT_FRACTION_BITS 6u
#define TAXEL_COMPACT_MEAN_MAX 4194303u
#define TAXEL_COMPACT_LEVEL_BITS 10u
#define TAXEL_COMPACT_LEVEL_MAX 1023u
#define TAXEL_COMPACT_LEVEL_START 384u
#define TAXEL_COMPACT_LEVEL_START_STEP 128u
#define TAXEL_COMPACT_TOTAL_BITS 16u
#define TAXEL_COMPACT_ESCAPE 128u
#define TAXEL_COMPACT_UNIT 1024u
#define TAXEL_COMPACT_REACH 8192u
#define TAXEL_COMPACT_STEP_BITS 7u
#define TAXEL_COMPACT_JUMP 6144u
#define TAXEL_COMPACT_CLIP 4096u
#define TAXEL_COMPACT_COARSE_OCTAVE 8u
#define TAXEL_COMPACT_MULTIPLIERS \
    {256, 235, 215, 197, 181, 166, 152, 140}
#define TAXEL_COMPACT_GAINS \
    {128, 85, 64, 51, 42, 36, 32, 28, 25, 23, 21, 19, 18, 17, 16}
#define TAXEL_COMPACT_MEAN_DEVIATION 1283u
#define TAXEL_COMPACT_LEVEL_STEP 92u
#define TAXEL_COMPACT_CUMULATIVE \
    {0, 3243, 6435, 9530, 12483, 15258, 17824, 20162, 22258, 24109, 25718, 27095, 28255, 29218, 30005, 30638, \
     31139, 31531, 31832, 32060, 32230, 32356, 32447, 32512, 32559, 32591, 32614, 32630, 32642, 32650, 32656, 32660, \
     32664, 32666, 32669, 32671, 32673, 32675, 32676, 32678, 32679, 32681, 32682, 32684, 32685, 32686, 32688, 32689, \
     32690, 32691, 32692, 32693, 32694, 32695, 32696, 32697, 32698, 32699, 32699, 32700, 32701, 32702, 32703, 32703, \
     32704}

enum taxel_frame_type {
    TAXEL_FRAME_TYPE_HUB_HANDSHAKE = 0x01,
    TAXEL_FRAME_TYPE_TAXELS = 0x02,
    TAXEL_FRAME_TYPE_COMPACT_TAXELS = 0x03,
    TAXEL_FRAME_TYPE_HUB_STATUS = 0x08,
    TAXEL_FRAME_TYPE_BOARD_STATUS = 0x09,
    TAXEL_FRAME_TYPE_BOARD_INFO = 0x0A,
    TAXEL_FRAME_TYPE_BOARD_FAULT = 0x0B,
    TAXEL_FRAME_TYPE_TIME_SYNC = 0x0C,
    TAXEL_FRAME_TYPE_LOG = 0x0D,
    TAXEL_FRAME_TYPE_REPLY = 0x0E,
    TAXEL_FRAME_TYPE_HOST_HANDSHAKE = 0x81,
    TAXEL_FRAME_TYPE_COMMAND = 0x82,
    TAXEL_FRAME_TYPE_ACKNOWLEDGE = 0x83,
};

enum taxel_command {
    TAXEL_COMMAND_START = 0x01,
    TAXEL_COMMAND_STOP = 0x02,
    TAXEL_COMMAND_SET_RATE = 0x03,
    TAXEL_COMMAND_SCAN_BUS = 0x04,
    TAXEL_COMMAND_I2C_TRANSFER = 0x05,
    TAXEL_COMMAND_SET_SCAN_SETTINGS = 0x06,
    TAXEL_COMMAND_REBOOT = 0x07,
    TAXEL_COMMAND_GET_STATUS = 0x08,
    TAXEL_COMMAND_GET_BOARD_INFO = 0x09,
    TAXEL_COMMAND_GET_TIME = 0x0A,
    TAXEL_COMMAND_ENTER_BOOTLOADER = 0x0B,
    TAXEL_COMMAND_GET_FAULT = 0x0C,
};

enum taxel_start_flag {
    TAXEL_START_FLAG_COMPACT = 0x01,
};

enum taxel_reply_status {
    TAXEL_REPLY_STATUS_OK = 0x00,
    TAXEL_REPLY_STATUS_UNKNOWN_COMMAND = 0x01,
    TAXEL_REPLY_STATUS_BAD_ARGUMENTS = 0x02,
    TAXEL_REPLY_STATUS_BUSY = 0x03,
    TAXEL_REPLY_STATUS_NO_HANDSHAKE = 0x04,
    TAXEL_REPLY_STATUS_UNKNOWN_BOARD = 0x05,
    TAXEL_REPLY_STATUS_NACK = 0x06,
    TAXEL_REPLY_STATUS_TIMEOUT = 0x07,
    TAXEL_REPLY_STATUS_BUS_ERROR = 0x08,
    TAXEL_REPLY_STATUS_REJECTED_BY_BOARD = 0x09,
};

enum taxel_board_state {
    TAXEL_BOARD_STATE_ABSENT = 0x00,
    TAXEL_BOARD_STATE_IDENTIFYING = 0x01,
    TAXEL_BOARD_STATE_STREAMING = 0x02,
    TAXEL_BOARD_STATE_INCOMPATIBLE = 0x03,
};

enum taxel_board_fault {
    TAXEL_BOARD_FAULT_NONE = 0x00,
    TAXEL_BOARD_FAULT_NACK = 0x01,
    TAXEL_BOARD_FAULT_TIMEOUT = 0x02,
    TAXEL_BOARD_FAULT_CRC = 0x03,
    TAXEL_BOARD_FAULT_SDA_STUCK = 0x04,
    TAXEL_BOARD_FAULT_SCL_STUCK = 0x05,
    TAXEL_BOARD_FAULT_ARBITRATION = 0x06,
    TAXEL_BOARD_FAULT_NOT_A_TAXEL_BOARD = 0x07,
    TAXEL_BOARD_FAULT_MAP_VERSION = 0x08,
    TAXEL_BOARD_FAULT_RESTARTED = 0x09,
    TAXEL_BOARD_FAULT_TOO_LARGE = 0x0A,
    TAXEL_BOARD_FAULT_SETTINGS_REJECTED = 0x0B,
    TAXEL_BOARD_FAULT_RECOVERED = 0x0C,
};

enum taxel_reset_cause {
    TAXEL_RESET_CAUSE_POWER_ON = 0x00,
    TAXEL_RESET_CAUSE_BROWN_OUT = 0x01,
    TAXEL_RESET_CAUSE_WATCHDOG = 0x02,
    TAXEL_RESET_CAUSE_COMMAND = 0x03,
};

enum taxel_log_level {
    TAXEL_LOG_LEVEL_DEBUG = 0x00,
    TAXEL_LOG_LEVEL_INFO = 0x01,
    TAXEL_LOG_LEVEL_WARNING = 0x02,
    TAXEL_LOG_LEVEL_ERROR = 0x03,
};

enum taxel_log_code {
    TAXEL_LOG_CODE_BUS_FREE = 0x01,
    TAXEL_LOG_CODE_SDA_STUCK = 0x02,
    TAXEL_LOG_CODE_SCL_STUCK = 0x03,
    TAXEL_LOG_CODE_RECEIVE_OVERRUN = 0x04,
    TAXEL_LOG_CODE_FRAME_DROPPED = 0x05,
};

enum taxel_board_command {
    TAXEL_BOARD_COMMAND_START_SCAN = 0x01,
    TAXEL_BOARD_COMMAND_STOP_SCAN = 0x02,
    TAXEL_BOARD_COMMAND_CLEAR_COUNTERS = 0x03,
    TAXEL_BOARD_COMMAND_RESTART = 0x04,
    TAXEL_BOARD_COMMAND_ENTER_BOOTLOADER = 0x05,
};

enum taxel_board_error_flag {
    TAXEL_BOARD_ERROR_FLAG_SETTINGS_REJECTED = 0x01,
    TAXEL_BOARD_ERROR_FLAG_COMMAND_REJECTED = 0x02,
    TAXEL_BOARD_ERROR_FLAG_SATURATED = 0x08,
    TAXEL_BOARD_ERROR_FLAG_READ_ONLY_WRITE = 0x10,
    TAXEL_BOARD_ERROR_FLAG_NOT_SCANNING = 0x20,
};

enum taxel_front_end {
    TAXEL_FRONT_END_CAPSENSE = 0x00,
};

enum taxel_fault_code {
    TAXEL_FAULT_CODE_NONE = 0x00,
    TAXEL_FAULT_CODE_EXCEPTION = 0x01,
    TAXEL_FAULT_CODE_NOT_SCANNING = 0x02,
};

static inline void taxel_put_u8(uint8_t *bytes, uint8_t value)
{
    bytes[0] = value;
}
static inline void taxel_put_u16(uint8_t *bytes, uint16_t value)
{
    bytes[0] = (uint8_t)(value & 0xFFu);
    bytes[1] = (uint8_t)(value >> 8);
}
static inline void taxel_put_u32(uint8_t *bytes, uint32_t value)
{
    taxel_put_u16(bytes, (uint16_t)(value & 0xFFFFu));
    taxel_put_u16(bytes + 2, (uint16_t)(value >> 16));
}
static inline void taxel_put_u64(uint8_t *bytes, uint64_t value)
{
    taxel_put_u32(bytes, (uint32_t)(value & 0xFFFFFFFFu));
    taxel_put_u32(bytes + 4, (uint32_t)(value >> 32));
}
static inline uint8_t taxel_get_u8(const uint8_t *bytes)
{
    return bytes[0];
}
static inline uint16_t taxel_get_u16(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] | (uint16_t)(bytes[1] << 8));
}
static inline uint32_t taxel_get_u32(const uint8_t *bytes)
{
    return (uint32_t)taxel_get_u16(bytes) | ((uint32_t)taxel_get_u16(bytes + 2) << 16);
}
static inline uint64_t taxel_get_u64(const uint8_t *bytes)
{
    return (uint64_t)taxel_get_u32(bytes) | ((uint64_t)taxel_get_u32(bytes + 4) << 32);
}

/* Bytes of the compact snapshot whose first byte on the bus is `length`. */
static inline uint16_t taxel_compact_size(uint8_t length)
{
    const unsigned steps = length - TAXEL_COMPACT_LENGTH_FINE;
    return (uint16_t)(length < TAXEL_COMPACT_LENGTH_FINE ? length : steps * TAXEL_COMPACT_LENGTH_STEP);
}

#define TAXEL_IDENTITY_SIZE 58u
#define TAXEL_IDENTITY_OFFSET_WHO_AM_I 0u
#define TAXEL_IDENTITY_OFFSET_MAP_VERSION 1u
#define TAXEL_IDENTITY_OFFSET_FIRMWARE_MAJOR 2u
#define TAXEL_IDENTITY_OFFSET_FIRMWARE_MINOR 3u
#define TAXEL_IDENTITY_OFFSET_FIRMWARE_PATCH 4u
#define TAXEL_IDENTITY_OFFSET_KIND 5u
#define TAXEL_IDENTITY_OFFSET_ADDRESS 6u
#define TAXEL_IDENTITY_OFFSET_MAP_REVISION 7u
#define TAXEL_IDENTITY_OFFSET_UNIQUE_ID 8u
#define TAXEL_IDENTITY_OFFSET_ROWS 16u
#define TAXEL_IDENTITY_OFFSET_COLUMNS 17u
#define TAXEL_IDENTITY_OFFSET_TAXEL_COUNT 18u
#define TAXEL_IDENTITY_OFFSET_SNAPSHOT_SIZE 20u
#define TAXEL_IDENTITY_OFFSET_CROSSING_MAP 22u
#define TAXEL_IDENTITY_OFFSET_CRC32 54u
struct taxel_identity {
    uint8_t who_am_i;
    uint8_t map_version;
    uint8_t firmware_major;
    uint8_t firmware_minor;
    uint8_t firmware_patch;
    uint8_t kind;
    uint8_t address;
    uint8_t map_revision;
    uint8_t unique_id[8];
    uint8_t rows;
    uint8_t columns;
    uint16_t taxel_count;
    uint16_t snapshot_size;
    uint8_t crossing_map[32];
    uint32_t crc32;
};
static inline void taxel_identity_pack(const struct taxel_identity *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->who_am_i);
    taxel_put_u8(bytes + 1, value->map_version);
    taxel_put_u8(bytes + 2, value->firmware_major);
    taxel_put_u8(bytes + 3, value->firmware_minor);
    taxel_put_u8(bytes + 4, value->firmware_patch);
    taxel_put_u8(bytes + 5, value->kind);
    taxel_put_u8(bytes + 6, value->address);
    taxel_put_u8(bytes + 7, value->map_revision);
    memcpy(bytes + 8, value->unique_id, 8);
    taxel_put_u8(bytes + 16, value->rows);
    taxel_put_u8(bytes + 17, value->columns);
    taxel_put_u16(bytes + 18, value->taxel_count);
    taxel_put_u16(bytes + 20, value->snapshot_size);
    memcpy(bytes + 22, value->crossing_map, 32);
    taxel_put_u32(bytes + 54, value->crc32);
}
static inline void taxel_identity_unpack(struct taxel_identity *value, const uint8_t *bytes)
{
    value->who_am_i = taxel_get_u8(bytes + 0);
    value->map_version = taxel_get_u8(bytes + 1);
    value->firmware_major = taxel_get_u8(bytes + 2);
    value->firmware_minor = taxel_get_u8(bytes + 3);
    value->firmware_patch = taxel_get_u8(bytes + 4);
    value->kind = taxel_get_u8(bytes + 5);
    value->address = taxel_get_u8(bytes + 6);
    value->map_revision = taxel_get_u8(bytes + 7);
    memcpy(value->unique_id, bytes + 8, 8);
    value->rows = taxel_get_u8(bytes + 16);
    value->columns = taxel_get_u8(bytes + 17);
    value->taxel_count = taxel_get_u16(bytes + 18);
    value->snapshot_size = taxel_get_u16(bytes + 20);
    memcpy(value->crossing_map, bytes + 22, 32);
    value->crc32 = taxel_get_u32(bytes + 54);
}

#define TAXEL_STATUS_SIZE 28u
#define TAXEL_STATUS_OFFSET_STATE 0u
#define TAXEL_STATUS_OFFSET_ERROR_FLAGS 1u
#define TAXEL_STATUS_OFFSET_RESET_CAUSE 2u
#define TAXEL_STATUS_OFFSET_SETTINGS_GENERATION 3u
#define TAXEL_STATUS_OFFSET_CLOCK_US 4u
#define TAXEL_STATUS_OFFSET_SCANS 8u
#define TAXEL_STATUS_OFFSET_SCAN_TIME_US 12u
#define TAXEL_STATUS_OFFSET_SNAPSHOT_READS 16u
#define TAXEL_STATUS_OFFSET_BUS_ERRORS 20u
#define TAXEL_STATUS_OFFSET_REJECTED_WRITES 22u
#define TAXEL_STATUS_OFFSET_FRONT_END 24u
#define TAXEL_STATUS_OFFSET_RESERVED 25u
#define TAXEL_STATUS_OFFSET_SATURATED_CONVERSIONS 26u
struct taxel_status {
    uint8_t state;
    uint8_t error_flags;
    uint8_t reset_cause;
    uint8_t settings_generation;
    uint32_t clock_us;
    uint32_t scans;
    uint32_t scan_time_us;
    uint32_t snapshot_reads;
    uint16_t bus_errors;
    uint16_t rejected_writes;
    uint8_t front_end;
    uint8_t reserved;
    uint16_t saturated_conversions;
};
static inline void taxel_status_pack(const struct taxel_status *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->state);
    taxel_put_u8(bytes + 1, value->error_flags);
    taxel_put_u8(bytes + 2, value->reset_cause);
    taxel_put_u8(bytes + 3, value->settings_generation);
    taxel_put_u32(bytes + 4, value->clock_us);
    taxel_put_u32(bytes + 8, value->scans);
    taxel_put_u32(bytes + 12, value->scan_time_us);
    taxel_put_u32(bytes + 16, value->snapshot_reads);
    taxel_put_u16(bytes + 20, value->bus_errors);
    taxel_put_u16(bytes + 22, value->rejected_writes);
    taxel_put_u8(bytes + 24, value->front_end);
    taxel_put_u8(bytes + 25, value->reserved);
    taxel_put_u16(bytes + 26, value->saturated_conversions);
}
static inline void taxel_status_unpack(struct taxel_status *value, const uint8_t *bytes)
{
    value->state = taxel_get_u8(bytes + 0);
    value->error_flags = taxel_get_u8(bytes + 1);
    value->reset_cause = taxel_get_u8(bytes + 2);
    value->settings_generation = taxel_get_u8(bytes + 3);
    value->clock_us = taxel_get_u32(bytes + 4);
    value->scans = taxel_get_u32(bytes + 8);
    value->scan_time_us = taxel_get_u32(bytes + 12);
    value->snapshot_reads = taxel_get_u32(bytes + 16);
    value->bus_errors = taxel_get_u16(bytes + 20);
    value->rejected_writes = taxel_get_u16(bytes + 22);
    value->front_end = taxel_get_u8(bytes + 24);
    value->reserved = taxel_get_u8(bytes + 25);
    value->saturated_conversions = taxel_get_u16(bytes + 26);
}

#define TAXEL_SCAN_SETTINGS_SIZE 8u
#define TAXEL_SCAN_SETTINGS_OFFSET_SUB_CONVERSIONS 0u
#define TAXEL_SCAN_SETTINGS_OFFSET_SENSE_CLOCK_DIVIDER 2u
#define TAXEL_SCAN_SETTINGS_OFFSET_MODULATOR_CLOCK_DIVIDER 4u
#define TAXEL_SCAN_SETTINGS_OFFSET_IDAC_CODE 5u
#define TAXEL_SCAN_SETTINGS_OFFSET_SETTLE_CYCLES 6u
struct taxel_scan_settings {
    uint16_t sub_conversions;
    uint16_t sense_clock_divider;
    uint8_t modulator_clock_divider;
    uint8_t idac_code;
    uint16_t settle_cycles;
};
static inline void taxel_scan_settings_pack(const struct taxel_scan_settings *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->sub_conversions);
    taxel_put_u16(bytes + 2, value->sense_clock_divider);
    taxel_put_u8(bytes + 4, value->modulator_clock_divider);
    taxel_put_u8(bytes + 5, value->idac_code);
    taxel_put_u16(bytes + 6, value->settle_cycles);
}
static inline void taxel_scan_settings_unpack(struct taxel_scan_settings *value, const uint8_t *bytes)
{
    value->sub_conversions = taxel_get_u16(bytes + 0);
    value->sense_clock_divider = taxel_get_u16(bytes + 2);
    value->modulator_clock_divider = taxel_get_u8(bytes + 4);
    value->idac_code = taxel_get_u8(bytes + 5);
    value->settle_cycles = taxel_get_u16(bytes + 6);
}

#define TAXEL_SETTINGS_REGISTER_SIZE 12u
#define TAXEL_SETTINGS_REGISTER_OFFSET_SETTINGS_SUB_CONVERSIONS 0u
#define TAXEL_SETTINGS_REGISTER_OFFSET_SETTINGS_SENSE_CLOCK_DIVIDER 2u
#define TAXEL_SETTINGS_REGISTER_OFFSET_SETTINGS_MODULATOR_CLOCK_DIVIDER 4u
#define TAXEL_SETTINGS_REGISTER_OFFSET_SETTINGS_IDAC_CODE 5u
#define TAXEL_SETTINGS_REGISTER_OFFSET_SETTINGS_SETTLE_CYCLES 6u
#define TAXEL_SETTINGS_REGISTER_OFFSET_CRC32 8u
struct taxel_settings_register {
    uint16_t settings_sub_conversions;
    uint16_t settings_sense_clock_divider;
    uint8_t settings_modulator_clock_divider;
    uint8_t settings_idac_code;
    uint16_t settings_settle_cycles;
    uint32_t crc32;
};
static inline void taxel_settings_register_pack(const struct taxel_settings_register *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->settings_sub_conversions);
    taxel_put_u16(bytes + 2, value->settings_sense_clock_divider);
    taxel_put_u8(bytes + 4, value->settings_modulator_clock_divider);
    taxel_put_u8(bytes + 5, value->settings_idac_code);
    taxel_put_u16(bytes + 6, value->settings_settle_cycles);
    taxel_put_u32(bytes + 8, value->crc32);
}
static inline void taxel_settings_register_unpack(struct taxel_settings_register *value, const uint8_t *bytes)
{
    value->settings_sub_conversions = taxel_get_u16(bytes + 0);
    value->settings_sense_clock_divider = taxel_get_u16(bytes + 2);
    value->settings_modulator_clock_divider = taxel_get_u8(bytes + 4);
    value->settings_idac_code = taxel_get_u8(bytes + 5);
    value->settings_settle_cycles = taxel_get_u16(bytes + 6);
    value->crc32 = taxel_get_u32(bytes + 8);
}

#define TAXEL_COMMAND_REGISTER_SIZE 2u
#define TAXEL_COMMAND_REGISTER_OFFSET_COMMAND 0u
#define TAXEL_COMMAND_REGISTER_OFFSET_COMPLEMENT 1u
struct taxel_command_register {
    uint8_t command;
    uint8_t complement;
};
static inline void taxel_command_register_pack(const struct taxel_command_register *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->command);
    taxel_put_u8(bytes + 1, value->complement);
}
static inline void taxel_command_register_unpack(struct taxel_command_register *value, const uint8_t *bytes)
{
    value->command = taxel_get_u8(bytes + 0);
    value->complement = taxel_get_u8(bytes + 1);
}

#define TAXEL_ENTER_BOOTLOADER_REGISTER_SIZE 6u
#define TAXEL_ENTER_BOOTLOADER_REGISTER_OFFSET_COMMAND 0u
#define TAXEL_ENTER_BOOTLOADER_REGISTER_OFFSET_COMPLEMENT 1u
#define TAXEL_ENTER_BOOTLOADER_REGISTER_OFFSET_KEY 2u
struct taxel_enter_bootloader_register {
    uint8_t command;
    uint8_t complement;
    uint32_t key;
};
static inline void taxel_enter_bootloader_register_pack(const struct taxel_enter_bootloader_register *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->command);
    taxel_put_u8(bytes + 1, value->complement);
    taxel_put_u32(bytes + 2, value->key);
}
static inline void taxel_enter_bootloader_register_unpack(struct taxel_enter_bootloader_register *value, const uint8_t *bytes)
{
    value->command = taxel_get_u8(bytes + 0);
    value->complement = taxel_get_u8(bytes + 1);
    value->key = taxel_get_u32(bytes + 2);
}

#define TAXEL_FAULT_RECORD_SIZE 12u
#define TAXEL_FAULT_RECORD_OFFSET_CODE 0u
#define TAXEL_FAULT_RECORD_OFFSET_EXCEPTION 1u
#define TAXEL_FAULT_RECORD_OFFSET_COUNT 2u
#define TAXEL_FAULT_RECORD_OFFSET_PROGRAM_COUNTER 4u
#define TAXEL_FAULT_RECORD_OFFSET_LINK_REGISTER 8u
struct taxel_fault_record {
    uint8_t code;
    uint8_t exception;
    uint16_t count;
    uint32_t program_counter;
    uint32_t link_register;
};
static inline void taxel_fault_record_pack(const struct taxel_fault_record *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->code);
    taxel_put_u8(bytes + 1, value->exception);
    taxel_put_u16(bytes + 2, value->count);
    taxel_put_u32(bytes + 4, value->program_counter);
    taxel_put_u32(bytes + 8, value->link_register);
}
static inline void taxel_fault_record_unpack(struct taxel_fault_record *value, const uint8_t *bytes)
{
    value->code = taxel_get_u8(bytes + 0);
    value->exception = taxel_get_u8(bytes + 1);
    value->count = taxel_get_u16(bytes + 2);
    value->program_counter = taxel_get_u32(bytes + 4);
    value->link_register = taxel_get_u32(bytes + 8);
}

#define TAXEL_FAULT_REGISTER_SIZE 16u
#define TAXEL_FAULT_REGISTER_OFFSET_RECORD_CODE 0u
#define TAXEL_FAULT_REGISTER_OFFSET_RECORD_EXCEPTION 1u
#define TAXEL_FAULT_REGISTER_OFFSET_RECORD_COUNT 2u
#define TAXEL_FAULT_REGISTER_OFFSET_RECORD_PROGRAM_COUNTER 4u
#define TAXEL_FAULT_REGISTER_OFFSET_RECORD_LINK_REGISTER 8u
#define TAXEL_FAULT_REGISTER_OFFSET_CRC32 12u
struct taxel_fault_register {
    uint8_t record_code;
    uint8_t record_exception;
    uint16_t record_count;
    uint32_t record_program_counter;
    uint32_t record_link_register;
    uint32_t crc32;
};
static inline void taxel_fault_register_pack(const struct taxel_fault_register *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->record_code);
    taxel_put_u8(bytes + 1, value->record_exception);
    taxel_put_u16(bytes + 2, value->record_count);
    taxel_put_u32(bytes + 4, value->record_program_counter);
    taxel_put_u32(bytes + 8, value->record_link_register);
    taxel_put_u32(bytes + 12, value->crc32);
}
static inline void taxel_fault_register_unpack(struct taxel_fault_register *value, const uint8_t *bytes)
{
    value->record_code = taxel_get_u8(bytes + 0);
    value->record_exception = taxel_get_u8(bytes + 1);
    value->record_count = taxel_get_u16(bytes + 2);
    value->record_program_counter = taxel_get_u32(bytes + 4);
    value->record_link_register = taxel_get_u32(bytes + 8);
    value->crc32 = taxel_get_u32(bytes + 12);
}

#define TAXEL_SNAPSHOT_HEADER_SIZE 6u
#define TAXEL_SNAPSHOT_HEADER_OFFSET_SEQUENCE 0u
#define TAXEL_SNAPSHOT_HEADER_OFFSET_TIMESTAMP_US 2u
struct taxel_snapshot_header {
    uint16_t sequence;
    uint32_t timestamp_us;
};
static inline void taxel_snapshot_header_pack(const struct taxel_snapshot_header *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->sequence);
    taxel_put_u32(bytes + 2, value->timestamp_us);
}
static inline void taxel_snapshot_header_unpack(struct taxel_snapshot_header *value, const uint8_t *bytes)
{
    value->sequence = taxel_get_u16(bytes + 0);
    value->timestamp_us = taxel_get_u32(bytes + 2);
}

#define TAXEL_COMPACT_HEADER_SIZE 3u
#define TAXEL_COMPACT_HEADER_OFFSET_SEQUENCE 0u
#define TAXEL_COMPACT_HEADER_OFFSET_FORMAT 2u
struct taxel_compact_header {
    uint16_t sequence;
    uint8_t format;
};
static inline void taxel_compact_header_pack(const struct taxel_compact_header *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->sequence);
    taxel_put_u8(bytes + 2, value->format);
}
static inline void taxel_compact_header_unpack(struct taxel_compact_header *value, const uint8_t *bytes)
{
    value->sequence = taxel_get_u16(bytes + 0);
    value->format = taxel_get_u8(bytes + 2);
}

#define TAXEL_COMPACT_PACKED_SIZE 7u
#define TAXEL_COMPACT_PACKED_OFFSET_SEQUENCE 0u
#define TAXEL_COMPACT_PACKED_OFFSET_FORMAT 2u
#define TAXEL_COMPACT_PACKED_OFFSET_TIMESTAMP_US 3u
struct taxel_compact_packed {
    uint16_t sequence;
    uint8_t format;
    uint32_t timestamp_us;
};
static inline void taxel_compact_packed_pack(const struct taxel_compact_packed *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->sequence);
    taxel_put_u8(bytes + 2, value->format);
    taxel_put_u32(bytes + 3, value->timestamp_us);
}
static inline void taxel_compact_packed_unpack(struct taxel_compact_packed *value, const uint8_t *bytes)
{
    value->sequence = taxel_get_u16(bytes + 0);
    value->format = taxel_get_u8(bytes + 2);
    value->timestamp_us = taxel_get_u32(bytes + 3);
}

#define TAXEL_COMPACT_DELTA_SIZE 8u
#define TAXEL_COMPACT_DELTA_OFFSET_SEQUENCE 0u
#define TAXEL_COMPACT_DELTA_OFFSET_FORMAT 2u
#define TAXEL_COMPACT_DELTA_OFFSET_KEY_FRAME 3u
#define TAXEL_COMPACT_DELTA_OFFSET_TIMESTAMP_LOW 5u
struct taxel_compact_delta {
    uint16_t sequence;
    uint8_t format;
    uint16_t key_frame;
    uint8_t timestamp_low[3];
};
static inline void taxel_compact_delta_pack(const struct taxel_compact_delta *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->sequence);
    taxel_put_u8(bytes + 2, value->format);
    taxel_put_u16(bytes + 3, value->key_frame);
    memcpy(bytes + 5, value->timestamp_low, 3);
}
static inline void taxel_compact_delta_unpack(struct taxel_compact_delta *value, const uint8_t *bytes)
{
    value->sequence = taxel_get_u16(bytes + 0);
    value->format = taxel_get_u8(bytes + 2);
    value->key_frame = taxel_get_u16(bytes + 3);
    memcpy(value->timestamp_low, bytes + 5, 3);
}

#define TAXEL_COMPACT_ACKNOWLEDGE_SIZE 2u
#define TAXEL_COMPACT_ACKNOWLEDGE_OFFSET_KEY_FRAME 0u
struct taxel_compact_acknowledge {
    uint16_t key_frame;
};
static inline void taxel_compact_acknowledge_pack(const struct taxel_compact_acknowledge *value, uint8_t *bytes)
{
    taxel_put_u16(bytes + 0, value->key_frame);
}
static inline void taxel_compact_acknowledge_unpack(struct taxel_compact_acknowledge *value, const uint8_t *bytes)
{
    value->key_frame = taxel_get_u16(bytes + 0);
}

#define TAXEL_HOST_HANDSHAKE_SIZE 3u
#define TAXEL_HOST_HANDSHAKE_OFFSET_TAG 0u
#define TAXEL_HOST_HANDSHAKE_OFFSET_VERSION_MIN 1u
#define TAXEL_HOST_HANDSHAKE_OFFSET_VERSION_MAX 2u
struct taxel_host_handshake {
    uint8_t tag;
    uint8_t version_min;
    uint8_t version_max;
};
static inline void taxel_host_handshake_pack(const struct taxel_host_handshake *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->tag);
    taxel_put_u8(bytes + 1, value->version_min);
    taxel_put_u8(bytes + 2, value->version_max);
}
static inline void taxel_host_handshake_unpack(struct taxel_host_handshake *value, const uint8_t *bytes)
{
    value->tag = taxel_get_u8(bytes + 0);
    value->version_min = taxel_get_u8(bytes + 1);
    value->version_max = taxel_get_u8(bytes + 2);
}

#define TAXEL_HUB_HANDSHAKE_SIZE 24u
#define TAXEL_HUB_HANDSHAKE_OFFSET_TAG 0u
#define TAXEL_HUB_HANDSHAKE_OFFSET_VERSION_MIN 1u
#define TAXEL_HUB_HANDSHAKE_OFFSET_VERSION_MAX 2u
#define TAXEL_HUB_HANDSHAKE_OFFSET_VERSION_CHOSEN 3u
#define TAXEL_HUB_HANDSHAKE_OFFSET_RESET_CAUSE 4u
#define TAXEL_HUB_HANDSHAKE_OFFSET_FIRMWARE_MAJOR 5u
#define TAXEL_HUB_HANDSHAKE_OFFSET_FIRMWARE_MINOR 6u
#define TAXEL_HUB_HANDSHAKE_OFFSET_FIRMWARE_PATCH 7u
#define TAXEL_HUB_HANDSHAKE_OFFSET_UNIQUE_ID 8u
#define TAXEL_HUB_HANDSHAKE_OFFSET_UPTIME_US 16u
struct taxel_hub_handshake {
    uint8_t tag;
    uint8_t version_min;
    uint8_t version_max;
    uint8_t version_chosen;
    uint8_t reset_cause;
    uint8_t firmware_major;
    uint8_t firmware_minor;
    uint8_t firmware_patch;
    uint8_t unique_id[8];
    uint64_t uptime_us;
};
static inline void taxel_hub_handshake_pack(const struct taxel_hub_handshake *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->tag);
    taxel_put_u8(bytes + 1, value->version_min);
    taxel_put_u8(bytes + 2, value->version_max);
    taxel_put_u8(bytes + 3, value->version_chosen);
    taxel_put_u8(bytes + 4, value->reset_cause);
    taxel_put_u8(bytes + 5, value->firmware_major);
    taxel_put_u8(bytes + 6, value->firmware_minor);
    taxel_put_u8(bytes + 7, value->firmware_patch);
    memcpy(bytes + 8, value->unique_id, 8);
    taxel_put_u64(bytes + 16, value->uptime_us);
}
static inline void taxel_hub_handshake_unpack(struct taxel_hub_handshake *value, const uint8_t *bytes)
{
    value->tag = taxel_get_u8(bytes + 0);
    value->version_min = taxel_get_u8(bytes + 1);
    value->version_max = taxel_get_u8(bytes + 2);
    value->version_chosen = taxel_get_u8(bytes + 3);
    value->reset_cause = taxel_get_u8(bytes + 4);
    value->firmware_major = taxel_get_u8(bytes + 5);
    value->firmware_minor = taxel_get_u8(bytes + 6);
    value->firmware_patch = taxel_get_u8(bytes + 7);
    memcpy(value->unique_id, bytes + 8, 8);
    value->uptime_us = taxel_get_u64(bytes + 16);
}

#define TAXEL_TAXEL_HEADER_SIZE 8u
#define TAXEL_TAXEL_HEADER_OFFSET_ADDRESS 0u
#define TAXEL_TAXEL_HEADER_OFFSET_TAXEL_COUNT 1u
#define TAXEL_TAXEL_HEADER_OFFSET_CYCLE 2u
#define TAXEL_TAXEL_HEADER_OFFSET_HUB_TIME_US 4u
struct taxel_taxel_header {
    uint8_t address;
    uint8_t taxel_count;
    uint16_t cycle;
    uint32_t hub_time_us;
};
static inline void taxel_taxel_header_pack(const struct taxel_taxel_header *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u8(bytes + 1, value->taxel_count);
    taxel_put_u16(bytes + 2, value->cycle);
    taxel_put_u32(bytes + 4, value->hub_time_us);
}
static inline void taxel_taxel_header_unpack(struct taxel_taxel_header *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->taxel_count = taxel_get_u8(bytes + 1);
    value->cycle = taxel_get_u16(bytes + 2);
    value->hub_time_us = taxel_get_u32(bytes + 4);
}

#define TAXEL_HUB_STATUS_SIZE 42u
#define TAXEL_HUB_STATUS_OFFSET_UPTIME_US 0u
#define TAXEL_HUB_STATUS_OFFSET_CYCLES 8u
#define TAXEL_HUB_STATUS_OFFSET_CYCLE_TIME_US 12u
#define TAXEL_HUB_STATUS_OFFSET_FRAMES_SENT 16u
#define TAXEL_HUB_STATUS_OFFSET_BYTES_SENT 20u
#define TAXEL_HUB_STATUS_OFFSET_FRAMES_DROPPED 24u
#define TAXEL_HUB_STATUS_OFFSET_COMMANDS 28u
#define TAXEL_HUB_STATUS_OFFSET_COMMANDS_REJECTED 32u
#define TAXEL_HUB_STATUS_OFFSET_BUS_RECOVERIES 36u
#define TAXEL_HUB_STATUS_OFFSET_BOARDS_STREAMING 40u
#define TAXEL_HUB_STATUS_OFFSET_STREAMING 41u
struct taxel_hub_status {
    uint64_t uptime_us;
    uint32_t cycles;
    uint32_t cycle_time_us;
    uint32_t frames_sent;
    uint32_t bytes_sent;
    uint32_t frames_dropped;
    uint32_t commands;
    uint32_t commands_rejected;
    uint32_t bus_recoveries;
    uint8_t boards_streaming;
    uint8_t streaming;
};
static inline void taxel_hub_status_pack(const struct taxel_hub_status *value, uint8_t *bytes)
{
    taxel_put_u64(bytes + 0, value->uptime_us);
    taxel_put_u32(bytes + 8, value->cycles);
    taxel_put_u32(bytes + 12, value->cycle_time_us);
    taxel_put_u32(bytes + 16, value->frames_sent);
    taxel_put_u32(bytes + 20, value->bytes_sent);
    taxel_put_u32(bytes + 24, value->frames_dropped);
    taxel_put_u32(bytes + 28, value->commands);
    taxel_put_u32(bytes + 32, value->commands_rejected);
    taxel_put_u32(bytes + 36, value->bus_recoveries);
    taxel_put_u8(bytes + 40, value->boards_streaming);
    taxel_put_u8(bytes + 41, value->streaming);
}
static inline void taxel_hub_status_unpack(struct taxel_hub_status *value, const uint8_t *bytes)
{
    value->uptime_us = taxel_get_u64(bytes + 0);
    value->cycles = taxel_get_u32(bytes + 8);
    value->cycle_time_us = taxel_get_u32(bytes + 12);
    value->frames_sent = taxel_get_u32(bytes + 16);
    value->bytes_sent = taxel_get_u32(bytes + 20);
    value->frames_dropped = taxel_get_u32(bytes + 24);
    value->commands = taxel_get_u32(bytes + 28);
    value->commands_rejected = taxel_get_u32(bytes + 32);
    value->bus_recoveries = taxel_get_u32(bytes + 36);
    value->boards_streaming = taxel_get_u8(bytes + 40);
    value->streaming = taxel_get_u8(bytes + 41);
}

#define TAXEL_BOARD_STATUS_SIZE 39u
#define TAXEL_BOARD_STATUS_OFFSET_ADDRESS 0u
#define TAXEL_BOARD_STATUS_OFFSET_STATE 1u
#define TAXEL_BOARD_STATUS_OFFSET_LAST_FAULT 2u
#define TAXEL_BOARD_STATUS_OFFSET_POLLS 3u
#define TAXEL_BOARD_STATUS_OFFSET_FORWARDED 7u
#define TAXEL_BOARD_STATUS_OFFSET_REPEATED 11u
#define TAXEL_BOARD_STATUS_OFFSET_NACKS 15u
#define TAXEL_BOARD_STATUS_OFFSET_TIMEOUTS 19u
#define TAXEL_BOARD_STATUS_OFFSET_CRC_ERRORS 23u
#define TAXEL_BOARD_STATUS_OFFSET_BUS_ERRORS 27u
#define TAXEL_BOARD_STATUS_OFFSET_DROPPED 31u
#define TAXEL_BOARD_STATUS_OFFSET_RETRIES 35u
struct taxel_board_status {
    uint8_t address;
    uint8_t state;
    uint8_t last_fault;
    uint32_t polls;
    uint32_t forwarded;
    uint32_t repeated;
    uint32_t nacks;
    uint32_t timeouts;
    uint32_t crc_errors;
    uint32_t bus_errors;
    uint32_t dropped;
    uint32_t retries;
};
static inline void taxel_board_status_pack(const struct taxel_board_status *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u8(bytes + 1, value->state);
    taxel_put_u8(bytes + 2, value->last_fault);
    taxel_put_u32(bytes + 3, value->polls);
    taxel_put_u32(bytes + 7, value->forwarded);
    taxel_put_u32(bytes + 11, value->repeated);
    taxel_put_u32(bytes + 15, value->nacks);
    taxel_put_u32(bytes + 19, value->timeouts);
    taxel_put_u32(bytes + 23, value->crc_errors);
    taxel_put_u32(bytes + 27, value->bus_errors);
    taxel_put_u32(bytes + 31, value->dropped);
    taxel_put_u32(bytes + 35, value->retries);
}
static inline void taxel_board_status_unpack(struct taxel_board_status *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->state = taxel_get_u8(bytes + 1);
    value->last_fault = taxel_get_u8(bytes + 2);
    value->polls = taxel_get_u32(bytes + 3);
    value->forwarded = taxel_get_u32(bytes + 7);
    value->repeated = taxel_get_u32(bytes + 11);
    value->nacks = taxel_get_u32(bytes + 15);
    value->timeouts = taxel_get_u32(bytes + 19);
    value->crc_errors = taxel_get_u32(bytes + 23);
    value->bus_errors = taxel_get_u32(bytes + 27);
    value->dropped = taxel_get_u32(bytes + 31);
    value->retries = taxel_get_u32(bytes + 35);
}

#define TAXEL_BOARD_INFO_SIZE 66u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_WHO_AM_I 0u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_MAP_VERSION 1u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_FIRMWARE_MAJOR 2u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_FIRMWARE_MINOR 3u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_FIRMWARE_PATCH 4u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_KIND 5u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_ADDRESS 6u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_MAP_REVISION 7u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_UNIQUE_ID 8u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_ROWS 16u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_COLUMNS 17u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_TAXEL_COUNT 18u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_SNAPSHOT_SIZE 20u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_CROSSING_MAP 22u
#define TAXEL_BOARD_INFO_OFFSET_IDENTITY_CRC32 54u
#define TAXEL_BOARD_INFO_OFFSET_SETTINGS_SUB_CONVERSIONS 58u
#define TAXEL_BOARD_INFO_OFFSET_SETTINGS_SENSE_CLOCK_DIVIDER 60u
#define TAXEL_BOARD_INFO_OFFSET_SETTINGS_MODULATOR_CLOCK_DIVIDER 62u
#define TAXEL_BOARD_INFO_OFFSET_SETTINGS_IDAC_CODE 63u
#define TAXEL_BOARD_INFO_OFFSET_SETTINGS_SETTLE_CYCLES 64u
struct taxel_board_info {
    uint8_t identity_who_am_i;
    uint8_t identity_map_version;
    uint8_t identity_firmware_major;
    uint8_t identity_firmware_minor;
    uint8_t identity_firmware_patch;
    uint8_t identity_kind;
    uint8_t identity_address;
    uint8_t identity_map_revision;
    uint8_t identity_unique_id[8];
    uint8_t identity_rows;
    uint8_t identity_columns;
    uint16_t identity_taxel_count;
    uint16_t identity_snapshot_size;
    uint8_t identity_crossing_map[32];
    uint32_t identity_crc32;
    uint16_t settings_sub_conversions;
    uint16_t settings_sense_clock_divider;
    uint8_t settings_modulator_clock_divider;
    uint8_t settings_idac_code;
    uint16_t settings_settle_cycles;
};
static inline void taxel_board_info_pack(const struct taxel_board_info *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->identity_who_am_i);
    taxel_put_u8(bytes + 1, value->identity_map_version);
    taxel_put_u8(bytes + 2, value->identity_firmware_major);
    taxel_put_u8(bytes + 3, value->identity_firmware_minor);
    taxel_put_u8(bytes + 4, value->identity_firmware_patch);
    taxel_put_u8(bytes + 5, value->identity_kind);
    taxel_put_u8(bytes + 6, value->identity_address);
    taxel_put_u8(bytes + 7, value->identity_map_revision);
    memcpy(bytes + 8, value->identity_unique_id, 8);
    taxel_put_u8(bytes + 16, value->identity_rows);
    taxel_put_u8(bytes + 17, value->identity_columns);
    taxel_put_u16(bytes + 18, value->identity_taxel_count);
    taxel_put_u16(bytes + 20, value->identity_snapshot_size);
    memcpy(bytes + 22, value->identity_crossing_map, 32);
    taxel_put_u32(bytes + 54, value->identity_crc32);
    taxel_put_u16(bytes + 58, value->settings_sub_conversions);
    taxel_put_u16(bytes + 60, value->settings_sense_clock_divider);
    taxel_put_u8(bytes + 62, value->settings_modulator_clock_divider);
    taxel_put_u8(bytes + 63, value->settings_idac_code);
    taxel_put_u16(bytes + 64, value->settings_settle_cycles);
}
static inline void taxel_board_info_unpack(struct taxel_board_info *value, const uint8_t *bytes)
{
    value->identity_who_am_i = taxel_get_u8(bytes + 0);
    value->identity_map_version = taxel_get_u8(bytes + 1);
    value->identity_firmware_major = taxel_get_u8(bytes + 2);
    value->identity_firmware_minor = taxel_get_u8(bytes + 3);
    value->identity_firmware_patch = taxel_get_u8(bytes + 4);
    value->identity_kind = taxel_get_u8(bytes + 5);
    value->identity_address = taxel_get_u8(bytes + 6);
    value->identity_map_revision = taxel_get_u8(bytes + 7);
    memcpy(value->identity_unique_id, bytes + 8, 8);
    value->identity_rows = taxel_get_u8(bytes + 16);
    value->identity_columns = taxel_get_u8(bytes + 17);
    value->identity_taxel_count = taxel_get_u16(bytes + 18);
    value->identity_snapshot_size = taxel_get_u16(bytes + 20);
    memcpy(value->identity_crossing_map, bytes + 22, 32);
    value->identity_crc32 = taxel_get_u32(bytes + 54);
    value->settings_sub_conversions = taxel_get_u16(bytes + 58);
    value->settings_sense_clock_divider = taxel_get_u16(bytes + 60);
    value->settings_modulator_clock_divider = taxel_get_u8(bytes + 62);
    value->settings_idac_code = taxel_get_u8(bytes + 63);
    value->settings_settle_cycles = taxel_get_u16(bytes + 64);
}

#define TAXEL_BOARD_FAULT_REPORT_SIZE 10u
#define TAXEL_BOARD_FAULT_REPORT_OFFSET_ADDRESS 0u
#define TAXEL_BOARD_FAULT_REPORT_OFFSET_FAULT 1u
#define TAXEL_BOARD_FAULT_REPORT_OFFSET_CYCLE 2u
#define TAXEL_BOARD_FAULT_REPORT_OFFSET_HUB_TIME_US 4u
#define TAXEL_BOARD_FAULT_REPORT_OFFSET_CONSECUTIVE 8u
struct taxel_board_fault_report {
    uint8_t address;
    uint8_t fault;
    uint16_t cycle;
    uint32_t hub_time_us;
    uint16_t consecutive;
};
static inline void taxel_board_fault_report_pack(const struct taxel_board_fault_report *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u8(bytes + 1, value->fault);
    taxel_put_u16(bytes + 2, value->cycle);
    taxel_put_u32(bytes + 4, value->hub_time_us);
    taxel_put_u16(bytes + 8, value->consecutive);
}
static inline void taxel_board_fault_report_unpack(struct taxel_board_fault_report *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->fault = taxel_get_u8(bytes + 1);
    value->cycle = taxel_get_u16(bytes + 2);
    value->hub_time_us = taxel_get_u32(bytes + 4);
    value->consecutive = taxel_get_u16(bytes + 8);
}

#define TAXEL_TIME_SYNC_SIZE 13u
#define TAXEL_TIME_SYNC_OFFSET_ADDRESS 0u
#define TAXEL_TIME_SYNC_OFFSET_BOARD_TIME_US 1u
#define TAXEL_TIME_SYNC_OFFSET_HUB_TIME_US 5u
struct taxel_time_sync {
    uint8_t address;
    uint32_t board_time_us;
    uint64_t hub_time_us;
};
static inline void taxel_time_sync_pack(const struct taxel_time_sync *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u32(bytes + 1, value->board_time_us);
    taxel_put_u64(bytes + 5, value->hub_time_us);
}
static inline void taxel_time_sync_unpack(struct taxel_time_sync *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->board_time_us = taxel_get_u32(bytes + 1);
    value->hub_time_us = taxel_get_u64(bytes + 5);
}

#define TAXEL_LOG_HEADER_SIZE 7u
#define TAXEL_LOG_HEADER_OFFSET_LEVEL 0u
#define TAXEL_LOG_HEADER_OFFSET_CODE 1u
#define TAXEL_LOG_HEADER_OFFSET_HUB_TIME_US 3u
struct taxel_log_header {
    uint8_t level;
    uint16_t code;
    uint32_t hub_time_us;
};
static inline void taxel_log_header_pack(const struct taxel_log_header *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->level);
    taxel_put_u16(bytes + 1, value->code);
    taxel_put_u32(bytes + 3, value->hub_time_us);
}
static inline void taxel_log_header_unpack(struct taxel_log_header *value, const uint8_t *bytes)
{
    value->level = taxel_get_u8(bytes + 0);
    value->code = taxel_get_u16(bytes + 1);
    value->hub_time_us = taxel_get_u32(bytes + 3);
}

#define TAXEL_REPLY_HEADER_SIZE 3u
#define TAXEL_REPLY_HEADER_OFFSET_TAG 0u
#define TAXEL_REPLY_HEADER_OFFSET_COMMAND 1u
#define TAXEL_REPLY_HEADER_OFFSET_STATUS 2u
struct taxel_reply_header {
    uint8_t tag;
    uint8_t command;
    uint8_t status;
};
static inline void taxel_reply_header_pack(const struct taxel_reply_header *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->tag);
    taxel_put_u8(bytes + 1, value->command);
    taxel_put_u8(bytes + 2, value->status);
}
static inline void taxel_reply_header_unpack(struct taxel_reply_header *value, const uint8_t *bytes)
{
    value->tag = taxel_get_u8(bytes + 0);
    value->command = taxel_get_u8(bytes + 1);
    value->status = taxel_get_u8(bytes + 2);
}

#define TAXEL_COMMAND_HEADER_SIZE 2u
#define TAXEL_COMMAND_HEADER_OFFSET_TAG 0u
#define TAXEL_COMMAND_HEADER_OFFSET_COMMAND 1u
struct taxel_command_header {
    uint8_t tag;
    uint8_t command;
};
static inline void taxel_command_header_pack(const struct taxel_command_header *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->tag);
    taxel_put_u8(bytes + 1, value->command);
}
static inline void taxel_command_header_unpack(struct taxel_command_header *value, const uint8_t *bytes)
{
    value->tag = taxel_get_u8(bytes + 0);
    value->command = taxel_get_u8(bytes + 1);
}

#define TAXEL_ACKNOWLEDGEMENT_SIZE 3u
#define TAXEL_ACKNOWLEDGEMENT_OFFSET_ADDRESS 0u
#define TAXEL_ACKNOWLEDGEMENT_OFFSET_KEY_FRAME 1u
struct taxel_acknowledgement {
    uint8_t address;
    uint16_t key_frame;
};
static inline void taxel_acknowledgement_pack(const struct taxel_acknowledgement *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u16(bytes + 1, value->key_frame);
}
static inline void taxel_acknowledgement_unpack(struct taxel_acknowledgement *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->key_frame = taxel_get_u16(bytes + 1);
}

#define TAXEL_START_ARGUMENTS_SIZE 1u
#define TAXEL_START_ARGUMENTS_OFFSET_FLAGS 0u
struct taxel_start_arguments {
    uint8_t flags;
};
static inline void taxel_start_arguments_pack(const struct taxel_start_arguments *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->flags);
}
static inline void taxel_start_arguments_unpack(struct taxel_start_arguments *value, const uint8_t *bytes)
{
    value->flags = taxel_get_u8(bytes + 0);
}

#define TAXEL_SET_RATE_ARGUMENTS_SIZE 4u
#define TAXEL_SET_RATE_ARGUMENTS_OFFSET_PERIOD_US 0u
struct taxel_set_rate_arguments {
    uint32_t period_us;
};
static inline void taxel_set_rate_arguments_pack(const struct taxel_set_rate_arguments *value, uint8_t *bytes)
{
    taxel_put_u32(bytes + 0, value->period_us);
}
static inline void taxel_set_rate_arguments_unpack(struct taxel_set_rate_arguments *value, const uint8_t *bytes)
{
    value->period_us = taxel_get_u32(bytes + 0);
}

#define TAXEL_ENTER_BOOTLOADER_ARGUMENTS_SIZE 4u
#define TAXEL_ENTER_BOOTLOADER_ARGUMENTS_OFFSET_KEY 0u
struct taxel_enter_bootloader_arguments {
    uint32_t key;
};
static inline void taxel_enter_bootloader_arguments_pack(const struct taxel_enter_bootloader_arguments *value, uint8_t *bytes)
{
    taxel_put_u32(bytes + 0, value->key);
}
static inline void taxel_enter_bootloader_arguments_unpack(struct taxel_enter_bootloader_arguments *value, const uint8_t *bytes)
{
    value->key = taxel_get_u32(bytes + 0);
}

#define TAXEL_TRANSFER_ARGUMENTS_SIZE 2u
#define TAXEL_TRANSFER_ARGUMENTS_OFFSET_ADDRESS 0u
#define TAXEL_TRANSFER_ARGUMENTS_OFFSET_READ_LENGTH 1u
struct taxel_transfer_arguments {
    uint8_t address;
    uint8_t read_length;
};
static inline void taxel_transfer_arguments_pack(const struct taxel_transfer_arguments *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u8(bytes + 1, value->read_length);
}
static inline void taxel_transfer_arguments_unpack(struct taxel_transfer_arguments *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->read_length = taxel_get_u8(bytes + 1);
}

#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE 10u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_ADDRESS 0u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_SETTINGS_SUB_CONVERSIONS 1u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_SETTINGS_SENSE_CLOCK_DIVIDER 3u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_SETTINGS_MODULATOR_CLOCK_DIVIDER 5u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_SETTINGS_IDAC_CODE 6u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_SETTINGS_SETTLE_CYCLES 7u
#define TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_FRONT_END 9u
struct taxel_set_scan_settings_arguments {
    uint8_t address;
    uint16_t settings_sub_conversions;
    uint16_t settings_sense_clock_divider;
    uint8_t settings_modulator_clock_divider;
    uint8_t settings_idac_code;
    uint16_t settings_settle_cycles;
    uint8_t front_end;
};
static inline void taxel_set_scan_settings_arguments_pack(const struct taxel_set_scan_settings_arguments *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
    taxel_put_u16(bytes + 1, value->settings_sub_conversions);
    taxel_put_u16(bytes + 3, value->settings_sense_clock_divider);
    taxel_put_u8(bytes + 5, value->settings_modulator_clock_divider);
    taxel_put_u8(bytes + 6, value->settings_idac_code);
    taxel_put_u16(bytes + 7, value->settings_settle_cycles);
    taxel_put_u8(bytes + 9, value->front_end);
}
static inline void taxel_set_scan_settings_arguments_unpack(struct taxel_set_scan_settings_arguments *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
    value->settings_sub_conversions = taxel_get_u16(bytes + 1);
    value->settings_sense_clock_divider = taxel_get_u16(bytes + 3);
    value->settings_modulator_clock_divider = taxel_get_u8(bytes + 5);
    value->settings_idac_code = taxel_get_u8(bytes + 6);
    value->settings_settle_cycles = taxel_get_u16(bytes + 7);
    value->front_end = taxel_get_u8(bytes + 9);
}

#define TAXEL_GET_BOARD_INFO_ARGUMENTS_SIZE 1u
#define TAXEL_GET_BOARD_INFO_ARGUMENTS_OFFSET_ADDRESS 0u
struct taxel_get_board_info_arguments {
    uint8_t address;
};
static inline void taxel_get_board_info_arguments_pack(const struct taxel_get_board_info_arguments *value, uint8_t *bytes)
{
    taxel_put_u8(bytes + 0, value->address);
}
static inline void taxel_get_board_info_arguments_unpack(struct taxel_get_board_info_arguments *value, const uint8_t *bytes)
{
    value->address = taxel_get_u8(bytes + 0);
}

#define TAXEL_GET_TIME_REPLY_SIZE 8u
#define TAXEL_GET_TIME_REPLY_OFFSET_HUB_TIME_US 0u
struct taxel_get_time_reply {
    uint64_t hub_time_us;
};
static inline void taxel_get_time_reply_pack(const struct taxel_get_time_reply *value, uint8_t *bytes)
{
    taxel_put_u64(bytes + 0, value->hub_time_us);
}
static inline void taxel_get_time_reply_unpack(struct taxel_get_time_reply *value, const uint8_t *bytes)
{
    value->hub_time_us = taxel_get_u64(bytes + 0);
}

/* X(type, payload begins with an address, shortest payload, longest payload) */
#define TAXEL_FRAME_RULES(X) \
    X(TAXEL_FRAME_TYPE_HUB_HANDSHAKE, 0, 24u, 24u) \
    X(TAXEL_FRAME_TYPE_TAXELS, 1, 20u, 498u) \
    X(TAXEL_FRAME_TYPE_COMPACT_TAXELS, 1, 20u, 496u) \
    X(TAXEL_FRAME_TYPE_HUB_STATUS, 0, 42u, 42u) \
    X(TAXEL_FRAME_TYPE_BOARD_STATUS, 1, 39u, 39u) \
    X(TAXEL_FRAME_TYPE_BOARD_INFO, 0, 66u, 66u) \
    X(TAXEL_FRAME_TYPE_BOARD_FAULT, 1, 10u, 10u) \
    X(TAXEL_FRAME_TYPE_TIME_SYNC, 1, 13u, 13u) \
    X(TAXEL_FRAME_TYPE_LOG, 0, 7u, 71u) \
    X(TAXEL_FRAME_TYPE_REPLY, 0, 3u, 131u) \
    X(TAXEL_FRAME_TYPE_HOST_HANDSHAKE, 0, 3u, 3u) \
    X(TAXEL_FRAME_TYPE_COMMAND, 0, 2u, 68u) \
    X(TAXEL_FRAME_TYPE_ACKNOWLEDGE, 0, 3u, 66u)

#endif
