-- Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit.
-- Constants, named codes, structs and frame types of the protocol.
local protocol = {}

protocol.PROTOCOL_VERSION = 3
protocol.PROTOCOL_VERSION_MIN = 1
protocol.REGISTER_MAP_VERSION = 2
protocol.REGISTER_MAP_REVISION = 1
protocol.REGISTER_MAP_VERSION_MIN = 1
protocol.WHO_AM_I = 84
protocol.ADDRESS_MIN = 8
protocol.ADDRESS_MAX = 119
protocol.LINES_MAX = 16
protocol.TAXELS_MAX = 240
protocol.SMBUS_BLOCK = 32
protocol.CROSSING_MAP_SIZE = 32
protocol.SNAPSHOT_OVERHEAD = 10
protocol.COMPACT_OVERHEAD_PACKED = 11
protocol.COMPACT_OVERHEAD_DELTA = 12
protocol.COMPACT_TAXELS_MAX = 238
protocol.COMPACT_SIZE_MAX = 488
protocol.COMPACT_LENGTH_FINE = 128
protocol.COMPACT_LENGTH_STEP = 4
protocol.COMPACT_WIDTH_MASK = 31
protocol.COMPACT_START_MASK = 96
protocol.COMPACT_START_SHIFT = 5
protocol.COMPACT_KEY_FRAME = 128
protocol.ACKNOWLEDGE_FORGET = 128
protocol.ACKNOWLEDGE_MAX = 22
protocol.TRANSFER_MAX = 64
protocol.BOOTLOADER_KEY = 1414483778
protocol.LOG_TEXT_MAX = 64
protocol.FRAME_HEADER_SIZE = 5
protocol.FRAME_CRC_SIZE = 4
protocol.PAYLOAD_MAX = 498
protocol.BODY_MAX = 507
protocol.ENCODED_MAX = 509
protocol.WHITENING_SEED = 165
protocol.WHITENING_FACTOR = 5
protocol.WHITENING_INCREMENT = 107
protocol.REGISTER_IDENTITY = 0
protocol.REGISTER_STATUS = 64
protocol.REGISTER_CLOCK = 68
protocol.REGISTER_SETTINGS = 96
protocol.REGISTER_COMMAND = 112
protocol.REGISTER_SNAPSHOT = 128
protocol.REGISTER_SNAPSHOT_LAST = 143
protocol.REGISTER_FAULT = 144
protocol.REGISTER_COMPACT = 160
protocol.COMPACT_FRACTION_BITS = 6
protocol.COMPACT_MEAN_MAX = 4194303
protocol.COMPACT_LEVEL_BITS = 10
protocol.COMPACT_LEVEL_MAX = 1023
protocol.COMPACT_LEVEL_START = 384
protocol.COMPACT_LEVEL_START_STEP = 128
protocol.COMPACT_TOTAL_BITS = 16
protocol.COMPACT_ESCAPE = 128
protocol.COMPACT_UNIT = 1024
protocol.COMPACT_REACH = 8192
protocol.COMPACT_STEP_BITS = 7
protocol.COMPACT_JUMP = 6144
protocol.COMPACT_CLIP = 4096
protocol.COMPACT_COARSE_OCTAVE = 8
protocol.COMPACT_MEAN_DEVIATION = 1283
protocol.COMPACT_LEVEL_STEP = 92
protocol.COMPACT_MULTIPLIERS = {
    256, 235, 215, 197, 181, 166, 152, 140,
}
protocol.COMPACT_GAINS = {
    128, 85, 64, 51, 42, 36, 32, 28, 25, 23, 21, 19, 18,
    17, 16,
}
protocol.COMPACT_CUMULATIVE = {
    0, 3243, 6435, 9530, 12483, 15258, 17824, 20162, 22258, 24109, 25718, 27095, 28255,
    29218, 30005, 30638, 31139, 31531, 31832, 32060, 32230, 32356, 32447, 32512, 32559, 32591,
    32614, 32630, 32642, 32650, 32656, 32660, 32664, 32666, 32669, 32671, 32673, 32675, 32676,
    32678, 32679, 32681, 32682, 32684, 32685, 32686, 32688, 32689, 32690, 32691, 32692, 32693,
    32694, 32695, 32696, 32697, 32698, 32699, 32699, 32700, 32701, 32702, 32703, 32703, 32704,
}

-- Names of codes.
protocol.names = {
    FrameType = { [1] = "HUB_HANDSHAKE", [2] = "TAXELS", [3] = "COMPACT_TAXELS", [8] = "HUB_STATUS", [9] = "BOARD_STATUS", [10] = "BOARD_INFO", [11] = "BOARD_FAULT", [12] = "TIME_SYNC", [13] = "LOG", [14] = "REPLY", [129] = "HOST_HANDSHAKE", [130] = "COMMAND", [131] = "ACKNOWLEDGE" },
    Command = { [1] = "START", [2] = "STOP", [3] = "SET_RATE", [4] = "SCAN_BUS", [5] = "I2C_TRANSFER", [6] = "SET_SCAN_SETTINGS", [7] = "REBOOT", [8] = "GET_STATUS", [9] = "GET_BOARD_INFO", [10] = "GET_TIME", [11] = "ENTER_BOOTLOADER", [12] = "GET_FAULT" },
    StartFlag = { [1] = "COMPACT" },
    ReplyStatus = { [0] = "OK", [1] = "UNKNOWN_COMMAND", [2] = "BAD_ARGUMENTS", [3] = "BUSY", [4] = "NO_HANDSHAKE", [5] = "UNKNOWN_BOARD", [6] = "NACK", [7] = "TIMEOUT", [8] = "BUS_ERROR", [9] = "REJECTED_BY_BOARD" },
    BoardState = { [0] = "ABSENT", [1] = "IDENTIFYING", [2] = "STREAMING", [3] = "INCOMPATIBLE" },
    BoardFault = { [0] = "NONE", [1] = "NACK", [2] = "TIMEOUT", [3] = "CRC", [4] = "SDA_STUCK", [5] = "SCL_STUCK", [6] = "ARBITRATION", [7] = "NOT_A_TAXEL_BOARD", [8] = "MAP_VERSION", [9] = "RESTARTED", [10] = "TOO_LARGE", [11] = "SETTINGS_REJECTED", [12] = "RECOVERED" },
    ResetCause = { [0] = "POWER_ON", [1] = "BROWN_OUT", [2] = "WATCHDOG", [3] = "COMMAND" },
    LogLevel = { [0] = "DEBUG", [1] = "INFO", [2] = "WARNING", [3] = "ERROR" },
    LogCode = { [1] = "BUS_FREE", [2] = "SDA_STUCK", [3] = "SCL_STUCK", [4] = "RECEIVE_OVERRUN", [5] = "FRAME_DROPPED" },
    BoardCommand = { [1] = "START_SCAN", [2] = "STOP_SCAN", [3] = "CLEAR_COUNTERS", [4] = "RESTART", [5] = "ENTER_BOOTLOADER" },
    BoardErrorFlag = { [1] = "SETTINGS_REJECTED", [2] = "COMMAND_REJECTED", [8] = "SATURATED", [16] = "READ_ONLY_WRITE", [32] = "NOT_SCANNING" },
    FrontEnd = { [0] = "CAPSENSE" },
    FaultCode = { [0] = "NONE", [1] = "EXCEPTION", [2] = "NOT_SCANNING" },
}

-- Structs: size in bytes, and the fields in order.
protocol.structs = {
    identity = {
        size = 58,
        { name = "who_am_i", offset = 0, size = 1 },
        { name = "map_version", offset = 1, size = 1 },
        { name = "firmware_major", offset = 2, size = 1 },
        { name = "firmware_minor", offset = 3, size = 1 },
        { name = "firmware_patch", offset = 4, size = 1 },
        { name = "kind", offset = 5, size = 1 },
        { name = "address", offset = 6, size = 1 },
        { name = "map_revision", offset = 7, size = 1 },
        { name = "unique_id", offset = 8, size = 8, is_bytes = true },
        { name = "rows", offset = 16, size = 1 },
        { name = "columns", offset = 17, size = 1 },
        { name = "taxel_count", offset = 18, size = 2 },
        { name = "snapshot_size", offset = 20, size = 2 },
        { name = "crossing_map", offset = 22, size = 32, is_bytes = true },
        { name = "crc32", offset = 54, size = 4 },
    },
    status = {
        size = 28,
        { name = "state", offset = 0, size = 1 },
        { name = "error_flags", offset = 1, size = 1 },
        { name = "reset_cause", offset = 2, size = 1 },
        { name = "settings_generation", offset = 3, size = 1 },
        { name = "clock_us", offset = 4, size = 4 },
        { name = "scans", offset = 8, size = 4 },
        { name = "scan_time_us", offset = 12, size = 4 },
        { name = "snapshot_reads", offset = 16, size = 4 },
        { name = "bus_errors", offset = 20, size = 2 },
        { name = "rejected_writes", offset = 22, size = 2 },
        { name = "front_end", offset = 24, size = 1 },
        { name = "reserved", offset = 25, size = 1 },
        { name = "saturated_conversions", offset = 26, size = 2 },
    },
    scan_settings = {
        size = 8,
        { name = "sub_conversions", offset = 0, size = 2 },
        { name = "sense_clock_divider", offset = 2, size = 2 },
        { name = "modulator_clock_divider", offset = 4, size = 1 },
        { name = "idac_code", offset = 5, size = 1 },
        { name = "settle_cycles", offset = 6, size = 2 },
    },
    settings_register = {
        size = 12,
        { name = "settings_sub_conversions", offset = 0, size = 2 },
        { name = "settings_sense_clock_divider", offset = 2, size = 2 },
        { name = "settings_modulator_clock_divider", offset = 4, size = 1 },
        { name = "settings_idac_code", offset = 5, size = 1 },
        { name = "settings_settle_cycles", offset = 6, size = 2 },
        { name = "crc32", offset = 8, size = 4 },
    },
    command_register = {
        size = 2,
        { name = "command", offset = 0, size = 1 },
        { name = "complement", offset = 1, size = 1 },
    },
    enter_bootloader_register = {
        size = 6,
        { name = "command", offset = 0, size = 1 },
        { name = "complement", offset = 1, size = 1 },
        { name = "key", offset = 2, size = 4 },
    },
    fault_record = {
        size = 12,
        { name = "code", offset = 0, size = 1 },
        { name = "exception", offset = 1, size = 1 },
        { name = "count", offset = 2, size = 2 },
        { name = "program_counter", offset = 4, size = 4 },
        { name = "link_register", offset = 8, size = 4 },
    },
    fault_register = {
        size = 16,
        { name = "record_code", offset = 0, size = 1 },
        { name = "record_exception", offset = 1, size = 1 },
        { name = "record_count", offset = 2, size = 2 },
        { name = "record_program_counter", offset = 4, size = 4 },
        { name = "record_link_register", offset = 8, size = 4 },
        { name = "crc32", offset = 12, size = 4 },
    },
    snapshot_header = {
        size = 6,
        { name = "sequence", offset = 0, size = 2 },
        { name = "timestamp_us", offset = 2, size = 4 },
    },
    compact_header = {
        size = 3,
        { name = "sequence", offset = 0, size = 2 },
        { name = "format", offset = 2, size = 1 },
    },
    compact_packed = {
        size = 7,
        { name = "sequence", offset = 0, size = 2 },
        { name = "format", offset = 2, size = 1 },
        { name = "timestamp_us", offset = 3, size = 4 },
    },
    compact_delta = {
        size = 8,
        { name = "sequence", offset = 0, size = 2 },
        { name = "format", offset = 2, size = 1 },
        { name = "key_frame", offset = 3, size = 2 },
        { name = "timestamp_low", offset = 5, size = 3, is_bytes = true },
    },
    compact_acknowledge = {
        size = 2,
        { name = "key_frame", offset = 0, size = 2 },
    },
    host_handshake = {
        size = 3,
        { name = "tag", offset = 0, size = 1 },
        { name = "version_min", offset = 1, size = 1 },
        { name = "version_max", offset = 2, size = 1 },
    },
    hub_handshake = {
        size = 24,
        { name = "tag", offset = 0, size = 1 },
        { name = "version_min", offset = 1, size = 1 },
        { name = "version_max", offset = 2, size = 1 },
        { name = "version_chosen", offset = 3, size = 1 },
        { name = "reset_cause", offset = 4, size = 1 },
        { name = "firmware_major", offset = 5, size = 1 },
        { name = "firmware_minor", offset = 6, size = 1 },
        { name = "firmware_patch", offset = 7, size = 1 },
        { name = "unique_id", offset = 8, size = 8, is_bytes = true },
        { name = "uptime_us", offset = 16, size = 8 },
    },
    taxel_header = {
        size = 8,
        { name = "address", offset = 0, size = 1 },
        { name = "taxel_count", offset = 1, size = 1 },
        { name = "cycle", offset = 2, size = 2 },
        { name = "hub_time_us", offset = 4, size = 4 },
    },
    hub_status = {
        size = 42,
        { name = "uptime_us", offset = 0, size = 8 },
        { name = "cycles", offset = 8, size = 4 },
        { name = "cycle_time_us", offset = 12, size = 4 },
        { name = "frames_sent", offset = 16, size = 4 },
        { name = "bytes_sent", offset = 20, size = 4 },
        { name = "frames_dropped", offset = 24, size = 4 },
        { name = "commands", offset = 28, size = 4 },
        { name = "commands_rejected", offset = 32, size = 4 },
        { name = "bus_recoveries", offset = 36, size = 4 },
        { name = "boards_streaming", offset = 40, size = 1 },
        { name = "streaming", offset = 41, size = 1 },
    },
    board_status = {
        size = 39,
        { name = "address", offset = 0, size = 1 },
        { name = "state", offset = 1, size = 1 },
        { name = "last_fault", offset = 2, size = 1 },
        { name = "polls", offset = 3, size = 4 },
        { name = "forwarded", offset = 7, size = 4 },
        { name = "repeated", offset = 11, size = 4 },
        { name = "nacks", offset = 15, size = 4 },
        { name = "timeouts", offset = 19, size = 4 },
        { name = "crc_errors", offset = 23, size = 4 },
        { name = "bus_errors", offset = 27, size = 4 },
        { name = "dropped", offset = 31, size = 4 },
        { name = "retries", offset = 35, size = 4 },
    },
    board_info = {
        size = 66,
        { name = "identity_who_am_i", offset = 0, size = 1 },
        { name = "identity_map_version", offset = 1, size = 1 },
        { name = "identity_firmware_major", offset = 2, size = 1 },
        { name = "identity_firmware_minor", offset = 3, size = 1 },
        { name = "identity_firmware_patch", offset = 4, size = 1 },
        { name = "identity_kind", offset = 5, size = 1 },
        { name = "identity_address", offset = 6, size = 1 },
        { name = "identity_map_revision", offset = 7, size = 1 },
        { name = "identity_unique_id", offset = 8, size = 8, is_bytes = true },
        { name = "identity_rows", offset = 16, size = 1 },
        { name = "identity_columns", offset = 17, size = 1 },
        { name = "identity_taxel_count", offset = 18, size = 2 },
        { name = "identity_snapshot_size", offset = 20, size = 2 },
        { name = "identity_crossing_map", offset = 22, size = 32, is_bytes = true },
        { name = "identity_crc32", offset = 54, size = 4 },
        { name = "settings_sub_conversions", offset = 58, size = 2 },
        { name = "settings_sense_clock_divider", offset = 60, size = 2 },
        { name = "settings_modulator_clock_divider", offset = 62, size = 1 },
        { name = "settings_idac_code", offset = 63, size = 1 },
        { name = "settings_settle_cycles", offset = 64, size = 2 },
    },
    board_fault_report = {
        size = 10,
        { name = "address", offset = 0, size = 1 },
        { name = "fault", offset = 1, size = 1 },
        { name = "cycle", offset = 2, size = 2 },
        { name = "hub_time_us", offset = 4, size = 4 },
        { name = "consecutive", offset = 8, size = 2 },
    },
    time_sync = {
        size = 13,
        { name = "address", offset = 0, size = 1 },
        { name = "board_time_us", offset = 1, size = 4 },
        { name = "hub_time_us", offset = 5, size = 8 },
    },
    log_header = {
        size = 7,
        { name = "level", offset = 0, size = 1 },
        { name = "code", offset = 1, size = 2 },
        { name = "hub_time_us", offset = 3, size = 4 },
    },
    reply_header = {
        size = 3,
        { name = "tag", offset = 0, size = 1 },
        { name = "command", offset = 1, size = 1 },
        { name = "status", offset = 2, size = 1 },
    },
    command_header = {
        size = 2,
        { name = "tag", offset = 0, size = 1 },
        { name = "command", offset = 1, size = 1 },
    },
    acknowledgement = {
        size = 3,
        { name = "address", offset = 0, size = 1 },
        { name = "key_frame", offset = 1, size = 2 },
    },
    start_arguments = {
        size = 1,
        { name = "flags", offset = 0, size = 1 },
    },
    set_rate_arguments = {
        size = 4,
        { name = "period_us", offset = 0, size = 4 },
    },
    enter_bootloader_arguments = {
        size = 4,
        { name = "key", offset = 0, size = 4 },
    },
    transfer_arguments = {
        size = 2,
        { name = "address", offset = 0, size = 1 },
        { name = "read_length", offset = 1, size = 1 },
    },
    set_scan_settings_arguments = {
        size = 10,
        { name = "address", offset = 0, size = 1 },
        { name = "settings_sub_conversions", offset = 1, size = 2 },
        { name = "settings_sense_clock_divider", offset = 3, size = 2 },
        { name = "settings_modulator_clock_divider", offset = 5, size = 1 },
        { name = "settings_idac_code", offset = 6, size = 1 },
        { name = "settings_settle_cycles", offset = 7, size = 2 },
        { name = "front_end", offset = 9, size = 1 },
    },
    get_board_info_arguments = {
        size = 1,
        { name = "address", offset = 0, size = 1 },
    },
    get_time_reply = {
        size = 8,
        { name = "hub_time_us", offset = 0, size = 8 },
    },
}

-- Frame types by code. parts: structs at the front of the payload; tail: name of the bytes behind them.
protocol.frames = {
    [0x01] = { name = "HUB_HANDSHAKE",
        minimum = 24, maximum = 24,
        has_address = false, parts = { { struct = "hub_handshake", prefix = "" } }, tail = nil },
    [0x02] = { name = "TAXELS",
        minimum = 20, maximum = 498,
        has_address = true, parts = { { struct = "taxel_header", prefix = "header_" }, { struct = "snapshot_header", prefix = "snapshot_header_" } }, tail = nil },
    [0x03] = { name = "COMPACT_TAXELS",
        minimum = 20, maximum = 496,
        has_address = true, parts = { { struct = "taxel_header", prefix = "header_" }, { struct = "compact_header", prefix = "snapshot_" } }, tail = "data" },
    [0x08] = { name = "HUB_STATUS",
        minimum = 42, maximum = 42,
        has_address = false, parts = { { struct = "hub_status", prefix = "" } }, tail = nil },
    [0x09] = { name = "BOARD_STATUS",
        minimum = 39, maximum = 39,
        has_address = true, parts = { { struct = "board_status", prefix = "" } }, tail = nil },
    [0x0A] = { name = "BOARD_INFO",
        minimum = 66, maximum = 66,
        has_address = false, parts = { { struct = "board_info", prefix = "" } }, tail = nil },
    [0x0B] = { name = "BOARD_FAULT",
        minimum = 10, maximum = 10,
        has_address = true, parts = { { struct = "board_fault_report", prefix = "" } }, tail = nil },
    [0x0C] = { name = "TIME_SYNC",
        minimum = 13, maximum = 13,
        has_address = true, parts = { { struct = "time_sync", prefix = "" } }, tail = nil },
    [0x0D] = { name = "LOG",
        minimum = 7, maximum = 71,
        has_address = false, parts = { { struct = "log_header", prefix = "" } }, tail = "text" },
    [0x0E] = { name = "REPLY",
        minimum = 3, maximum = 131,
        has_address = false, parts = { { struct = "reply_header", prefix = "" } }, tail = "data" },
    [0x81] = { name = "HOST_HANDSHAKE",
        minimum = 3, maximum = 3,
        has_address = false, parts = { { struct = "host_handshake", prefix = "" } }, tail = nil },
    [0x82] = { name = "COMMAND",
        minimum = 2, maximum = 68,
        has_address = false, parts = { { struct = "command_header", prefix = "" } }, tail = "arguments" },
    [0x83] = { name = "ACKNOWLEDGE",
        minimum = 3, maximum = 66,
        has_address = false, parts = {  }, tail = "acknowledgements" },
}

return protocol
