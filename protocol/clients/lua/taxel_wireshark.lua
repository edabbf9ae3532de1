-- Dissector of the taxel protocol for Wireshark and tshark, as one file.
-- Generated from protocol/clients/lua/taxel by tools/codegen/clients.py (make generate). Do not edit.

package.preload["taxel.bits"] = function(...)
-- Bit operations on unsigned 32-bit numbers: the library bit32 (Lua 5.2, 5.3) or the operators of Lua 5.3 and later.
-- The operators are compiled from a string, because an older Lua cannot parse them.
local bits = bit32
if not bits then
    bits = assert(load([[
        return {
            band = function(a, b) return a & b end,
            bor = function(a, b) return a | b end,
            bxor = function(a, b) return a ~ b end,
            lshift = function(a, n) return (a << n) & 0xFFFFFFFF end,
            rshift = function(a, n) return a >> n end,
        }]], "=bits"))()
end
return bits
end

package.preload["taxel.protocol"] = function(...)
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
end

package.preload["taxel.fields"] = function(...)
-- Fields of structs in strings of bytes.
local protocol = require("taxel.protocol")

local fields = {}

-- Returns the unsigned little-endian number of 1 to 4 bytes behind `offset` (0: first byte).
function fields.read_number(data, offset, size)
    local value = 0
    for i = size, 1, -1 do
        value = value * 256 + data:byte(offset + i)
    end
    return value
end

-- Formats an unsigned number of any size as decimal digits: Lua has no unsigned 64-bit numbers.
function fields.format_decimal(data, offset, size)
    local digits = { 0 }
    for i = size, 1, -1 do
        local carry = data:byte(offset + i)
        for k = 1, #digits do
            local value = digits[k] * 256 + carry
            digits[k] = value % 10
            carry = (value - digits[k]) / 10
        end
        while carry > 0 do
            digits[#digits + 1] = carry % 10
            carry = (carry - carry % 10) / 10
        end
    end
    local text = {}
    for k = #digits, 1, -1 do
        text[#text + 1] = string.format("%d", digits[k])
    end
    return table.concat(text)
end

-- Formats bytes as hexadecimal digits.
function fields.to_hex(data)
    return (data:gsub(".", function(byte)
        return string.format("%02x", byte:byte())
    end))
end

-- Returns the value of a field: a number; the digits of a number of 64 bits; or a string of bytes.
function fields.read(field, data, offset)
    if field.is_bytes then
        return data:sub(offset + field.offset + 1, offset + field.offset + field.size)
    elseif field.size > 4 then
        return fields.format_decimal(data, offset + field.offset, field.size)
    end
    return fields.read_number(data, offset + field.offset, field.size)
end

-- Returns the values of all fields of a struct by name. name: as in protocol.structs.
function fields.unpack(name, data, offset)
    local values = {}
    for _, field in ipairs(protocol.structs[name]) do
        values[field.name] = fields.read(field, data, offset or 0)
    end
    return values
end

-- Calls visitor(struct name, prefix, field, offset of the struct) for each field of the structs of a payload; returns
-- the number of bytes of these structs.
function fields.visit_payload(code, visitor)
    local offset = 0
    for _, part in ipairs(protocol.frames[code].parts) do
        local struct = protocol.structs[part.struct]
        for _, field in ipairs(struct) do
            visitor(part.struct, part.prefix, field, offset)
        end
        offset = offset + struct.size
    end
    return offset
end

return fields
end

package.preload["taxel.crc32"] = function(...)
-- CRC-32 of IEEE 802.3, as crc32() of zlib.
local bits = require("taxel.bits")

local bxor, band, rshift = bits.bxor, bits.band, bits.rshift
local remainders = {}
for byte = 0, 255 do
    local remainder = byte
    for _ = 1, 8 do
        remainder = bxor(rshift(remainder, 1), remainder % 2 == 1 and 0xEDB88320 or 0)
    end
    remainders[byte] = remainder
end

-- Computes the CRC-32 of the bytes `first` to `last` of a string. crc: CRC-32 of the bytes before them, 0 at the start.
return function(data, crc, first, last)
    local state = bxor(crc or 0, 0xFFFFFFFF)
    for i = first or 1, last or #data do
        state = bxor(rshift(state, 8), remainders[band(bxor(state, data:byte(i)), 0xFF)])
    end
    return bxor(state, 0xFFFFFFFF)
end
end

package.preload["taxel.framing"] = function(...)
-- Frames on the wire: whitening, byte stuffing (COBS), and a deframer that finds every intact frame of a stream.
local bits = require("taxel.bits")
local crc32 = require("taxel.crc32")
local fields = require("taxel.fields")
local protocol = require("taxel.protocol")

local HEADER, CRC = protocol.FRAME_HEADER_SIZE, protocol.FRAME_CRC_SIZE
local ENCODED = protocol.ENCODED_MAX + 2

local framing = { TO_HOST = 1, TO_HUB = 2, BOTH = 3 }

local whitening = {}
local value = protocol.WHITENING_SEED
for i = 1, protocol.BODY_MAX do
    whitening[i] = value
    value = (protocol.WHITENING_FACTOR * value + protocol.WHITENING_INCREMENT) % 256
end

-- Returns the bytes of a string XORed with the whitening sequence from position `first` (1: start of the body) on.
local function whiten(data, first)
    local out = { data:byte(1, #data) }
    for i = 1, #out do
        out[i] = bits.bxor(out[i], whitening[first + i - 1])
    end
    return string.char(table.unpack(out))
end

-- Returns whether frames of this type are accepted. Bit 7 of a type: from host to hub.
function framing.is_accepted(code, directions)
    return bits.band(directions, code >= 0x80 and framing.TO_HUB or framing.TO_HOST) ~= 0
end

-- Returns the size of the body with this header; nil if no frame has this length. A newer sender may use types and
-- lengths that this version does not define.
local function compute_expected_size(header)
    local length = fields.read_number(header, 3, 2)
    return length <= protocol.PAYLOAD_MAX and HEADER + length + CRC or nil
end

-- Returns whether the CRC of a body is correct.
local function is_crc_correct(body)
    return crc32(body, 0, 1, #body - CRC) == fields.read_number(body, #body - CRC, CRC)
end

-- Returns whether this version defines a complete frame: its type, length, address and number of taxels.
function framing.is_known(code, payload, directions)
    local rule = protocol.frames[code]
    if not rule or not framing.is_accepted(code, directions) or #payload < rule.minimum or #payload > rule.maximum then
        return false
    end
    local address, count = payload:byte(1, 2)
    if rule.has_address and (address < protocol.ADDRESS_MIN or address > protocol.ADDRESS_MAX) then
        return false
    end
    local header = protocol.structs.taxel_header.size
    return rule.name ~= "TAXELS" or #payload == header + protocol.SNAPSHOT_OVERHEAD + 2 * count
end

-- Returns the position behind the stuffed bytes, and the body, of the frame that begins at byte `start` of a chunk; nil
-- if no frame begins there.
local function take_frame(chunk, start)
    local parts, length, position, size = {}, 0, start, nil
    while position <= #chunk do
        local code = chunk:byte(position)
        if position + code - 1 > #chunk or length + code - 1 > protocol.BODY_MAX then
            return nil
        end
        parts[#parts + 1] = whiten(chunk:sub(position + 1, position + code - 1), length + 1)
        length = length + code - 1
        position = position + code
        if not size and length >= HEADER then
            size = compute_expected_size(table.concat(parts))
            if not size then
                return nil
            end
        end
        if size and length >= size then
            local body = table.concat(parts)
            if length == size and is_crc_correct(body) then
                return position, body
            end
            return nil
        end
        if code ~= 0xFF then -- the zero between two blocks
            if length == protocol.BODY_MAX then
                return nil
            end
            length = length + 1
            parts[#parts + 1] = string.char(whitening[length])
        end
    end
    return nil
end

local Deframer = {}
Deframer.__index = Deframer

-- Creates a deframer without received bytes. directions: TO_HOST (default), TO_HUB or BOTH.
function framing.new_deframer(directions)
    return setmetatable({ directions = directions or framing.TO_HOST, chunk = "", discarded_bytes = 0 }, Deframer)
end

-- Takes any number of bytes and calls handler(code, sequence, payload, is_known) for each frame that they complete.
-- is_known: this version defines the type with this payload.
function Deframer:push(data, handler)
    local start = 1
    while true do
        local zero = data:find("\0", start, true)
        self.chunk = self.chunk .. data:sub(start, (zero or #data + 1) - 1)
        if not zero then
            break
        end
        self:finish(handler)
        start = zero + 1
    end
    if #self.chunk > 2 * ENCODED then -- no delimiter: the last bytes may be the start of a frame
        self.chunk = self.chunk:sub(self:search(#self.chunk - ENCODED, handler))
    end
end

-- Searches the remaining bytes, as if a delimiter followed: at the end of a stream.
function Deframer:finish(handler)
    self:search(#self.chunk, handler)
    self.chunk = ""
end

-- Tries every byte up to `last` as the start of a frame; returns the position behind the searched bytes.
function Deframer:search(last, handler)
    local start = 1
    while start <= last do
        local next_start, body = take_frame(self.chunk, start)
        if next_start then
            local code, payload = body:byte(1), body:sub(HEADER + 1, #body - CRC)
            local is_known = framing.is_known(code, payload, self.directions)
            handler(code, fields.read_number(body, 1, 2), payload, is_known)
            start = next_start
        else
            self.discarded_bytes = self.discarded_bytes + 1
            start = start + 1
        end
    end
    return start
end

return framing
end

package.preload["taxel.compact"] = function(...)
-- Compact snapshots of one board: packed frames and delta frames to counts (SPEC.md, "Coding of compact snapshots").
-- Integers and rounding are part of the protocol.
local bits = require("taxel.bits")
local crc32 = require("taxel.crc32")
local fields = require("taxel.fields")
local protocol = require("taxel.protocol")

local floor, min, max, abs = math.floor, math.min, math.max, math.abs
local band, lshift, rshift = bits.band, bits.lshift, bits.rshift
local COUNT_MAX, WORD = 0xFFFF, 4294967296
local cumulative_table, multipliers = protocol.COMPACT_CUMULATIVE, protocol.COMPACT_MULTIPLIERS
local REACH, ESCAPE = protocol.COMPACT_REACH, protocol.COMPACT_ESCAPE
local MIDDLE = ESCAPE + cumulative_table[#cumulative_table]
local REPEAT_AFTER = 4 -- snapshots that may arrive before an answer takes effect on the board

-- Creates the state of a taxel: mean in 64ths of a count, level of the scale, and values that follow from the level.
local function new_taxel(mean, level)
    local octave = rshift(level, 6)
    return { mean = mean, level = level, octave = octave, multiplier = multipliers[rshift(level, 3) % 8 + 1],
        raw_bits = max(octave - protocol.COMPACT_COARSE_OCTAVE, 0) }
end

-- Returns the predicted count.
local function compute_centre(taxel)
    return min(floor((taxel.mean + 32) / 64), COUNT_MAX)
end

-- Converts a magnitude in 64ths of a count to 1024ths of the taxel's scale.
local function compute_distance(taxel, difference)
    return rshift(difference * taxel.multiplier, taxel.octave)
end

-- Returns the probability of all counts below `symbol` (a count without its raw bits) and of the escape, in 2^-16.
local function compute_cumulative(taxel, symbol)
    local difference = lshift(symbol, taxel.raw_bits + 6) - 32 - taxel.mean
    local size = min(compute_distance(taxel, abs(difference)), REACH)
    local corner, fraction = rshift(size, 7), size % 128
    local share = cumulative_table[corner + 1]
    if fraction > 0 then
        share = share + rshift((cumulative_table[corner + 2] - share) * fraction, 7)
    end
    return difference < 0 and MIDDLE - share or MIDDLE + share
end

-- Returns the largest corner of the cumulative table, 0 to 63, with at most this share.
local function find_corner(share)
    local low, high = 0, 63
    while low < high do
        local middle = floor((low + high + 1) / 2)
        if cumulative_table[middle + 1] <= share then
            low = middle
        else
            high = middle - 1
        end
    end
    return low
end

-- Returns a symbol at or below the symbol of the probability `target`, at most a few symbols away: the end of the
-- segment of the cumulative table that contains the target.
local function find_first_symbol(taxel, target)
    local from, step, edge = taxel.mean + 32, lshift(1, 7 + taxel.octave), nil
    if target >= MIDDLE then
        edge = from + floor(find_corner(target - MIDDLE) * step / taxel.multiplier)
    else
        local corner = find_corner(MIDDLE - target - 1) + 1
        edge = max(from - floor((corner * step + taxel.multiplier - 1) / taxel.multiplier), 0)
    end
    return min(rshift(edge, taxel.raw_bits + 6), rshift(COUNT_MAX, taxel.raw_bits))
end

-- Rounds the difference between count and centre as a board stores it in one byte: exact below 64, else the middle of
-- its quarter of an octave.
local function quantise(size)
    local shift = 0
    if size >= 64 then
        while rshift(size, shift) >= 8 do
            shift = shift + 1
        end
        return lshift(rshift(size, shift), shift) + rshift(lshift(1, shift), 1)
    end
    return size
end

-- Returns the state after one more key frame. gain: weight of the new count, in 256ths.
local function update(taxel, count, gain)
    local centre = compute_centre(taxel)
    local size = quantise(abs(count - centre))
    local difference = 64 * (centre + (count < centre and -size or size)) - taxel.mean
    local magnitude, sign = abs(difference), difference < 0 and -1 or 1
    local scales, mean, level = compute_distance(taxel, magnitude), nil, taxel.level
    if scales >= protocol.COMPACT_JUMP then
        mean = taxel.mean + difference
    else
        local spread = rshift(min(scales, protocol.COMPACT_CLIP) * protocol.COMPACT_MEAN_DEVIATION, 10)
        local excess = spread - protocol.COMPACT_UNIT
        local step = rshift(abs(excess) * gain * protocol.COMPACT_LEVEL_STEP + 131072, 18)
        level = min(max(level + (excess < 0 and -step or step), 0), protocol.COMPACT_LEVEL_MAX)
        mean = taxel.mean + sign * rshift(magnitude * gain + 128, 8)
    end
    return new_taxel(min(max(mean, 0), protocol.COMPACT_MEAN_MAX), level)
end

-- Decoder of a range coder (Martin, 1979). Bytes after the last one are zeros.
local RangeDecoder = {}
RangeDecoder.__index = RangeDecoder

-- Creates a decoder of the coded bytes of a delta frame.
local function new_range_decoder(data)
    local decoder = setmetatable({ data = data, position = 0, code = 0, range = WORD - 1 }, RangeDecoder)
    for _ = 1, 4 do
        decoder:shift_in_byte()
    end
    return decoder
end

-- Moves the next byte into the code.
function RangeDecoder:shift_in_byte()
    self.position = self.position + 1
    self.code = (self.code * 256 + (self.data:byte(self.position) or 0)) % WORD
end

-- Returns the next of 2^count equal shares, without consuming it. Damaged bytes alone point behind the last one.
function RangeDecoder:peek(count)
    return min(floor(self.code / rshift(self.range, count)), lshift(1, count) - 1)
end

-- Consumes the symbol with the interval from `first` on with `size` of 2^count equal shares.
function RangeDecoder:take(first, size, count)
    local share = rshift(self.range, count)
    self.code = (self.code - first * share) % WORD
    self.range = size * share
    while self.range < 16777216 do
        self:shift_in_byte()
        self.range = self.range * 256
    end
end

-- Decodes and consumes an uncoded number.
function RangeDecoder:take_bits(count)
    local value = self:peek(count)
    self:take(value, 1, count)
    return value
end

-- Decodes a count too far from its prediction; returns nil for bytes that no encoder produces.
function RangeDecoder:take_escape(taxel)
    self:take(0, ESCAPE, 16)
    local head = self:take_bits(5)
    local exponent = rshift(head, 1)
    local size = lshift(1, exponent) + self:take_bits(exponent)
    local count = compute_centre(taxel) + (head % 2 == 1 and -size or size)
    return count >= 0 and count <= COUNT_MAX and count or nil
end

-- Decodes the next count; returns nil for bytes that no encoder produces.
function RangeDecoder:take_count(taxel)
    local target = self:peek(16)
    if target < ESCAPE then
        return self:take_escape(taxel)
    end
    local symbol, last = find_first_symbol(taxel, target), rshift(COUNT_MAX, taxel.raw_bits)
    local first, following = compute_cumulative(taxel, symbol), compute_cumulative(taxel, symbol + 1)
    while following <= target and symbol < last do
        symbol = symbol + 1
        first, following = following, compute_cumulative(taxel, symbol + 1)
    end
    if target < first or target >= following then
        return nil
    end
    self:take(first, following - first, 16)
    return lshift(symbol, taxel.raw_bits) + self:take_bits(taxel.raw_bits)
end

-- Decodes the counts of a delta frame; returns nil for bytes that no encoder produces.
local function decode_counts(taxels, data)
    local decoder, counts = new_range_decoder(data), {}
    for i, taxel in ipairs(taxels) do
        counts[i] = decoder:take_count(taxel)
        if not counts[i] then
            return nil
        end
    end
    return counts
end

-- Unpacks the counts of a packed frame, each of `width` bits, lowest bits first.
local function unpack_counts(data, width, taxel_count)
    local counts, buffer, available, position = {}, 0, 0, 0
    for i = 1, taxel_count do
        while available < width do
            position = position + 1
            buffer = buffer + lshift(data:byte(position), available)
            available = available + 8
        end
        counts[i] = buffer % lshift(1, width)
        buffer = rshift(buffer, width)
        available = available - width
    end
    return counts
end

local Receiver = {}
Receiver.__index = Receiver

local compact = {}

-- Creates the state of the compact snapshots of one board: key_frame and pending, each {id, timestamp_us, updates, taxels}
-- or nil; answer: "acknowledge" or "forget" that the host has to send, or nil.
function compact.new_receiver()
    return setmetatable({ snapshots_until_repeat = 0 }, Receiver)
end

-- Stores an answer to be sent.
function Receiver:set_answer(answer)
    self.answer, self.snapshots_until_repeat = answer, REPEAT_AFTER
end

-- Stores an answer again if several snapshots have arrived without its effect.
function Receiver:repeat_answer(answer)
    if self.snapshots_until_repeat > 0 then
        self.snapshots_until_repeat = self.snapshots_until_repeat - 1
    else
        self:set_answer(answer)
    end
end

-- Decodes a compact snapshot, the bytes from `sequence` to `crc32`. Returns counts and the board's time; nil and
-- "damaged" or "no key frame" without counts.
function Receiver:receive(address, taxel_count, data)
    if #data < protocol.COMPACT_OVERHEAD_DELTA or taxel_count == 0 or taxel_count > protocol.COMPACT_TAXELS_MAX then
        return nil, "damaged"
    end
    local content, format = data:sub(1, -5), data:byte(3)
    local crc = crc32(content, crc32(string.char(address)))
    local width, start = band(format, protocol.COMPACT_WIDTH_MASK), band(format, protocol.COMPACT_START_MASK)
    local is_key_frame = band(format, protocol.COMPACT_KEY_FRAME) ~= 0
    if crc ~= fields.read_number(data, #content, 4) or width > 16 or (start ~= 0 and not (width > 0 and is_key_frame)) then
        return nil, "damaged"
    end
    local counts, time, next_key_frame
    if width > 0 then
        counts, time, next_key_frame = self:receive_packed(content, taxel_count, width, start, is_key_frame)
    else
        counts, time, next_key_frame = self:receive_delta(content, taxel_count, is_key_frame)
    end
    if counts and is_key_frame then
        next_key_frame.id, next_key_frame.timestamp_us = crc % 65536, time
        if self.key_frame and self.key_frame.id == next_key_frame.id then
            self.pending = nil -- no board marks a snapshot whose id equals that of the key frame in use
        else
            self.pending = next_key_frame
            self:set_answer("acknowledge")
        end
    end
    return counts, time
end

-- Decodes a packed frame. Returns counts, time and, if it is marked as one, the next key frame.
function Receiver:receive_packed(content, taxel_count, width, start, is_key_frame)
    local head = fields.unpack("compact_packed", content)
    local size = protocol.structs.compact_packed.size
    if #content < size + floor((width * taxel_count + 7) / 8) then
        return nil, "damaged"
    end
    local counts = unpack_counts(content:sub(size + 1), width, taxel_count)
    if not is_key_frame then
        return counts, head.timestamp_us
    end
    self.key_frame = nil -- the board has discarded its earlier key frame
    local level = protocol.COMPACT_LEVEL_START
        + protocol.COMPACT_LEVEL_START_STEP * rshift(start, protocol.COMPACT_START_SHIFT)
    local taxels = {}
    for i, count in ipairs(counts) do
        taxels[i] = new_taxel(64 * count, level)
    end
    return counts, head.timestamp_us, { updates = 1, taxels = taxels }
end

-- Decodes a delta frame against the key frame that it names. Returns the same values.
function Receiver:receive_delta(content, taxel_count, is_key_frame)
    local head, size = fields.unpack("compact_delta", content), protocol.structs.compact_delta.size
    if self.pending and self.pending.id == head.key_frame then -- the board has received the acknowledgement
        self.key_frame, self.pending, self.answer = self.pending, nil, nil
    end
    local key_frame, counts = self.key_frame, nil
    if key_frame and key_frame.id == head.key_frame and #key_frame.taxels == taxel_count then
        counts = decode_counts(key_frame.taxels, content:sub(size + 1))
    end
    if not counts then
        return self:reject_delta()
    end
    local low = fields.read_number(head.timestamp_low, 0, 3)
    local time = (key_frame.timestamp_us + (low - key_frame.timestamp_us) % 16777216) % WORD
    if not is_key_frame then
        if self.pending then
            self:repeat_answer("acknowledge")
        end
        return counts, time
    end
    local gain, taxels = protocol.COMPACT_GAINS[key_frame.updates], {}
    for i, count in ipairs(counts) do
        taxels[i] = update(key_frame.taxels[i], count, gain)
    end
    return counts, time, { updates = min(key_frame.updates + 1, #protocol.COMPACT_GAINS), taxels = taxels }
end

-- Discards both key frames after a delta frame that cannot be decoded, and reports this to the board.
function Receiver:reject_delta()
    if self.key_frame or self.pending then
        self.key_frame, self.pending, self.snapshots_until_repeat = nil, nil, 0
    end
    self:repeat_answer("forget")
    return nil, "no key frame"
end

-- Returns the answer as 3 bytes of an ACKNOWLEDGE payload, which then counts as sent; "" if there is none.
function Receiver:take_answer(address)
    local answer = self.answer
    self.answer = nil
    if answer == "forget" then
        return string.char(address + protocol.ACKNOWLEDGE_FORGET, 0, 0)
    elseif answer then
        return string.char(address, self.pending.id % 256, rshift(self.pending.id, 8))
    end
    return ""
end

return compact
end

package.preload["taxel.decoder"] = function(...)
-- Stream decoder: bytes of the hub in, frames with counts and losses out.
local compact = require("taxel.compact")
local crc32 = require("taxel.crc32")
local fields = require("taxel.fields")
local framing = require("taxel.framing")
local protocol = require("taxel.protocol")

local HEADER_SIZE = protocol.structs.taxel_header.size
local BOARD_CRC_BAD, HUB_RESTARTED, NO_KEY_FRAME = 1, 2, 4
local decoder = { BOARD_CRC_BAD = BOARD_CRC_BAD, HUB_RESTARTED = HUB_RESTARTED, NO_KEY_FRAME = NO_KEY_FRAME }

local Decoder = {}
Decoder.__index = Decoder

-- Creates a decoder without received bytes. losses: frames, lost (on the wire), restarts, unknown (complete frames that
-- this version does not define); boards: by address the counters received, missing (poll cycles), damaged (board CRC)
-- and undecoded (no key frame).
function decoder.new(directions)
    return setmetatable({
        deframer = framing.new_deframer(directions),
        losses = { frames = 0, lost = 0, restarts = 0, unknown = 0 },
        lost_before_unknown = 0,
        boards = {},
    }, Decoder)
end

-- Takes any number of bytes and calls handler(frame) for each frame that they complete. A frame has the fields code,
-- type, sequence, lost_before, flags and payload; a taxel frame also address, cycle, hub_time_us, board_sequence,
-- board_time_us, missing_before and counts (empty if they are not available).
function Decoder:push(data, handler)
    self.deframer:push(data, function(...)
        self:deliver(handler, ...)
    end)
end

-- Decodes the remaining bytes at the end of a stream.
function Decoder:finish(handler)
    self.deframer:finish(function(...)
        self:deliver(handler, ...)
    end)
end

-- Forgets the poll cycles of all boards. To be called when the host sends START: frames of the interrupted poll cycle
-- then do not count as missing.
function Decoder:forget_cycles()
    for _, board in pairs(self.boards) do
        board.cycle = nil
    end
end

-- Returns the addresses of the boards that have sent a frame, in ascending order.
function Decoder:list_addresses()
    local addresses = {}
    for address in pairs(self.boards) do
        addresses[#addresses + 1] = address
    end
    table.sort(addresses)
    return addresses
end

-- Returns the pending acknowledgements as the payload of an ACKNOWLEDGE frame, which the caller has to send.
function Decoder:take_acknowledgements()
    local parts = {}
    for _, address in ipairs(self:list_addresses()) do
        local receiver = self.boards[address].receiver
        if #parts < protocol.ACKNOWLEDGE_MAX and receiver.answer then
            parts[#parts + 1] = receiver:take_answer(address)
        end
    end
    return table.concat(parts)
end

-- Decodes a known frame; counts an unknown one, which takes a number of the sender's sequence and is no loss. A frame of
-- the other direction has the sequence of another sender.
function Decoder:deliver(handler, code, sequence, payload, is_known)
    if is_known then
        handler(self:decode(code, sequence, payload))
        return
    end
    self.losses.unknown = self.losses.unknown + 1
    if framing.is_accepted(code, self.deframer.directions) then
        local lost = self:compute_lost_before(sequence)
        self.lost_before_unknown = (self.lost_before_unknown + lost) % 65536
        self:count_frame(sequence, lost)
    end
end

-- Returns the number of frames that are missing in the sequence before this frame.
function Decoder:compute_lost_before(sequence)
    return self.next_sequence and (sequence - self.next_sequence) % 65536 or 0
end

-- Counts a frame with the number of frames that were lost before it.
function Decoder:count_frame(sequence, lost)
    self.losses.frames = self.losses.frames + 1
    self.losses.lost = self.losses.lost + lost
    self.next_sequence = (sequence + 1) % 65536
end

-- Decodes a frame that this version defines.
function Decoder:decode(code, sequence, payload)
    local frame = { code = code, type = protocol.frames[code].name, sequence = sequence, payload = payload,
        lost_before = 0, flags = 0 }
    self:count_sequence(frame)
    if frame.type == "TAXELS" then
        self:decode_taxels(frame)
    elseif frame.type == "COMPACT_TAXELS" then
        self:decode_compact(frame)
    end
    return frame
end

-- Counts a frame and the frames that were lost before it.
function Decoder:count_sequence(frame)
    local losses = self.losses
    if frame.type == "HUB_HANDSHAKE" and frame.sequence == 0 and fields.unpack("hub_handshake", frame.payload).tag == 0 then
        self:forget_cycles()
        if self.next_sequence then
            frame.flags = HUB_RESTARTED
            losses.restarts = losses.restarts + 1
        end
        self:count_frame(frame.sequence, 0)
    else
        local lost = self:compute_lost_before(frame.sequence)
        frame.lost_before = (lost + self.lost_before_unknown) % 65536
        self:count_frame(frame.sequence, lost)
    end
    self.lost_before_unknown = 0
end

-- Copies the header of a taxel frame to the frame; returns the board and the number of taxels.
function Decoder:read_header(frame)
    local header = fields.unpack("taxel_header", frame.payload)
    frame.address, frame.cycle, frame.hub_time_us = header.address, header.cycle, header.hub_time_us
    frame.counts, frame.board_time_us = {}, 0
    local board = self.boards[header.address]
    if not board then
        board = { received = 0, missing = 0, damaged = 0, undecoded = 0, receiver = compact.new_receiver() }
        self.boards[header.address] = board
    end
    return board, header.taxel_count
end

-- Decodes a TAXELS frame and checks the CRC of its board.
function Decoder:decode_taxels(frame)
    local board, taxel_count = self:read_header(frame)
    local payload = frame.payload
    local snapshot = fields.unpack("snapshot_header", payload, HEADER_SIZE)
    frame.board_sequence, frame.board_time_us = snapshot.sequence, snapshot.timestamp_us
    local offset = HEADER_SIZE + protocol.structs.snapshot_header.size
    for i = 1, taxel_count do
        local low, high = payload:byte(offset + 2 * i - 1, offset + 2 * i)
        frame.counts[i] = low + 256 * high
    end
    local crc = crc32(payload, crc32(payload, 0, 1, 1), HEADER_SIZE + 1, #payload - 4)
    if crc == fields.read_number(payload, #payload - 4, 4) then
        board.received = board.received + 1
    else
        frame.flags = frame.flags + BOARD_CRC_BAD
        board.damaged = board.damaged + 1
    end
    Decoder.count_cycles(board, frame, 0)
end

-- Decodes a COMPACT_TAXELS frame.
function Decoder:decode_compact(frame)
    local board, taxel_count = self:read_header(frame)
    local snapshot = frame.payload:sub(HEADER_SIZE + 1)
    frame.board_sequence = fields.unpack("compact_header", snapshot).sequence
    local counts, result = board.receiver:receive(frame.address, taxel_count, snapshot)
    if counts then
        frame.counts, frame.board_time_us = counts, result
        board.received = board.received + 1
    elseif result == "no key frame" then
        frame.flags = frame.flags + NO_KEY_FRAME
        board.undecoded = board.undecoded + 1
    else
        frame.flags = frame.flags + BOARD_CRC_BAD
        board.damaged = board.damaged + 1
    end
    Decoder.count_cycles(board, frame, 1)
end

-- Counts the frames that are missing since the previous frame of the board. No more can be missing than scans were
-- skipped; a board that is polled while it codes a compact snapshot skips one scan without loss (`coding`).
function Decoder.count_cycles(board, frame, coding)
    frame.missing_before = 0
    if board.cycle then
        local cycles = (frame.cycle - board.cycle) % 65536
        local scans = math.max((frame.board_sequence - board.scan) % 65536 - coding, 0)
        frame.missing_before = math.max(math.min(cycles, scans) - 1, 0)
        board.missing = board.missing + frame.missing_before
    end
    board.cycle, board.scan = frame.cycle, frame.board_sequence
end

return decoder
end

-- Dissector for Wireshark and tshark. A packet contains bytes of the hub's stream in their order (`taxel convert x.bin
-- x.pcapng` writes them with link type USER0); a frame may extend over several packets and is shown in its last packet.
local crc_status = { [0] = "right", [1] = "wrong" }
local decoder = require("taxel.decoder")
local fields = require("taxel.fields")
local framing = require("taxel.framing")
local protocol = require("taxel.protocol")

local proto = Proto("taxel", "Taxel tactile skin")
local pf, info = {}, {}
local FIELD_TYPES = { [1] = ProtoField.uint8, [2] = ProtoField.uint16, [4] = ProtoField.uint32, [8] = ProtoField.uint64 }
-- Enumerations of fields that hold a code, by field name.
local CODES = { reset_cause = "ResetCause", last_fault = "BoardFault", fault = "BoardFault", state = "BoardState",
    status = "ReplyStatus", command = "Command", level = "LogLevel", code = "LogCode" }

local frame_names = {}
for code, rule in pairs(protocol.frames) do
    frame_names[code] = rule.name
end

info.type = ProtoField.uint8("taxel.type", "Type", base.HEX, frame_names)
info.sequence = ProtoField.uint16("taxel.sequence", "Sequence")
info.lost = ProtoField.uint16("taxel.lost", "Frames lost before this frame")
info.flags = ProtoField.uint8("taxel.flags", "Flags", base.HEX)
info.board_crc = ProtoField.uint8("taxel.board_crc", "CRC of the board", base.DEC, crc_status)
info.address = ProtoField.uint8("taxel.address", "Address", base.HEX)
info.missing = ProtoField.uint16("taxel.missing", "Frames of this board missing before this frame")
info.board_time = ProtoField.uint32("taxel.board_time_us", "Time of the board (us)")
info.counts = ProtoField.string("taxel.counts", "Raw counts")
info.tail = ProtoField.bytes("taxel.tail", "Data")
info.text = ProtoField.string("taxel.text", "Text")
info.unknown = ProtoField.uint32("taxel.unknown", "Frames of a newer version")
info.discarded = ProtoField.uint32("taxel.discarded", "Bytes of no frame")

-- Creates one field of Wireshark per field of a struct: taxel.STRUCT.FIELD.
local function register_struct(struct)
    for _, field in ipairs(protocol.structs[struct]) do
        local name = struct .. "." .. field.name
        if not pf[name] then
            local label = field.name:gsub("_", " ")
            if field.is_bytes then
                pf[name] = ProtoField.bytes("taxel." .. name, label)
            elseif CODES[field.name] then
                pf[name] = FIELD_TYPES[field.size]("taxel." .. name, label, base.DEC, protocol.names[CODES[field.name]])
            else
                pf[name] = FIELD_TYPES[field.size]("taxel." .. name, label)
            end
        end
    end
end

local all = {}
for _, rule in pairs(protocol.frames) do
    for _, part in ipairs(rule.parts) do
        register_struct(part.struct)
    end
end
for _, group in ipairs({ pf, info }) do
    for _, field in pairs(group) do
        all[#all + 1] = field
    end
end
proto.fields = all

local lost_expert = ProtoExpert.new("taxel.expert.lost", "Frames were lost before this frame", expert.group.SEQUENCE,
    expert.severity.WARN)
local crc_expert = ProtoExpert.new("taxel.expert.board_crc", "The board's CRC is wrong", expert.group.CHECKSUM,
    expert.severity.ERROR)
local key_expert = ProtoExpert.new("taxel.expert.key_frame", "The key frame of this delta frame is not in the capture",
    expert.group.UNDECODED, expert.severity.NOTE)
local restart_expert = ProtoExpert.new("taxel.expert.restart", "The hub has restarted", expert.group.SEQUENCE,
    expert.severity.NOTE)
local discarded_expert = ProtoExpert.new("taxel.expert.discarded", "Bytes that belong to no frame",
    expert.group.MALFORMED, expert.severity.WARN)
proto.experts = { lost_expert, crc_expert, key_expert, restart_expert, discarded_expert }

-- State of the capture: a decoder for each direction, and the frames of each packet, found in the first pass.
local streams, packets

function proto.init()
    streams, packets = {}, {}
end

-- Returns the frames that end in this packet, and the number of bytes of no frame. Packets are decoded once, in order.
local function decode_packet(number, data, direction)
    if not packets[number] then
        local stream = streams[direction] or decoder.new(direction)
        local before, frames, unknown = stream.deframer.discarded_bytes, {}, stream.losses.unknown
        streams[direction] = stream
        stream:push(data, function(frame)
            if frame.counts then -- as text: a table of numbers takes ten times the memory
                frame.counts = table.concat(frame.counts, ",")
            end
            frames[#frames + 1] = frame
        end)
        packets[number] = { frames = frames, discarded = stream.deframer.discarded_bytes - before,
            unknown = stream.losses.unknown - unknown }
    end
    return packets[number]
end

-- Adds the fields of the structs at the front of a payload; returns the bytes of these structs.
local function add_fields(tree, frame, buffer)
    return fields.visit_payload(frame.code, function(struct, _, field, offset)
        tree:add_le(pf[struct .. "." .. field.name], buffer(offset + field.offset, field.size))
    end)
end

-- Adds the decoded content of a taxel frame.
local function add_taxels(tree, frame)
    tree:add(info.address, frame.address):set_generated()
    tree:add(info.missing, frame.missing_before):set_generated()
    tree:add(info.board_time, frame.board_time_us):set_generated()
    tree:add(info.board_crc, frame.flags % 2):set_generated()
    if frame.counts ~= "" then
        tree:add(info.counts, frame.counts):set_generated()
    end
end

-- Adds the expert information about losses and damage.
local function add_experts(tree, frame)
    if frame.lost_before > 0 then
        tree:add_proto_expert_info(lost_expert, frame.lost_before .. " frames were lost before this frame")
    end
    if frame.flags == decoder.BOARD_CRC_BAD then
        tree:add_proto_expert_info(crc_expert)
    elseif frame.flags == decoder.NO_KEY_FRAME then
        tree:add_proto_expert_info(key_expert)
    elseif frame.flags == decoder.HUB_RESTARTED then
        tree:add_proto_expert_info(restart_expert)
    end
end

-- Returns the text of a frame for the column Info.
local function describe(frame)
    if frame.counts then
        local count = select(2, frame.counts:gsub("%d+", ""))
        return string.format("%s 0x%02X, cycle %d, %d counts", frame.type, frame.address, frame.cycle, count)
    end
    return frame.type
end

-- Adds a frame with all its fields.
local function add_frame(tree, frame)
    local buffer = ByteArray.new(fields.to_hex(frame.payload)):tvb("Payload of " .. frame.type)
    local branch = tree:add(proto, buffer(), "Taxel frame, " .. describe(frame))
    branch:add(info.type, frame.code):set_generated()
    branch:add(info.sequence, frame.sequence):set_generated()
    branch:add(info.lost, frame.lost_before):set_generated()
    branch:add(info.flags, frame.flags):set_generated()
    local size = add_fields(branch, frame, buffer)
    if frame.type == "LOG" then
        branch:add(info.text, buffer(size))
    elseif frame.counts then
        add_taxels(branch, frame)
    elseif size < buffer:len() then
        branch:add(info.tail, buffer(size))
    end
    add_experts(branch, frame)
end

function proto.dissector(buffer, pinfo, tree)
    local direction = pinfo.p2p_dir == P2P_DIR_SENT and framing.TO_HUB or framing.TO_HOST
    local packet = decode_packet(pinfo.number, buffer:raw(), direction)
    local texts = {}
    for i, frame in ipairs(packet.frames) do
        add_frame(tree, frame)
        texts[i] = describe(frame)
    end
    if packet.unknown > 0 then
        local branch = tree:add(proto, buffer(), "Frames that this version does not define: " .. packet.unknown)
        branch:add(info.unknown, packet.unknown):set_generated()
        texts[#texts + 1] = packet.unknown .. " unknown frames"
    end
    if packet.discarded > 0 then
        local branch = tree:add(proto, buffer(), "Bytes that belong to no frame: " .. packet.discarded)
        branch:add(info.discarded, packet.discarded):set_generated()
        branch:add_proto_expert_info(discarded_expert)
        texts[#texts + 1] = packet.discarded .. " bytes of no frame"
    elseif #texts == 0 then
        tree:add(proto, buffer(), "Part of a taxel frame")
        texts[1] = "part of a frame"
    end
    pinfo.cols.protocol = "TAXEL"
    pinfo.cols.info = table.concat(texts, "; ")
    return buffer:len()
end

-- Link type USER0 belongs to no protocol; with other captures, "Decode as" or the table DLT_USER selects this dissector.
DissectorTable.get("wtap_encap"):add(wtap.USER0, proto)
