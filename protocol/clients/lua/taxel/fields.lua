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
