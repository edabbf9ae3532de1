/* Compact snapshots of one board: packed frames and delta frames to counts, key frames, and the answers to the
 * board. */
#ifndef TAXEL_CLIENT_COMPACT_HPP
#define TAXEL_CLIENT_COMPACT_HPP

#include "taxel/compact_model.hpp"
#include "taxel/crc32.hpp"

namespace taxel
{

/* Result of a compact snapshot; NO_KEY_FRAME: a delta frame whose key frame this host does not have. */
enum class CompactResult { OK, DAMAGED, NO_KEY_FRAME };

/* Answer that the host has to send to a board in an ACKNOWLEDGE frame. */
enum class CompactAnswer : std::uint8_t { NONE, ACKNOWLEDGE, FORGET };

namespace detail
{

/* Decoder of a range coder (Martin, 1979). Bytes after the last one are zeros. */
class RangeDecoder
{
  public:
    /* Creates a decoder of the coded bytes of a delta frame. */
    RangeDecoder(const std::uint8_t *bytes, std::size_t size) : bytes_(bytes), size_(size)
    {
        for (int i = 0; i < 4; i++) {
            shift_in_byte();
        }
    }
    /* Returns the next of 2^bits equal shares, without consuming it. Damaged bytes alone point behind the last one. */
    std::uint32_t peek(std::uint32_t bits) const
    {
        const std::uint32_t share = code_ / (range_ >> bits), last = (1u << bits) - 1u;
        return share < last ? share : last;
    }
    /* Consumes the symbol with the interval [first, first + size) of 2^bits equal shares. */
    void take(std::uint32_t first, std::uint32_t size, std::uint32_t bits)
    {
        const std::uint32_t share = range_ >> bits;
        code_ -= first * share;
        range_ = size * share;
        while (range_ < 1u << 24) {
            shift_in_byte();
            range_ <<= 8;
        }
    }
    /* Decodes and consumes an uncoded number. */
    std::uint32_t take_bits(std::uint32_t bits)
    {
        const std::uint32_t value = peek(bits);
        take(value, 1, bits);
        return value;
    }

  private:
    /* Moves the next byte into the code. */
    void shift_in_byte()
    {
        code_ = code_ << 8 | (position_ < size_ ? bytes_[position_] : 0u);
        position_++;
    }

    const std::uint8_t *bytes_;
    std::size_t size_, position_ = 0;
    std::uint32_t code_ = 0, range_ = 0xFFFFFFFF;
};

/* Decodes a count too far from its prediction: sign, exponent and mantissa of the distance from the centre. Returns
 * false for bytes that no encoder produces. */
inline bool take_escape(RangeDecoder &decoder, const Taxel &taxel, std::uint16_t &count)
{
    decoder.take(0, COMPACT_ESCAPE, COMPACT_TOTAL_BITS);
    const std::uint32_t head = decoder.take_bits(5), exponent = head >> 1;
    const std::uint32_t size = (1u << exponent) + decoder.take_bits(exponent), centre = taxel.centre();
    if (head & 1u ? size > centre : size > COUNT_MAX - centre) {
        return false;
    }
    count = static_cast<std::uint16_t>(head & 1u ? centre - size : centre + size);
    return true;
}

/* Decodes the next count; returns false for bytes that no encoder produces. */
inline bool take_count(RangeDecoder &decoder, const Taxel &taxel, std::uint16_t &count)
{
    const std::uint32_t target = decoder.peek(COMPACT_TOTAL_BITS);
    if (target < COMPACT_ESCAPE) {
        return take_escape(decoder, taxel, count);
    }
    const std::uint32_t raw_bits = taxel.raw_bits(), last = COUNT_MAX >> raw_bits;
    std::uint32_t symbol = find_first_symbol(taxel, target);
    std::uint32_t first = taxel.cumulative(symbol), next = taxel.cumulative(symbol + 1);
    while (next <= target && symbol < last) {
        symbol++;
        first = next;
        next = taxel.cumulative(symbol + 1);
    }
    if (target < first || target >= next) {
        return false;
    }
    decoder.take(first, next - first, COMPACT_TOTAL_BITS);
    count = static_cast<std::uint16_t>(symbol << raw_bits | (raw_bits ? decoder.take_bits(raw_bits) : 0u));
    return true;
}

/* Unpacks the counts of a packed frame, each of `width` bits, lowest bits first. */
inline void unpack_counts(const std::uint8_t *bytes, std::size_t taxels, std::uint32_t width, std::uint16_t *counts)
{
    std::uint32_t buffer = 0, bits = 0;
    for (std::size_t i = 0; i < taxels; i++) {
        for (; bits < width; bits += 8) {
            buffer |= static_cast<std::uint32_t>(*bytes++) << bits;
        }
        counts[i] = static_cast<std::uint16_t>(buffer & ((1u << width) - 1u));
        buffer >>= width;
        bits -= width;
    }
}

/* Key frame of a board: the predictions against which delta frames are coded. */
struct KeyFrame {
    bool is_valid = false;
    std::uint8_t taxel_count = 0;
    std::uint32_t updates = 0;
    std::uint16_t id = 0;
    std::uint32_t timestamp_us = 0;
    Taxel taxels[COMPACT_TAXELS_MAX];
};

} // namespace detail

/* State of the compact snapshots of one board. */
class CompactReceiver
{
  public:
    /* Decodes a compact snapshot, the bytes from `sequence` to `crc32`, into counts[taxel_count] and the time. */
    CompactResult receive(std::uint8_t address, std::uint8_t taxel_count, const std::uint8_t *bytes, std::size_t size,
                          std::uint16_t *counts, std::uint32_t &timestamp_us)
    {
        std::uint32_t crc = 0;
        if (size < COMPACT_OVERHEAD_DELTA || taxel_count == 0 || taxel_count > COMPACT_TAXELS_MAX) {
            return CompactResult::DAMAGED;
        }
        detail::load(bytes + size - 4, crc);
        const CompactHeader head = CompactHeader::unpack(bytes);
        const bool is_key_frame = head.format & COMPACT_KEY_FRAME;
        if (crc32(bytes, size - 4, crc32(&address, 1)) != crc || !is_defined(head.format)) {
            return CompactResult::DAMAGED;
        }
        const CompactResult result = head.format & COMPACT_WIDTH_MASK
                                         ? receive_packed(taxel_count, bytes, size, counts, timestamp_us)
                                         : receive_delta(taxel_count, bytes, size, counts, timestamp_us);
        const auto id = static_cast<std::uint16_t>(crc);
        if (result == CompactResult::OK && is_key_frame) {
            /* no board marks a snapshot whose id equals that of the key frame in use */
            pending_.is_valid = !(key_frame_.is_valid && key_frame_.id == id);
            if (pending_.is_valid) {
                pending_.id = id;
                pending_.timestamp_us = timestamp_us;
                set_answer(CompactAnswer::ACKNOWLEDGE);
            }
        }
        return result;
    }

    /* Returns the answer that has not been sent yet. */
    CompactAnswer answer() const
    {
        return answer_;
    }

    /* Returns the answer as an element of an ACKNOWLEDGE payload; it then counts as sent. */
    Acknowledgement take_answer(std::uint8_t address)
    {
        Acknowledgement acknowledgement;
        const bool is_forget = answer_ == CompactAnswer::FORGET;
        acknowledgement.address = static_cast<std::uint8_t>(address | (is_forget ? ACKNOWLEDGE_FORGET : 0u));
        acknowledgement.key_frame = is_forget ? std::uint16_t{0} : pending_.id;
        answer_ = CompactAnswer::NONE;
        return acknowledgement;
    }

  private:
    static constexpr int REPEAT_AFTER = 4; /* snapshots that may arrive before an answer takes effect on the board */

    /* Returns whether the protocol defines this format byte. */
    static bool is_defined(std::uint8_t format)
    {
        const std::uint32_t width = format & COMPACT_WIDTH_MASK;
        return width <= 16 && (!(format & COMPACT_START_MASK) || (width && format & COMPACT_KEY_FRAME));
    }

    /* Stores an answer to be sent. */
    void set_answer(CompactAnswer answer)
    {
        answer_ = answer;
        snapshots_until_repeat_ = REPEAT_AFTER;
    }

    /* Stores an answer again if several snapshots have arrived without its effect. */
    void repeat_answer(CompactAnswer answer)
    {
        if (snapshots_until_repeat_) {
            snapshots_until_repeat_--;
        } else {
            set_answer(answer);
        }
    }

    /* Decodes a packed frame; if it is marked as a key frame, it becomes the pending one. */
    CompactResult receive_packed(std::uint8_t taxel_count, const std::uint8_t *bytes, std::size_t size,
                                 std::uint16_t *counts, std::uint32_t &timestamp_us)
    {
        const CompactPacked head = CompactPacked::unpack(bytes);
        const std::uint32_t width = head.format & COMPACT_WIDTH_MASK;
        if (size < CompactPacked::size + (width * taxel_count + 7) / 8 + 4) {
            return CompactResult::DAMAGED;
        }
        timestamp_us = head.timestamp_us;
        detail::unpack_counts(bytes + CompactPacked::size, taxel_count, width, counts);
        if (head.format & COMPACT_KEY_FRAME) { /* the board has discarded its earlier key frame */
            const std::uint32_t start = (head.format & COMPACT_START_MASK) >> COMPACT_START_SHIFT;
            key_frame_.is_valid = false;
            pending_.taxel_count = taxel_count;
            pending_.updates = 1;
            for (std::size_t i = 0; i < taxel_count; i++) {
                pending_.taxels[i].mean = static_cast<std::uint32_t>(counts[i]) << COMPACT_FRACTION_BITS;
                pending_.taxels[i].level = COMPACT_LEVEL_START + COMPACT_LEVEL_START_STEP * start;
            }
        }
        return CompactResult::OK;
    }

    /* Decodes a delta frame against the key frame that it names. */
    CompactResult receive_delta(std::uint8_t taxel_count, const std::uint8_t *bytes, std::size_t size,
                                std::uint16_t *counts, std::uint32_t &timestamp_us)
    {
        const CompactDelta head = CompactDelta::unpack(bytes);
        if (pending_.is_valid && pending_.id == head.key_frame) { /* the board has received the acknowledgement */
            key_frame_ = pending_;
            pending_.is_valid = false;
            answer_ = CompactAnswer::NONE;
        }
        if (!key_frame_.is_valid || key_frame_.id != head.key_frame || key_frame_.taxel_count != taxel_count ||
            !decode_counts(bytes + CompactDelta::size, size - CompactDelta::size - 4, counts)) {
            return reject_delta();
        }
        const std::uint32_t low = head.timestamp_low[0] | static_cast<std::uint32_t>(head.timestamp_low[1]) << 8 |
                                  static_cast<std::uint32_t>(head.timestamp_low[2]) << 16;
        timestamp_us = key_frame_.timestamp_us + ((low - key_frame_.timestamp_us) & 0xFFFFFFu);
        if (head.format & COMPACT_KEY_FRAME) {
            update_pending(counts);
        } else if (pending_.is_valid) {
            repeat_answer(CompactAnswer::ACKNOWLEDGE);
        }
        return CompactResult::OK;
    }

    /* Decodes the counts of a delta frame; returns false for bytes that no encoder produces. */
    bool decode_counts(const std::uint8_t *bytes, std::size_t size, std::uint16_t *counts) const
    {
        detail::RangeDecoder decoder(bytes, size);
        for (std::size_t i = 0; i < key_frame_.taxel_count; i++) {
            if (!detail::take_count(decoder, key_frame_.taxels[i], counts[i])) {
                return false;
            }
        }
        return true;
    }

    /* Computes the pending key frame from the key frame in use and the counts after it. */
    void update_pending(const std::uint16_t *counts)
    {
        const std::uint32_t gain = COMPACT_GAINS[key_frame_.updates - 1];
        pending_.taxel_count = key_frame_.taxel_count;
        for (std::size_t i = 0; i < key_frame_.taxel_count; i++) {
            pending_.taxels[i] = detail::update(key_frame_.taxels[i], counts[i], gain);
        }
        pending_.updates = key_frame_.updates + (key_frame_.updates < detail::UPDATES_MAX ? 1u : 0u);
    }

    /* Discards both key frames after a delta frame that cannot be decoded, and reports this to the board. */
    CompactResult reject_delta()
    {
        if (key_frame_.is_valid || pending_.is_valid) {
            key_frame_.is_valid = pending_.is_valid = false;
            snapshots_until_repeat_ = 0;
        }
        repeat_answer(CompactAnswer::FORGET);
        return CompactResult::NO_KEY_FRAME;
    }

    CompactAnswer answer_ = CompactAnswer::NONE;
    int snapshots_until_repeat_ = 0;
    detail::KeyFrame key_frame_, pending_;
};

} // namespace taxel

#endif
