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
