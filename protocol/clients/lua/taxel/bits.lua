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
