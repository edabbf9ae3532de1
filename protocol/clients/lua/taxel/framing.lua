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
