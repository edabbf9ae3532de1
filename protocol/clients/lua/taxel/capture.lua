-- Capture files: bytes of a wire with their arrival times (SPEC.md, part 4).
local fields = require("taxel.fields")

local capture = {}

-- Calls handler(bytes, time in nanoseconds as a number) for each record of a capture file, and returns its header, a
-- JSON text. Raises an error of one line for a file that is no capture, or after the last record of a truncated file.
function capture.read(path, handler)
    local file, reason = io.open(path, "rb")
    if not file then
        error(reason, 0)
    end
    local start = file:read(16)
    if not start or #start < 16 or start:sub(1, 8) ~= "TAXELCAP" then
        error(path .. ": is not a taxel capture (it does not begin with TAXELCAP)", 0)
    end
    local version, size = fields.read_number(start, 8, 2), fields.read_number(start, 12, 4)
    if version ~= 1 then
        error(path .. ": is a capture of version " .. version .. "; this program reads version 1", 0)
    end
    local header = size == 0 and "" or file:read(size)
    if not header or #header < size then
        error(path .. ": has a damaged header (its length is impossible)", 0)
    end
    while true do
        local head = file:read(12)
        if not head then
            break
        end
        local length = #head == 12 and fields.read_number(head, 8, 4)
        local bytes = length and (length == 0 and "" or file:read(length))
        if not bytes or #bytes < length then
            error(path .. ": ends inside a record; the records before are complete", 0)
        end
        handler(bytes, fields.read_number(head, 0, 4) + 4294967296 * fields.read_number(head, 4, 4))
    end
    file:close()
    return header
end

return capture
