/* Messages of the original hub (SPEC.md, part 7): without CRC, sequence number and byte stuffing. */
#ifndef TAXEL_CLIENT_ORIGINAL_HPP
#define TAXEL_CLIENT_ORIGINAL_HPP

#include <algorithm>
#include <cstring>
#include <optional>
#include <vector>

#include "taxel/original_formats.hpp"

namespace taxel
{

/* One message. Pointers stay valid during the call of the handler. */
struct OriginalMessage {
    std::uint8_t address;
    std::uint32_t timestamp_ms; /* 0 in formats without a timestamp */
    bool is_time_plausible;     /* the time follows a recent message; a damaged time seldom does */
    std::uint64_t position;     /* of the first byte in the stream */
    const std::uint16_t *counts;
    std::size_t taxel_count;
    const std::int16_t *accelerations;
    std::size_t acceleration_count;
};

/* Decoder of a stream. A candidate begins with start byte, length and address of a known board, and ends with the end
 * byte. It is accepted if no overlapping candidate has better evidence, or equal evidence and a later start. */
class OriginalDecoder
{
  public:
    /* Creates a decoder without received bytes. format: variant of the messages, one of original_formats. */
    explicit OriginalDecoder(const OriginalFormat &format = original_formats[0]) : format_(format)
    {
        for (std::size_t address = 0; address < sizeof format.taxels; address++) {
            is_length_[get_length(address)] = true;
        }
    }

    /* Takes any number of bytes and calls handler(const OriginalMessage &) for each message that can be decided. */
    template <class Handler> void push(const std::uint8_t *bytes, std::size_t size, Handler &&handler)
    {
        buffer_.insert(buffer_.end(), bytes, bytes + size);
        process(false, handler);
    }

    /* Decides the remaining bytes: at the end of a stream, or after a pause of the hub. */
    template <class Handler> void finish(Handler &&handler)
    {
        process(true, handler);
    }

    /* Returns the number of bytes in no accepted message. */
    std::uint64_t discarded_bytes() const
    {
        return discarded_;
    }
    /* Returns the number of headers without an end byte at their length. */
    std::uint64_t rejected_candidates() const
    {
        return rejected_;
    }
    /* Returns the number of complete candidates that overlap a better one. */
    std::uint64_t ambiguous_candidates() const
    {
        return ambiguous_;
    }

  private:
    /* A complete candidate in the buffer. has_evidence: no value: not yet needed. */
    struct Candidate {
        std::size_t start, end;
        std::optional<bool> has_evidence;
    };

    /* Returns the length of a message of this board; 0 for an unknown board. */
    std::size_t get_length(std::size_t address) const
    {
        if (address >= sizeof format_.taxels || !format_.taxels[address]) {
            return 0;
        }
        const std::size_t words = std::size_t{format_.taxels[address]} + format_.accelerations[address];
        return counts_offset() + 2 * words + 1;
    }

    /* Returns the offset of the first count in a message. */
    std::size_t counts_offset() const
    {
        return ORIGINAL_HEADER_SIZE + (format_.has_timestamp ? ORIGINAL_TIMESTAMP_SIZE : 0);
    }

    /* Delivers the messages that can be decided with the bytes in the buffer. */
    template <class Handler> void process(bool is_end, Handler &handler)
    {
        if (format_.record_size) {
            for (; buffer_.size() - scan_ >= format_.record_size; scan_ += format_.record_size) {
                accept({scan_, scan_ + format_.record_size, false}, handler);
            }
            scan_ = is_end ? buffer_.size() : scan_;
        } else {
            while (step(is_end, handler)) {
            }
        }
        remove_settled_bytes();
    }

    /* Searches up to the next start byte, or to the end of the current candidate; returns false if bytes are
     * missing. */
    template <class Handler> bool step(bool is_end, Handler &handler)
    {
        const std::size_t until = current_ ? current_->end : buffer_.size();
        const auto end = buffer_.begin() + static_cast<std::ptrdiff_t>(until);
        const auto found = std::find(buffer_.begin() + static_cast<std::ptrdiff_t>(scan_), end, ORIGINAL_START);
        scan_ = static_cast<std::size_t>(found - buffer_.begin());
        if (found == end) {
            if (!current_) {
                return false;
            }
            const Candidate accepted = *current_;
            current_.reset();
            accept(accepted, handler);
            return true;
        }
        const std::optional<std::size_t> length = match_header(scan_);
        if (!length || (*length && scan_ + *length > buffer_.size())) {
            if (!is_end) {
                return false;
            }
            rejected_ += length.has_value();
        } else if (*length) {
            if (buffer_[scan_ + *length - 1] != ORIGINAL_END) {
                rejected_++;
            } else if (!resolve({scan_, scan_ + *length, std::nullopt}, is_end)) {
                return false;
            }
        }
        scan_++;
        return true;
    }

    /* Returns the length of the message whose header begins at `start`; 0: no header; no value: bytes are missing. */
    std::optional<std::size_t> match_header(std::size_t start) const
    {
        const std::size_t available = buffer_.size() - start;
        if (available && buffer_[start] != ORIGINAL_START) {
            return 0;
        }
        if (available >= ORIGINAL_HEADER_SIZE) {
            const std::size_t length = get_length(buffer_[start + 2]);
            return length == buffer_[start + 1] ? length : 0;
        }
        if (available < 2 || is_length_[buffer_[start + 1]]) {
            return std::nullopt;
        }
        return 0;
    }

    /* Compares a complete candidate with those that overlap it, and keeps the better one; returns false if bytes are
     * missing. */
    bool resolve(Candidate candidate, bool is_end)
    {
        if (format_.has_timestamp) {
            candidate.has_evidence = is_plausible(read_time(candidate.start));
        } else if (current_ || strong_end_ > candidate.start) {
            if (!find_evidence(candidate, is_end) || (current_ && !find_evidence(*current_, is_end))) {
                return false;
            }
        }
        const bool is_strong = candidate.has_evidence.value_or(false);
        const bool is_current_strong = current_ && current_->has_evidence.value_or(false);
        if (is_current_strong) {
            strong_end_ = std::max(strong_end_, current_->end);
        }
        const bool is_beaten = !is_strong && strong_end_ > candidate.start;
        ambiguous_ += is_beaten;
        if (current_ && (is_strong || !is_current_strong)) {
            ambiguous_++;
            current_.reset();
        }
        if (!is_beaten) {
            current_ = candidate;
        }
        if (is_strong) {
            strong_end_ = std::max(strong_end_, candidate.end);
        }
        return true;
    }

    /* Finds the evidence of a candidate without timestamps: a header or the end of the stream directly behind it.
     * Returns false if bytes are missing. */
    bool find_evidence(Candidate &candidate, bool is_end) const
    {
        if (!candidate.has_evidence) {
            const std::optional<std::size_t> length = match_header(candidate.end);
            if (!length && !is_end) {
                return false;
            }
            candidate.has_evidence = !length || *length;
        }
        return true;
    }

    /* Returns the timestamp of the message that begins at `start`. */
    std::uint32_t read_time(std::size_t start) const
    {
        std::uint32_t time = 0;
        for (std::size_t i = 0; i < ORIGINAL_TIMESTAMP_SIZE; i++) {
            time = time << 8 | buffer_[start + ORIGINAL_HEADER_SIZE + i];
        }
        return time;
    }

    /* Returns whether a time follows one of the last messages' times closely. Time 0, the start of the hub, is always a
     * reference. */
    bool is_plausible(std::uint32_t time_ms) const
    {
        return time_ms <= ORIGINAL_TIME_STEP_MAX_MS ||
               std::any_of(times_.begin(), times_.end(),
                           [&](std::uint32_t time) { return time_ms - time <= ORIGINAL_TIME_STEP_MAX_MS; });
    }

    /* Returns the number of 16 bits at a position of the buffer. */
    std::uint16_t read_word(std::size_t position) const
    {
        const unsigned first = buffer_[position], second = buffer_[position + 1];
        return static_cast<std::uint16_t>(format_.is_big_endian ? first << 8 | second : second << 8 | first);
    }

    /* Decodes an accepted candidate, calls the handler, and updates counters and reference times. */
    template <class Handler> void accept(const Candidate &candidate, Handler &handler)
    {
        OriginalMessage message{};
        const bool is_record = format_.record_size != 0;
        message.address = is_record ? static_cast<std::uint8_t>(ORIGINAL_RECORD_ADDRESS) : buffer_[candidate.start + 2];
        message.position = base_ + candidate.start;
        std::size_t offset = candidate.start + (is_record ? 0 : counts_offset());
        if (format_.has_timestamp) {
            message.timestamp_ms = read_time(candidate.start);
            message.is_time_plausible = candidate.has_evidence.value_or(false);
            times_.push_back(message.timestamp_ms);
            if (times_.size() > ORIGINAL_REFERENCE_TIMES) {
                times_.erase(times_.begin());
            }
        }
        message.taxel_count = format_.taxels[message.address];
        message.acceleration_count = format_.accelerations[message.address];
        for (std::size_t i = 0; i < message.taxel_count; i++, offset += 2) {
            counts_[i] = read_word(offset);
        }
        for (std::size_t i = 0; i < message.acceleration_count; i++, offset += 2) {
            accelerations_[i] = static_cast<std::int16_t>(read_word(offset));
        }
        message.counts = counts_;
        message.accelerations = accelerations_;
        discarded_ += message.position - covered_;
        covered_ = base_ + candidate.end;
        handler(static_cast<const OriginalMessage &>(message));
    }

    /* Counts the bytes before the search position as discarded and removes them from the buffer. */
    void remove_settled_bytes()
    {
        const std::size_t settled = current_ ? current_->start : scan_;
        if (base_ + settled > covered_) {
            discarded_ += base_ + settled - covered_;
            covered_ = base_ + settled;
        }
        buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(settled));
        base_ += settled;
        scan_ -= settled;
        strong_end_ = strong_end_ > settled ? strong_end_ - settled : 0;
        if (current_) {
            current_->start -= settled;
            current_->end -= settled;
        }
    }

    const OriginalFormat &format_;
    bool is_length_[256] = {};
    std::vector<std::uint8_t> buffer_;
    std::size_t scan_ = 0;                 /* first byte that is not searched yet */
    std::size_t strong_end_ = 0;           /* end of the farthest candidate with evidence */
    std::optional<Candidate> current_;     /* best candidate that overlaps the byte at scan_ */
    std::uint64_t base_ = 0, covered_ = 0; /* stream positions: start of the buffer; end of the settled bytes */
    std::uint64_t discarded_ = 0, rejected_ = 0, ambiguous_ = 0;
    std::vector<std::uint32_t> times_;
    std::uint16_t counts_[256];
    std::int16_t accelerations_[ORIGINAL_ACCELERATIONS];
};

} // namespace taxel

#endif
