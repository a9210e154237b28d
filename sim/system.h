// A Verilated system (sim/system.v) to C++: its clock and reset, and the ports of its unit by where they lie.

#pragma once

#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "Vsystem.h"
#include "harness.h"

namespace harness {

using Operand = Payload<INPUT_BITS, TAG_BITS>;
using Result = Payload<OUTPUT_BITS, TAG_BITS>;

// Some bits of `controls` or `statuses`.
struct Place {
    unsigned low, width;
};

class System {
    VerilatedContext context_;
    Vsystem top_;
    Words<CONTROL_BITS> controls_;

    const VerilatedContext& told(int argc, const char** argv) {
        context_.commandArgs(argc, argv);
        return context_;
    }

  public:
    // Arguments: those of the memory, "+image=FILE" and so on, among any others.
    System(int argc, const char** argv) : top_{(told(argc, argv), &context_)} {}

    Vsystem& top() { return top_; }

    void set(Place place, uint64_t value) {
        for (unsigned k = 0; k < place.width; ++k) {
            const unsigned bit = place.low + k;
            const uint32_t mask = uint32_t{1} << bit % 32;
            controls_.word[bit / 32] = value >> k & 1 ? controls_.word[bit / 32] | mask : controls_.word[bit / 32] & ~mask;
        }
        controls_.to(top_.controls);
    }

    uint64_t status(Place place) const {
        Words<STATUS_BITS> all;
        all.from(top_.statuses);
        uint64_t value = 0;
        for (unsigned k = 0; k < place.width; ++k) {
            const unsigned bit = place.low + k;
            value |= uint64_t{all.word[bit / 32] >> bit % 32 & 1} << k;
        }
        return value;
    }

    uint64_t counter(unsigned number) const {
        Words<COUNTER_BITS> all;
        all.from(top_.counters);
        return all.word[2 * number] | (uint64_t{all.word[2 * number + 1]} << 32);
    }

    // Of the memory, in the order of the port.
    uint64_t figure(unsigned number) const {
        Words<64 * 5> all;
        all.from(top_.figures);
        return all.word[2 * number] | (uint64_t{all.word[2 * number + 1]} << 32);
    }

    void clock() {
        top_.clk = 0, top_.eval();
        top_.clk = 1, top_.eval();
    }

    // The memory has given up, and has said why.
    bool over() const { return context_.gotFinish(); }

    // `cycles` of reset, and two without, in the first of which the unit still is in it.
    void reset(unsigned cycles) {
        top_.rst = 1;
        for (unsigned k = 0; k < cycles; ++k) {
            clock();
            if (over()) std::exit(1);
        }
        top_.rst = 0;
        clock(), clock();
    }

    // Whether no rule of AXI was broken at the memory; otherwise says which.
    bool keeps_rules() const {
        if (!top_.violation && !top_.axi_master_rule && !top_.axi_slave_rule) return true;
        std::printf("axi_rules %u %u\n", unsigned{top_.axi_master_rule}, unsigned{top_.axi_slave_rule});
        std::fprintf(stderr, "a rule of AXI is broken\n");
        return false;
    }

    void end() { top_.final(); }
};

}  // namespace harness
