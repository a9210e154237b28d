// What the C++ harnesses have in common: payloads as 32-bit words (the packing of golden_model/contract/bitpack.py), random
// stalls, files in memory.

#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace harness {

// A port as 32-bit words, whatever type Verilator gave it.
template <unsigned BITS>
struct Words {
    static constexpr unsigned COUNT = (BITS + 31) / 32;
    uint32_t word[COUNT + 2] = {};  // room for a tag that starts in the last word

    template <typename Port>
    void to(Port& port) const {
        if constexpr (BITS > 64) {
            std::memcpy(port.data(), word, COUNT * 4);
        } else {
            port = static_cast<Port>(word[0] | (uint64_t{word[1]} << 32));
        }
    }

    template <typename Port>
    void from(const Port& port) {
        if constexpr (BITS > 64) {
            std::memcpy(word, port.data(), COUNT * 4);
        } else {
            const uint64_t value = port;
            word[0] = static_cast<uint32_t>(value);
            word[1] = static_cast<uint32_t>(value >> 32);
        }
    }
};

// A stream's payload: BITS of data, and TAG_WIDTH bits of tag above them.
template <unsigned BITS, unsigned TAG_WIDTH>
struct Payload : Words<BITS + TAG_WIDTH> {
    static constexpr unsigned ROW = (BITS + 31) / 32;  // words of the data alone
    static constexpr uint64_t TAG_MASK = (uint64_t{1} << TAG_WIDTH) - 1;
    static constexpr unsigned TAG_WORD = BITS / 32, TAG_SHIFT = BITS % 32;

    // `row` has no bits beyond BITS.
    void put(const uint32_t* row, uint64_t tag) {
        std::memcpy(this->word, row, ROW * 4);
        if constexpr (TAG_SHIFT == 0) this->word[TAG_WORD] = 0;
        this->word[TAG_WORD + 1] = 0;
        const uint64_t shifted = (tag & TAG_MASK) << TAG_SHIFT;
        this->word[TAG_WORD] |= static_cast<uint32_t>(shifted);
        this->word[TAG_WORD + 1] |= static_cast<uint32_t>(shifted >> 32);
    }

    uint64_t tag() const {
        const uint64_t top = this->word[TAG_WORD] | (uint64_t{this->word[TAG_WORD + 1]} << 32);
        return (top >> TAG_SHIFT) & TAG_MASK;
    }

    void get(uint32_t* row) const {
        std::memcpy(row, this->word, ROW * 4);
        if constexpr (TAG_SHIFT != 0) row[TAG_WORD] &= (uint32_t{1} << TAG_SHIFT) - 1;
    }
};

// xorshift64*: one random bit decides a side's next cycle, and now and then a side stalls for longer. Seed 0: never.
class Stalls {
    uint64_t state_;
    unsigned hold_ = 0;

  public:
    explicit Stalls(uint64_t seed) : state_{seed} {}

    bool next() {
        if (state_ == 0) return true;
        if (hold_ != 0) return --hold_, false;
        state_ ^= state_ >> 12, state_ ^= state_ << 25, state_ ^= state_ >> 27;
        const uint64_t random = state_ * 0x2545F4914F6CDD1Du;
        if ((random >> 56) == 0) hold_ = (random >> 48) & 63;
        return (random >> 32) & 1;
    }
};

// A file of at least so many bytes, in memory.
inline void* map(const char* path, uint64_t bytes, bool write) {
    const int file = open(path, write ? O_RDWR : O_RDONLY);
    if (file < 0) { std::perror(path); std::exit(1); }
    if (bytes == 0) { close(file); return nullptr; }
    void* memory = mmap(nullptr, bytes, write ? PROT_READ | PROT_WRITE : PROT_READ, MAP_SHARED, file, 0);
    if (memory == MAP_FAILED) { std::perror(path); std::exit(1); }
    close(file);
    return memory;
}

}  // namespace harness
