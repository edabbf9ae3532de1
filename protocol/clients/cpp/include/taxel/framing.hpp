/* Frames on the wire: whitening, byte stuffing (COBS), and a deframer that finds every intact frame of a stream. */
#ifndef TAXEL_CLIENT_FRAMING_HPP
#define TAXEL_CLIENT_FRAMING_HPP

#include <cstring>
#include <stdexcept>
#include <vector>

#include "taxel/crc32.hpp"

namespace taxel
{

/* Frames that a receiver accepts, as bits. */
enum Direction : unsigned { TO_HOST = 1, TO_HUB = 2 };

/* A complete frame with a correct CRC. `payload` stays valid during the call of the handler. */
struct RawFrame {
    FrameType type;
    bool is_known; /* false: this version does not define the type, or not with this payload */
    std::uint16_t sequence;
    const std::uint8_t *payload;
    std::size_t length;
};

namespace detail
{

/* Bytes behind a buffer that a copy in pieces of this size may read or write. */
constexpr std::size_t PADDING = 64;

/* Computes the whitening sequence. */
constexpr std::array<std::uint8_t, BODY_MAX + 1> make_whitening()
{
    std::array<std::uint8_t, BODY_MAX + 1> sequence{};
    std::uint32_t value = WHITENING_SEED;
    for (auto &byte : sequence) {
        byte = static_cast<std::uint8_t>(value);
        value = (WHITENING_FACTOR * value + WHITENING_INCREMENT) & 0xFFu;
    }
    return sequence;
}

inline constexpr auto whitening = make_whitening();

/* XORs bytes from position `first` of a body on with the whitening sequence, 32 at a time. */
inline void whiten(std::uint8_t *out, const std::uint8_t *bytes, std::size_t first, std::size_t size)
{
    const std::uint8_t *key = whitening.data() + first;
    std::size_t i = 0;
    for (; i + 32 <= size; i += 32) {
        std::uint64_t words[4], keys[4];
        std::memcpy(words, bytes + i, sizeof words);
        std::memcpy(keys, key + i, sizeof keys);
        for (int k = 0; k < 4; k++) {
            words[k] ^= keys[k];
        }
        std::memcpy(out + i, words, sizeof words);
    }
    for (; i < size; i++) {
        out[i] = static_cast<std::uint8_t>(bytes[i] ^ key[i]);
    }
}

/* Returns the rule of each code of a frame type, NULL for an undefined one. */
constexpr std::array<const FrameRule *, 256> make_rules_by_code()
{
    std::array<const FrameRule *, 256> rules{};
    for (const FrameRule &rule : frame_rules) {
        rules[static_cast<std::size_t>(rule.type)] = &rule;
    }
    return rules;
}

inline constexpr auto rules_by_code = make_rules_by_code();

} // namespace detail

/* Returns the rule of a frame type, or NULL for an undefined type. */
inline const FrameRule *find_rule(std::uint8_t type)
{
    return detail::rules_by_code[type];
}

/* Encodes a frame with its two delimiters. Throws std::invalid_argument if the type does not allow the length. */
inline std::vector<std::uint8_t> encode_frame(FrameType type, std::uint16_t sequence, const std::uint8_t *payload,
                                              std::size_t length)
{
    const FrameRule *rule = find_rule(static_cast<std::uint8_t>(type));
    if (!rule || length < rule->minimum || length > rule->maximum) {
        throw std::invalid_argument("taxel: the frame type does not allow this length of the payload");
    }
    std::vector<std::uint8_t> body(FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE);
    body[0] = static_cast<std::uint8_t>(type);
    detail::store(&body[1], sequence);
    detail::store(&body[3], static_cast<std::uint16_t>(length));
    if (length) {
        std::memcpy(&body[FRAME_HEADER_SIZE], payload, length);
    }
    detail::store(&body[FRAME_HEADER_SIZE + length], crc32(body.data(), FRAME_HEADER_SIZE + length));
    std::vector<std::uint8_t> wire = {0, 0};
    std::size_t code = 1; /* position of the code byte of the current block */
    for (std::size_t i = 0; i < body.size(); i++) {
        if (wire.size() - code == 0xFF) { /* 254 bytes without a zero: no zero follows this block */
            wire[code] = 0xFF;
            code = wire.size();
            wire.push_back(0);
        }
        const std::uint8_t byte = static_cast<std::uint8_t>(body[i] ^ detail::whitening[i]);
        if (byte) {
            wire.push_back(byte);
        } else {
            wire[code] = static_cast<std::uint8_t>(wire.size() - code);
            code = wire.size();
            wire.push_back(0);
        }
    }
    wire[code] = static_cast<std::uint8_t>(wire.size() - code);
    wire.push_back(0);
    return wire;
}

/* Returns whether frames of this type are accepted. Bit 7 of a type: from host to hub. */
inline bool is_accepted(FrameType type, unsigned directions)
{
    return directions & (static_cast<std::uint8_t>(type) & 0x80u ? TO_HUB : TO_HOST);
}

/* Finds the frames of a stream. A frame needs no delimiter: its header states its length. Every byte of a chunk (the
 * bytes between two zeros) is tried as the start of a frame until one is found, so that damage never hides an intact
 * frame. Memory: about 1.6 kB. */
class Deframer
{
  public:
    /* Creates a deframer without received bytes. directions: accepted frames, bits of Direction. */
    explicit Deframer(unsigned directions = TO_HOST) : directions_(directions)
    {
    }

    /* Takes any number of bytes and calls handler(const RawFrame &) for each frame that they complete. */
    template <class Handler> void push(const std::uint8_t *bytes, std::size_t size, Handler &&handler)
    {
        while (size) {
            const auto *zero = static_cast<const std::uint8_t *>(std::memchr(bytes, 0, size));
            const std::size_t length = zero ? static_cast<std::size_t>(zero - bytes) : size;
            const std::size_t used = zero ? length + 1 : size;
            position_ += used;
            if (zero && !fill_) { /* the chunk is complete: no copy is needed */
                search(bytes, length, length, handler);
            } else {
                append(bytes, length, handler);
                if (zero) {
                    finish(handler);
                }
            }
            bytes += used;
            size -= used;
        }
    }

    /* Searches the remaining bytes, as if a delimiter followed: at the end of a stream. */
    template <class Handler> void finish(Handler &&handler)
    {
        search(chunk_, fill_, fill_, handler);
        fill_ = 0;
    }

    /* Returns the number of bytes that were part of no frame; delimiters are not counted. */
    std::uint64_t discarded_bytes() const
    {
        return discarded_;
    }

    /* Returns the number of bytes of the stream up to the delimiter behind the current frame. */
    std::uint64_t position() const
    {
        return position_;
    }

  private:
    static constexpr std::size_t CAPACITY = 2 * (ENCODED_MAX + 2);

    /* Appends bytes without a zero to the chunk; searches its front when the buffer is full. */
    template <class Handler> void append(const std::uint8_t *bytes, std::size_t size, Handler &handler)
    {
        while (size) {
            if (fill_ == CAPACITY) { /* an incomplete frame may begin in the last ENCODED_MAX + 2 bytes */
                const std::size_t used = search(chunk_, fill_, fill_ - (ENCODED_MAX + 2), handler);
                fill_ -= used;
                std::memmove(chunk_, chunk_ + used, fill_);
            }
            const std::size_t step = size < CAPACITY - fill_ ? size : CAPACITY - fill_;
            std::memcpy(chunk_ + fill_, bytes, step);
            fill_ += step;
            bytes += step;
            size -= step;
        }
    }

    /* Tries every byte before `until` as the start of a frame; returns where the search ended. */
    template <class Handler>
    std::size_t search(const std::uint8_t *chunk, std::size_t size, std::size_t until, Handler &handler)
    {
        std::size_t start = 0;
        while (start < until) {
            const std::size_t used = take_frame(chunk + start, size - start, handler);
            discarded_ += used == 0;
            start += used ? used : 1;
        }
        return start;
    }

    /* Delivers the frame at the start of `bytes`; returns the number of its stuffed bytes, 0 if no frame begins there.
     */
    template <class Handler> std::size_t take_frame(const std::uint8_t *bytes, std::size_t size, Handler &handler)
    {
        std::size_t length = 0, expected = 0, position = 0;
        while (position < size) {
            const std::size_t block = bytes[position] - std::size_t{1}, end = position + bytes[position];
            if (end > size || length + block > BODY_MAX) {
                return 0;
            }
            detail::whiten(body_ + length, bytes + position + 1, length, block);
            length += block;
            if (!expected && length >= FRAME_HEADER_SIZE) {
                expected = compute_expected_size();
                if (!expected) {
                    return 0;
                }
            }
            if (expected && length >= expected) {
                return length == expected && deliver(length, handler) ? end : 0;
            }
            if (bytes[position] != 0xFF) { /* the zero between two blocks */
                if (length == BODY_MAX) {
                    return 0;
                }
                body_[length] = detail::whitening[length];
                length++;
            }
            position = end;
        }
        return 0;
    }

    /* Returns the size of the body that begins with this header, or 0 if no frame has this length. A newer sender may
     * use types and lengths that this version does not define. */
    std::size_t compute_expected_size() const
    {
        const std::size_t length = body_[3] | static_cast<std::size_t>(body_[4]) << 8;
        return length > PAYLOAD_MAX ? 0 : FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE;
    }

    /* Returns whether this version defines the frame in the buffer: its type, length, address and number of taxels. */
    bool is_known(std::size_t length) const
    {
        const std::uint8_t *payload = body_ + FRAME_HEADER_SIZE;
        const FrameRule *rule = find_rule(body_[0]);
        if (!rule || !is_accepted(rule->type, directions_) || length < rule->minimum || length > rule->maximum) {
            return false;
        }
        if (rule->has_address && (payload[0] < ADDRESS_MIN || payload[0] > ADDRESS_MAX)) {
            return false;
        }
        return rule->type != FrameType::TAXELS || length == TaxelHeader::size + SNAPSHOT_OVERHEAD + 2u * payload[1];
    }

    /* Delivers the frame in body_ if its CRC is correct; else returns false. */
    template <class Handler> bool deliver(std::size_t size, Handler &handler)
    {
        const std::uint8_t *payload = body_ + FRAME_HEADER_SIZE;
        const std::size_t length = size - FRAME_HEADER_SIZE - FRAME_CRC_SIZE;
        std::uint32_t crc = 0;
        std::uint16_t sequence = 0;
        detail::load(payload + length, crc);
        if (crc32(body_, size - FRAME_CRC_SIZE) != crc) {
            return false;
        }
        detail::load(body_ + 1, sequence);
        handler(RawFrame{static_cast<FrameType>(body_[0]), is_known(length), sequence, payload, length});
        return true;
    }

    unsigned directions_;
    std::size_t fill_ = 0;
    std::uint64_t discarded_ = 0, position_ = 0;
    std::uint8_t chunk_[CAPACITY];
    std::uint8_t body_[BODY_MAX + 1 + detail::PADDING] = {};
};

} // namespace taxel

#endif
