// Sends operands from a file through a Verilated system and writes its results, in the order of the operands.
//
//     system_run OPERANDS RESULTS COUNT STALL_SEED PATIENCE STEP... +image=FILE
//
// OPERANDS holds COUNT rows of Operand::ROW 32-bit words, RESULTS gets COUNT rows of Result::ROW words. An operand is
// offered in every cycle in which the unit takes one, under a tag that none in the unit has; results are taken at once,
// in any order. With a STALL_SEED other than 0 both sides stall at random. PATIENCE is the number of cycles that may pass
// without an operand taken or a result given. Steps come before, in their order; those up to the first that is no `set`
// before the reset:
//
//     set LOW WIDTH VALUE         controls from then on
//     strobe LOW                  a control for one cycle
//     await WHAT N LOW WIDTH ...  until one of N statuses is not 0; WHAT is what does not happen where none ever is
//     watch NUMBER                a counter that moves as long as the unit works on what takes long
//
// Prints "name value" lines: statuses, behind the steps, in hexadecimal words, the lowest first; cycles, from the first
// operand taken to the last result; figure, the memory's in that time, in the order of the top's port; most_in_flight,
// operands; simulated, cycles of the whole run, and the seconds of processor time for them; counter, in the order of the
// top's port.
// Exits with 1 and one line on stderr where a tag is not that of an operand under way, a result is missing or too many,
// nothing moves any more, or a rule of AXI is broken: then "axi_rules" with the numbers of the first ones that the unit
// and the memory broke (golden_model/contract/axi_rules.py).

#include <algorithm>
#include <cstring>
#include <ctime>
#include <vector>

#include "system.h"

namespace {

using harness::Operand, harness::Result, harness::System;

constexpr uint64_t STUCK_CYCLES = 200000;  // far more than any answer of the memory and any stall
constexpr uint64_t LOOK_EVERY = 4096;      // cycles
constexpr uint64_t TAIL_CYCLES = 1024;     // after the last result, to catch one too many
constexpr uint64_t NONE = ~uint64_t{0};
constexpr unsigned FIGURES = 5, READ_BEATS = 1, WRITE_BEATS = 4;
constexpr const char* STILL = "oldest operand in the unit, results";

[[noreturn]] void fail(const char* what, uint64_t first, uint64_t second, const char* names) {
    std::fprintf(stderr, "%s (%s %" PRIu64 ", %" PRIu64 ")\n", what, names, first, second);
    std::exit(1);
}

// Tags that are free, the one that was given back longest ago first: so a result that comes twice is noticed.
class Tags {
    static constexpr uint64_t NUMBER = uint64_t{1} << (TAG_BITS < 16 ? TAG_BITS : 16);  // of the tags that are used
    std::vector<uint64_t> ring_, operand_;
    uint64_t head_ = 0, free_ = NUMBER;

  public:
    Tags() : ring_(NUMBER), operand_(NUMBER, NONE) {
        for (uint64_t k = 0; k < NUMBER; ++k) ring_[k] = k;
    }

    bool any() const { return free_ != 0; }

    uint64_t take(uint64_t operand) {
        const uint64_t tag = ring_[head_];
        head_ = (head_ + 1) % NUMBER;
        --free_;
        operand_[tag] = operand;
        return tag;
    }

    // The first operand that has not come back, NONE if there is none.
    uint64_t oldest() const { return *std::min_element(operand_.begin(), operand_.end()); }

    // The operand that had the tag, NONE if none has.
    uint64_t give_back(uint64_t tag) {
        if (tag >= NUMBER || operand_[tag] == NONE) return NONE;
        const uint64_t operand = operand_[tag];
        operand_[tag] = NONE;
        ring_[(head_ + free_++) % NUMBER] = tag;
        return operand;
    }
};

// What is done before operands come.
class Steps {
    System& system_;
    char** next_;
    char** end_;

    unsigned long long number() {
        if (next_ == end_) std::fprintf(stderr, "a step ends too early\n"), std::exit(2);
        return std::strtoull(*next_++, nullptr, 10);
    }

    harness::Place place() {
        const auto low = static_cast<unsigned>(number());
        return {low, static_cast<unsigned>(number())};
    }

    void strobe() {
        const harness::Place bit{static_cast<unsigned>(number()), 1};
        system_.set(bit, 1), system_.clock();
        system_.set(bit, 0), system_.clock(), system_.clock();
    }

    void await() {
        const char* what = *next_++;
        std::vector<harness::Place> places(number());
        for (auto& one : places) one = place();
        const auto is_set = [&](harness::Place one) { return system_.status(one) != 0; };
        for (uint64_t cycle = 0; std::none_of(places.begin(), places.end(), is_set); ++cycle) {
            if (cycle == STUCK_CYCLES) fail(what, cycle, 0, "cycles, results");
            system_.clock();
        }
    }

    bool is(const char* name) { return next_ != end_ && std::strcmp(*next_, name) == 0 && ++next_; }

    bool set() {
        if (!is("set")) return false;
        const harness::Place where = place();
        system_.set(where, number());
        return true;
    }

  public:
    std::vector<unsigned> watched;

    Steps(System& system, char** first, char** end) : system_{system}, next_{first}, end_{end} {}

    void run() {
        while (set()) {}
        system_.reset(8);
        while (next_ != end_ && **next_ != '+') {
            if (set()) continue;
            if (is("strobe")) strobe();
            else if (is("await")) await();
            else if (is("watch")) watched.push_back(static_cast<unsigned>(number()));
            else std::fprintf(stderr, "%s: no such step\n", *next_), std::exit(2);
        }
    }
};

uint64_t progress(const System& system, const std::vector<unsigned>& watched) {
    uint64_t sum = system.figure(READ_BEATS) + system.figure(WRITE_BEATS);
    for (unsigned k : watched) sum += system.counter(k);
    return sum;
}

void print_statuses(System& system) {
    std::printf("statuses ");
    for (unsigned low = 0; low < STATUS_BITS; low += 32)
        std::printf("%08" PRIx32 ",", static_cast<uint32_t>(system.status({low, std::min(32u, STATUS_BITS - low)})));
    std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 6) {
        std::fprintf(stderr, "system_run OPERANDS RESULTS COUNT STALL_SEED PATIENCE STEP... +image=FILE\n");
        return 2;
    }
    const uint64_t count = std::strtoull(argv[3], nullptr, 10), seed = std::strtoull(argv[4], nullptr, 10);
    const uint64_t patience = std::strtoull(argv[5], nullptr, 10);
    const auto* operands = static_cast<const uint32_t*>(harness::map(argv[1], count * Operand::ROW * 4, false));
    auto* results = static_cast<uint32_t*>(harness::map(argv[2], count * Result::ROW * 4, true));

    System system{argc, const_cast<const char**>(argv)};
    Vsystem& top = system.top();
    top.out_ready = 1;
    Steps steps{system, argv + 6, argv + argc};
    steps.run();
    print_statuses(system);

    harness::Stalls give{seed}, take{seed == 0 ? 0 : ~seed};
    Tags tags;
    Operand operand;
    uint64_t figures[2][FIGURES];  // at the first operand, and at the last result
    const auto look = [&](uint64_t* into) { for (unsigned k = 0; k < FIGURES; ++k) into[k] = system.figure(k); };
    look(figures[0]), look(figures[1]);
    uint64_t sent = 0, received = 0, most = 0, cycle = 0, first = 0, last = 0, moved = 0, stirred = 0, before = 0;
    bool offered = false;
    const std::clock_t start = std::clock();
    for (uint64_t tail = 0; received < count || tail < TAIL_CYCLES; ++cycle) {
        if (!offered && sent < count && tags.any() && give.next()) {
            operand.put(operands + sent * Operand::ROW, tags.take(sent));
            operand.to(top.in_payload);
            offered = true;
        }
        top.in_valid = offered;
        if (offered && top.in_ready) {
            if (sent++ == 0) first = cycle;
            moved = cycle;
            offered = false;
        }
        if (top.out_valid) {
            Result result;
            result.from(top.out_payload);
            const uint64_t number = tags.give_back(result.tag());
            if (number == NONE || number >= sent)
                fail("a result whose tag no operand has: lost, doubled or made up", received, result.tag(), "results, tag");
            result.get(results + number * Result::ROW);
            last = moved = cycle;
            ++received;
        }
        if (most < sent - received) most = sent - received;
        top.out_ready = take.next();
        system.clock();
        if (received == count) {
            if (tail++ == 0) look(figures[1]);
        } else if (cycle % LOOK_EVERY == 0) {
            const uint64_t now = progress(system, steps.watched);
            if (now != before) stirred = cycle, before = now;
            if (cycle - moved > STUCK_CYCLES && cycle - stirred > STUCK_CYCLES)
                fail("the unit hangs: no operand, result, counter or beat of the memory moves", tags.oldest(), received, STILL);
            if (cycle - moved > patience)
                fail("the unit gives no result for longer than anything takes", tags.oldest(), received, STILL);
        }
    }
    if (!system.keeps_rules()) return 1;

    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    std::printf("cycles %" PRIu64 "\n", count == 0 ? 0 : last - first);
    for (unsigned k = 0; k < FIGURES; ++k) std::printf("figure %" PRIu64 "\n", figures[1][k] - figures[0][k]);
    std::printf("most_in_flight %" PRIu64 "\nsimulated %" PRIu64 "\nseconds %.9f\n", most, cycle, seconds);
    for (unsigned k = 0; k < COUNTER_NUMBER; ++k) std::printf("counter %" PRIu64 "\n", system.counter(k));
    system.end();
    return 0;
}
