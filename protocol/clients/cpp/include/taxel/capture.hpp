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

/* A file that is no capture, or a capture that is damaged or truncated. */
class CaptureError : public std::runtime_error
{
  public:
    using std::runtime_error::runtime_error;
};

/* Reader of a capture file. Throws CaptureError if the file cannot be read or is no capture. */
class CaptureReader
{
  public:
    explicit CaptureReader(const std::string &path) : path_(path), file_(path, std::ios::binary)
    {
        std::uint8_t start[START_SIZE] = {};
        std::uint16_t version = 0;
        std::uint32_t size = 0;
        if (!file_) {
            throw CaptureError(path_ + ": cannot be opened");
        }
        file_.seekg(0, std::ios::end);
        remaining_ = static_cast<std::uint64_t>(file_.tellg());
        file_.seekg(0);
        if (!read(start, sizeof start) || std::memcmp(start, "TAXELCAP", 8) != 0) {
            throw CaptureError(path_ + ": is not a taxel capture (it does not begin with TAXELCAP)");
        }
        detail::load(start + 8, version);
        detail::load(start + 12, size);
        if (version != VERSION) {
            throw CaptureError(path_ + ": is a capture of version " + std::to_string(version) +
                               "; this program reads version " + std::to_string(VERSION));
        }
        if (size > remaining_) {
            throw CaptureError(path_ + ": has a damaged header (its length is impossible)");
        }
        header_.resize(size);
        read(reinterpret_cast<std::uint8_t *>(&header_[0]), size);
    }

    /* The header of the file, a JSON object. */
    const std::string &header() const
    {
        return header_;
    }

    /* Reads the next record; false at the end of the file. Throws CaptureError for an incomplete record, after all
     * complete records. */
    bool next(std::uint64_t &time_ns, std::vector<std::uint8_t> &bytes)
    {
        std::uint8_t head[HEAD_SIZE];
        std::uint32_t size = 0;
        if (!remaining_) {
            return false;
        }
        if (read(head, sizeof head)) {
            detail::load(head, time_ns);
            detail::load(head + 8, size);
            if (size <= remaining_) { /* no more memory than the file has bytes */
                bytes.resize(size);
                read(bytes.data(), size);
                return true;
            }
        }
        remaining_ = 0;
        throw CaptureError(path_ + ": ends inside a record; the records before are complete");
    }

  private:
    static constexpr std::size_t START_SIZE = 16, HEAD_SIZE = 12;
    static constexpr unsigned VERSION = 1;

    bool read(std::uint8_t *bytes, std::size_t size)
    {
        if (size > remaining_) {
            return false;
        }
        if (size && !file_.read(reinterpret_cast<char *>(bytes), static_cast<std::streamsize>(size))) {
            throw CaptureError(path_ + ": cannot be read");
        }
        remaining_ -= size;
        return true;
    }

    std::string path_, header_;
    std::ifstream file_;
    std::uint64_t remaining_ = 0;
};

} // namespace taxel

#endif
