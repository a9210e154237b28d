// Streams binary operands through a Verilated unit and writes its binary results.
//
//     bulk OPERANDS RESULTS COUNT STALL_SEED
//
// OPERANDS holds COUNT rows of OPERAND_WORDS 32-bit words, RESULTS gets COUNT rows of RESULT_WORDS words (the packing of
// golden_model/bitpack.py). Operation k carries the low bits of k as its tag. STALL_SEED 0 keeps both sides busy every
// cycle; any other seed stalls both at random. Prints "cycles latency seconds"; exits with 1 and one line on
// stderr where a tag is wrong, a result is missing or too many, or nothing moves any more.
//
// Compiled with -DINPUT_BITS, -DOUTPUT_BITS (payload without tag), -DTAG_BITS as the top, sim/bulk.v, is, and with
// -DSTALLS where the unit may be stalled; without it the top holds a register before the unit.

#include <chrono>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "Vbulk.h"
#include "Vbulk___024root.h"

// What Vbulk::eval calls. The rest of that, for designs that print or that run in threads, takes as long as an adder.
void Vbulk___024root___eval(Vbulk___024root* root);

namespace {

constexpr unsigned OPERAND_WORDS = (INPUT_BITS + 31) / 32;
constexpr unsigned RESULT_WORDS = (OUTPUT_BITS + 31) / 32;
constexpr uint64_t TAG_MASK = (uint64_t{1} << TAG_BITS) - 1;
#ifdef STALLS
constexpr uint64_t TOP_LATENCY = 0;
#else
constexpr uint64_t TOP_LATENCY = 1;
#endif
constexpr uint64_t HANG_CYCLES = 100000;  // far more than any latency and any stall

[[noreturn]] void fail(const char* what, uint64_t index, uint64_t value = 0) {
    std::fprintf(stderr, "%s (operation %" PRIu64 ", value %" PRIu64 ")\n", what, index, value);
    std::exit(1);
}

// A payload as 32-bit words, whatever type Verilator gave the port.
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

using Operand = Words<INPUT_BITS + TAG_BITS>;
using Result = Words<OUTPUT_BITS + TAG_BITS>;

inline Operand operand(const uint32_t* row, uint64_t index) {
    constexpr unsigned word = INPUT_BITS / 32, shift = INPUT_BITS % 32;
    Operand payload;
    std::memcpy(payload.word, row, OPERAND_WORDS * 4);
    const uint64_t tag = (index & TAG_MASK) << shift;
    payload.word[word] |= static_cast<uint32_t>(tag);
    payload.word[word + 1] |= static_cast<uint32_t>(tag >> 32);
    return payload;
}

inline void result(const Result& payload, uint32_t* row, uint64_t index) {
    constexpr unsigned word = OUTPUT_BITS / 32, shift = OUTPUT_BITS % 32;
    const uint64_t top = payload.word[word] | (uint64_t{payload.word[word + 1]} << 32);
    const uint64_t tag = (top >> shift) & TAG_MASK;
    if (tag != (index & TAG_MASK)) fail("a result carries the wrong tag", index, tag);
    std::memcpy(row, payload.word, RESULT_WORDS * 4);
    if constexpr (shift != 0) row[word] &= (uint32_t{1} << shift) - 1;
}

// xorshift64*: one random bit decides a side's next cycle, and now and then a side stalls for longer.
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

void* map(const char* path, uint64_t bytes, bool write) {
    const int file = open(path, write ? O_RDWR : O_RDONLY);
    if (file < 0) { std::perror(path); std::exit(1); }
    if (bytes == 0) return nullptr;
    void* memory = mmap(nullptr, bytes, write ? PROT_READ | PROT_WRITE : PROT_READ, MAP_SHARED, file, 0);
    if (memory == MAP_FAILED) { std::perror(path); std::exit(1); }
    close(file);
    return memory;
}

void clock(Vbulk& unit, int level) {
    unit.clk = level;
    Vbulk___024root___eval(unit.rootp);
}

void reset(Vbulk& unit) {
    unit.eval();  // also initialises
    unit.in_valid = 0;
    unit.out_ready = 1;
    unit.rst = 1;
    for (int k = 0; k < 4; ++k) clock(unit, 0), clock(unit, 1);
    unit.rst = 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 5) { std::fprintf(stderr, "bulk OPERANDS RESULTS COUNT STALL_SEED\n"); return 2; }
    const uint64_t count = std::strtoull(argv[3], nullptr, 10);
    const uint64_t seed = std::strtoull(argv[4], nullptr, 10);
    const auto* operands = static_cast<const uint32_t*>(map(argv[1], count * OPERAND_WORDS * 4, false));
    auto* results = static_cast<uint32_t*>(map(argv[2], count * RESULT_WORDS * 4, true));

    VerilatedContext context;
    Vbulk unit{&context};
    reset(unit);

    Stalls give{seed}, take{seed == 0 ? 0 : ~seed};
    uint64_t sent = 0, received = 0, cycle = 0, moved = 0, first_in = 0, latency = 0;
    bool offered = false;
    const auto start = std::chrono::steady_clock::now();
    // After the last result the unit runs on for a while, to catch one too many.
    for (uint64_t tail = 0; received < count || tail < 256; ++cycle) {
        if (!offered && sent < count && give.next()) {
            operand(operands + sent * OPERAND_WORDS, sent).to(unit.in_payload);
            offered = true;
        }
        unit.in_valid = offered;
        unit.out_ready = take.next();
        clock(unit, 0);
        if (offered && unit.in_ready) {
            if (sent++ == 0) first_in = cycle;
            offered = false;
            moved = cycle;
        }
        if (unit.out_valid && unit.out_ready) {
            if (received == count) fail("a result too many", received);
            if (received >= sent) fail("a result before its operands", received);
            Result payload;
            payload.from(unit.out_payload);
            result(payload, results + received * RESULT_WORDS, received);
            if (received++ == 0) latency = cycle - first_in - TOP_LATENCY;
            moved = cycle;
        }
        clock(unit, 1);
        if (received == count) ++tail;
        else if (cycle - moved > HANG_CYCLES) fail("the unit hangs: no operand and no result moves", received, sent);
    }
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    std::printf("%" PRIu64 " %" PRIu64 " %.9f\n", cycle, latency, seconds.count());
    return 0;
}
