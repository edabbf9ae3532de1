/* Generated from protocol/taxel_protocol by tools/codegen/field_tables.py (make generate). Do not edit. */
#ifndef TAXEL_GENERATED_FIELDS_H
#define TAXEL_GENERATED_FIELDS_H

#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

/* Position of a vector's field in its C struct. */
struct field {
    const char *name;
    size_t offset;
    size_t size;
    int is_bytes;
};

struct layout {
    const char *name;
    const struct field *fields;
    size_t field_count;
    size_t size; /* packed */
    void (*pack)(const void *value, uint8_t *bytes);
    void (*unpack)(void *value, const uint8_t *bytes);
};

/* The structs at the front of a type's payload, in order; `prefix`: prefix of their fields' names in a vector. */
struct payload_part {
    uint8_t type;
    const char *layout;
    const char *prefix;
};

static const struct field hub_handshake_fields[] = {
    {"tag", offsetof(struct taxel_hub_handshake, tag), 1, 0},
    {"version_min", offsetof(struct taxel_hub_handshake, version_min), 1, 0},
    {"version_max", offsetof(struct taxel_hub_handshake, version_max), 1, 0},
    {"version_chosen", offsetof(struct taxel_hub_handshake, version_chosen), 1, 0},
    {"reset_cause", offsetof(struct taxel_hub_handshake, reset_cause), 1, 0},
    {"firmware_major", offsetof(struct taxel_hub_handshake, firmware_major), 1, 0},
    {"firmware_minor", offsetof(struct taxel_hub_handshake, firmware_minor), 1, 0},
    {"firmware_patch", offsetof(struct taxel_hub_handshake, firmware_patch), 1, 0},
    {"unique_id", offsetof(struct taxel_hub_handshake, unique_id), 8, 1},
    {"uptime_us", offsetof(struct taxel_hub_handshake, uptime_us), 8, 0},
};
static void hub_handshake_pack(const void *value, uint8_t *bytes)
{
    taxel_hub_handshake_pack(value, bytes);
}
static void hub_handshake_unpack(void *value, const uint8_t *bytes)
{
    taxel_hub_handshake_unpack(value, bytes);
}

static const struct field taxel_header_fields[] = {
    {"address", offsetof(struct taxel_taxel_header, address), 1, 0},
    {"taxel_count", offsetof(struct taxel_taxel_header, taxel_count), 1, 0},
    {"cycle", offsetof(struct taxel_taxel_header, cycle), 2, 0},
    {"hub_time_us", offsetof(struct taxel_taxel_header, hub_time_us), 4, 0},
};
static void taxel_header_pack(const void *value, uint8_t *bytes)
{
    taxel_taxel_header_pack(value, bytes);
}
static void taxel_header_unpack(void *value, const uint8_t *bytes)
{
    taxel_taxel_header_unpack(value, bytes);
}

static const struct field snapshot_header_fields[] = {
    {"sequence", offsetof(struct taxel_snapshot_header, sequence), 2, 0},
    {"timestamp_us", offsetof(struct taxel_snapshot_header, timestamp_us), 4, 0},
};
static void snapshot_header_pack(const void *value, uint8_t *bytes)
{
    taxel_snapshot_header_pack(value, bytes);
}
static void snapshot_header_unpack(void *value, const uint8_t *bytes)
{
    taxel_snapshot_header_unpack(value, bytes);
}

static const struct field compact_header_fields[] = {
    {"sequence", offsetof(struct taxel_compact_header, sequence), 2, 0},
    {"format", offsetof(struct taxel_compact_header, format), 1, 0},
};
static void compact_header_pack(const void *value, uint8_t *bytes)
{
    taxel_compact_header_pack(value, bytes);
}
static void compact_header_unpack(void *value, const uint8_t *bytes)
{
    taxel_compact_header_unpack(value, bytes);
}

static const struct field hub_status_fields[] = {
    {"uptime_us", offsetof(struct taxel_hub_status, uptime_us), 8, 0},
    {"cycles", offsetof(struct taxel_hub_status, cycles), 4, 0},
    {"cycle_time_us", offsetof(struct taxel_hub_status, cycle_time_us), 4, 0},
    {"frames_sent", offsetof(struct taxel_hub_status, frames_sent), 4, 0},
    {"bytes_sent", offsetof(struct taxel_hub_status, bytes_sent), 4, 0},
    {"frames_dropped", offsetof(struct taxel_hub_status, frames_dropped), 4, 0},
    {"commands", offsetof(struct taxel_hub_status, commands), 4, 0},
    {"commands_rejected", offsetof(struct taxel_hub_status, commands_rejected), 4, 0},
    {"bus_recoveries", offsetof(struct taxel_hub_status, bus_recoveries), 4, 0},
    {"boards_streaming", offsetof(struct taxel_hub_status, boards_streaming), 1, 0},
    {"streaming", offsetof(struct taxel_hub_status, streaming), 1, 0},
};
static void hub_status_pack(const void *value, uint8_t *bytes)
{
    taxel_hub_status_pack(value, bytes);
}
static void hub_status_unpack(void *value, const uint8_t *bytes)
{
    taxel_hub_status_unpack(value, bytes);
}

static const struct field board_status_fields[] = {
    {"address", offsetof(struct taxel_board_status, address), 1, 0},
    {"state", offsetof(struct taxel_board_status, state), 1, 0},
    {"last_fault", offsetof(struct taxel_board_status, last_fault), 1, 0},
    {"polls", offsetof(struct taxel_board_status, polls), 4, 0},
    {"forwarded", offsetof(struct taxel_board_status, forwarded), 4, 0},
    {"repeated", offsetof(struct taxel_board_status, repeated), 4, 0},
    {"nacks", offsetof(struct taxel_board_status, nacks), 4, 0},
    {"timeouts", offsetof(struct taxel_board_status, timeouts), 4, 0},
    {"crc_errors", offsetof(struct taxel_board_status, crc_errors), 4, 0},
    {"bus_errors", offsetof(struct taxel_board_status, bus_errors), 4, 0},
    {"dropped", offsetof(struct taxel_board_status, dropped), 4, 0},
    {"retries", offsetof(struct taxel_board_status, retries), 4, 0},
};
static void board_status_pack(const void *value, uint8_t *bytes)
{
    taxel_board_status_pack(value, bytes);
}
static void board_status_unpack(void *value, const uint8_t *bytes)
{
    taxel_board_status_unpack(value, bytes);
}

static const struct field board_info_fields[] = {
    {"identity_who_am_i", offsetof(struct taxel_board_info, identity_who_am_i), 1, 0},
    {"identity_map_version", offsetof(struct taxel_board_info, identity_map_version), 1, 0},
    {"identity_firmware_major", offsetof(struct taxel_board_info, identity_firmware_major), 1, 0},
    {"identity_firmware_minor", offsetof(struct taxel_board_info, identity_firmware_minor), 1, 0},
    {"identity_firmware_patch", offsetof(struct taxel_board_info, identity_firmware_patch), 1, 0},
    {"identity_kind", offsetof(struct taxel_board_info, identity_kind), 1, 0},
    {"identity_address", offsetof(struct taxel_board_info, identity_address), 1, 0},
    {"identity_map_revision", offsetof(struct taxel_board_info, identity_map_revision), 1, 0},
    {"identity_unique_id", offsetof(struct taxel_board_info, identity_unique_id), 8, 1},
    {"identity_rows", offsetof(struct taxel_board_info, identity_rows), 1, 0},
    {"identity_columns", offsetof(struct taxel_board_info, identity_columns), 1, 0},
    {"identity_taxel_count", offsetof(struct taxel_board_info, identity_taxel_count), 2, 0},
    {"identity_snapshot_size", offsetof(struct taxel_board_info, identity_snapshot_size), 2, 0},
    {"identity_crossing_map", offsetof(struct taxel_board_info, identity_crossing_map), 32, 1},
    {"identity_crc32", offsetof(struct taxel_board_info, identity_crc32), 4, 0},
    {"settings_sub_conversions", offsetof(struct taxel_board_info, settings_sub_conversions), 2, 0},
    {"settings_sense_clock_divider", offsetof(struct taxel_board_info, settings_sense_clock_divider), 2, 0},
    {"settings_modulator_clock_divider", offsetof(struct taxel_board_info, settings_modulator_clock_divider), 1, 0},
    {"settings_idac_code", offsetof(struct taxel_board_info, settings_idac_code), 1, 0},
    {"settings_settle_cycles", offsetof(struct taxel_board_info, settings_settle_cycles), 2, 0},
};
static void board_info_pack(const void *value, uint8_t *bytes)
{
    taxel_board_info_pack(value, bytes);
}
static void board_info_unpack(void *value, const uint8_t *bytes)
{
    taxel_board_info_unpack(value, bytes);
}

static const struct field board_fault_report_fields[] = {
    {"address", offsetof(struct taxel_board_fault_report, address), 1, 0},
    {"fault", offsetof(struct taxel_board_fault_report, fault), 1, 0},
    {"cycle", offsetof(struct taxel_board_fault_report, cycle), 2, 0},
    {"hub_time_us", offsetof(struct taxel_board_fault_report, hub_time_us), 4, 0},
    {"consecutive", offsetof(struct taxel_board_fault_report, consecutive), 2, 0},
};
static void board_fault_report_pack(const void *value, uint8_t *bytes)
{
    taxel_board_fault_report_pack(value, bytes);
}
static void board_fault_report_unpack(void *value, const uint8_t *bytes)
{
    taxel_board_fault_report_unpack(value, bytes);
}

static const struct field time_sync_fields[] = {
    {"address", offsetof(struct taxel_time_sync, address), 1, 0},
    {"board_time_us", offsetof(struct taxel_time_sync, board_time_us), 4, 0},
    {"hub_time_us", offsetof(struct taxel_time_sync, hub_time_us), 8, 0},
};
static void time_sync_pack(const void *value, uint8_t *bytes)
{
    taxel_time_sync_pack(value, bytes);
}
static void time_sync_unpack(void *value, const uint8_t *bytes)
{
    taxel_time_sync_unpack(value, bytes);
}

static const struct field log_header_fields[] = {
    {"level", offsetof(struct taxel_log_header, level), 1, 0},
    {"code", offsetof(struct taxel_log_header, code), 2, 0},
    {"hub_time_us", offsetof(struct taxel_log_header, hub_time_us), 4, 0},
};
static void log_header_pack(const void *value, uint8_t *bytes)
{
    taxel_log_header_pack(value, bytes);
}
static void log_header_unpack(void *value, const uint8_t *bytes)
{
    taxel_log_header_unpack(value, bytes);
}

static const struct field reply_header_fields[] = {
    {"tag", offsetof(struct taxel_reply_header, tag), 1, 0},
    {"command", offsetof(struct taxel_reply_header, command), 1, 0},
    {"status", offsetof(struct taxel_reply_header, status), 1, 0},
};
static void reply_header_pack(const void *value, uint8_t *bytes)
{
    taxel_reply_header_pack(value, bytes);
}
static void reply_header_unpack(void *value, const uint8_t *bytes)
{
    taxel_reply_header_unpack(value, bytes);
}

static const struct field host_handshake_fields[] = {
    {"tag", offsetof(struct taxel_host_handshake, tag), 1, 0},
    {"version_min", offsetof(struct taxel_host_handshake, version_min), 1, 0},
    {"version_max", offsetof(struct taxel_host_handshake, version_max), 1, 0},
};
static void host_handshake_pack(const void *value, uint8_t *bytes)
{
    taxel_host_handshake_pack(value, bytes);
}
static void host_handshake_unpack(void *value, const uint8_t *bytes)
{
    taxel_host_handshake_unpack(value, bytes);
}

static const struct field command_header_fields[] = {
    {"tag", offsetof(struct taxel_command_header, tag), 1, 0},
    {"command", offsetof(struct taxel_command_header, command), 1, 0},
};
static void command_header_pack(const void *value, uint8_t *bytes)
{
    taxel_command_header_pack(value, bytes);
}
static void command_header_unpack(void *value, const uint8_t *bytes)
{
    taxel_command_header_unpack(value, bytes);
}

static const struct field acknowledgement_fields[] = {
    {"address", offsetof(struct taxel_acknowledgement, address), 1, 0},
    {"key_frame", offsetof(struct taxel_acknowledgement, key_frame), 2, 0},
};
static void acknowledgement_pack(const void *value, uint8_t *bytes)
{
    taxel_acknowledgement_pack(value, bytes);
}
static void acknowledgement_unpack(void *value, const uint8_t *bytes)
{
    taxel_acknowledgement_unpack(value, bytes);
}

static const struct field start_arguments_fields[] = {
    {"flags", offsetof(struct taxel_start_arguments, flags), 1, 0},
};
static void start_arguments_pack(const void *value, uint8_t *bytes)
{
    taxel_start_arguments_pack(value, bytes);
}
static void start_arguments_unpack(void *value, const uint8_t *bytes)
{
    taxel_start_arguments_unpack(value, bytes);
}

static const struct field set_rate_arguments_fields[] = {
    {"period_us", offsetof(struct taxel_set_rate_arguments, period_us), 4, 0},
};
static void set_rate_arguments_pack(const void *value, uint8_t *bytes)
{
    taxel_set_rate_arguments_pack(value, bytes);
}
static void set_rate_arguments_unpack(void *value, const uint8_t *bytes)
{
    taxel_set_rate_arguments_unpack(value, bytes);
}

static const struct field enter_bootloader_arguments_fields[] = {
    {"key", offsetof(struct taxel_enter_bootloader_arguments, key), 4, 0},
};
static void enter_bootloader_arguments_pack(const void *value, uint8_t *bytes)
{
    taxel_enter_bootloader_arguments_pack(value, bytes);
}
static void enter_bootloader_arguments_unpack(void *value, const uint8_t *bytes)
{
    taxel_enter_bootloader_arguments_unpack(value, bytes);
}

static const struct field transfer_arguments_fields[] = {
    {"address", offsetof(struct taxel_transfer_arguments, address), 1, 0},
    {"read_length", offsetof(struct taxel_transfer_arguments, read_length), 1, 0},
};
static void transfer_arguments_pack(const void *value, uint8_t *bytes)
{
    taxel_transfer_arguments_pack(value, bytes);
}
static void transfer_arguments_unpack(void *value, const uint8_t *bytes)
{
    taxel_transfer_arguments_unpack(value, bytes);
}

static const struct field set_scan_settings_arguments_fields[] = {
    {"address", offsetof(struct taxel_set_scan_settings_arguments, address), 1, 0},
    {"settings_sub_conversions", offsetof(struct taxel_set_scan_settings_arguments, settings_sub_conversions), 2, 0},
    {"settings_sense_clock_divider", offsetof(struct taxel_set_scan_settings_arguments, settings_sense_clock_divider), 2, 0},
    {"settings_modulator_clock_divider", offsetof(struct taxel_set_scan_settings_arguments, settings_modulator_clock_divider), 1, 0},
    {"settings_idac_code", offsetof(struct taxel_set_scan_settings_arguments, settings_idac_code), 1, 0},
    {"settings_settle_cycles", offsetof(struct taxel_set_scan_settings_arguments, settings_settle_cycles), 2, 0},
    {"front_end", offsetof(struct taxel_set_scan_settings_arguments, front_end), 1, 0},
};
static void set_scan_settings_arguments_pack(const void *value, uint8_t *bytes)
{
    taxel_set_scan_settings_arguments_pack(value, bytes);
}
static void set_scan_settings_arguments_unpack(void *value, const uint8_t *bytes)
{
    taxel_set_scan_settings_arguments_unpack(value, bytes);
}

static const struct field get_board_info_arguments_fields[] = {
    {"address", offsetof(struct taxel_get_board_info_arguments, address), 1, 0},
};
static void get_board_info_arguments_pack(const void *value, uint8_t *bytes)
{
    taxel_get_board_info_arguments_pack(value, bytes);
}
static void get_board_info_arguments_unpack(void *value, const uint8_t *bytes)
{
    taxel_get_board_info_arguments_unpack(value, bytes);
}

static const struct field get_time_reply_fields[] = {
    {"hub_time_us", offsetof(struct taxel_get_time_reply, hub_time_us), 8, 0},
};
static void get_time_reply_pack(const void *value, uint8_t *bytes)
{
    taxel_get_time_reply_pack(value, bytes);
}
static void get_time_reply_unpack(void *value, const uint8_t *bytes)
{
    taxel_get_time_reply_unpack(value, bytes);
}

static const struct field fault_record_fields[] = {
    {"code", offsetof(struct taxel_fault_record, code), 1, 0},
    {"exception", offsetof(struct taxel_fault_record, exception), 1, 0},
    {"count", offsetof(struct taxel_fault_record, count), 2, 0},
    {"program_counter", offsetof(struct taxel_fault_record, program_counter), 4, 0},
    {"link_register", offsetof(struct taxel_fault_record, link_register), 4, 0},
};
static void fault_record_pack(const void *value, uint8_t *bytes)
{
    taxel_fault_record_pack(value, bytes);
}
static void fault_record_unpack(void *value, const uint8_t *bytes)
{
    taxel_fault_record_unpack(value, bytes);
}

static const struct field identity_fields[] = {
    {"who_am_i", offsetof(struct taxel_identity, who_am_i), 1, 0},
    {"map_version", offsetof(struct taxel_identity, map_version), 1, 0},
    {"firmware_major", offsetof(struct taxel_identity, firmware_major), 1, 0},
    {"firmware_minor", offsetof(struct taxel_identity, firmware_minor), 1, 0},
    {"firmware_patch", offsetof(struct taxel_identity, firmware_patch), 1, 0},
    {"kind", offsetof(struct taxel_identity, kind), 1, 0},
    {"address", offsetof(struct taxel_identity, address), 1, 0},
    {"map_revision", offsetof(struct taxel_identity, map_revision), 1, 0},
    {"unique_id", offsetof(struct taxel_identity, unique_id), 8, 1},
    {"rows", offsetof(struct taxel_identity, rows), 1, 0},
    {"columns", offsetof(struct taxel_identity, columns), 1, 0},
    {"taxel_count", offsetof(struct taxel_identity, taxel_count), 2, 0},
    {"snapshot_size", offsetof(struct taxel_identity, snapshot_size), 2, 0},
    {"crossing_map", offsetof(struct taxel_identity, crossing_map), 32, 1},
    {"crc32", offsetof(struct taxel_identity, crc32), 4, 0},
};
static void identity_pack(const void *value, uint8_t *bytes)
{
    taxel_identity_pack(value, bytes);
}
static void identity_unpack(void *value, const uint8_t *bytes)
{
    taxel_identity_unpack(value, bytes);
}

static const struct field status_fields[] = {
    {"state", offsetof(struct taxel_status, state), 1, 0},
    {"error_flags", offsetof(struct taxel_status, error_flags), 1, 0},
    {"reset_cause", offsetof(struct taxel_status, reset_cause), 1, 0},
    {"settings_generation", offsetof(struct taxel_status, settings_generation), 1, 0},
    {"clock_us", offsetof(struct taxel_status, clock_us), 4, 0},
    {"scans", offsetof(struct taxel_status, scans), 4, 0},
    {"scan_time_us", offsetof(struct taxel_status, scan_time_us), 4, 0},
    {"snapshot_reads", offsetof(struct taxel_status, snapshot_reads), 4, 0},
    {"bus_errors", offsetof(struct taxel_status, bus_errors), 2, 0},
    {"rejected_writes", offsetof(struct taxel_status, rejected_writes), 2, 0},
    {"front_end", offsetof(struct taxel_status, front_end), 1, 0},
    {"reserved", offsetof(struct taxel_status, reserved), 1, 0},
    {"saturated_conversions", offsetof(struct taxel_status, saturated_conversions), 2, 0},
};
static void status_pack(const void *value, uint8_t *bytes)
{
    taxel_status_pack(value, bytes);
}
static void status_unpack(void *value, const uint8_t *bytes)
{
    taxel_status_unpack(value, bytes);
}

static const struct field settings_register_fields[] = {
    {"settings_sub_conversions", offsetof(struct taxel_settings_register, settings_sub_conversions), 2, 0},
    {"settings_sense_clock_divider", offsetof(struct taxel_settings_register, settings_sense_clock_divider), 2, 0},
    {"settings_modulator_clock_divider", offsetof(struct taxel_settings_register, settings_modulator_clock_divider), 1, 0},
    {"settings_idac_code", offsetof(struct taxel_settings_register, settings_idac_code), 1, 0},
    {"settings_settle_cycles", offsetof(struct taxel_settings_register, settings_settle_cycles), 2, 0},
    {"crc32", offsetof(struct taxel_settings_register, crc32), 4, 0},
};
static void settings_register_pack(const void *value, uint8_t *bytes)
{
    taxel_settings_register_pack(value, bytes);
}
static void settings_register_unpack(void *value, const uint8_t *bytes)
{
    taxel_settings_register_unpack(value, bytes);
}

static const struct field command_register_fields[] = {
    {"command", offsetof(struct taxel_command_register, command), 1, 0},
    {"complement", offsetof(struct taxel_command_register, complement), 1, 0},
};
static void command_register_pack(const void *value, uint8_t *bytes)
{
    taxel_command_register_pack(value, bytes);
}
static void command_register_unpack(void *value, const uint8_t *bytes)
{
    taxel_command_register_unpack(value, bytes);
}

static const struct field enter_bootloader_register_fields[] = {
    {"command", offsetof(struct taxel_enter_bootloader_register, command), 1, 0},
    {"complement", offsetof(struct taxel_enter_bootloader_register, complement), 1, 0},
    {"key", offsetof(struct taxel_enter_bootloader_register, key), 4, 0},
};
static void enter_bootloader_register_pack(const void *value, uint8_t *bytes)
{
    taxel_enter_bootloader_register_pack(value, bytes);
}
static void enter_bootloader_register_unpack(void *value, const uint8_t *bytes)
{
    taxel_enter_bootloader_register_unpack(value, bytes);
}

static const struct field fault_register_fields[] = {
    {"record_code", offsetof(struct taxel_fault_register, record_code), 1, 0},
    {"record_exception", offsetof(struct taxel_fault_register, record_exception), 1, 0},
    {"record_count", offsetof(struct taxel_fault_register, record_count), 2, 0},
    {"record_program_counter", offsetof(struct taxel_fault_register, record_program_counter), 4, 0},
    {"record_link_register", offsetof(struct taxel_fault_register, record_link_register), 4, 0},
    {"crc32", offsetof(struct taxel_fault_register, crc32), 4, 0},
};
static void fault_register_pack(const void *value, uint8_t *bytes)
{
    taxel_fault_register_pack(value, bytes);
}
static void fault_register_unpack(void *value, const uint8_t *bytes)
{
    taxel_fault_register_unpack(value, bytes);
}

static const struct field compact_packed_fields[] = {
    {"sequence", offsetof(struct taxel_compact_packed, sequence), 2, 0},
    {"format", offsetof(struct taxel_compact_packed, format), 1, 0},
    {"timestamp_us", offsetof(struct taxel_compact_packed, timestamp_us), 4, 0},
};
static void compact_packed_pack(const void *value, uint8_t *bytes)
{
    taxel_compact_packed_pack(value, bytes);
}
static void compact_packed_unpack(void *value, const uint8_t *bytes)
{
    taxel_compact_packed_unpack(value, bytes);
}

static const struct field compact_delta_fields[] = {
    {"sequence", offsetof(struct taxel_compact_delta, sequence), 2, 0},
    {"format", offsetof(struct taxel_compact_delta, format), 1, 0},
    {"key_frame", offsetof(struct taxel_compact_delta, key_frame), 2, 0},
    {"timestamp_low", offsetof(struct taxel_compact_delta, timestamp_low), 3, 1},
};
static void compact_delta_pack(const void *value, uint8_t *bytes)
{
    taxel_compact_delta_pack(value, bytes);
}
static void compact_delta_unpack(void *value, const uint8_t *bytes)
{
    taxel_compact_delta_unpack(value, bytes);
}

static const struct field compact_acknowledge_fields[] = {
    {"key_frame", offsetof(struct taxel_compact_acknowledge, key_frame), 2, 0},
};
static void compact_acknowledge_pack(const void *value, uint8_t *bytes)
{
    taxel_compact_acknowledge_pack(value, bytes);
}
static void compact_acknowledge_unpack(void *value, const uint8_t *bytes)
{
    taxel_compact_acknowledge_unpack(value, bytes);
}

static const struct layout layouts[] = {
    {"hub_handshake", hub_handshake_fields, sizeof hub_handshake_fields / sizeof hub_handshake_fields[0], TAXEL_HUB_HANDSHAKE_SIZE, hub_handshake_pack, hub_handshake_unpack},
    {"taxel_header", taxel_header_fields, sizeof taxel_header_fields / sizeof taxel_header_fields[0], TAXEL_TAXEL_HEADER_SIZE, taxel_header_pack, taxel_header_unpack},
    {"snapshot_header", snapshot_header_fields, sizeof snapshot_header_fields / sizeof snapshot_header_fields[0], TAXEL_SNAPSHOT_HEADER_SIZE, snapshot_header_pack, snapshot_header_unpack},
    {"compact_header", compact_header_fields, sizeof compact_header_fields / sizeof compact_header_fields[0], TAXEL_COMPACT_HEADER_SIZE, compact_header_pack, compact_header_unpack},
    {"hub_status", hub_status_fields, sizeof hub_status_fields / sizeof hub_status_fields[0], TAXEL_HUB_STATUS_SIZE, hub_status_pack, hub_status_unpack},
    {"board_status", board_status_fields, sizeof board_status_fields / sizeof board_status_fields[0], TAXEL_BOARD_STATUS_SIZE, board_status_pack, board_status_unpack},
    {"board_info", board_info_fields, sizeof board_info_fields / sizeof board_info_fields[0], TAXEL_BOARD_INFO_SIZE, board_info_pack, board_info_unpack},
    {"board_fault_report", board_fault_report_fields, sizeof board_fault_report_fields / sizeof board_fault_report_fields[0], TAXEL_BOARD_FAULT_REPORT_SIZE, board_fault_report_pack, board_fault_report_unpack},
    {"time_sync", time_sync_fields, sizeof time_sync_fields / sizeof time_sync_fields[0], TAXEL_TIME_SYNC_SIZE, time_sync_pack, time_sync_unpack},
    {"log_header", log_header_fields, sizeof log_header_fields / sizeof log_header_fields[0], TAXEL_LOG_HEADER_SIZE, log_header_pack, log_header_unpack},
    {"reply_header", reply_header_fields, sizeof reply_header_fields / sizeof reply_header_fields[0], TAXEL_REPLY_HEADER_SIZE, reply_header_pack, reply_header_unpack},
    {"host_handshake", host_handshake_fields, sizeof host_handshake_fields / sizeof host_handshake_fields[0], TAXEL_HOST_HANDSHAKE_SIZE, host_handshake_pack, host_handshake_unpack},
    {"command_header", command_header_fields, sizeof command_header_fields / sizeof command_header_fields[0], TAXEL_COMMAND_HEADER_SIZE, command_header_pack, command_header_unpack},
    {"acknowledgement", acknowledgement_fields, sizeof acknowledgement_fields / sizeof acknowledgement_fields[0], TAXEL_ACKNOWLEDGEMENT_SIZE, acknowledgement_pack, acknowledgement_unpack},
    {"start_arguments", start_arguments_fields, sizeof start_arguments_fields / sizeof start_arguments_fields[0], TAXEL_START_ARGUMENTS_SIZE, start_arguments_pack, start_arguments_unpack},
    {"set_rate_arguments", set_rate_arguments_fields, sizeof set_rate_arguments_fields / sizeof set_rate_arguments_fields[0], TAXEL_SET_RATE_ARGUMENTS_SIZE, set_rate_arguments_pack, set_rate_arguments_unpack},
    {"enter_bootloader_arguments", enter_bootloader_arguments_fields, sizeof enter_bootloader_arguments_fields / sizeof enter_bootloader_arguments_fields[0], TAXEL_ENTER_BOOTLOADER_ARGUMENTS_SIZE, enter_bootloader_arguments_pack, enter_bootloader_arguments_unpack},
    {"transfer_arguments", transfer_arguments_fields, sizeof transfer_arguments_fields / sizeof transfer_arguments_fields[0], TAXEL_TRANSFER_ARGUMENTS_SIZE, transfer_arguments_pack, transfer_arguments_unpack},
    {"set_scan_settings_arguments", set_scan_settings_arguments_fields, sizeof set_scan_settings_arguments_fields / sizeof set_scan_settings_arguments_fields[0], TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE, set_scan_settings_arguments_pack, set_scan_settings_arguments_unpack},
    {"get_board_info_arguments", get_board_info_arguments_fields, sizeof get_board_info_arguments_fields / sizeof get_board_info_arguments_fields[0], TAXEL_GET_BOARD_INFO_ARGUMENTS_SIZE, get_board_info_arguments_pack, get_board_info_arguments_unpack},
    {"get_time_reply", get_time_reply_fields, sizeof get_time_reply_fields / sizeof get_time_reply_fields[0], TAXEL_GET_TIME_REPLY_SIZE, get_time_reply_pack, get_time_reply_unpack},
    {"fault_record", fault_record_fields, sizeof fault_record_fields / sizeof fault_record_fields[0], TAXEL_FAULT_RECORD_SIZE, fault_record_pack, fault_record_unpack},
    {"identity", identity_fields, sizeof identity_fields / sizeof identity_fields[0], TAXEL_IDENTITY_SIZE, identity_pack, identity_unpack},
    {"status", status_fields, sizeof status_fields / sizeof status_fields[0], TAXEL_STATUS_SIZE, status_pack, status_unpack},
    {"settings_register", settings_register_fields, sizeof settings_register_fields / sizeof settings_register_fields[0], TAXEL_SETTINGS_REGISTER_SIZE, settings_register_pack, settings_register_unpack},
    {"command_register", command_register_fields, sizeof command_register_fields / sizeof command_register_fields[0], TAXEL_COMMAND_REGISTER_SIZE, command_register_pack, command_register_unpack},
    {"enter_bootloader_register", enter_bootloader_register_fields, sizeof enter_bootloader_register_fields / sizeof enter_bootloader_register_fields[0], TAXEL_ENTER_BOOTLOADER_REGISTER_SIZE, enter_bootloader_register_pack, enter_bootloader_register_unpack},
    {"fault_register", fault_register_fields, sizeof fault_register_fields / sizeof fault_register_fields[0], TAXEL_FAULT_REGISTER_SIZE, fault_register_pack, fault_register_unpack},
    {"compact_packed", compact_packed_fields, sizeof compact_packed_fields / sizeof compact_packed_fields[0], TAXEL_COMPACT_PACKED_SIZE, compact_packed_pack, compact_packed_unpack},
    {"compact_delta", compact_delta_fields, sizeof compact_delta_fields / sizeof compact_delta_fields[0], TAXEL_COMPACT_DELTA_SIZE, compact_delta_pack, compact_delta_unpack},
    {"compact_acknowledge", compact_acknowledge_fields, sizeof compact_acknowledge_fields / sizeof compact_acknowledge_fields[0], TAXEL_COMPACT_ACKNOWLEDGE_SIZE, compact_acknowledge_pack, compact_acknowledge_unpack},
};

static const struct payload_part payload_parts[] = {
    {TAXEL_FRAME_TYPE_HUB_HANDSHAKE, "hub_handshake", ""},
    {TAXEL_FRAME_TYPE_TAXELS, "taxel_header", "header_"},
    {TAXEL_FRAME_TYPE_TAXELS, "snapshot_header", "snapshot_header_"},
    {TAXEL_FRAME_TYPE_COMPACT_TAXELS, "taxel_header", "header_"},
    {TAXEL_FRAME_TYPE_COMPACT_TAXELS, "compact_header", "snapshot_"},
    {TAXEL_FRAME_TYPE_HUB_STATUS, "hub_status", ""},
    {TAXEL_FRAME_TYPE_BOARD_STATUS, "board_status", ""},
    {TAXEL_FRAME_TYPE_BOARD_INFO, "board_info", ""},
    {TAXEL_FRAME_TYPE_BOARD_FAULT, "board_fault_report", ""},
    {TAXEL_FRAME_TYPE_TIME_SYNC, "time_sync", ""},
    {TAXEL_FRAME_TYPE_LOG, "log_header", ""},
    {TAXEL_FRAME_TYPE_REPLY, "reply_header", ""},
    {TAXEL_FRAME_TYPE_HOST_HANDSHAKE, "host_handshake", ""},
    {TAXEL_FRAME_TYPE_COMMAND, "command_header", ""},
};

#endif
