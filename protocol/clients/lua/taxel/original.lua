-- Messages of the original hub (SPEC.md, part 7): without CRC, sequence number and byte stuffing.
local layouts = require("taxel.original_formats")

local original = { formats = layouts.formats }
local HEADER = layouts.HEADER_SIZE
local START = string.char(layouts.START)

local Decoder = {}
Decoder.__index = Decoder

-- Creates a decoder without received bytes. format: an element of original.formats (default: original). Counters:
-- discarded_bytes (in no accepted message), rejected_candidates (headers without an end byte at their length) and
-- ambiguous_candidates (complete candidates that overlap a better one).
function original.new_decoder(format)
    format = format or layouts.formats.original
    local offset = HEADER + (format.has_timestamp and layouts.TIMESTAMP_SIZE or 0)
    local lengths, is_length = {}, {}
    for address, taxels in pairs(format.taxels) do
        lengths[address] = offset + 2 * (taxels + (format.accelerations[address] or 0)) + 1
        is_length[lengths[address]] = true
    end
    return setmetatable({ format = format, lengths = lengths, is_length = is_length, counts_offset = offset,
        buffer = "", scan = 0, strong_end = 0, base = 0, covered = 0, times = {},
        discarded_bytes = 0, rejected_candidates = 0, ambiguous_candidates = 0 }, Decoder)
end

-- Takes any number of bytes and calls handler(message) for each message that can be decided. A message has the fields
-- address, timestamp_ms (nil without a timestamp), is_time_plausible, position, counts and accelerations.
function Decoder:push(data, handler)
    self.buffer = self.buffer .. data
    self:process(false, handler)
end

-- Decides the remaining bytes: at the end of a stream, or after a pause of the hub.
function Decoder:finish(handler)
    self:process(true, handler)
end

-- Delivers the messages that can be decided with the bytes in the buffer.
function Decoder:process(is_end, handler)
    local size = self.format.record_size
    if size > 0 then
        while #self.buffer - self.scan >= size do
            self:accept({ first = self.scan, last = self.scan + size }, handler)
            self.scan = self.scan + size
        end
        self.scan = is_end and #self.buffer or self.scan
    else
        while self:step(is_end, handler) do
        end
    end
    self:remove_settled_bytes()
end

-- Searches up to the next start byte, or to the end of the current candidate; returns false if bytes are missing.
-- Positions count from 0, `last` is the position behind a candidate.
function Decoder:step(is_end, handler)
    local bound = self.current and self.current.last or #self.buffer
    local found = self.buffer:find(START, self.scan + 1, true)
    if not found or found > bound then
        self.scan = bound
        local accepted = self.current
        self.current = nil
        if accepted then
            self:accept(accepted, handler)
        end
        return accepted ~= nil
    end
    self.scan = found - 1
    local length = self:match_header(self.scan)
    if not length or (length > 0 and self.scan + length > #self.buffer) then
        if not is_end then
            return false
        end
        self.rejected_candidates = self.rejected_candidates + (length and 1 or 0)
    elseif length > 0 then
        if self.buffer:byte(self.scan + length) ~= layouts.END then
            self.rejected_candidates = self.rejected_candidates + 1
        elseif not self:resolve({ first = self.scan, last = self.scan + length }, is_end) then
            return false
        end
    end
    self.scan = self.scan + 1
    return true
end

-- Returns the length of the message whose header begins at a position; 0: no header; nil: bytes are missing.
function Decoder:match_header(position)
    local first, length, address = self.buffer:byte(position + 1, position + HEADER)
    if first and first ~= layouts.START then
        return 0
    elseif address then
        return self.lengths[address] == length and length or 0
    elseif not length or self.is_length[length] then
        return nil
    end
    return 0
end

-- Compares a complete candidate with those that overlap it, and keeps the better one; returns false if bytes are
-- missing.
function Decoder:resolve(candidate, is_end)
    local current = self.current
    if self.format.has_timestamp then
        candidate.has_evidence = self:is_plausible(self:read_time(candidate.first))
    elseif current or self.strong_end > candidate.first then
        if not self:find_evidence(candidate, is_end) or (current and not self:find_evidence(current, is_end)) then
            return false
        end
    end
    if current and current.has_evidence then
        self.strong_end = math.max(self.strong_end, current.last)
    end
    local is_beaten = not candidate.has_evidence and self.strong_end > candidate.first
    local is_worse = current and (candidate.has_evidence or not current.has_evidence)
    self.ambiguous_candidates = self.ambiguous_candidates + (is_beaten and 1 or 0) + (is_worse and 1 or 0)
    if is_worse then
        self.current = nil
    end
    if not is_beaten then
        self.current = candidate
    end
    if candidate.has_evidence then
        self.strong_end = math.max(self.strong_end, candidate.last)
    end
    return true
end

-- Finds the evidence of a candidate without timestamps: a header or the end of the stream directly behind it. Returns
-- false if bytes are missing.
function Decoder:find_evidence(candidate, is_end)
    if candidate.has_evidence == nil then
        local length = self:match_header(candidate.last)
        if not length and not is_end then
            return false
        end
        candidate.has_evidence = length ~= 0
    end
    return true
end

-- Returns the timestamp of the message that begins at a position.
function Decoder:read_time(position)
    local a, b, c, d = self.buffer:byte(position + HEADER + 1, position + HEADER + 4)
    return ((a * 256 + b) * 256 + c) * 256 + d
end

-- Returns whether a time follows one of the last messages' times closely. Time 0, the start of the hub, is always a
-- reference.
function Decoder:is_plausible(time)
    if time <= layouts.TIME_STEP_MAX_MS then
        return true
    end
    for _, reference in ipairs(self.times) do
        if (time - reference) % 4294967296 <= layouts.TIME_STEP_MAX_MS then
            return true
        end
    end
    return false
end

-- Returns `count` words from a position on; is_signed: as numbers of two's complement.
function Decoder:read_words(position, count, is_signed)
    local words = {}
    for i = 1, count do
        local first, second = self.buffer:byte(position + 2 * i - 1, position + 2 * i)
        local word = self.format.is_big_endian and first * 256 + second or second * 256 + first
        words[i] = is_signed and word >= 32768 and word - 65536 or word
    end
    return words
end

-- Decodes an accepted candidate, calls the handler, and updates counters and reference times.
function Decoder:accept(candidate, handler)
    local format, first = self.format, candidate.first
    local is_record = format.record_size > 0
    local message = { position = self.base + first, is_time_plausible = false }
    message.address = is_record and layouts.RECORD_ADDRESS or self.buffer:byte(first + 3)
    if format.has_timestamp then
        message.timestamp_ms = self:read_time(first)
        message.is_time_plausible = candidate.has_evidence
        self.times[#self.times + 1] = message.timestamp_ms
        if #self.times > layouts.REFERENCE_TIMES then
            table.remove(self.times, 1)
        end
    end
    local offset, taxels = first + (is_record and 0 or self.counts_offset), format.taxels[message.address]
    message.counts = self:read_words(offset, taxels, false)
    message.accelerations = self:read_words(offset + 2 * taxels, format.accelerations[message.address] or 0, true)
    self.discarded_bytes = self.discarded_bytes + message.position - self.covered
    self.covered = self.base + candidate.last
    handler(message)
end

-- Counts the bytes before the search position as discarded and removes them from the buffer.
function Decoder:remove_settled_bytes()
    local settled = self.current and self.current.first or self.scan
    if self.base + settled > self.covered then
        self.discarded_bytes = self.discarded_bytes + self.base + settled - self.covered
        self.covered = self.base + settled
    end
    self.buffer = self.buffer:sub(settled + 1)
    self.base = self.base + settled
    self.scan = self.scan - settled
    self.strong_end = math.max(self.strong_end - settled, 0)
    if self.current then
        self.current.first, self.current.last = self.current.first - settled, self.current.last - settled
    end
end

return original
