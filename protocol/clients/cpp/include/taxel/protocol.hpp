/* Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit. */
// clang-format off
#ifndef TAXEL_CLIENT_PROTOCOL_HPP
#define TAXEL_CLIENT_PROTOCOL_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace taxel
{

namespace detail
{

inline void load(const std::uint8_t *bytes, std::uint8_t &value)
{
    value = bytes[0];
}
inline void load(const std::uint8_t *bytes, std::uint16_t &value)
{
    value = static_cast<std::uint16_t>(bytes[0] | bytes[1] << 8);
}
inline void load(const std::uint8_t *bytes, std::uint32_t &value)
{
    value = static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8 |
            static_cast<std::uint32_t>(bytes[2]) << 16 | static_cast<std::uint32_t>(bytes[3]) << 24;
}
inline void load(const std::uint8_t *bytes, std::uint64_t &value)
{
    std::uint32_t low = 0, high = 0;
    load(bytes, low);
    load(bytes + 4, high);
    value = low | static_cast<std::uint64_t>(high) << 32;
}
template <std::size_t N> void load(const std::uint8_t *bytes, std::array<std::uint8_t, N> &value)
{
    std::memcpy(value.data(), bytes, N);
}
template <class Integer> void store(std::uint8_t *bytes, Integer value)
{
    for (std::size_t i = 0; i < sizeof value; i++) {
        bytes[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * i);
    }
}
template <std::size_t N> void store(std::uint8_t *bytes, const std::array<std::uint8_t, N> &value)
{
    std::memcpy(bytes, value.data(), N);
}

} // namespace detail

inline constexpr std::uint32_t PROTOCOL_VERSION = 3;
inline constexpr std::uint32_t PROTOCOL_VERSION_MIN = 1;
inline constexpr std::uint32_t REGISTER_MAP_VERSION = 2;
inline constexpr std::uint32_t REGISTER_MAP_REVISION = 1;
inline constexpr std::uint32_t REGISTER_MAP_VERSION_MIN = 1;
inline constexpr std::uint32_t WHO_AM_I = 84;
inline constexpr std::uint32_t ADDRESS_MIN = 8;
inline constexpr std::uint32_t ADDRESS_MAX = 119;
inline constexpr std::uint32_t LINES_MAX = 16;
inline constexpr std::uint32_t TAXELS_MAX = 240;
inline constexpr std::uint32_t SMBUS_BLOCK = 32;
inline constexpr std::uint32_t CROSSING_MAP_SIZE = 32;
inline constexpr std::uint32_t SNAPSHOT_OVERHEAD = 10;
inline constexpr std::uint32_t COMPACT_OVERHEAD_PACKED = 11;
inline constexpr std::uint32_t COMPACT_OVERHEAD_DELTA = 12;
inline constexpr std::uint32_t COMPACT_TAXELS_MAX = 238;
inline constexpr std::uint32_t COMPACT_SIZE_MAX = 488;
inline constexpr std::uint32_t COMPACT_LENGTH_FINE = 128;
inline constexpr std::uint32_t COMPACT_LENGTH_STEP = 4;
inline constexpr std::uint32_t COMPACT_WIDTH_MASK = 31;
inline constexpr std::uint32_t COMPACT_START_MASK = 96;
inline constexpr std::uint32_t COMPACT_START_SHIFT = 5;
inline constexpr std::uint32_t COMPACT_KEY_FRAME = 128;
inline constexpr std::uint32_t ACKNOWLEDGE_FORGET = 128;
inline constexpr std::uint32_t ACKNOWLEDGE_MAX = 22;
inline constexpr std::uint32_t TRANSFER_MAX = 64;
inline constexpr std::uint32_t BOOTLOADER_KEY = 1414483778;
inline constexpr std::uint32_t LOG_TEXT_MAX = 64;
inline constexpr std::uint32_t FRAME_HEADER_SIZE = 5;
inline constexpr std::uint32_t FRAME_CRC_SIZE = 4;
inline constexpr std::uint32_t PAYLOAD_MAX = 498;
inline constexpr std::uint32_t BODY_MAX = 507;
inline constexpr std::uint32_t ENCODED_MAX = 509;
inline constexpr std::uint32_t WHITENING_SEED = 165;
inline constexpr std::uint32_t WHITENING_FACTOR = 5;
inline constexpr std::uint32_t WHITENING_INCREMENT = 107;
inline constexpr std::uint32_t REGISTER_IDENTITY = 0;
inline constexpr std::uint32_t REGISTER_STATUS = 64;
inline constexpr std::uint32_t REGISTER_CLOCK = 68;
inline constexpr std::uint32_t REGISTER_SETTINGS = 96;
inline constexpr std::uint32_t REGISTER_COMMAND = 112;
inline constexpr std::uint32_t REGISTER_SNAPSHOT = 128;
inline constexpr std::uint32_t REGISTER_SNAPSHOT_LAST = 143;
inline constexpr std::uint32_t REGISTER_FAULT = 144;
inline constexpr std::uint32_t REGISTER_COMPACT = 160;
inline constexpr std::uint32_t COMPACT_FRACTION_BITS = 6;
inline constexpr std::uint32_t COMPACT_MEAN_MAX = 4194303;
inline constexpr std::uint32_t COMPACT_LEVEL_BITS = 10;
inline constexpr std::uint32_t COMPACT_LEVEL_MAX = 1023;
inline constexpr std::uint32_t COMPACT_LEVEL_START = 384;
inline constexpr std::uint32_t COMPACT_LEVEL_START_STEP = 128;
inline constexpr std::uint32_t COMPACT_TOTAL_BITS = 16;
inline constexpr std::uint32_t COMPACT_ESCAPE = 128;
inline constexpr std::uint32_t COMPACT_UNIT = 1024;
inline constexpr std::uint32_t COMPACT_REACH = 8192;
inline constexpr std::uint32_t COMPACT_STEP_BITS = 7;
inline constexpr std::uint32_t COMPACT_JUMP = 6144;
inline constexpr std::uint32_t COMPACT_CLIP = 4096;
inline constexpr std::uint32_t COMPACT_COARSE_OCTAVE = 8;
inline constexpr std::uint32_t COMPACT_MEAN_DEVIATION = 1283;
inline constexpr std::uint32_t COMPACT_LEVEL_STEP = 92;
inline constexpr std::uint16_t COMPACT_MULTIPLIERS[] = {
    256, 235, 215, 197, 181, 166, 152, 140,
};
inline constexpr std::uint16_t COMPACT_GAINS[] = {
    128, 85, 64, 51, 42, 36, 32, 28, 25, 23, 21, 19, 18,
    17, 16,
};
inline constexpr std::uint16_t COMPACT_CUMULATIVE[] = {
    0, 3243, 6435, 9530, 12483, 15258, 17824, 20162, 22258, 24109, 25718, 27095, 28255,
    29218, 30005, 30638, 31139, 31531, 31832, 32060, 32230, 32356, 32447, 32512, 32559, 32591,
    32614, 32630, 32642, 32650, 32656, 32660, 32664, 32666, 32669, 32671, 32673, 32675, 32676,
    32678, 32679, 32681, 32682, 32684, 32685, 32686, 32688, 32689, 32690, 32691, 32692, 32693,
    32694, 32695, 32696, 32697, 32698, 32699, 32699, 32700, 32701, 32702, 32703, 32703, 32704,
};

enum class FrameType : std::uint8_t {
    HUB_HANDSHAKE = 0x01,
    TAXELS = 0x02,
    COMPACT_TAXELS = 0x03,
    HUB_STATUS = 0x08,
    BOARD_STATUS = 0x09,
    BOARD_INFO = 0x0A,
    BOARD_FAULT = 0x0B,
    TIME_SYNC = 0x0C,
    LOG = 0x0D,
    REPLY = 0x0E,
    HOST_HANDSHAKE = 0x81,
    COMMAND = 0x82,
    ACKNOWLEDGE = 0x83,
};
inline const char *to_string(FrameType code)
{
    switch (code) {
    case FrameType::HUB_HANDSHAKE: return "HUB_HANDSHAKE";
    case FrameType::TAXELS: return "TAXELS";
    case FrameType::COMPACT_TAXELS: return "COMPACT_TAXELS";
    case FrameType::HUB_STATUS: return "HUB_STATUS";
    case FrameType::BOARD_STATUS: return "BOARD_STATUS";
    case FrameType::BOARD_INFO: return "BOARD_INFO";
    case FrameType::BOARD_FAULT: return "BOARD_FAULT";
    case FrameType::TIME_SYNC: return "TIME_SYNC";
    case FrameType::LOG: return "LOG";
    case FrameType::REPLY: return "REPLY";
    case FrameType::HOST_HANDSHAKE: return "HOST_HANDSHAKE";
    case FrameType::COMMAND: return "COMMAND";
    case FrameType::ACKNOWLEDGE: return "ACKNOWLEDGE";
    }
    return "?";
}

enum class Command : std::uint8_t {
    START = 0x01,
    STOP = 0x02,
    SET_RATE = 0x03,
    SCAN_BUS = 0x04,
    I2C_TRANSFER = 0x05,
    SET_SCAN_SETTINGS = 0x06,
    REBOOT = 0x07,
    GET_STATUS = 0x08,
    GET_BOARD_INFO = 0x09,
    GET_TIME = 0x0A,
    ENTER_BOOTLOADER = 0x0B,
    GET_FAULT = 0x0C,
};
inline const char *to_string(Command code)
{
    switch (code) {
    case Command::START: return "START";
    case Command::STOP: return "STOP";
    case Command::SET_RATE: return "SET_RATE";
    case Command::SCAN_BUS: return "SCAN_BUS";
    case Command::I2C_TRANSFER: return "I2C_TRANSFER";
    case Command::SET_SCAN_SETTINGS: return "SET_SCAN_SETTINGS";
    case Command::REBOOT: return "REBOOT";
    case Command::GET_STATUS: return "GET_STATUS";
    case Command::GET_BOARD_INFO: return "GET_BOARD_INFO";
    case Command::GET_TIME: return "GET_TIME";
    case Command::ENTER_BOOTLOADER: return "ENTER_BOOTLOADER";
    case Command::GET_FAULT: return "GET_FAULT";
    }
    return "?";
}

enum class StartFlag : std::uint8_t {
    COMPACT = 0x01,
};
inline const char *to_string(StartFlag code)
{
    switch (code) {
    case StartFlag::COMPACT: return "COMPACT";
    }
    return "?";
}

enum class ReplyStatus : std::uint8_t {
    OK = 0x00,
    UNKNOWN_COMMAND = 0x01,
    BAD_ARGUMENTS = 0x02,
    BUSY = 0x03,
    NO_HANDSHAKE = 0x04,
    UNKNOWN_BOARD = 0x05,
    NACK = 0x06,
    TIMEOUT = 0x07,
    BUS_ERROR = 0x08,
    REJECTED_BY_BOARD = 0x09,
};
inline const char *to_string(ReplyStatus code)
{
    switch (code) {
    case ReplyStatus::OK: return "OK";
    case ReplyStatus::UNKNOWN_COMMAND: return "UNKNOWN_COMMAND";
    case ReplyStatus::BAD_ARGUMENTS: return "BAD_ARGUMENTS";
    case ReplyStatus::BUSY: return "BUSY";
    case ReplyStatus::NO_HANDSHAKE: return "NO_HANDSHAKE";
    case ReplyStatus::UNKNOWN_BOARD: return "UNKNOWN_BOARD";
    case ReplyStatus::NACK: return "NACK";
    case ReplyStatus::TIMEOUT: return "TIMEOUT";
    case ReplyStatus::BUS_ERROR: return "BUS_ERROR";
    case ReplyStatus::REJECTED_BY_BOARD: return "REJECTED_BY_BOARD";
    }
    return "?";
}

enum class BoardState : std::uint8_t {
    ABSENT = 0x00,
    IDENTIFYING = 0x01,
    STREAMING = 0x02,
    INCOMPATIBLE = 0x03,
};
inline const char *to_string(BoardState code)
{
    switch (code) {
    case BoardState::ABSENT: return "ABSENT";
    case BoardState::IDENTIFYING: return "IDENTIFYING";
    case BoardState::STREAMING: return "STREAMING";
    case BoardState::INCOMPATIBLE: return "INCOMPATIBLE";
    }
    return "?";
}

enum class BoardFault : std::uint8_t {
    NONE = 0x00,
    NACK = 0x01,
    TIMEOUT = 0x02,
    CRC = 0x03,
    SDA_STUCK = 0x04,
    SCL_STUCK = 0x05,
    ARBITRATION = 0x06,
    NOT_A_TAXEL_BOARD = 0x07,
    MAP_VERSION = 0x08,
    RESTARTED = 0x09,
    TOO_LARGE = 0x0A,
    SETTINGS_REJECTED = 0x0B,
    RECOVERED = 0x0C,
};
inline const char *to_string(BoardFault code)
{
    switch (code) {
    case BoardFault::NONE: return "NONE";
    case BoardFault::NACK: return "NACK";
    case BoardFault::TIMEOUT: return "TIMEOUT";
    case BoardFault::CRC: return "CRC";
    case BoardFault::SDA_STUCK: return "SDA_STUCK";
    case BoardFault::SCL_STUCK: return "SCL_STUCK";
    case BoardFault::ARBITRATION: return "ARBITRATION";
    case BoardFault::NOT_A_TAXEL_BOARD: return "NOT_A_TAXEL_BOARD";
    case BoardFault::MAP_VERSION: return "MAP_VERSION";
    case BoardFault::RESTARTED: return "RESTARTED";
    case BoardFault::TOO_LARGE: return "TOO_LARGE";
    case BoardFault::SETTINGS_REJECTED: return "SETTINGS_REJECTED";
    case BoardFault::RECOVERED: return "RECOVERED";
    }
    return "?";
}

enum class ResetCause : std::uint8_t {
    POWER_ON = 0x00,
    BROWN_OUT = 0x01,
    WATCHDOG = 0x02,
    COMMAND = 0x03,
};
inline const char *to_string(ResetCause code)
{
    switch (code) {
    case ResetCause::POWER_ON: return "POWER_ON";
    case ResetCause::BROWN_OUT: return "BROWN_OUT";
    case ResetCause::WATCHDOG: return "WATCHDOG";
    case ResetCause::COMMAND: return "COMMAND";
    }
    return "?";
}

enum class LogLevel : std::uint8_t {
    DEBUG = 0x00,
    INFO = 0x01,
    WARNING = 0x02,
    ERROR = 0x03,
};
inline const char *to_string(LogLevel code)
{
    switch (code) {
    case LogLevel::DEBUG: return "DEBUG";
    case LogLevel::INFO: return "INFO";
    case LogLevel::WARNING: return "WARNING";
    case LogLevel::ERROR: return "ERROR";
    }
    return "?";
}

enum class LogCode : std::uint8_t {
    BUS_FREE = 0x01,
    SDA_STUCK = 0x02,
    SCL_STUCK = 0x03,
    RECEIVE_OVERRUN = 0x04,
    FRAME_DROPPED = 0x05,
};
inline const char *to_string(LogCode code)
{
    switch (code) {
    case LogCode::BUS_FREE: return "BUS_FREE";
    case LogCode::SDA_STUCK: return "SDA_STUCK";
    case LogCode::SCL_STUCK: return "SCL_STUCK";
    case LogCode::RECEIVE_OVERRUN: return "RECEIVE_OVERRUN";
    case LogCode::FRAME_DROPPED: return "FRAME_DROPPED";
    }
    return "?";
}

enum class BoardCommand : std::uint8_t {
    START_SCAN = 0x01,
    STOP_SCAN = 0x02,
    CLEAR_COUNTERS = 0x03,
    RESTART = 0x04,
    ENTER_BOOTLOADER = 0x05,
};
inline const char *to_string(BoardCommand code)
{
    switch (code) {
    case BoardCommand::START_SCAN: return "START_SCAN";
    case BoardCommand::STOP_SCAN: return "STOP_SCAN";
    case BoardCommand::CLEAR_COUNTERS: return "CLEAR_COUNTERS";
    case BoardCommand::RESTART: return "RESTART";
    case BoardCommand::ENTER_BOOTLOADER: return "ENTER_BOOTLOADER";
    }
    return "?";
}

enum class BoardErrorFlag : std::uint8_t {
    SETTINGS_REJECTED = 0x01,
    COMMAND_REJECTED = 0x02,
    SATURATED = 0x08,
    READ_ONLY_WRITE = 0x10,
    NOT_SCANNING = 0x20,
};
inline const char *to_string(BoardErrorFlag code)
{
    switch (code) {
    case BoardErrorFlag::SETTINGS_REJECTED: return "SETTINGS_REJECTED";
    case BoardErrorFlag::COMMAND_REJECTED: return "COMMAND_REJECTED";
    case BoardErrorFlag::SATURATED: return "SATURATED";
    case BoardErrorFlag::READ_ONLY_WRITE: return "READ_ONLY_WRITE";
    case BoardErrorFlag::NOT_SCANNING: return "NOT_SCANNING";
    }
    return "?";
}

enum class FrontEnd : std::uint8_t {
    CAPSENSE = 0x00,
};
inline const char *to_string(FrontEnd code)
{
    switch (code) {
    case FrontEnd::CAPSENSE: return "CAPSENSE";
    }
    return "?";
}

enum class FaultCode : std::uint8_t {
    NONE = 0x00,
    EXCEPTION = 0x01,
    NOT_SCANNING = 0x02,
};
inline const char *to_string(FaultCode code)
{
    switch (code) {
    case FaultCode::NONE: return "NONE";
    case FaultCode::EXCEPTION: return "EXCEPTION";
    case FaultCode::NOT_SCANNING: return "NOT_SCANNING";
    }
    return "?";
}

struct Identity {
    static constexpr std::size_t size = 58;
    std::uint8_t who_am_i{};
    std::uint8_t map_version{};
    std::uint8_t firmware_major{};
    std::uint8_t firmware_minor{};
    std::uint8_t firmware_patch{};
    std::uint8_t kind{};
    std::uint8_t address{};
    std::uint8_t map_revision{};
    std::array<std::uint8_t, 8> unique_id{};
    std::uint8_t rows{};
    std::uint8_t columns{};
    std::uint16_t taxel_count{};
    std::uint16_t snapshot_size{};
    std::array<std::uint8_t, 32> crossing_map{};
    std::uint32_t crc32{};
    static Identity unpack(const std::uint8_t *bytes)
    {
        Identity value;
        detail::load(bytes + 0, value.who_am_i);
        detail::load(bytes + 1, value.map_version);
        detail::load(bytes + 2, value.firmware_major);
        detail::load(bytes + 3, value.firmware_minor);
        detail::load(bytes + 4, value.firmware_patch);
        detail::load(bytes + 5, value.kind);
        detail::load(bytes + 6, value.address);
        detail::load(bytes + 7, value.map_revision);
        detail::load(bytes + 8, value.unique_id);
        detail::load(bytes + 16, value.rows);
        detail::load(bytes + 17, value.columns);
        detail::load(bytes + 18, value.taxel_count);
        detail::load(bytes + 20, value.snapshot_size);
        detail::load(bytes + 22, value.crossing_map);
        detail::load(bytes + 54, value.crc32);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, who_am_i);
        detail::store(bytes + 1, map_version);
        detail::store(bytes + 2, firmware_major);
        detail::store(bytes + 3, firmware_minor);
        detail::store(bytes + 4, firmware_patch);
        detail::store(bytes + 5, kind);
        detail::store(bytes + 6, address);
        detail::store(bytes + 7, map_revision);
        detail::store(bytes + 8, unique_id);
        detail::store(bytes + 16, rows);
        detail::store(bytes + 17, columns);
        detail::store(bytes + 18, taxel_count);
        detail::store(bytes + 20, snapshot_size);
        detail::store(bytes + 22, crossing_map);
        detail::store(bytes + 54, crc32);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("who_am_i", who_am_i);
        visitor("map_version", map_version);
        visitor("firmware_major", firmware_major);
        visitor("firmware_minor", firmware_minor);
        visitor("firmware_patch", firmware_patch);
        visitor("kind", kind);
        visitor("address", address);
        visitor("map_revision", map_revision);
        visitor("unique_id", unique_id);
        visitor("rows", rows);
        visitor("columns", columns);
        visitor("taxel_count", taxel_count);
        visitor("snapshot_size", snapshot_size);
        visitor("crossing_map", crossing_map);
        visitor("crc32", crc32);
    }
};

struct Status {
    static constexpr std::size_t size = 28;
    std::uint8_t state{};
    std::uint8_t error_flags{};
    std::uint8_t reset_cause{};
    std::uint8_t settings_generation{};
    std::uint32_t clock_us{};
    std::uint32_t scans{};
    std::uint32_t scan_time_us{};
    std::uint32_t snapshot_reads{};
    std::uint16_t bus_errors{};
    std::uint16_t rejected_writes{};
    std::uint8_t front_end{};
    std::uint8_t reserved{};
    std::uint16_t saturated_conversions{};
    static Status unpack(const std::uint8_t *bytes)
    {
        Status value;
        detail::load(bytes + 0, value.state);
        detail::load(bytes + 1, value.error_flags);
        detail::load(bytes + 2, value.reset_cause);
        detail::load(bytes + 3, value.settings_generation);
        detail::load(bytes + 4, value.clock_us);
        detail::load(bytes + 8, value.scans);
        detail::load(bytes + 12, value.scan_time_us);
        detail::load(bytes + 16, value.snapshot_reads);
        detail::load(bytes + 20, value.bus_errors);
        detail::load(bytes + 22, value.rejected_writes);
        detail::load(bytes + 24, value.front_end);
        detail::load(bytes + 25, value.reserved);
        detail::load(bytes + 26, value.saturated_conversions);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, state);
        detail::store(bytes + 1, error_flags);
        detail::store(bytes + 2, reset_cause);
        detail::store(bytes + 3, settings_generation);
        detail::store(bytes + 4, clock_us);
        detail::store(bytes + 8, scans);
        detail::store(bytes + 12, scan_time_us);
        detail::store(bytes + 16, snapshot_reads);
        detail::store(bytes + 20, bus_errors);
        detail::store(bytes + 22, rejected_writes);
        detail::store(bytes + 24, front_end);
        detail::store(bytes + 25, reserved);
        detail::store(bytes + 26, saturated_conversions);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("state", state);
        visitor("error_flags", error_flags);
        visitor("reset_cause", reset_cause);
        visitor("settings_generation", settings_generation);
        visitor("clock_us", clock_us);
        visitor("scans", scans);
        visitor("scan_time_us", scan_time_us);
        visitor("snapshot_reads", snapshot_reads);
        visitor("bus_errors", bus_errors);
        visitor("rejected_writes", rejected_writes);
        visitor("front_end", front_end);
        visitor("reserved", reserved);
        visitor("saturated_conversions", saturated_conversions);
    }
};

struct ScanSettings {
    static constexpr std::size_t size = 8;
    std::uint16_t sub_conversions{};
    std::uint16_t sense_clock_divider{};
    std::uint8_t modulator_clock_divider{};
    std::uint8_t idac_code{};
    std::uint16_t settle_cycles{};
    static ScanSettings unpack(const std::uint8_t *bytes)
    {
        ScanSettings value;
        detail::load(bytes + 0, value.sub_conversions);
        detail::load(bytes + 2, value.sense_clock_divider);
        detail::load(bytes + 4, value.modulator_clock_divider);
        detail::load(bytes + 5, value.idac_code);
        detail::load(bytes + 6, value.settle_cycles);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, sub_conversions);
        detail::store(bytes + 2, sense_clock_divider);
        detail::store(bytes + 4, modulator_clock_divider);
        detail::store(bytes + 5, idac_code);
        detail::store(bytes + 6, settle_cycles);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("sub_conversions", sub_conversions);
        visitor("sense_clock_divider", sense_clock_divider);
        visitor("modulator_clock_divider", modulator_clock_divider);
        visitor("idac_code", idac_code);
        visitor("settle_cycles", settle_cycles);
    }
};

struct SettingsRegister {
    static constexpr std::size_t size = 12;
    std::uint16_t settings_sub_conversions{};
    std::uint16_t settings_sense_clock_divider{};
    std::uint8_t settings_modulator_clock_divider{};
    std::uint8_t settings_idac_code{};
    std::uint16_t settings_settle_cycles{};
    std::uint32_t crc32{};
    static SettingsRegister unpack(const std::uint8_t *bytes)
    {
        SettingsRegister value;
        detail::load(bytes + 0, value.settings_sub_conversions);
        detail::load(bytes + 2, value.settings_sense_clock_divider);
        detail::load(bytes + 4, value.settings_modulator_clock_divider);
        detail::load(bytes + 5, value.settings_idac_code);
        detail::load(bytes + 6, value.settings_settle_cycles);
        detail::load(bytes + 8, value.crc32);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, settings_sub_conversions);
        detail::store(bytes + 2, settings_sense_clock_divider);
        detail::store(bytes + 4, settings_modulator_clock_divider);
        detail::store(bytes + 5, settings_idac_code);
        detail::store(bytes + 6, settings_settle_cycles);
        detail::store(bytes + 8, crc32);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("settings_sub_conversions", settings_sub_conversions);
        visitor("settings_sense_clock_divider", settings_sense_clock_divider);
        visitor("settings_modulator_clock_divider", settings_modulator_clock_divider);
        visitor("settings_idac_code", settings_idac_code);
        visitor("settings_settle_cycles", settings_settle_cycles);
        visitor("crc32", crc32);
    }
};

struct CommandRegister {
    static constexpr std::size_t size = 2;
    std::uint8_t command{};
    std::uint8_t complement{};
    static CommandRegister unpack(const std::uint8_t *bytes)
    {
        CommandRegister value;
        detail::load(bytes + 0, value.command);
        detail::load(bytes + 1, value.complement);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, command);
        detail::store(bytes + 1, complement);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("command", command);
        visitor("complement", complement);
    }
};

struct EnterBootloaderRegister {
    static constexpr std::size_t size = 6;
    std::uint8_t command{};
    std::uint8_t complement{};
    std::uint32_t key{};
    static EnterBootloaderRegister unpack(const std::uint8_t *bytes)
    {
        EnterBootloaderRegister value;
        detail::load(bytes + 0, value.command);
        detail::load(bytes + 1, value.complement);
        detail::load(bytes + 2, value.key);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, command);
        detail::store(bytes + 1, complement);
        detail::store(bytes + 2, key);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("command", command);
        visitor("complement", complement);
        visitor("key", key);
    }
};

struct FaultRecord {
    static constexpr std::size_t size = 12;
    std::uint8_t code{};
    std::uint8_t exception{};
    std::uint16_t count{};
    std::uint32_t program_counter{};
    std::uint32_t link_register{};
    static FaultRecord unpack(const std::uint8_t *bytes)
    {
        FaultRecord value;
        detail::load(bytes + 0, value.code);
        detail::load(bytes + 1, value.exception);
        detail::load(bytes + 2, value.count);
        detail::load(bytes + 4, value.program_counter);
        detail::load(bytes + 8, value.link_register);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, code);
        detail::store(bytes + 1, exception);
        detail::store(bytes + 2, count);
        detail::store(bytes + 4, program_counter);
        detail::store(bytes + 8, link_register);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("code", code);
        visitor("exception", exception);
        visitor("count", count);
        visitor("program_counter", program_counter);
        visitor("link_register", link_register);
    }
};

struct FaultRegister {
    static constexpr std::size_t size = 16;
    std::uint8_t record_code{};
    std::uint8_t record_exception{};
    std::uint16_t record_count{};
    std::uint32_t record_program_counter{};
    std::uint32_t record_link_register{};
    std::uint32_t crc32{};
    static FaultRegister unpack(const std::uint8_t *bytes)
    {
        FaultRegister value;
        detail::load(bytes + 0, value.record_code);
        detail::load(bytes + 1, value.record_exception);
        detail::load(bytes + 2, value.record_count);
        detail::load(bytes + 4, value.record_program_counter);
        detail::load(bytes + 8, value.record_link_register);
        detail::load(bytes + 12, value.crc32);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, record_code);
        detail::store(bytes + 1, record_exception);
        detail::store(bytes + 2, record_count);
        detail::store(bytes + 4, record_program_counter);
        detail::store(bytes + 8, record_link_register);
        detail::store(bytes + 12, crc32);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("record_code", record_code);
        visitor("record_exception", record_exception);
        visitor("record_count", record_count);
        visitor("record_program_counter", record_program_counter);
        visitor("record_link_register", record_link_register);
        visitor("crc32", crc32);
    }
};

struct SnapshotHeader {
    static constexpr std::size_t size = 6;
    std::uint16_t sequence{};
    std::uint32_t timestamp_us{};
    static SnapshotHeader unpack(const std::uint8_t *bytes)
    {
        SnapshotHeader value;
        detail::load(bytes + 0, value.sequence);
        detail::load(bytes + 2, value.timestamp_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, sequence);
        detail::store(bytes + 2, timestamp_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("sequence", sequence);
        visitor("timestamp_us", timestamp_us);
    }
};

struct CompactHeader {
    static constexpr std::size_t size = 3;
    std::uint16_t sequence{};
    std::uint8_t format{};
    static CompactHeader unpack(const std::uint8_t *bytes)
    {
        CompactHeader value;
        detail::load(bytes + 0, value.sequence);
        detail::load(bytes + 2, value.format);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, sequence);
        detail::store(bytes + 2, format);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("sequence", sequence);
        visitor("format", format);
    }
};

struct CompactPacked {
    static constexpr std::size_t size = 7;
    std::uint16_t sequence{};
    std::uint8_t format{};
    std::uint32_t timestamp_us{};
    static CompactPacked unpack(const std::uint8_t *bytes)
    {
        CompactPacked value;
        detail::load(bytes + 0, value.sequence);
        detail::load(bytes + 2, value.format);
        detail::load(bytes + 3, value.timestamp_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, sequence);
        detail::store(bytes + 2, format);
        detail::store(bytes + 3, timestamp_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("sequence", sequence);
        visitor("format", format);
        visitor("timestamp_us", timestamp_us);
    }
};

struct CompactDelta {
    static constexpr std::size_t size = 8;
    std::uint16_t sequence{};
    std::uint8_t format{};
    std::uint16_t key_frame{};
    std::array<std::uint8_t, 3> timestamp_low{};
    static CompactDelta unpack(const std::uint8_t *bytes)
    {
        CompactDelta value;
        detail::load(bytes + 0, value.sequence);
        detail::load(bytes + 2, value.format);
        detail::load(bytes + 3, value.key_frame);
        detail::load(bytes + 5, value.timestamp_low);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, sequence);
        detail::store(bytes + 2, format);
        detail::store(bytes + 3, key_frame);
        detail::store(bytes + 5, timestamp_low);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("sequence", sequence);
        visitor("format", format);
        visitor("key_frame", key_frame);
        visitor("timestamp_low", timestamp_low);
    }
};

struct CompactAcknowledge {
    static constexpr std::size_t size = 2;
    std::uint16_t key_frame{};
    static CompactAcknowledge unpack(const std::uint8_t *bytes)
    {
        CompactAcknowledge value;
        detail::load(bytes + 0, value.key_frame);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, key_frame);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("key_frame", key_frame);
    }
};

struct HostHandshake {
    static constexpr std::size_t size = 3;
    std::uint8_t tag{};
    std::uint8_t version_min{};
    std::uint8_t version_max{};
    static HostHandshake unpack(const std::uint8_t *bytes)
    {
        HostHandshake value;
        detail::load(bytes + 0, value.tag);
        detail::load(bytes + 1, value.version_min);
        detail::load(bytes + 2, value.version_max);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, tag);
        detail::store(bytes + 1, version_min);
        detail::store(bytes + 2, version_max);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("tag", tag);
        visitor("version_min", version_min);
        visitor("version_max", version_max);
    }
};

struct HubHandshake {
    static constexpr std::size_t size = 24;
    std::uint8_t tag{};
    std::uint8_t version_min{};
    std::uint8_t version_max{};
    std::uint8_t version_chosen{};
    std::uint8_t reset_cause{};
    std::uint8_t firmware_major{};
    std::uint8_t firmware_minor{};
    std::uint8_t firmware_patch{};
    std::array<std::uint8_t, 8> unique_id{};
    std::uint64_t uptime_us{};
    static HubHandshake unpack(const std::uint8_t *bytes)
    {
        HubHandshake value;
        detail::load(bytes + 0, value.tag);
        detail::load(bytes + 1, value.version_min);
        detail::load(bytes + 2, value.version_max);
        detail::load(bytes + 3, value.version_chosen);
        detail::load(bytes + 4, value.reset_cause);
        detail::load(bytes + 5, value.firmware_major);
        detail::load(bytes + 6, value.firmware_minor);
        detail::load(bytes + 7, value.firmware_patch);
        detail::load(bytes + 8, value.unique_id);
        detail::load(bytes + 16, value.uptime_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, tag);
        detail::store(bytes + 1, version_min);
        detail::store(bytes + 2, version_max);
        detail::store(bytes + 3, version_chosen);
        detail::store(bytes + 4, reset_cause);
        detail::store(bytes + 5, firmware_major);
        detail::store(bytes + 6, firmware_minor);
        detail::store(bytes + 7, firmware_patch);
        detail::store(bytes + 8, unique_id);
        detail::store(bytes + 16, uptime_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("tag", tag);
        visitor("version_min", version_min);
        visitor("version_max", version_max);
        visitor("version_chosen", version_chosen);
        visitor("reset_cause", reset_cause);
        visitor("firmware_major", firmware_major);
        visitor("firmware_minor", firmware_minor);
        visitor("firmware_patch", firmware_patch);
        visitor("unique_id", unique_id);
        visitor("uptime_us", uptime_us);
    }
};

struct TaxelHeader {
    static constexpr std::size_t size = 8;
    std::uint8_t address{};
    std::uint8_t taxel_count{};
    std::uint16_t cycle{};
    std::uint32_t hub_time_us{};
    static TaxelHeader unpack(const std::uint8_t *bytes)
    {
        TaxelHeader value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.taxel_count);
        detail::load(bytes + 2, value.cycle);
        detail::load(bytes + 4, value.hub_time_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, taxel_count);
        detail::store(bytes + 2, cycle);
        detail::store(bytes + 4, hub_time_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("taxel_count", taxel_count);
        visitor("cycle", cycle);
        visitor("hub_time_us", hub_time_us);
    }
};

struct HubStatus {
    static constexpr std::size_t size = 42;
    std::uint64_t uptime_us{};
    std::uint32_t cycles{};
    std::uint32_t cycle_time_us{};
    std::uint32_t frames_sent{};
    std::uint32_t bytes_sent{};
    std::uint32_t frames_dropped{};
    std::uint32_t commands{};
    std::uint32_t commands_rejected{};
    std::uint32_t bus_recoveries{};
    std::uint8_t boards_streaming{};
    std::uint8_t streaming{};
    static HubStatus unpack(const std::uint8_t *bytes)
    {
        HubStatus value;
        detail::load(bytes + 0, value.uptime_us);
        detail::load(bytes + 8, value.cycles);
        detail::load(bytes + 12, value.cycle_time_us);
        detail::load(bytes + 16, value.frames_sent);
        detail::load(bytes + 20, value.bytes_sent);
        detail::load(bytes + 24, value.frames_dropped);
        detail::load(bytes + 28, value.commands);
        detail::load(bytes + 32, value.commands_rejected);
        detail::load(bytes + 36, value.bus_recoveries);
        detail::load(bytes + 40, value.boards_streaming);
        detail::load(bytes + 41, value.streaming);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, uptime_us);
        detail::store(bytes + 8, cycles);
        detail::store(bytes + 12, cycle_time_us);
        detail::store(bytes + 16, frames_sent);
        detail::store(bytes + 20, bytes_sent);
        detail::store(bytes + 24, frames_dropped);
        detail::store(bytes + 28, commands);
        detail::store(bytes + 32, commands_rejected);
        detail::store(bytes + 36, bus_recoveries);
        detail::store(bytes + 40, boards_streaming);
        detail::store(bytes + 41, streaming);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("uptime_us", uptime_us);
        visitor("cycles", cycles);
        visitor("cycle_time_us", cycle_time_us);
        visitor("frames_sent", frames_sent);
        visitor("bytes_sent", bytes_sent);
        visitor("frames_dropped", frames_dropped);
        visitor("commands", commands);
        visitor("commands_rejected", commands_rejected);
        visitor("bus_recoveries", bus_recoveries);
        visitor("boards_streaming", boards_streaming);
        visitor("streaming", streaming);
    }
};

struct BoardStatus {
    static constexpr std::size_t size = 39;
    std::uint8_t address{};
    std::uint8_t state{};
    std::uint8_t last_fault{};
    std::uint32_t polls{};
    std::uint32_t forwarded{};
    std::uint32_t repeated{};
    std::uint32_t nacks{};
    std::uint32_t timeouts{};
    std::uint32_t crc_errors{};
    std::uint32_t bus_errors{};
    std::uint32_t dropped{};
    std::uint32_t retries{};
    static BoardStatus unpack(const std::uint8_t *bytes)
    {
        BoardStatus value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.state);
        detail::load(bytes + 2, value.last_fault);
        detail::load(bytes + 3, value.polls);
        detail::load(bytes + 7, value.forwarded);
        detail::load(bytes + 11, value.repeated);
        detail::load(bytes + 15, value.nacks);
        detail::load(bytes + 19, value.timeouts);
        detail::load(bytes + 23, value.crc_errors);
        detail::load(bytes + 27, value.bus_errors);
        detail::load(bytes + 31, value.dropped);
        detail::load(bytes + 35, value.retries);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, state);
        detail::store(bytes + 2, last_fault);
        detail::store(bytes + 3, polls);
        detail::store(bytes + 7, forwarded);
        detail::store(bytes + 11, repeated);
        detail::store(bytes + 15, nacks);
        detail::store(bytes + 19, timeouts);
        detail::store(bytes + 23, crc_errors);
        detail::store(bytes + 27, bus_errors);
        detail::store(bytes + 31, dropped);
        detail::store(bytes + 35, retries);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("state", state);
        visitor("last_fault", last_fault);
        visitor("polls", polls);
        visitor("forwarded", forwarded);
        visitor("repeated", repeated);
        visitor("nacks", nacks);
        visitor("timeouts", timeouts);
        visitor("crc_errors", crc_errors);
        visitor("bus_errors", bus_errors);
        visitor("dropped", dropped);
        visitor("retries", retries);
    }
};

struct BoardInfo {
    static constexpr std::size_t size = 66;
    std::uint8_t identity_who_am_i{};
    std::uint8_t identity_map_version{};
    std::uint8_t identity_firmware_major{};
    std::uint8_t identity_firmware_minor{};
    std::uint8_t identity_firmware_patch{};
    std::uint8_t identity_kind{};
    std::uint8_t identity_address{};
    std::uint8_t identity_map_revision{};
    std::array<std::uint8_t, 8> identity_unique_id{};
    std::uint8_t identity_rows{};
    std::uint8_t identity_columns{};
    std::uint16_t identity_taxel_count{};
    std::uint16_t identity_snapshot_size{};
    std::array<std::uint8_t, 32> identity_crossing_map{};
    std::uint32_t identity_crc32{};
    std::uint16_t settings_sub_conversions{};
    std::uint16_t settings_sense_clock_divider{};
    std::uint8_t settings_modulator_clock_divider{};
    std::uint8_t settings_idac_code{};
    std::uint16_t settings_settle_cycles{};
    static BoardInfo unpack(const std::uint8_t *bytes)
    {
        BoardInfo value;
        detail::load(bytes + 0, value.identity_who_am_i);
        detail::load(bytes + 1, value.identity_map_version);
        detail::load(bytes + 2, value.identity_firmware_major);
        detail::load(bytes + 3, value.identity_firmware_minor);
        detail::load(bytes + 4, value.identity_firmware_patch);
        detail::load(bytes + 5, value.identity_kind);
        detail::load(bytes + 6, value.identity_address);
        detail::load(bytes + 7, value.identity_map_revision);
        detail::load(bytes + 8, value.identity_unique_id);
        detail::load(bytes + 16, value.identity_rows);
        detail::load(bytes + 17, value.identity_columns);
        detail::load(bytes + 18, value.identity_taxel_count);
        detail::load(bytes + 20, value.identity_snapshot_size);
        detail::load(bytes + 22, value.identity_crossing_map);
        detail::load(bytes + 54, value.identity_crc32);
        detail::load(bytes + 58, value.settings_sub_conversions);
        detail::load(bytes + 60, value.settings_sense_clock_divider);
        detail::load(bytes + 62, value.settings_modulator_clock_divider);
        detail::load(bytes + 63, value.settings_idac_code);
        detail::load(bytes + 64, value.settings_settle_cycles);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, identity_who_am_i);
        detail::store(bytes + 1, identity_map_version);
        detail::store(bytes + 2, identity_firmware_major);
        detail::store(bytes + 3, identity_firmware_minor);
        detail::store(bytes + 4, identity_firmware_patch);
        detail::store(bytes + 5, identity_kind);
        detail::store(bytes + 6, identity_address);
        detail::store(bytes + 7, identity_map_revision);
        detail::store(bytes + 8, identity_unique_id);
        detail::store(bytes + 16, identity_rows);
        detail::store(bytes + 17, identity_columns);
        detail::store(bytes + 18, identity_taxel_count);
        detail::store(bytes + 20, identity_snapshot_size);
        detail::store(bytes + 22, identity_crossing_map);
        detail::store(bytes + 54, identity_crc32);
        detail::store(bytes + 58, settings_sub_conversions);
        detail::store(bytes + 60, settings_sense_clock_divider);
        detail::store(bytes + 62, settings_modulator_clock_divider);
        detail::store(bytes + 63, settings_idac_code);
        detail::store(bytes + 64, settings_settle_cycles);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("identity_who_am_i", identity_who_am_i);
        visitor("identity_map_version", identity_map_version);
        visitor("identity_firmware_major", identity_firmware_major);
        visitor("identity_firmware_minor", identity_firmware_minor);
        visitor("identity_firmware_patch", identity_firmware_patch);
        visitor("identity_kind", identity_kind);
        visitor("identity_address", identity_address);
        visitor("identity_map_revision", identity_map_revision);
        visitor("identity_unique_id", identity_unique_id);
        visitor("identity_rows", identity_rows);
        visitor("identity_columns", identity_columns);
        visitor("identity_taxel_count", identity_taxel_count);
        visitor("identity_snapshot_size", identity_snapshot_size);
        visitor("identity_crossing_map", identity_crossing_map);
        visitor("identity_crc32", identity_crc32);
        visitor("settings_sub_conversions", settings_sub_conversions);
        visitor("settings_sense_clock_divider", settings_sense_clock_divider);
        visitor("settings_modulator_clock_divider", settings_modulator_clock_divider);
        visitor("settings_idac_code", settings_idac_code);
        visitor("settings_settle_cycles", settings_settle_cycles);
    }
};

struct BoardFaultReport {
    static constexpr std::size_t size = 10;
    std::uint8_t address{};
    std::uint8_t fault{};
    std::uint16_t cycle{};
    std::uint32_t hub_time_us{};
    std::uint16_t consecutive{};
    static BoardFaultReport unpack(const std::uint8_t *bytes)
    {
        BoardFaultReport value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.fault);
        detail::load(bytes + 2, value.cycle);
        detail::load(bytes + 4, value.hub_time_us);
        detail::load(bytes + 8, value.consecutive);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, fault);
        detail::store(bytes + 2, cycle);
        detail::store(bytes + 4, hub_time_us);
        detail::store(bytes + 8, consecutive);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("fault", fault);
        visitor("cycle", cycle);
        visitor("hub_time_us", hub_time_us);
        visitor("consecutive", consecutive);
    }
};

struct TimeSync {
    static constexpr std::size_t size = 13;
    std::uint8_t address{};
    std::uint32_t board_time_us{};
    std::uint64_t hub_time_us{};
    static TimeSync unpack(const std::uint8_t *bytes)
    {
        TimeSync value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.board_time_us);
        detail::load(bytes + 5, value.hub_time_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, board_time_us);
        detail::store(bytes + 5, hub_time_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("board_time_us", board_time_us);
        visitor("hub_time_us", hub_time_us);
    }
};

struct LogHeader {
    static constexpr std::size_t size = 7;
    std::uint8_t level{};
    std::uint16_t code{};
    std::uint32_t hub_time_us{};
    static LogHeader unpack(const std::uint8_t *bytes)
    {
        LogHeader value;
        detail::load(bytes + 0, value.level);
        detail::load(bytes + 1, value.code);
        detail::load(bytes + 3, value.hub_time_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, level);
        detail::store(bytes + 1, code);
        detail::store(bytes + 3, hub_time_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("level", level);
        visitor("code", code);
        visitor("hub_time_us", hub_time_us);
    }
};

struct ReplyHeader {
    static constexpr std::size_t size = 3;
    std::uint8_t tag{};
    std::uint8_t command{};
    std::uint8_t status{};
    static ReplyHeader unpack(const std::uint8_t *bytes)
    {
        ReplyHeader value;
        detail::load(bytes + 0, value.tag);
        detail::load(bytes + 1, value.command);
        detail::load(bytes + 2, value.status);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, tag);
        detail::store(bytes + 1, command);
        detail::store(bytes + 2, status);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("tag", tag);
        visitor("command", command);
        visitor("status", status);
    }
};

struct CommandHeader {
    static constexpr std::size_t size = 2;
    std::uint8_t tag{};
    std::uint8_t command{};
    static CommandHeader unpack(const std::uint8_t *bytes)
    {
        CommandHeader value;
        detail::load(bytes + 0, value.tag);
        detail::load(bytes + 1, value.command);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, tag);
        detail::store(bytes + 1, command);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("tag", tag);
        visitor("command", command);
    }
};

struct Acknowledgement {
    static constexpr std::size_t size = 3;
    std::uint8_t address{};
    std::uint16_t key_frame{};
    static Acknowledgement unpack(const std::uint8_t *bytes)
    {
        Acknowledgement value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.key_frame);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, key_frame);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("key_frame", key_frame);
    }
};

struct StartArguments {
    static constexpr std::size_t size = 1;
    std::uint8_t flags{};
    static StartArguments unpack(const std::uint8_t *bytes)
    {
        StartArguments value;
        detail::load(bytes + 0, value.flags);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, flags);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("flags", flags);
    }
};

struct SetRateArguments {
    static constexpr std::size_t size = 4;
    std::uint32_t period_us{};
    static SetRateArguments unpack(const std::uint8_t *bytes)
    {
        SetRateArguments value;
        detail::load(bytes + 0, value.period_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, period_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("period_us", period_us);
    }
};

struct EnterBootloaderArguments {
    static constexpr std::size_t size = 4;
    std::uint32_t key{};
    static EnterBootloaderArguments unpack(const std::uint8_t *bytes)
    {
        EnterBootloaderArguments value;
        detail::load(bytes + 0, value.key);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, key);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("key", key);
    }
};

struct TransferArguments {
    static constexpr std::size_t size = 2;
    std::uint8_t address{};
    std::uint8_t read_length{};
    static TransferArguments unpack(const std::uint8_t *bytes)
    {
        TransferArguments value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.read_length);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, read_length);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("read_length", read_length);
    }
};

struct SetScanSettingsArguments {
    static constexpr std::size_t size = 10;
    std::uint8_t address{};
    std::uint16_t settings_sub_conversions{};
    std::uint16_t settings_sense_clock_divider{};
    std::uint8_t settings_modulator_clock_divider{};
    std::uint8_t settings_idac_code{};
    std::uint16_t settings_settle_cycles{};
    std::uint8_t front_end{};
    static SetScanSettingsArguments unpack(const std::uint8_t *bytes)
    {
        SetScanSettingsArguments value;
        detail::load(bytes + 0, value.address);
        detail::load(bytes + 1, value.settings_sub_conversions);
        detail::load(bytes + 3, value.settings_sense_clock_divider);
        detail::load(bytes + 5, value.settings_modulator_clock_divider);
        detail::load(bytes + 6, value.settings_idac_code);
        detail::load(bytes + 7, value.settings_settle_cycles);
        detail::load(bytes + 9, value.front_end);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
        detail::store(bytes + 1, settings_sub_conversions);
        detail::store(bytes + 3, settings_sense_clock_divider);
        detail::store(bytes + 5, settings_modulator_clock_divider);
        detail::store(bytes + 6, settings_idac_code);
        detail::store(bytes + 7, settings_settle_cycles);
        detail::store(bytes + 9, front_end);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
        visitor("settings_sub_conversions", settings_sub_conversions);
        visitor("settings_sense_clock_divider", settings_sense_clock_divider);
        visitor("settings_modulator_clock_divider", settings_modulator_clock_divider);
        visitor("settings_idac_code", settings_idac_code);
        visitor("settings_settle_cycles", settings_settle_cycles);
        visitor("front_end", front_end);
    }
};

struct GetBoardInfoArguments {
    static constexpr std::size_t size = 1;
    std::uint8_t address{};
    static GetBoardInfoArguments unpack(const std::uint8_t *bytes)
    {
        GetBoardInfoArguments value;
        detail::load(bytes + 0, value.address);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, address);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("address", address);
    }
};

struct GetTimeReply {
    static constexpr std::size_t size = 8;
    std::uint64_t hub_time_us{};
    static GetTimeReply unpack(const std::uint8_t *bytes)
    {
        GetTimeReply value;
        detail::load(bytes + 0, value.hub_time_us);
        return value;
    }
    void pack(std::uint8_t *bytes) const
    {
        detail::store(bytes + 0, hub_time_us);
    }
    /* Calls visitor(name, value) for each field. */
    template <class Visitor> void visit(Visitor &&visitor) const
    {
        visitor("hub_time_us", hub_time_us);
    }
};

/* Payloads that a frame type allows; has_address: the payload begins with the address of a board. */
struct FrameRule {
    FrameType type;
    bool has_address;
    std::uint16_t minimum;
    std::uint16_t maximum;
};
inline constexpr FrameRule frame_rules[] = {
    {FrameType::HUB_HANDSHAKE, false, 24, 24},
    {FrameType::TAXELS, true, 20, 498},
    {FrameType::COMPACT_TAXELS, true, 20, 496},
    {FrameType::HUB_STATUS, false, 42, 42},
    {FrameType::BOARD_STATUS, true, 39, 39},
    {FrameType::BOARD_INFO, false, 66, 66},
    {FrameType::BOARD_FAULT, true, 10, 10},
    {FrameType::TIME_SYNC, true, 13, 13},
    {FrameType::LOG, false, 7, 71},
    {FrameType::REPLY, false, 3, 131},
    {FrameType::HOST_HANDSHAKE, false, 3, 3},
    {FrameType::COMMAND, false, 2, 68},
    {FrameType::ACKNOWLEDGE, false, 3, 66},
};

/* Calls visitor(prefix, value) for each struct at the front of a payload, in order, and returns the number
 * of bytes of these structs. `payload` has a length that the frame type allows. */
template <class Visitor>
std::size_t visit_payload(FrameType type, const std::uint8_t *payload, Visitor &&visitor)
{
    (void)payload;
    (void)visitor;
    switch (type) {
    case FrameType::HUB_HANDSHAKE:
        visitor("", HubHandshake::unpack(payload + 0));
        return 24;
    case FrameType::TAXELS:
        visitor("header_", TaxelHeader::unpack(payload + 0));
        visitor("snapshot_header_", SnapshotHeader::unpack(payload + 8));
        return 14;
    case FrameType::COMPACT_TAXELS:
        visitor("header_", TaxelHeader::unpack(payload + 0));
        visitor("snapshot_", CompactHeader::unpack(payload + 8));
        return 11;
    case FrameType::HUB_STATUS:
        visitor("", HubStatus::unpack(payload + 0));
        return 42;
    case FrameType::BOARD_STATUS:
        visitor("", BoardStatus::unpack(payload + 0));
        return 39;
    case FrameType::BOARD_INFO:
        visitor("", BoardInfo::unpack(payload + 0));
        return 66;
    case FrameType::BOARD_FAULT:
        visitor("", BoardFaultReport::unpack(payload + 0));
        return 10;
    case FrameType::TIME_SYNC:
        visitor("", TimeSync::unpack(payload + 0));
        return 13;
    case FrameType::LOG:
        visitor("", LogHeader::unpack(payload + 0));
        return 7;
    case FrameType::REPLY:
        visitor("", ReplyHeader::unpack(payload + 0));
        return 3;
    case FrameType::HOST_HANDSHAKE:
        visitor("", HostHandshake::unpack(payload + 0));
        return 3;
    case FrameType::COMMAND:
        visitor("", CommandHeader::unpack(payload + 0));
        return 2;
    case FrameType::ACKNOWLEDGE:
        return 0;
    }
    return 0;
}

/* Calls visitor(value) for the struct of this name in snake case; returns false for another name or size. */
template <class Visitor>
bool visit_struct(std::string_view name, const std::uint8_t *bytes, std::size_t size, Visitor &&visitor)
{
    if (name == "identity" && size >= Identity::size) {
        visitor(Identity::unpack(bytes));
        return true;
    }
    if (name == "status" && size >= Status::size) {
        visitor(Status::unpack(bytes));
        return true;
    }
    if (name == "scan_settings" && size >= ScanSettings::size) {
        visitor(ScanSettings::unpack(bytes));
        return true;
    }
    if (name == "settings_register" && size >= SettingsRegister::size) {
        visitor(SettingsRegister::unpack(bytes));
        return true;
    }
    if (name == "command_register" && size >= CommandRegister::size) {
        visitor(CommandRegister::unpack(bytes));
        return true;
    }
    if (name == "enter_bootloader_register" && size >= EnterBootloaderRegister::size) {
        visitor(EnterBootloaderRegister::unpack(bytes));
        return true;
    }
    if (name == "fault_record" && size >= FaultRecord::size) {
        visitor(FaultRecord::unpack(bytes));
        return true;
    }
    if (name == "fault_register" && size >= FaultRegister::size) {
        visitor(FaultRegister::unpack(bytes));
        return true;
    }
    if (name == "snapshot_header" && size >= SnapshotHeader::size) {
        visitor(SnapshotHeader::unpack(bytes));
        return true;
    }
    if (name == "compact_header" && size >= CompactHeader::size) {
        visitor(CompactHeader::unpack(bytes));
        return true;
    }
    if (name == "compact_packed" && size >= CompactPacked::size) {
        visitor(CompactPacked::unpack(bytes));
        return true;
    }
    if (name == "compact_delta" && size >= CompactDelta::size) {
        visitor(CompactDelta::unpack(bytes));
        return true;
    }
    if (name == "compact_acknowledge" && size >= CompactAcknowledge::size) {
        visitor(CompactAcknowledge::unpack(bytes));
        return true;
    }
    if (name == "host_handshake" && size >= HostHandshake::size) {
        visitor(HostHandshake::unpack(bytes));
        return true;
    }
    if (name == "hub_handshake" && size >= HubHandshake::size) {
        visitor(HubHandshake::unpack(bytes));
        return true;
    }
    if (name == "taxel_header" && size >= TaxelHeader::size) {
        visitor(TaxelHeader::unpack(bytes));
        return true;
    }
    if (name == "hub_status" && size >= HubStatus::size) {
        visitor(HubStatus::unpack(bytes));
        return true;
    }
    if (name == "board_status" && size >= BoardStatus::size) {
        visitor(BoardStatus::unpack(bytes));
        return true;
    }
    if (name == "board_info" && size >= BoardInfo::size) {
        visitor(BoardInfo::unpack(bytes));
        return true;
    }
    if (name == "board_fault_report" && size >= BoardFaultReport::size) {
        visitor(BoardFaultReport::unpack(bytes));
        return true;
    }
    if (name == "time_sync" && size >= TimeSync::size) {
        visitor(TimeSync::unpack(bytes));
        return true;
    }
    if (name == "log_header" && size >= LogHeader::size) {
        visitor(LogHeader::unpack(bytes));
        return true;
    }
    if (name == "reply_header" && size >= ReplyHeader::size) {
        visitor(ReplyHeader::unpack(bytes));
        return true;
    }
    if (name == "command_header" && size >= CommandHeader::size) {
        visitor(CommandHeader::unpack(bytes));
        return true;
    }
    if (name == "acknowledgement" && size >= Acknowledgement::size) {
        visitor(Acknowledgement::unpack(bytes));
        return true;
    }
    if (name == "start_arguments" && size >= StartArguments::size) {
        visitor(StartArguments::unpack(bytes));
        return true;
    }
    if (name == "set_rate_arguments" && size >= SetRateArguments::size) {
        visitor(SetRateArguments::unpack(bytes));
        return true;
    }
    if (name == "enter_bootloader_arguments" && size >= EnterBootloaderArguments::size) {
        visitor(EnterBootloaderArguments::unpack(bytes));
        return true;
    }
    if (name == "transfer_arguments" && size >= TransferArguments::size) {
        visitor(TransferArguments::unpack(bytes));
        return true;
    }
    if (name == "set_scan_settings_arguments" && size >= SetScanSettingsArguments::size) {
        visitor(SetScanSettingsArguments::unpack(bytes));
        return true;
    }
    if (name == "get_board_info_arguments" && size >= GetBoardInfoArguments::size) {
        visitor(GetBoardInfoArguments::unpack(bytes));
        return true;
    }
    if (name == "get_time_reply" && size >= GetTimeReply::size) {
        visitor(GetTimeReply::unpack(bytes));
        return true;
    }
    return false;
}

} // namespace taxel

#endif
