// Streams binary operands through a Verilated unit and writes its binary results.
//
//     bulk OPERANDS RESULTS COUNT STALL_SEED
//
// OPERANDS holds COUNT rows of Operand::ROW 32-bit words, RESULTS gets COUNT rows of Result::ROW words. Operation k
// carries the low bits of k as its tag. STALL_SEED 0 keeps both sides busy every cycle; any other seed stalls both at
// random. Prints "cycles latency seconds"; exits with 1 and one line on stderr where a tag is wrong, a result is missing
// or too many, or nothing moves any more.
//
// Compiled with -DINPUT_BITS, -DOUTPUT_BITS (payload without tag), -DTAG_BITS as the top, sim/bulk.v, is, and with
// -DSTALLS where the unit may be stalled; without it the top holds a register before the unit.

#include <chrono>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "Vbulk.h"
#include "Vbulk___024root.h"
#include "harness.h"

// What Vbulk::eval calls. The rest of that, for designs that print or that run in threads, takes as long as an adder.
void Vbulk___024root___eval(Vbulk___024root* root);

namespace {

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

using Operand = harness::Payload<INPUT_BITS, TAG_BITS>;
using Result = harness::Payload<OUTPUT_BITS, TAG_BITS>;

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
    const auto* operands = static_cast<const uint32_t*>(harness::map(argv[1], count * Operand::ROW * 4, false));
    auto* results = static_cast<uint32_t*>(harness::map(argv[2], count * Result::ROW * 4, true));

    VerilatedContext context;
    Vbulk unit{&context};
    reset(unit);

    harness::Stalls give{seed}, take{seed == 0 ? 0 : ~seed};
    uint64_t sent = 0, received = 0, cycle = 0, moved = 0, first_in = 0, latency = 0;
    bool offered = false;
    const auto start = std::chrono::steady_clock::now();
    // After the last result the unit runs on for a while, to catch one too many.
    for (uint64_t tail = 0; received < count || tail < 256; ++cycle) {
        if (!offered && sent < count && give.next()) {
            Operand payload;
            payload.put(operands + sent * Operand::ROW, sent);
            payload.to(unit.in_payload);
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
            if (payload.tag() != (received & Result::TAG_MASK))
                fail("a result carries the wrong tag", received, payload.tag());
            payload.get(results + received * Result::ROW);
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
