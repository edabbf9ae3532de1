/* Capture files: bytes of a wire with their arrival times (SPEC.md, part 4). */
#ifndef TAXEL_CLIENT_CAPTURE_HPP
#define TAXEL_CLIENT_CAPTURE_HPP

#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "taxel/protocol.hpp"

namespace taxel
{

/* Error of a file that is no capture, or of a capture that is damaged or truncated. */
class CaptureError : public std::runtime_error
{
  public:
    using std::runtime_error::runtime_error;
};

/* The bytes that arrived in one piece, and the time of their arrival. */
struct CaptureRecord {
    std::uint64_t time_ns = 0;
    const std::uint8_t *bytes = nullptr; /* valid until the next call of next() */
    std::size_t size = 0;
};

/* Reader of a capture file. Throws CaptureError if the file cannot be read or is no capture. */
class CaptureReader
{
  public:
    /* Opens a capture file and reads its header. */
    explicit CaptureReader(const std::string &path) : path_(path), file_(path, std::ios::binary)
    {
        std::uint16_t version = 0;
        std::uint32_t size = 0;
        if (!file_) {
            throw CaptureError(path_ + ": cannot be opened");
        }
        file_.seekg(0, std::ios::end);
        unread_ = static_cast<std::uint64_t>(file_.tellg());
        file_.seekg(0);
        if (!fill_block(START_SIZE) || std::memcmp(block_.data(), "TAXELCAP", 8) != 0) {
            throw CaptureError(path_ + ": is not a taxel capture (it does not begin with TAXELCAP)");
        }
        detail::load(block_.data() + 8, version);
        detail::load(block_.data() + 12, size);
        if (version != VERSION) {
            throw CaptureError(path_ + ": is a capture of version " + std::to_string(version) +
                               "; this program reads version " + std::to_string(VERSION));
        }
        first_ = START_SIZE;
        if (!fill_block(size)) {
            throw CaptureError(path_ + ": has a damaged header (its length is impossible)");
        }
        header_.assign(reinterpret_cast<const char *>(block_.data() + first_), size);
        first_ += size;
    }

    /* Returns the header of the file, a JSON object. */
    const std::string &header() const
    {
        return header_;
    }

    /* Reads the next record; returns false at the end of the file. Throws CaptureError for an incomplete record, after
     * all complete records. */
    bool next(CaptureRecord &record)
    {
        std::uint32_t size = 0;
        if (!fill_block(1)) {
            return false;
        }
        if (fill_block(HEAD_SIZE)) {
            detail::load(block_.data() + first_, record.time_ns);
            detail::load(block_.data() + first_ + 8, size);
            if (fill_block(HEAD_SIZE + std::size_t{size})) {
                record.bytes = block_.data() + first_ + HEAD_SIZE;
                record.size = size;
                first_ += HEAD_SIZE + size;
                return true;
            }
        }
        first_ = last_; /* the next call returns false */
        unread_ = 0;
        throw CaptureError(path_ + ": ends inside a record; the records before are complete");
    }

  private:
    static constexpr std::size_t START_SIZE = 16, HEAD_SIZE = 12, BLOCK_SIZE = 1 << 16;
    static constexpr unsigned VERSION = 1;

    /* Reads until the block holds `size` bytes from first_ on; returns false if the file has fewer. A damaged length
     * never allocates more memory than the file has bytes. */
    bool fill_block(std::size_t size)
    {
        if (last_ - first_ >= size) {
            return true;
        }
        if (size > last_ - first_ + unread_) {
            return false;
        }
        if (first_) {
            std::memmove(block_.data(), block_.data() + first_, last_ - first_);
            last_ -= first_;
            first_ = 0;
        }
        if (block_.size() < size || block_.size() < BLOCK_SIZE) {
            block_.resize(size < BLOCK_SIZE ? BLOCK_SIZE : size);
        }
        const std::size_t space = block_.size() - last_,
                          step = unread_ < space ? static_cast<std::size_t>(unread_) : space;
        if (!file_.read(reinterpret_cast<char *>(block_.data() + last_), static_cast<std::streamsize>(step))) {
            throw CaptureError(path_ + ": cannot be read");
        }
        last_ += step;
        unread_ -= step;
        return true;
    }

    std::string path_, header_;
    std::ifstream file_;
    std::vector<std::uint8_t> block_;
    std::size_t first_ = 0, last_ = 0; /* valid bytes of the block */
    std::uint64_t unread_ = 0;
};

} // namespace taxel

#endif
