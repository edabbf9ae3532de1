// Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit.
//! Constants, named codes, structs and messages of the protocol.

/// Value of a field, for programs that list the fields of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

/// Payloads that a frame type allows; `has_address`: the payload begins with the address of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRule {
    pub frame_type: FrameType,
    pub has_address: bool,
    pub minimum: usize,
    pub maximum: usize,
}

fn array<const N: usize>(bytes: &[u8], offset: usize) -> [u8; N] {
    let mut value = [0; N];
    value.copy_from_slice(&bytes[offset..offset + N]);
    value
}

pub const PROTOCOL_VERSION: u32 = 3;
pub const PROTOCOL_VERSION_MIN: u32 = 1;
pub const REGISTER_MAP_VERSION: u32 = 2;
pub const REGISTER_MAP_REVISION: u32 = 1;
pub const REGISTER_MAP_VERSION_MIN: u32 = 1;
pub const WHO_AM_I: u32 = 84;
pub const ADDRESS_MIN: u32 = 8;
pub const ADDRESS_MAX: u32 = 119;
pub const LINES_MAX: u32 = 16;
pub const TAXELS_MAX: u32 = 240;
pub const SMBUS_BLOCK: u32 = 32;
pub const CROSSING_MAP_SIZE: u32 = 32;
pub const SNAPSHOT_OVERHEAD: u32 = 10;
pub const COMPACT_OVERHEAD_PACKED: u32 = 11;
pub const COMPACT_OVERHEAD_DELTA: u32 = 12;
pub const COMPACT_TAXELS_MAX: u32 = 238;
pub const COMPACT_SIZE_MAX: u32 = 488;
pub const COMPACT_LENGTH_FINE: u32 = 128;
pub const COMPACT_LENGTH_STEP: u32 = 4;
pub const COMPACT_WIDTH_MASK: u32 = 31;
pub const COMPACT_START_MASK: u32 = 96;
pub const COMPACT_START_SHIFT: u32 = 5;
pub const COMPACT_KEY_FRAME: u32 = 128;
pub const ACKNOWLEDGE_FORGET: u32 = 128;
pub const ACKNOWLEDGE_MAX: u32 = 22;
pub const TRANSFER_MAX: u32 = 64;
pub const BOOTLOADER_KEY: u32 = 1414483778;
pub const LOG_TEXT_MAX: u32 = 64;
pub const FRAME_HEADER_SIZE: u32 = 5;
pub const FRAME_CRC_SIZE: u32 = 4;
pub const PAYLOAD_MAX: u32 = 498;
pub const BODY_MAX: u32 = 507;
pub const ENCODED_MAX: u32 = 509;
pub const WHITENING_SEED: u32 = 165;
pub const WHITENING_FACTOR: u32 = 5;
pub const WHITENING_INCREMENT: u32 = 107;
pub const REGISTER_IDENTITY: u32 = 0;
pub const REGISTER_STATUS: u32 = 64;
pub const REGISTER_CLOCK: u32 = 68;
pub const REGISTER_SETTINGS: u32 = 96;
pub const REGISTER_COMMAND: u32 = 112;
pub const REGISTER_SNAPSHOT: u32 = 128;
pub const REGISTER_SNAPSHOT_LAST: u32 = 143;
pub const REGISTER_FAULT: u32 = 144;
pub const REGISTER_COMPACT: u32 = 160;
pub const COMPACT_FRACTION_BITS: u32 = 6;
pub const COMPACT_MEAN_MAX: u32 = 4194303;
pub const COMPACT_LEVEL_BITS: u32 = 10;
pub const COMPACT_LEVEL_MAX: u32 = 1023;
pub const COMPACT_LEVEL_START: u32 = 384;
pub const COMPACT_LEVEL_START_STEP: u32 = 128;
pub const COMPACT_TOTAL_BITS: u32 = 16;
pub const COMPACT_ESCAPE: u32 = 128;
pub const COMPACT_UNIT: u32 = 1024;
pub const COMPACT_REACH: u32 = 8192;
pub const COMPACT_STEP_BITS: u32 = 7;
pub const COMPACT_JUMP: u32 = 6144;
pub const COMPACT_CLIP: u32 = 4096;
pub const COMPACT_COARSE_OCTAVE: u32 = 8;
pub const COMPACT_MEAN_DEVIATION: u32 = 1283;
pub const COMPACT_LEVEL_STEP: u32 = 92;
pub const COMPACT_MULTIPLIERS: [u16; 8] = [
    256, 235, 215, 197, 181, 166, 152, 140,
];
pub const COMPACT_GAINS: [u16; 15] = [
    128, 85, 64, 51, 42, 36, 32, 28, 25, 23, 21, 19, 18,
    17, 16,
];
pub const COMPACT_CUMULATIVE: [u16; 65] = [
    0, 3243, 6435, 9530, 12483, 15258, 17824, 20162, 22258, 24109, 25718, 27095, 28255,
    29218, 30005, 30638, 31139, 31531, 31832, 32060, 32230, 32356, 32447, 32512, 32559, 32591,
    32614, 32630, 32642, 32650, 32656, 32660, 32664, 32666, 32669, 32671, 32673, 32675, 32676,
    32678, 32679, 32681, 32682, 32684, 32685, 32686, 32688, 32689, 32690, 32691, 32692, 32693,
    32694, 32695, 32696, 32697, 32698, 32699, 32699, 32700, 32701, 32702, 32703, 32703, 32704,
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FrameType {
    HubHandshake = 0x01,
    Taxels = 0x02,
    CompactTaxels = 0x03,
    HubStatus = 0x08,
    BoardStatus = 0x09,
    BoardInfo = 0x0A,
    BoardFault = 0x0B,
    TimeSync = 0x0C,
    Log = 0x0D,
    Reply = 0x0E,
    HostHandshake = 0x81,
    Command = 0x82,
    Acknowledge = 0x83,
}

impl FrameType {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::HubHandshake),
            0x02 => Some(Self::Taxels),
            0x03 => Some(Self::CompactTaxels),
            0x08 => Some(Self::HubStatus),
            0x09 => Some(Self::BoardStatus),
            0x0A => Some(Self::BoardInfo),
            0x0B => Some(Self::BoardFault),
            0x0C => Some(Self::TimeSync),
            0x0D => Some(Self::Log),
            0x0E => Some(Self::Reply),
            0x81 => Some(Self::HostHandshake),
            0x82 => Some(Self::Command),
            0x83 => Some(Self::Acknowledge),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::HubHandshake => "HUB_HANDSHAKE",
            Self::Taxels => "TAXELS",
            Self::CompactTaxels => "COMPACT_TAXELS",
            Self::HubStatus => "HUB_STATUS",
            Self::BoardStatus => "BOARD_STATUS",
            Self::BoardInfo => "BOARD_INFO",
            Self::BoardFault => "BOARD_FAULT",
            Self::TimeSync => "TIME_SYNC",
            Self::Log => "LOG",
            Self::Reply => "REPLY",
            Self::HostHandshake => "HOST_HANDSHAKE",
            Self::Command => "COMMAND",
            Self::Acknowledge => "ACKNOWLEDGE",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Command {
    Start = 0x01,
    Stop = 0x02,
    SetRate = 0x03,
    ScanBus = 0x04,
    I2cTransfer = 0x05,
    SetScanSettings = 0x06,
    Reboot = 0x07,
    GetStatus = 0x08,
    GetBoardInfo = 0x09,
    GetTime = 0x0A,
    EnterBootloader = 0x0B,
    GetFault = 0x0C,
}

impl Command {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::Start),
            0x02 => Some(Self::Stop),
            0x03 => Some(Self::SetRate),
            0x04 => Some(Self::ScanBus),
            0x05 => Some(Self::I2cTransfer),
            0x06 => Some(Self::SetScanSettings),
            0x07 => Some(Self::Reboot),
            0x08 => Some(Self::GetStatus),
            0x09 => Some(Self::GetBoardInfo),
            0x0A => Some(Self::GetTime),
            0x0B => Some(Self::EnterBootloader),
            0x0C => Some(Self::GetFault),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "START",
            Self::Stop => "STOP",
            Self::SetRate => "SET_RATE",
            Self::ScanBus => "SCAN_BUS",
            Self::I2cTransfer => "I2C_TRANSFER",
            Self::SetScanSettings => "SET_SCAN_SETTINGS",
            Self::Reboot => "REBOOT",
            Self::GetStatus => "GET_STATUS",
            Self::GetBoardInfo => "GET_BOARD_INFO",
            Self::GetTime => "GET_TIME",
            Self::EnterBootloader => "ENTER_BOOTLOADER",
            Self::GetFault => "GET_FAULT",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum StartFlag {
    Compact = 0x01,
}

impl StartFlag {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::Compact),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::Compact => "COMPACT",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ReplyStatus {
    Ok = 0x00,
    UnknownCommand = 0x01,
    BadArguments = 0x02,
    Busy = 0x03,
    NoHandshake = 0x04,
    UnknownBoard = 0x05,
    Nack = 0x06,
    Timeout = 0x07,
    BusError = 0x08,
    RejectedByBoard = 0x09,
}

impl ReplyStatus {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::Ok),
            0x01 => Some(Self::UnknownCommand),
            0x02 => Some(Self::BadArguments),
            0x03 => Some(Self::Busy),
            0x04 => Some(Self::NoHandshake),
            0x05 => Some(Self::UnknownBoard),
            0x06 => Some(Self::Nack),
            0x07 => Some(Self::Timeout),
            0x08 => Some(Self::BusError),
            0x09 => Some(Self::RejectedByBoard),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::UnknownCommand => "UNKNOWN_COMMAND",
            Self::BadArguments => "BAD_ARGUMENTS",
            Self::Busy => "BUSY",
            Self::NoHandshake => "NO_HANDSHAKE",
            Self::UnknownBoard => "UNKNOWN_BOARD",
            Self::Nack => "NACK",
            Self::Timeout => "TIMEOUT",
            Self::BusError => "BUS_ERROR",
            Self::RejectedByBoard => "REJECTED_BY_BOARD",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BoardState {
    Absent = 0x00,
    Identifying = 0x01,
    Streaming = 0x02,
    Incompatible = 0x03,
}

impl BoardState {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::Absent),
            0x01 => Some(Self::Identifying),
            0x02 => Some(Self::Streaming),
            0x03 => Some(Self::Incompatible),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::Absent => "ABSENT",
            Self::Identifying => "IDENTIFYING",
            Self::Streaming => "STREAMING",
            Self::Incompatible => "INCOMPATIBLE",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BoardFault {
    None = 0x00,
    Nack = 0x01,
    Timeout = 0x02,
    Crc = 0x03,
    SdaStuck = 0x04,
    SclStuck = 0x05,
    Arbitration = 0x06,
    NotATaxelBoard = 0x07,
    MapVersion = 0x08,
    Restarted = 0x09,
    TooLarge = 0x0A,
    SettingsRejected = 0x0B,
    Recovered = 0x0C,
}

impl BoardFault {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::None),
            0x01 => Some(Self::Nack),
            0x02 => Some(Self::Timeout),
            0x03 => Some(Self::Crc),
            0x04 => Some(Self::SdaStuck),
            0x05 => Some(Self::SclStuck),
            0x06 => Some(Self::Arbitration),
            0x07 => Some(Self::NotATaxelBoard),
            0x08 => Some(Self::MapVersion),
            0x09 => Some(Self::Restarted),
            0x0A => Some(Self::TooLarge),
            0x0B => Some(Self::SettingsRejected),
            0x0C => Some(Self::Recovered),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "NONE",
            Self::Nack => "NACK",
            Self::Timeout => "TIMEOUT",
            Self::Crc => "CRC",
            Self::SdaStuck => "SDA_STUCK",
            Self::SclStuck => "SCL_STUCK",
            Self::Arbitration => "ARBITRATION",
            Self::NotATaxelBoard => "NOT_A_TAXEL_BOARD",
            Self::MapVersion => "MAP_VERSION",
            Self::Restarted => "RESTARTED",
            Self::TooLarge => "TOO_LARGE",
            Self::SettingsRejected => "SETTINGS_REJECTED",
            Self::Recovered => "RECOVERED",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ResetCause {
    PowerOn = 0x00,
    BrownOut = 0x01,
    Watchdog = 0x02,
    Command = 0x03,
}

impl ResetCause {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::PowerOn),
            0x01 => Some(Self::BrownOut),
            0x02 => Some(Self::Watchdog),
            0x03 => Some(Self::Command),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "POWER_ON",
            Self::BrownOut => "BROWN_OUT",
            Self::Watchdog => "WATCHDOG",
            Self::Command => "COMMAND",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum LogLevel {
    Debug = 0x00,
    Info = 0x01,
    Warning = 0x02,
    Error = 0x03,
}

impl LogLevel {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::Debug),
            0x01 => Some(Self::Info),
            0x02 => Some(Self::Warning),
            0x03 => Some(Self::Error),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::Debug => "DEBUG",
            Self::Info => "INFO",
            Self::Warning => "WARNING",
            Self::Error => "ERROR",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum LogCode {
    BusFree = 0x01,
    SdaStuck = 0x02,
    SclStuck = 0x03,
    ReceiveOverrun = 0x04,
    FrameDropped = 0x05,
}

impl LogCode {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::BusFree),
            0x02 => Some(Self::SdaStuck),
            0x03 => Some(Self::SclStuck),
            0x04 => Some(Self::ReceiveOverrun),
            0x05 => Some(Self::FrameDropped),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::BusFree => "BUS_FREE",
            Self::SdaStuck => "SDA_STUCK",
            Self::SclStuck => "SCL_STUCK",
            Self::ReceiveOverrun => "RECEIVE_OVERRUN",
            Self::FrameDropped => "FRAME_DROPPED",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BoardCommand {
    StartScan = 0x01,
    StopScan = 0x02,
    ClearCounters = 0x03,
    Restart = 0x04,
    EnterBootloader = 0x05,
}

impl BoardCommand {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::StartScan),
            0x02 => Some(Self::StopScan),
            0x03 => Some(Self::ClearCounters),
            0x04 => Some(Self::Restart),
            0x05 => Some(Self::EnterBootloader),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::StartScan => "START_SCAN",
            Self::StopScan => "STOP_SCAN",
            Self::ClearCounters => "CLEAR_COUNTERS",
            Self::Restart => "RESTART",
            Self::EnterBootloader => "ENTER_BOOTLOADER",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BoardErrorFlag {
    SettingsRejected = 0x01,
    CommandRejected = 0x02,
    Saturated = 0x08,
    ReadOnlyWrite = 0x10,
    NotScanning = 0x20,
}

impl BoardErrorFlag {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::SettingsRejected),
            0x02 => Some(Self::CommandRejected),
            0x08 => Some(Self::Saturated),
            0x10 => Some(Self::ReadOnlyWrite),
            0x20 => Some(Self::NotScanning),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::SettingsRejected => "SETTINGS_REJECTED",
            Self::CommandRejected => "COMMAND_REJECTED",
            Self::Saturated => "SATURATED",
            Self::ReadOnlyWrite => "READ_ONLY_WRITE",
            Self::NotScanning => "NOT_SCANNING",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FrontEnd {
    Capsense = 0x00,
}

impl FrontEnd {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::Capsense),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::Capsense => "CAPSENSE",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FaultCode {
    None = 0x00,
    Exception = 0x01,
    NotScanning = 0x02,
}

impl FaultCode {
    /// The code of this number, or None if it is not defined.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0x00 => Some(Self::None),
            0x01 => Some(Self::Exception),
            0x02 => Some(Self::NotScanning),
            _ => None,
        }
    }

    /// The name in the specification.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "NONE",
            Self::Exception => "EXCEPTION",
            Self::NotScanning => "NOT_SCANNING",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    pub who_am_i: u8,
    pub map_version: u8,
    pub firmware_major: u8,
    pub firmware_minor: u8,
    pub firmware_patch: u8,
    pub kind: u8,
    pub address: u8,
    pub map_revision: u8,
    pub unique_id: [u8; 8],
    pub rows: u8,
    pub columns: u8,
    pub taxel_count: u16,
    pub snapshot_size: u16,
    pub crossing_map: [u8; 32],
    pub crc32: u32,
}

impl Identity {
    /// Bytes of the fields.
    pub const SIZE: usize = 58;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            who_am_i: u8::from_le_bytes(array(bytes, 0)),
            map_version: u8::from_le_bytes(array(bytes, 1)),
            firmware_major: u8::from_le_bytes(array(bytes, 2)),
            firmware_minor: u8::from_le_bytes(array(bytes, 3)),
            firmware_patch: u8::from_le_bytes(array(bytes, 4)),
            kind: u8::from_le_bytes(array(bytes, 5)),
            address: u8::from_le_bytes(array(bytes, 6)),
            map_revision: u8::from_le_bytes(array(bytes, 7)),
            unique_id: array(bytes, 8),
            rows: u8::from_le_bytes(array(bytes, 16)),
            columns: u8::from_le_bytes(array(bytes, 17)),
            taxel_count: u16::from_le_bytes(array(bytes, 18)),
            snapshot_size: u16::from_le_bytes(array(bytes, 20)),
            crossing_map: array(bytes, 22),
            crc32: u32::from_le_bytes(array(bytes, 54)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.who_am_i.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.map_version.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.firmware_major.to_le_bytes());
        bytes[3..4].copy_from_slice(&self.firmware_minor.to_le_bytes());
        bytes[4..5].copy_from_slice(&self.firmware_patch.to_le_bytes());
        bytes[5..6].copy_from_slice(&self.kind.to_le_bytes());
        bytes[6..7].copy_from_slice(&self.address.to_le_bytes());
        bytes[7..8].copy_from_slice(&self.map_revision.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.unique_id);
        bytes[16..17].copy_from_slice(&self.rows.to_le_bytes());
        bytes[17..18].copy_from_slice(&self.columns.to_le_bytes());
        bytes[18..20].copy_from_slice(&self.taxel_count.to_le_bytes());
        bytes[20..22].copy_from_slice(&self.snapshot_size.to_le_bytes());
        bytes[22..54].copy_from_slice(&self.crossing_map);
        bytes[54..58].copy_from_slice(&self.crc32.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("who_am_i", Value::Number(self.who_am_i as u64));
        visitor("map_version", Value::Number(self.map_version as u64));
        visitor("firmware_major", Value::Number(self.firmware_major as u64));
        visitor("firmware_minor", Value::Number(self.firmware_minor as u64));
        visitor("firmware_patch", Value::Number(self.firmware_patch as u64));
        visitor("kind", Value::Number(self.kind as u64));
        visitor("address", Value::Number(self.address as u64));
        visitor("map_revision", Value::Number(self.map_revision as u64));
        visitor("unique_id", Value::Bytes(&self.unique_id));
        visitor("rows", Value::Number(self.rows as u64));
        visitor("columns", Value::Number(self.columns as u64));
        visitor("taxel_count", Value::Number(self.taxel_count as u64));
        visitor("snapshot_size", Value::Number(self.snapshot_size as u64));
        visitor("crossing_map", Value::Bytes(&self.crossing_map));
        visitor("crc32", Value::Number(self.crc32 as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    pub state: u8,
    pub error_flags: u8,
    pub reset_cause: u8,
    pub settings_generation: u8,
    pub clock_us: u32,
    pub scans: u32,
    pub scan_time_us: u32,
    pub snapshot_reads: u32,
    pub bus_errors: u16,
    pub rejected_writes: u16,
    pub front_end: u8,
    pub reserved: u8,
    pub saturated_conversions: u16,
}

impl Status {
    /// Bytes of the fields.
    pub const SIZE: usize = 28;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            state: u8::from_le_bytes(array(bytes, 0)),
            error_flags: u8::from_le_bytes(array(bytes, 1)),
            reset_cause: u8::from_le_bytes(array(bytes, 2)),
            settings_generation: u8::from_le_bytes(array(bytes, 3)),
            clock_us: u32::from_le_bytes(array(bytes, 4)),
            scans: u32::from_le_bytes(array(bytes, 8)),
            scan_time_us: u32::from_le_bytes(array(bytes, 12)),
            snapshot_reads: u32::from_le_bytes(array(bytes, 16)),
            bus_errors: u16::from_le_bytes(array(bytes, 20)),
            rejected_writes: u16::from_le_bytes(array(bytes, 22)),
            front_end: u8::from_le_bytes(array(bytes, 24)),
            reserved: u8::from_le_bytes(array(bytes, 25)),
            saturated_conversions: u16::from_le_bytes(array(bytes, 26)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.state.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.error_flags.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.reset_cause.to_le_bytes());
        bytes[3..4].copy_from_slice(&self.settings_generation.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.clock_us.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.scans.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.scan_time_us.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.snapshot_reads.to_le_bytes());
        bytes[20..22].copy_from_slice(&self.bus_errors.to_le_bytes());
        bytes[22..24].copy_from_slice(&self.rejected_writes.to_le_bytes());
        bytes[24..25].copy_from_slice(&self.front_end.to_le_bytes());
        bytes[25..26].copy_from_slice(&self.reserved.to_le_bytes());
        bytes[26..28].copy_from_slice(&self.saturated_conversions.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("state", Value::Number(self.state as u64));
        visitor("error_flags", Value::Number(self.error_flags as u64));
        visitor("reset_cause", Value::Number(self.reset_cause as u64));
        visitor("settings_generation", Value::Number(self.settings_generation as u64));
        visitor("clock_us", Value::Number(self.clock_us as u64));
        visitor("scans", Value::Number(self.scans as u64));
        visitor("scan_time_us", Value::Number(self.scan_time_us as u64));
        visitor("snapshot_reads", Value::Number(self.snapshot_reads as u64));
        visitor("bus_errors", Value::Number(self.bus_errors as u64));
        visitor("rejected_writes", Value::Number(self.rejected_writes as u64));
        visitor("front_end", Value::Number(self.front_end as u64));
        visitor("reserved", Value::Number(self.reserved as u64));
        visitor("saturated_conversions", Value::Number(self.saturated_conversions as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanSettings {
    pub sub_conversions: u16,
    pub sense_clock_divider: u16,
    pub modulator_clock_divider: u8,
    pub idac_code: u8,
    pub settle_cycles: u16,
}

impl ScanSettings {
    /// Bytes of the fields.
    pub const SIZE: usize = 8;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            sub_conversions: u16::from_le_bytes(array(bytes, 0)),
            sense_clock_divider: u16::from_le_bytes(array(bytes, 2)),
            modulator_clock_divider: u8::from_le_bytes(array(bytes, 4)),
            idac_code: u8::from_le_bytes(array(bytes, 5)),
            settle_cycles: u16::from_le_bytes(array(bytes, 6)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.sub_conversions.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.sense_clock_divider.to_le_bytes());
        bytes[4..5].copy_from_slice(&self.modulator_clock_divider.to_le_bytes());
        bytes[5..6].copy_from_slice(&self.idac_code.to_le_bytes());
        bytes[6..8].copy_from_slice(&self.settle_cycles.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("sub_conversions", Value::Number(self.sub_conversions as u64));
        visitor("sense_clock_divider", Value::Number(self.sense_clock_divider as u64));
        visitor("modulator_clock_divider", Value::Number(self.modulator_clock_divider as u64));
        visitor("idac_code", Value::Number(self.idac_code as u64));
        visitor("settle_cycles", Value::Number(self.settle_cycles as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingsRegister {
    pub settings_sub_conversions: u16,
    pub settings_sense_clock_divider: u16,
    pub settings_modulator_clock_divider: u8,
    pub settings_idac_code: u8,
    pub settings_settle_cycles: u16,
    pub crc32: u32,
}

impl SettingsRegister {
    /// Bytes of the fields.
    pub const SIZE: usize = 12;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            settings_sub_conversions: u16::from_le_bytes(array(bytes, 0)),
            settings_sense_clock_divider: u16::from_le_bytes(array(bytes, 2)),
            settings_modulator_clock_divider: u8::from_le_bytes(array(bytes, 4)),
            settings_idac_code: u8::from_le_bytes(array(bytes, 5)),
            settings_settle_cycles: u16::from_le_bytes(array(bytes, 6)),
            crc32: u32::from_le_bytes(array(bytes, 8)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.settings_sub_conversions.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.settings_sense_clock_divider.to_le_bytes());
        bytes[4..5].copy_from_slice(&self.settings_modulator_clock_divider.to_le_bytes());
        bytes[5..6].copy_from_slice(&self.settings_idac_code.to_le_bytes());
        bytes[6..8].copy_from_slice(&self.settings_settle_cycles.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.crc32.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("settings_sub_conversions", Value::Number(self.settings_sub_conversions as u64));
        visitor("settings_sense_clock_divider", Value::Number(self.settings_sense_clock_divider as u64));
        visitor("settings_modulator_clock_divider", Value::Number(self.settings_modulator_clock_divider as u64));
        visitor("settings_idac_code", Value::Number(self.settings_idac_code as u64));
        visitor("settings_settle_cycles", Value::Number(self.settings_settle_cycles as u64));
        visitor("crc32", Value::Number(self.crc32 as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandRegister {
    pub command: u8,
    pub complement: u8,
}

impl CommandRegister {
    /// Bytes of the fields.
    pub const SIZE: usize = 2;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            command: u8::from_le_bytes(array(bytes, 0)),
            complement: u8::from_le_bytes(array(bytes, 1)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.command.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.complement.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("command", Value::Number(self.command as u64));
        visitor("complement", Value::Number(self.complement as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnterBootloaderRegister {
    pub command: u8,
    pub complement: u8,
    pub key: u32,
}

impl EnterBootloaderRegister {
    /// Bytes of the fields.
    pub const SIZE: usize = 6;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            command: u8::from_le_bytes(array(bytes, 0)),
            complement: u8::from_le_bytes(array(bytes, 1)),
            key: u32::from_le_bytes(array(bytes, 2)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.command.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.complement.to_le_bytes());
        bytes[2..6].copy_from_slice(&self.key.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("command", Value::Number(self.command as u64));
        visitor("complement", Value::Number(self.complement as u64));
        visitor("key", Value::Number(self.key as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultRecord {
    pub code: u8,
    pub exception: u8,
    pub count: u16,
    pub program_counter: u32,
    pub link_register: u32,
}

impl FaultRecord {
    /// Bytes of the fields.
    pub const SIZE: usize = 12;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            code: u8::from_le_bytes(array(bytes, 0)),
            exception: u8::from_le_bytes(array(bytes, 1)),
            count: u16::from_le_bytes(array(bytes, 2)),
            program_counter: u32::from_le_bytes(array(bytes, 4)),
            link_register: u32::from_le_bytes(array(bytes, 8)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.code.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.exception.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.count.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.program_counter.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.link_register.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("code", Value::Number(self.code as u64));
        visitor("exception", Value::Number(self.exception as u64));
        visitor("count", Value::Number(self.count as u64));
        visitor("program_counter", Value::Number(self.program_counter as u64));
        visitor("link_register", Value::Number(self.link_register as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultRegister {
    pub record_code: u8,
    pub record_exception: u8,
    pub record_count: u16,
    pub record_program_counter: u32,
    pub record_link_register: u32,
    pub crc32: u32,
}

impl FaultRegister {
    /// Bytes of the fields.
    pub const SIZE: usize = 16;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            record_code: u8::from_le_bytes(array(bytes, 0)),
            record_exception: u8::from_le_bytes(array(bytes, 1)),
            record_count: u16::from_le_bytes(array(bytes, 2)),
            record_program_counter: u32::from_le_bytes(array(bytes, 4)),
            record_link_register: u32::from_le_bytes(array(bytes, 8)),
            crc32: u32::from_le_bytes(array(bytes, 12)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.record_code.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.record_exception.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.record_count.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.record_program_counter.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.record_link_register.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.crc32.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("record_code", Value::Number(self.record_code as u64));
        visitor("record_exception", Value::Number(self.record_exception as u64));
        visitor("record_count", Value::Number(self.record_count as u64));
        visitor("record_program_counter", Value::Number(self.record_program_counter as u64));
        visitor("record_link_register", Value::Number(self.record_link_register as u64));
        visitor("crc32", Value::Number(self.crc32 as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SnapshotHeader {
    pub sequence: u16,
    pub timestamp_us: u32,
}

impl SnapshotHeader {
    /// Bytes of the fields.
    pub const SIZE: usize = 6;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            sequence: u16::from_le_bytes(array(bytes, 0)),
            timestamp_us: u32::from_le_bytes(array(bytes, 2)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[2..6].copy_from_slice(&self.timestamp_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("sequence", Value::Number(self.sequence as u64));
        visitor("timestamp_us", Value::Number(self.timestamp_us as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactHeader {
    pub sequence: u16,
    pub format: u8,
}

impl CompactHeader {
    /// Bytes of the fields.
    pub const SIZE: usize = 3;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            sequence: u16::from_le_bytes(array(bytes, 0)),
            format: u8::from_le_bytes(array(bytes, 2)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.format.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("sequence", Value::Number(self.sequence as u64));
        visitor("format", Value::Number(self.format as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactPacked {
    pub sequence: u16,
    pub format: u8,
    pub timestamp_us: u32,
}

impl CompactPacked {
    /// Bytes of the fields.
    pub const SIZE: usize = 7;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            sequence: u16::from_le_bytes(array(bytes, 0)),
            format: u8::from_le_bytes(array(bytes, 2)),
            timestamp_us: u32::from_le_bytes(array(bytes, 3)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.format.to_le_bytes());
        bytes[3..7].copy_from_slice(&self.timestamp_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("sequence", Value::Number(self.sequence as u64));
        visitor("format", Value::Number(self.format as u64));
        visitor("timestamp_us", Value::Number(self.timestamp_us as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactDelta {
    pub sequence: u16,
    pub format: u8,
    pub key_frame: u16,
    pub timestamp_low: [u8; 3],
}

impl CompactDelta {
    /// Bytes of the fields.
    pub const SIZE: usize = 8;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            sequence: u16::from_le_bytes(array(bytes, 0)),
            format: u8::from_le_bytes(array(bytes, 2)),
            key_frame: u16::from_le_bytes(array(bytes, 3)),
            timestamp_low: array(bytes, 5),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.format.to_le_bytes());
        bytes[3..5].copy_from_slice(&self.key_frame.to_le_bytes());
        bytes[5..8].copy_from_slice(&self.timestamp_low);
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("sequence", Value::Number(self.sequence as u64));
        visitor("format", Value::Number(self.format as u64));
        visitor("key_frame", Value::Number(self.key_frame as u64));
        visitor("timestamp_low", Value::Bytes(&self.timestamp_low));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactAcknowledge {
    pub key_frame: u16,
}

impl CompactAcknowledge {
    /// Bytes of the fields.
    pub const SIZE: usize = 2;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            key_frame: u16::from_le_bytes(array(bytes, 0)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..2].copy_from_slice(&self.key_frame.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("key_frame", Value::Number(self.key_frame as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostHandshake {
    pub tag: u8,
    pub version_min: u8,
    pub version_max: u8,
}

impl HostHandshake {
    /// Bytes of the fields.
    pub const SIZE: usize = 3;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            tag: u8::from_le_bytes(array(bytes, 0)),
            version_min: u8::from_le_bytes(array(bytes, 1)),
            version_max: u8::from_le_bytes(array(bytes, 2)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.tag.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.version_min.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.version_max.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("tag", Value::Number(self.tag as u64));
        visitor("version_min", Value::Number(self.version_min as u64));
        visitor("version_max", Value::Number(self.version_max as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HubHandshake {
    pub tag: u8,
    pub version_min: u8,
    pub version_max: u8,
    pub version_chosen: u8,
    pub reset_cause: u8,
    pub firmware_major: u8,
    pub firmware_minor: u8,
    pub firmware_patch: u8,
    pub unique_id: [u8; 8],
    pub uptime_us: u64,
}

impl HubHandshake {
    /// Bytes of the fields.
    pub const SIZE: usize = 24;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            tag: u8::from_le_bytes(array(bytes, 0)),
            version_min: u8::from_le_bytes(array(bytes, 1)),
            version_max: u8::from_le_bytes(array(bytes, 2)),
            version_chosen: u8::from_le_bytes(array(bytes, 3)),
            reset_cause: u8::from_le_bytes(array(bytes, 4)),
            firmware_major: u8::from_le_bytes(array(bytes, 5)),
            firmware_minor: u8::from_le_bytes(array(bytes, 6)),
            firmware_patch: u8::from_le_bytes(array(bytes, 7)),
            unique_id: array(bytes, 8),
            uptime_us: u64::from_le_bytes(array(bytes, 16)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.tag.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.version_min.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.version_max.to_le_bytes());
        bytes[3..4].copy_from_slice(&self.version_chosen.to_le_bytes());
        bytes[4..5].copy_from_slice(&self.reset_cause.to_le_bytes());
        bytes[5..6].copy_from_slice(&self.firmware_major.to_le_bytes());
        bytes[6..7].copy_from_slice(&self.firmware_minor.to_le_bytes());
        bytes[7..8].copy_from_slice(&self.firmware_patch.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.unique_id);
        bytes[16..24].copy_from_slice(&self.uptime_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("tag", Value::Number(self.tag as u64));
        visitor("version_min", Value::Number(self.version_min as u64));
        visitor("version_max", Value::Number(self.version_max as u64));
        visitor("version_chosen", Value::Number(self.version_chosen as u64));
        visitor("reset_cause", Value::Number(self.reset_cause as u64));
        visitor("firmware_major", Value::Number(self.firmware_major as u64));
        visitor("firmware_minor", Value::Number(self.firmware_minor as u64));
        visitor("firmware_patch", Value::Number(self.firmware_patch as u64));
        visitor("unique_id", Value::Bytes(&self.unique_id));
        visitor("uptime_us", Value::Number(self.uptime_us));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaxelHeader {
    pub address: u8,
    pub taxel_count: u8,
    pub cycle: u16,
    pub hub_time_us: u32,
}

impl TaxelHeader {
    /// Bytes of the fields.
    pub const SIZE: usize = 8;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            taxel_count: u8::from_le_bytes(array(bytes, 1)),
            cycle: u16::from_le_bytes(array(bytes, 2)),
            hub_time_us: u32::from_le_bytes(array(bytes, 4)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.taxel_count.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.cycle.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.hub_time_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("taxel_count", Value::Number(self.taxel_count as u64));
        visitor("cycle", Value::Number(self.cycle as u64));
        visitor("hub_time_us", Value::Number(self.hub_time_us as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HubStatus {
    pub uptime_us: u64,
    pub cycles: u32,
    pub cycle_time_us: u32,
    pub frames_sent: u32,
    pub bytes_sent: u32,
    pub frames_dropped: u32,
    pub commands: u32,
    pub commands_rejected: u32,
    pub bus_recoveries: u32,
    pub boards_streaming: u8,
    pub streaming: u8,
}

impl HubStatus {
    /// Bytes of the fields.
    pub const SIZE: usize = 42;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            uptime_us: u64::from_le_bytes(array(bytes, 0)),
            cycles: u32::from_le_bytes(array(bytes, 8)),
            cycle_time_us: u32::from_le_bytes(array(bytes, 12)),
            frames_sent: u32::from_le_bytes(array(bytes, 16)),
            bytes_sent: u32::from_le_bytes(array(bytes, 20)),
            frames_dropped: u32::from_le_bytes(array(bytes, 24)),
            commands: u32::from_le_bytes(array(bytes, 28)),
            commands_rejected: u32::from_le_bytes(array(bytes, 32)),
            bus_recoveries: u32::from_le_bytes(array(bytes, 36)),
            boards_streaming: u8::from_le_bytes(array(bytes, 40)),
            streaming: u8::from_le_bytes(array(bytes, 41)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..8].copy_from_slice(&self.uptime_us.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.cycles.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.cycle_time_us.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.frames_sent.to_le_bytes());
        bytes[20..24].copy_from_slice(&self.bytes_sent.to_le_bytes());
        bytes[24..28].copy_from_slice(&self.frames_dropped.to_le_bytes());
        bytes[28..32].copy_from_slice(&self.commands.to_le_bytes());
        bytes[32..36].copy_from_slice(&self.commands_rejected.to_le_bytes());
        bytes[36..40].copy_from_slice(&self.bus_recoveries.to_le_bytes());
        bytes[40..41].copy_from_slice(&self.boards_streaming.to_le_bytes());
        bytes[41..42].copy_from_slice(&self.streaming.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("uptime_us", Value::Number(self.uptime_us));
        visitor("cycles", Value::Number(self.cycles as u64));
        visitor("cycle_time_us", Value::Number(self.cycle_time_us as u64));
        visitor("frames_sent", Value::Number(self.frames_sent as u64));
        visitor("bytes_sent", Value::Number(self.bytes_sent as u64));
        visitor("frames_dropped", Value::Number(self.frames_dropped as u64));
        visitor("commands", Value::Number(self.commands as u64));
        visitor("commands_rejected", Value::Number(self.commands_rejected as u64));
        visitor("bus_recoveries", Value::Number(self.bus_recoveries as u64));
        visitor("boards_streaming", Value::Number(self.boards_streaming as u64));
        visitor("streaming", Value::Number(self.streaming as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardStatus {
    pub address: u8,
    pub state: u8,
    pub last_fault: u8,
    pub polls: u32,
    pub forwarded: u32,
    pub repeated: u32,
    pub nacks: u32,
    pub timeouts: u32,
    pub crc_errors: u32,
    pub bus_errors: u32,
    pub dropped: u32,
    pub retries: u32,
}

impl BoardStatus {
    /// Bytes of the fields.
    pub const SIZE: usize = 39;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            state: u8::from_le_bytes(array(bytes, 1)),
            last_fault: u8::from_le_bytes(array(bytes, 2)),
            polls: u32::from_le_bytes(array(bytes, 3)),
            forwarded: u32::from_le_bytes(array(bytes, 7)),
            repeated: u32::from_le_bytes(array(bytes, 11)),
            nacks: u32::from_le_bytes(array(bytes, 15)),
            timeouts: u32::from_le_bytes(array(bytes, 19)),
            crc_errors: u32::from_le_bytes(array(bytes, 23)),
            bus_errors: u32::from_le_bytes(array(bytes, 27)),
            dropped: u32::from_le_bytes(array(bytes, 31)),
            retries: u32::from_le_bytes(array(bytes, 35)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.state.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.last_fault.to_le_bytes());
        bytes[3..7].copy_from_slice(&self.polls.to_le_bytes());
        bytes[7..11].copy_from_slice(&self.forwarded.to_le_bytes());
        bytes[11..15].copy_from_slice(&self.repeated.to_le_bytes());
        bytes[15..19].copy_from_slice(&self.nacks.to_le_bytes());
        bytes[19..23].copy_from_slice(&self.timeouts.to_le_bytes());
        bytes[23..27].copy_from_slice(&self.crc_errors.to_le_bytes());
        bytes[27..31].copy_from_slice(&self.bus_errors.to_le_bytes());
        bytes[31..35].copy_from_slice(&self.dropped.to_le_bytes());
        bytes[35..39].copy_from_slice(&self.retries.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("state", Value::Number(self.state as u64));
        visitor("last_fault", Value::Number(self.last_fault as u64));
        visitor("polls", Value::Number(self.polls as u64));
        visitor("forwarded", Value::Number(self.forwarded as u64));
        visitor("repeated", Value::Number(self.repeated as u64));
        visitor("nacks", Value::Number(self.nacks as u64));
        visitor("timeouts", Value::Number(self.timeouts as u64));
        visitor("crc_errors", Value::Number(self.crc_errors as u64));
        visitor("bus_errors", Value::Number(self.bus_errors as u64));
        visitor("dropped", Value::Number(self.dropped as u64));
        visitor("retries", Value::Number(self.retries as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardInfo {
    pub identity_who_am_i: u8,
    pub identity_map_version: u8,
    pub identity_firmware_major: u8,
    pub identity_firmware_minor: u8,
    pub identity_firmware_patch: u8,
    pub identity_kind: u8,
    pub identity_address: u8,
    pub identity_map_revision: u8,
    pub identity_unique_id: [u8; 8],
    pub identity_rows: u8,
    pub identity_columns: u8,
    pub identity_taxel_count: u16,
    pub identity_snapshot_size: u16,
    pub identity_crossing_map: [u8; 32],
    pub identity_crc32: u32,
    pub settings_sub_conversions: u16,
    pub settings_sense_clock_divider: u16,
    pub settings_modulator_clock_divider: u8,
    pub settings_idac_code: u8,
    pub settings_settle_cycles: u16,
}

impl BoardInfo {
    /// Bytes of the fields.
    pub const SIZE: usize = 66;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            identity_who_am_i: u8::from_le_bytes(array(bytes, 0)),
            identity_map_version: u8::from_le_bytes(array(bytes, 1)),
            identity_firmware_major: u8::from_le_bytes(array(bytes, 2)),
            identity_firmware_minor: u8::from_le_bytes(array(bytes, 3)),
            identity_firmware_patch: u8::from_le_bytes(array(bytes, 4)),
            identity_kind: u8::from_le_bytes(array(bytes, 5)),
            identity_address: u8::from_le_bytes(array(bytes, 6)),
            identity_map_revision: u8::from_le_bytes(array(bytes, 7)),
            identity_unique_id: array(bytes, 8),
            identity_rows: u8::from_le_bytes(array(bytes, 16)),
            identity_columns: u8::from_le_bytes(array(bytes, 17)),
            identity_taxel_count: u16::from_le_bytes(array(bytes, 18)),
            identity_snapshot_size: u16::from_le_bytes(array(bytes, 20)),
            identity_crossing_map: array(bytes, 22),
            identity_crc32: u32::from_le_bytes(array(bytes, 54)),
            settings_sub_conversions: u16::from_le_bytes(array(bytes, 58)),
            settings_sense_clock_divider: u16::from_le_bytes(array(bytes, 60)),
            settings_modulator_clock_divider: u8::from_le_bytes(array(bytes, 62)),
            settings_idac_code: u8::from_le_bytes(array(bytes, 63)),
            settings_settle_cycles: u16::from_le_bytes(array(bytes, 64)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.identity_who_am_i.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.identity_map_version.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.identity_firmware_major.to_le_bytes());
        bytes[3..4].copy_from_slice(&self.identity_firmware_minor.to_le_bytes());
        bytes[4..5].copy_from_slice(&self.identity_firmware_patch.to_le_bytes());
        bytes[5..6].copy_from_slice(&self.identity_kind.to_le_bytes());
        bytes[6..7].copy_from_slice(&self.identity_address.to_le_bytes());
        bytes[7..8].copy_from_slice(&self.identity_map_revision.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.identity_unique_id);
        bytes[16..17].copy_from_slice(&self.identity_rows.to_le_bytes());
        bytes[17..18].copy_from_slice(&self.identity_columns.to_le_bytes());
        bytes[18..20].copy_from_slice(&self.identity_taxel_count.to_le_bytes());
        bytes[20..22].copy_from_slice(&self.identity_snapshot_size.to_le_bytes());
        bytes[22..54].copy_from_slice(&self.identity_crossing_map);
        bytes[54..58].copy_from_slice(&self.identity_crc32.to_le_bytes());
        bytes[58..60].copy_from_slice(&self.settings_sub_conversions.to_le_bytes());
        bytes[60..62].copy_from_slice(&self.settings_sense_clock_divider.to_le_bytes());
        bytes[62..63].copy_from_slice(&self.settings_modulator_clock_divider.to_le_bytes());
        bytes[63..64].copy_from_slice(&self.settings_idac_code.to_le_bytes());
        bytes[64..66].copy_from_slice(&self.settings_settle_cycles.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("identity_who_am_i", Value::Number(self.identity_who_am_i as u64));
        visitor("identity_map_version", Value::Number(self.identity_map_version as u64));
        visitor("identity_firmware_major", Value::Number(self.identity_firmware_major as u64));
        visitor("identity_firmware_minor", Value::Number(self.identity_firmware_minor as u64));
        visitor("identity_firmware_patch", Value::Number(self.identity_firmware_patch as u64));
        visitor("identity_kind", Value::Number(self.identity_kind as u64));
        visitor("identity_address", Value::Number(self.identity_address as u64));
        visitor("identity_map_revision", Value::Number(self.identity_map_revision as u64));
        visitor("identity_unique_id", Value::Bytes(&self.identity_unique_id));
        visitor("identity_rows", Value::Number(self.identity_rows as u64));
        visitor("identity_columns", Value::Number(self.identity_columns as u64));
        visitor("identity_taxel_count", Value::Number(self.identity_taxel_count as u64));
        visitor("identity_snapshot_size", Value::Number(self.identity_snapshot_size as u64));
        visitor("identity_crossing_map", Value::Bytes(&self.identity_crossing_map));
        visitor("identity_crc32", Value::Number(self.identity_crc32 as u64));
        visitor("settings_sub_conversions", Value::Number(self.settings_sub_conversions as u64));
        visitor("settings_sense_clock_divider", Value::Number(self.settings_sense_clock_divider as u64));
        visitor("settings_modulator_clock_divider", Value::Number(self.settings_modulator_clock_divider as u64));
        visitor("settings_idac_code", Value::Number(self.settings_idac_code as u64));
        visitor("settings_settle_cycles", Value::Number(self.settings_settle_cycles as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardFaultReport {
    pub address: u8,
    pub fault: u8,
    pub cycle: u16,
    pub hub_time_us: u32,
    pub consecutive: u16,
}

impl BoardFaultReport {
    /// Bytes of the fields.
    pub const SIZE: usize = 10;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            fault: u8::from_le_bytes(array(bytes, 1)),
            cycle: u16::from_le_bytes(array(bytes, 2)),
            hub_time_us: u32::from_le_bytes(array(bytes, 4)),
            consecutive: u16::from_le_bytes(array(bytes, 8)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.fault.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.cycle.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.hub_time_us.to_le_bytes());
        bytes[8..10].copy_from_slice(&self.consecutive.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("fault", Value::Number(self.fault as u64));
        visitor("cycle", Value::Number(self.cycle as u64));
        visitor("hub_time_us", Value::Number(self.hub_time_us as u64));
        visitor("consecutive", Value::Number(self.consecutive as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeSync {
    pub address: u8,
    pub board_time_us: u32,
    pub hub_time_us: u64,
}

impl TimeSync {
    /// Bytes of the fields.
    pub const SIZE: usize = 13;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            board_time_us: u32::from_le_bytes(array(bytes, 1)),
            hub_time_us: u64::from_le_bytes(array(bytes, 5)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..5].copy_from_slice(&self.board_time_us.to_le_bytes());
        bytes[5..13].copy_from_slice(&self.hub_time_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("board_time_us", Value::Number(self.board_time_us as u64));
        visitor("hub_time_us", Value::Number(self.hub_time_us));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogHeader {
    pub level: u8,
    pub code: u16,
    pub hub_time_us: u32,
}

impl LogHeader {
    /// Bytes of the fields.
    pub const SIZE: usize = 7;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            level: u8::from_le_bytes(array(bytes, 0)),
            code: u16::from_le_bytes(array(bytes, 1)),
            hub_time_us: u32::from_le_bytes(array(bytes, 3)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.level.to_le_bytes());
        bytes[1..3].copy_from_slice(&self.code.to_le_bytes());
        bytes[3..7].copy_from_slice(&self.hub_time_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("level", Value::Number(self.level as u64));
        visitor("code", Value::Number(self.code as u64));
        visitor("hub_time_us", Value::Number(self.hub_time_us as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplyHeader {
    pub tag: u8,
    pub command: u8,
    pub status: u8,
}

impl ReplyHeader {
    /// Bytes of the fields.
    pub const SIZE: usize = 3;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            tag: u8::from_le_bytes(array(bytes, 0)),
            command: u8::from_le_bytes(array(bytes, 1)),
            status: u8::from_le_bytes(array(bytes, 2)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.tag.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.command.to_le_bytes());
        bytes[2..3].copy_from_slice(&self.status.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("tag", Value::Number(self.tag as u64));
        visitor("command", Value::Number(self.command as u64));
        visitor("status", Value::Number(self.status as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandHeader {
    pub tag: u8,
    pub command: u8,
}

impl CommandHeader {
    /// Bytes of the fields.
    pub const SIZE: usize = 2;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            tag: u8::from_le_bytes(array(bytes, 0)),
            command: u8::from_le_bytes(array(bytes, 1)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.tag.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.command.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("tag", Value::Number(self.tag as u64));
        visitor("command", Value::Number(self.command as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acknowledgement {
    pub address: u8,
    pub key_frame: u16,
}

impl Acknowledgement {
    /// Bytes of the fields.
    pub const SIZE: usize = 3;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            key_frame: u16::from_le_bytes(array(bytes, 1)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..3].copy_from_slice(&self.key_frame.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("key_frame", Value::Number(self.key_frame as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StartArguments {
    pub flags: u8,
}

impl StartArguments {
    /// Bytes of the fields.
    pub const SIZE: usize = 1;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            flags: u8::from_le_bytes(array(bytes, 0)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.flags.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("flags", Value::Number(self.flags as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetRateArguments {
    pub period_us: u32,
}

impl SetRateArguments {
    /// Bytes of the fields.
    pub const SIZE: usize = 4;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            period_us: u32::from_le_bytes(array(bytes, 0)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..4].copy_from_slice(&self.period_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("period_us", Value::Number(self.period_us as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnterBootloaderArguments {
    pub key: u32,
}

impl EnterBootloaderArguments {
    /// Bytes of the fields.
    pub const SIZE: usize = 4;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            key: u32::from_le_bytes(array(bytes, 0)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..4].copy_from_slice(&self.key.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("key", Value::Number(self.key as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransferArguments {
    pub address: u8,
    pub read_length: u8,
}

impl TransferArguments {
    /// Bytes of the fields.
    pub const SIZE: usize = 2;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            read_length: u8::from_le_bytes(array(bytes, 1)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..2].copy_from_slice(&self.read_length.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("read_length", Value::Number(self.read_length as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetScanSettingsArguments {
    pub address: u8,
    pub settings_sub_conversions: u16,
    pub settings_sense_clock_divider: u16,
    pub settings_modulator_clock_divider: u8,
    pub settings_idac_code: u8,
    pub settings_settle_cycles: u16,
    pub front_end: u8,
}

impl SetScanSettingsArguments {
    /// Bytes of the fields.
    pub const SIZE: usize = 10;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
            settings_sub_conversions: u16::from_le_bytes(array(bytes, 1)),
            settings_sense_clock_divider: u16::from_le_bytes(array(bytes, 3)),
            settings_modulator_clock_divider: u8::from_le_bytes(array(bytes, 5)),
            settings_idac_code: u8::from_le_bytes(array(bytes, 6)),
            settings_settle_cycles: u16::from_le_bytes(array(bytes, 7)),
            front_end: u8::from_le_bytes(array(bytes, 9)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
        bytes[1..3].copy_from_slice(&self.settings_sub_conversions.to_le_bytes());
        bytes[3..5].copy_from_slice(&self.settings_sense_clock_divider.to_le_bytes());
        bytes[5..6].copy_from_slice(&self.settings_modulator_clock_divider.to_le_bytes());
        bytes[6..7].copy_from_slice(&self.settings_idac_code.to_le_bytes());
        bytes[7..9].copy_from_slice(&self.settings_settle_cycles.to_le_bytes());
        bytes[9..10].copy_from_slice(&self.front_end.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
        visitor("settings_sub_conversions", Value::Number(self.settings_sub_conversions as u64));
        visitor("settings_sense_clock_divider", Value::Number(self.settings_sense_clock_divider as u64));
        visitor("settings_modulator_clock_divider", Value::Number(self.settings_modulator_clock_divider as u64));
        visitor("settings_idac_code", Value::Number(self.settings_idac_code as u64));
        visitor("settings_settle_cycles", Value::Number(self.settings_settle_cycles as u64));
        visitor("front_end", Value::Number(self.front_end as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GetBoardInfoArguments {
    pub address: u8,
}

impl GetBoardInfoArguments {
    /// Bytes of the fields.
    pub const SIZE: usize = 1;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            address: u8::from_le_bytes(array(bytes, 0)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..1].copy_from_slice(&self.address.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("address", Value::Number(self.address as u64));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GetTimeReply {
    pub hub_time_us: u64,
}

impl GetTimeReply {
    /// Bytes of the fields.
    pub const SIZE: usize = 8;

    /// The fields at the front of `bytes`; None if they are shorter than `SIZE`.
    pub fn unpack(bytes: &[u8]) -> Option<Self> {
        if bytes.len() < Self::SIZE {
            return None;
        }
        Some(Self {
            hub_time_us: u64::from_le_bytes(array(bytes, 0)),
        })
    }

    /// Write the fields to the first `SIZE` bytes. Panics for a shorter slice.
    pub fn pack(&self, bytes: &mut [u8]) {
        bytes[0..8].copy_from_slice(&self.hub_time_us.to_le_bytes());
    }

    /// Call `visitor` with name and value of each field.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, Value<'_>)) {
        visitor("hub_time_us", Value::Number(self.hub_time_us));
    }
}

/// Every frame type of this version.
pub const FRAME_RULES: [FrameRule; 13] = [
    FrameRule { frame_type: FrameType::HubHandshake, has_address: false, minimum: 24, maximum: 24 },
    FrameRule { frame_type: FrameType::Taxels, has_address: true, minimum: 20, maximum: 498 },
    FrameRule { frame_type: FrameType::CompactTaxels, has_address: true, minimum: 20, maximum: 496 },
    FrameRule { frame_type: FrameType::HubStatus, has_address: false, minimum: 42, maximum: 42 },
    FrameRule { frame_type: FrameType::BoardStatus, has_address: true, minimum: 39, maximum: 39 },
    FrameRule { frame_type: FrameType::BoardInfo, has_address: false, minimum: 66, maximum: 66 },
    FrameRule { frame_type: FrameType::BoardFault, has_address: true, minimum: 10, maximum: 10 },
    FrameRule { frame_type: FrameType::TimeSync, has_address: true, minimum: 13, maximum: 13 },
    FrameRule { frame_type: FrameType::Log, has_address: false, minimum: 7, maximum: 71 },
    FrameRule { frame_type: FrameType::Reply, has_address: false, minimum: 3, maximum: 131 },
    FrameRule { frame_type: FrameType::HostHandshake, has_address: false, minimum: 3, maximum: 3 },
    FrameRule { frame_type: FrameType::Command, has_address: false, minimum: 2, maximum: 68 },
    FrameRule { frame_type: FrameType::Acknowledge, has_address: false, minimum: 3, maximum: 66 },
];

/// A payload: its structs, and the bytes behind these structs (`tail`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message<'a> {
    HubHandshake { fields: HubHandshake },
    Taxels { header: TaxelHeader, snapshot_header: SnapshotHeader, tail: &'a [u8] },
    CompactTaxels { header: TaxelHeader, snapshot: CompactHeader, tail: &'a [u8] },
    HubStatus { fields: HubStatus },
    BoardStatus { fields: BoardStatus },
    BoardInfo { fields: BoardInfo },
    BoardFault { fields: BoardFaultReport },
    TimeSync { fields: TimeSync },
    Log { fields: LogHeader, tail: &'a [u8] },
    Reply { fields: ReplyHeader, tail: &'a [u8] },
    HostHandshake { fields: HostHandshake },
    Command { fields: CommandHeader, tail: &'a [u8] },
    Acknowledge { tail: &'a [u8] },
}

impl<'a> Message<'a> {
    /// The message in a payload; None for a shorter payload.
    pub fn parse(frame_type: FrameType, payload: &'a [u8]) -> Option<Self> {
        Some(match frame_type {
            FrameType::HubHandshake => Self::HubHandshake {
                fields: HubHandshake::unpack(payload.get(0..)?)?,
            },
            FrameType::Taxels => Self::Taxels {
                header: TaxelHeader::unpack(payload.get(0..)?)?,
                snapshot_header: SnapshotHeader::unpack(payload.get(8..)?)?,
                tail: payload.get(14..)?,
            },
            FrameType::CompactTaxels => Self::CompactTaxels {
                header: TaxelHeader::unpack(payload.get(0..)?)?,
                snapshot: CompactHeader::unpack(payload.get(8..)?)?,
                tail: payload.get(11..)?,
            },
            FrameType::HubStatus => Self::HubStatus {
                fields: HubStatus::unpack(payload.get(0..)?)?,
            },
            FrameType::BoardStatus => Self::BoardStatus {
                fields: BoardStatus::unpack(payload.get(0..)?)?,
            },
            FrameType::BoardInfo => Self::BoardInfo {
                fields: BoardInfo::unpack(payload.get(0..)?)?,
            },
            FrameType::BoardFault => Self::BoardFault {
                fields: BoardFaultReport::unpack(payload.get(0..)?)?,
            },
            FrameType::TimeSync => Self::TimeSync {
                fields: TimeSync::unpack(payload.get(0..)?)?,
            },
            FrameType::Log => Self::Log {
                fields: LogHeader::unpack(payload.get(0..)?)?,
                tail: payload.get(7..)?,
            },
            FrameType::Reply => Self::Reply {
                fields: ReplyHeader::unpack(payload.get(0..)?)?,
                tail: payload.get(3..)?,
            },
            FrameType::HostHandshake => Self::HostHandshake {
                fields: HostHandshake::unpack(payload.get(0..)?)?,
            },
            FrameType::Command => Self::Command {
                fields: CommandHeader::unpack(payload.get(0..)?)?,
                tail: payload.get(2..)?,
            },
            FrameType::Acknowledge => Self::Acknowledge {
                tail: payload.get(0..)?,
            },
        })
    }

    /// Call `visitor` with prefix, name and value of each field, in order.
    pub fn visit(&self, visitor: &mut dyn FnMut(&'static str, &'static str, Value<'_>)) {
        match self {
            Self::HubHandshake { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::Taxels { header, snapshot_header, .. } => {
                header.visit(&mut |name, value| visitor("header_", name, value));
                snapshot_header.visit(&mut |name, value| visitor("snapshot_header_", name, value));
            }
            Self::CompactTaxels { header, snapshot, .. } => {
                header.visit(&mut |name, value| visitor("header_", name, value));
                snapshot.visit(&mut |name, value| visitor("snapshot_", name, value));
            }
            Self::HubStatus { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::BoardStatus { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::BoardInfo { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::BoardFault { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::TimeSync { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::Log { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::Reply { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::HostHandshake { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::Command { fields, .. } => {
                fields.visit(&mut |name, value| visitor("", name, value));
            }
            Self::Acknowledge { .. } => {
            }
        }
    }

    /// Write the structs to the front of `payload`; returns their size. Panics for a shorter slice.
    pub fn pack(&self, payload: &mut [u8]) -> usize {
        let _ = &payload;
        match self {
            Self::HubHandshake { fields, .. } => {
                fields.pack(&mut payload[0..]);
                24
            }
            Self::Taxels { header, snapshot_header, .. } => {
                header.pack(&mut payload[0..]);
                snapshot_header.pack(&mut payload[8..]);
                14
            }
            Self::CompactTaxels { header, snapshot, .. } => {
                header.pack(&mut payload[0..]);
                snapshot.pack(&mut payload[8..]);
                11
            }
            Self::HubStatus { fields, .. } => {
                fields.pack(&mut payload[0..]);
                42
            }
            Self::BoardStatus { fields, .. } => {
                fields.pack(&mut payload[0..]);
                39
            }
            Self::BoardInfo { fields, .. } => {
                fields.pack(&mut payload[0..]);
                66
            }
            Self::BoardFault { fields, .. } => {
                fields.pack(&mut payload[0..]);
                10
            }
            Self::TimeSync { fields, .. } => {
                fields.pack(&mut payload[0..]);
                13
            }
            Self::Log { fields, .. } => {
                fields.pack(&mut payload[0..]);
                7
            }
            Self::Reply { fields, .. } => {
                fields.pack(&mut payload[0..]);
                3
            }
            Self::HostHandshake { fields, .. } => {
                fields.pack(&mut payload[0..]);
                3
            }
            Self::Command { fields, .. } => {
                fields.pack(&mut payload[0..]);
                2
            }
            Self::Acknowledge { .. } => {
                0
            }
        }
    }

    /// The bytes behind the structs.
    pub fn tail(&self) -> &'a [u8] {
        match self {
            Self::Taxels { tail, .. } => tail,
            Self::CompactTaxels { tail, .. } => tail,
            Self::Log { tail, .. } => tail,
            Self::Reply { tail, .. } => tail,
            Self::Command { tail, .. } => tail,
            Self::Acknowledge { tail, .. } => tail,
            _ => &[],
        }
    }
}

/// Visit the fields of the struct with this name in snake case, and pack them again; returns its size.
pub fn visit_struct(
    name: &str,
    bytes: &[u8],
    packed: &mut [u8],
    visitor: &mut dyn FnMut(&'static str, Value<'_>),
) -> Option<usize> {
    match name {
        "identity" => {
            let value = Identity::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(Identity::SIZE)
        }
        "status" => {
            let value = Status::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(Status::SIZE)
        }
        "scan_settings" => {
            let value = ScanSettings::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(ScanSettings::SIZE)
        }
        "settings_register" => {
            let value = SettingsRegister::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(SettingsRegister::SIZE)
        }
        "command_register" => {
            let value = CommandRegister::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(CommandRegister::SIZE)
        }
        "enter_bootloader_register" => {
            let value = EnterBootloaderRegister::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(EnterBootloaderRegister::SIZE)
        }
        "fault_record" => {
            let value = FaultRecord::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(FaultRecord::SIZE)
        }
        "fault_register" => {
            let value = FaultRegister::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(FaultRegister::SIZE)
        }
        "snapshot_header" => {
            let value = SnapshotHeader::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(SnapshotHeader::SIZE)
        }
        "compact_header" => {
            let value = CompactHeader::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(CompactHeader::SIZE)
        }
        "compact_packed" => {
            let value = CompactPacked::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(CompactPacked::SIZE)
        }
        "compact_delta" => {
            let value = CompactDelta::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(CompactDelta::SIZE)
        }
        "compact_acknowledge" => {
            let value = CompactAcknowledge::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(CompactAcknowledge::SIZE)
        }
        "host_handshake" => {
            let value = HostHandshake::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(HostHandshake::SIZE)
        }
        "hub_handshake" => {
            let value = HubHandshake::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(HubHandshake::SIZE)
        }
        "taxel_header" => {
            let value = TaxelHeader::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(TaxelHeader::SIZE)
        }
        "hub_status" => {
            let value = HubStatus::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(HubStatus::SIZE)
        }
        "board_status" => {
            let value = BoardStatus::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(BoardStatus::SIZE)
        }
        "board_info" => {
            let value = BoardInfo::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(BoardInfo::SIZE)
        }
        "board_fault_report" => {
            let value = BoardFaultReport::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(BoardFaultReport::SIZE)
        }
        "time_sync" => {
            let value = TimeSync::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(TimeSync::SIZE)
        }
        "log_header" => {
            let value = LogHeader::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(LogHeader::SIZE)
        }
        "reply_header" => {
            let value = ReplyHeader::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(ReplyHeader::SIZE)
        }
        "command_header" => {
            let value = CommandHeader::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(CommandHeader::SIZE)
        }
        "acknowledgement" => {
            let value = Acknowledgement::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(Acknowledgement::SIZE)
        }
        "start_arguments" => {
            let value = StartArguments::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(StartArguments::SIZE)
        }
        "set_rate_arguments" => {
            let value = SetRateArguments::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(SetRateArguments::SIZE)
        }
        "enter_bootloader_arguments" => {
            let value = EnterBootloaderArguments::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(EnterBootloaderArguments::SIZE)
        }
        "transfer_arguments" => {
            let value = TransferArguments::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(TransferArguments::SIZE)
        }
        "set_scan_settings_arguments" => {
            let value = SetScanSettingsArguments::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(SetScanSettingsArguments::SIZE)
        }
        "get_board_info_arguments" => {
            let value = GetBoardInfoArguments::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(GetBoardInfoArguments::SIZE)
        }
        "get_time_reply" => {
            let value = GetTimeReply::unpack(bytes)?;
            value.visit(visitor);
            value.pack(packed);
            Some(GetTimeReply::SIZE)
        }
        _ => None,
    }
}
