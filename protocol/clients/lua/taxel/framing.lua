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

-- The bytes of a string XORed with the whitening sequence from position `first` (1: start of the body) on.
local function whiten(data, first)
    local out = { data:byte(1, #data) }
    for i = 1, #out do
        out[i] = bits.bxor(out[i], whitening[first + i - 1])
    end
    return string.char(table.unpack(out))
end

-- The frame type of a header if it is defined for the directions and allows the stated length, and the body's size.
local function expect_size(header, directions)
    local code = header:byte(1)
    local rule, length = protocol.frames[code], fields.read_number(header, 3, 2)
    local direction = code >= 0x80 and framing.TO_HUB or framing.TO_HOST
    if not rule or bits.band(directions, direction) == 0 or length < rule.minimum or length > rule.maximum then
        return nil
    end
    return rule, HEADER + length + CRC
end

-- Whether address, number of taxels and CRC of a body are right.
local function is_valid(rule, body)
    local first, length = body:byte(HEADER + 1), #body - HEADER - CRC
    if rule.has_address and (first < protocol.ADDRESS_MIN or first > protocol.ADDRESS_MAX) then
        return false
    end
    if rule.name == "TAXELS" then
        local snapshot = protocol.SNAPSHOT_OVERHEAD + 2 * body:byte(HEADER + 2)
        if length ~= protocol.structs.taxel_header.size + snapshot then
            return false
        end
    end
    return crc32(body, 0, 1, #body - CRC) == fields.read_number(body, #body - CRC, CRC)
end

-- The frame that begins at byte `start` of a chunk: position behind its stuffed bytes, and its body; nil if there is none.
local function take_frame(chunk, start, directions)
    local parts, length, position = {}, 0, start
    local rule, size
    while position <= #chunk do
        local code = chunk:byte(position)
        if position + code - 1 > #chunk or length + code - 1 > protocol.BODY_MAX then
            return nil
        end
        parts[#parts + 1] = whiten(chunk:sub(position + 1, position + code - 1), length + 1)
        length = length + code - 1
        position = position + code
        if not rule and length >= HEADER then
            rule, size = expect_size(table.concat(parts), directions)
            if not rule then
                return nil
            end
        end
        if rule and length >= size then
            local body = table.concat(parts)
            if length == size and is_valid(rule, body) then
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

-- A deframer without received bytes. directions: TO_HOST (default), TO_HUB or BOTH.
function framing.new_deframer(directions)
    return setmetatable({ directions = directions or framing.TO_HOST, chunk = "", discarded_bytes = 0 }, Deframer)
end

-- Takes any number of bytes and calls handler(code, sequence, payload) for each frame that they complete.
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
        local next_start, body = take_frame(self.chunk, start, self.directions)
        if next_start then
            handler(body:byte(1), fields.read_number(body, 1, 2), body:sub(HEADER + 1, #body - CRC))
            start = next_start
        else
            self.discarded_bytes = self.discarded_bytes + 1
            start = start + 1
        end
    end
    return start
end

return framing
