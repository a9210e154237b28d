// Sends rays from a file through the Verilated traversal unit and writes its results, in the order of the rays.
//
//     traversal_run QUERIES RESULTS COUNT NAME=VALUE... +image=FILE
//
// QUERIES holds COUNT rows of Query::ROW 32-bit words, RESULTS gets COUNT rows of Result::ROW words. A ray is offered in
// every cycle in which the unit takes one, under a tag that no ray in the unit has; results are taken at once. With
// stall_seed both sides stall at random. The other names are inputs of sim/traversal_run.v; `patience` is the number of
// cycles that may pass without a ray taken or a result given.
//
// Prints "name value" lines: load_error; cycles, from the first ray taken to the last result; bursts, beats, busy_cycles
// of the memory in that time; most_in_flight, rays; simulated, cycles of the whole run, and the seconds of processor
// time for them; counter, in the order of the top's port.
// Exits with 1 and one line on stderr where a tag is not that of a ray under way, a result is missing or too many,
// nothing moves any more, or a rule of AXI is broken: then "axi_rules" with the numbers of the first ones that the unit and
// the memory broke (golden_model/contract/axi_rules.py).
//
// PROGRESS are the numbers of the counters one of which moves where the unit works on long rays.

#include <algorithm>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

#include "Vtraversal_run.h"
#include "harness.h"

namespace {

using Query = harness::Payload<QUERY_BITS, TAG_BITS>;
using Result = harness::Payload<RESULT_BITS, TAG_BITS>;
using Counters = harness::Words<64 * COUNTER_NUMBER>;

constexpr uint64_t STUCK_CYCLES = 200000;  // far more than any answer of the memory and any stall
constexpr uint64_t LOOK_EVERY = 4096;      // cycles
constexpr uint64_t TAIL_CYCLES = 1024;     // after the last result, to catch one too many
constexpr uint64_t NO_RAY = ~uint64_t{0};
constexpr const char* STILL = "oldest ray in the unit, results";

[[noreturn]] void fail(const char* what, uint64_t first, uint64_t second, const char* names) {
    std::fprintf(stderr, "%s (%s %" PRIu64 ", %" PRIu64 ")\n", what, names, first, second);
    std::exit(1);
}

class Options {
    int argc_;
    char** argv_;

  public:
    Options(int argc, char** argv) : argc_{argc}, argv_{argv} {}

    // The number after NAME=, or `otherwise`.
    uint64_t operator()(const char* name, uint64_t otherwise) const {
        const size_t length = std::strlen(name);
        for (int k = 4; k < argc_; ++k)
            if (std::strncmp(argv_[k], name, length) == 0 && argv_[k][length] == '=')
                return std::strtoull(argv_[k] + length + 1, nullptr, 10);
        return otherwise;
    }
};

// Tags that are free, the one that was given back longest ago first: so a result that comes twice is noticed.
class Tags {
    static constexpr uint64_t NUMBER = uint64_t{1} << (TAG_BITS < 16 ? TAG_BITS : 16);  // of the tags that are used
    std::vector<uint64_t> ring_, ray_;
    uint64_t head_ = 0, free_ = NUMBER;

  public:
    Tags() : ring_(NUMBER), ray_(NUMBER, NO_RAY) {
        for (uint64_t k = 0; k < NUMBER; ++k) ring_[k] = k;
    }

    bool any() const { return free_ != 0; }

    uint64_t take(uint64_t ray) {
        const uint64_t tag = ring_[head_];
        head_ = (head_ + 1) % NUMBER;
        --free_;
        ray_[tag] = ray;
        return tag;
    }

    // The first ray that has not come back, NO_RAY if there is none.
    uint64_t oldest() const { return *std::min_element(ray_.begin(), ray_.end()); }

    // The ray that had the tag, NO_RAY if none has.
    uint64_t give_back(uint64_t tag) {
        if (tag >= NUMBER || ray_[tag] == NO_RAY) return NO_RAY;
        const uint64_t ray = ray_[tag];
        ray_[tag] = NO_RAY;
        ring_[(head_ + free_++) % NUMBER] = tag;
        return ray;
    }
};

void clock(Vtraversal_run& run) {
    run.clk = 0, run.eval();
    run.clk = 1, run.eval();
}

uint64_t progress(const Vtraversal_run& run) {
    constexpr unsigned watched[] = {PROGRESS};
    Counters counters;
    counters.from(run.counters);
    uint64_t sum = run.read_beats;
    for (unsigned k : watched) sum += counters.word[2 * k];
    return sum;
}

void reset(Vtraversal_run& run, const VerilatedContext& context, const Options& option) {
    run.latency = option("latency", 100);
    run.bandwidth = option("bandwidth", 256);
    run.reorder = option("reorder", 0);
    run.interleave = option("interleave", 0);
    run.stall = option("stall", 0);
    run.seed = option("seed", 1);
    run.error_enable = option("error_enable", 0);
    run.error_first = option("error_first", 0);
    run.error_last = option("error_last", 0);
    run.overlap = option("overlap", 1);
    run.read_timeout = option("read_timeout", 0);
    run.base = option("base", 0);
    run.out_ready = 1;
    run.rst = 1;
    for (int k = 0; k < 8; ++k) {
        clock(run);
        if (context.gotFinish()) std::exit(1);  // the memory has said why
    }
    run.rst = 0;
    clock(run), clock(run);
}

void load_tree(Vtraversal_run& run) {
    run.load = 1, clock(run);
    run.load = 0, clock(run), clock(run);
    for (uint64_t cycle = 0; !run.loaded && run.load_error == 0; ++cycle) {
        if (cycle == STUCK_CYCLES) fail("the unit hangs: it does not load the tree", cycle, 0, "cycles, rays");
        clock(run);
    }
    run.count_clear = 1, clock(run);
    run.count_clear = 0, clock(run), clock(run);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 4) { std::fprintf(stderr, "traversal_run QUERIES RESULTS COUNT NAME=VALUE... +image=FILE\n"); return 2; }
    const Options option{argc, argv};
    const uint64_t count = std::strtoull(argv[3], nullptr, 10), seed = option("stall_seed", 0);
    const uint64_t patience = option("patience", 10000000);
    const auto* queries = static_cast<const uint32_t*>(harness::map(argv[1], count * Query::ROW * 4, false));
    auto* results = static_cast<uint32_t*>(harness::map(argv[2], count * Result::ROW * 4, true));

    VerilatedContext context;
    context.commandArgs(argc, argv);
    Vtraversal_run run{&context};
    reset(run, context, option);
    load_tree(run);
    const uint64_t load_error = run.load_error;

    harness::Stalls give{seed}, take{seed == 0 ? 0 : ~seed};
    Tags tags;
    Query query;
    const uint64_t bursts = run.read_bursts, beats = run.read_beats, busy = run.busy_cycles;
    uint64_t memory[3] = {bursts, beats, busy};
    uint64_t sent = 0, received = 0, most = 0, cycle = 0, first = 0, last = 0, moved = 0, stirred = 0, before = 0;
    bool offered = false;
    const std::clock_t start = std::clock();
    for (uint64_t tail = 0; received < count || tail < TAIL_CYCLES; ++cycle) {
        if (!offered && sent < count && tags.any() && give.next()) {
            query.put(queries + sent * Query::ROW, tags.take(sent));
            query.to(run.in_payload);
            offered = true;
        }
        run.in_valid = offered;
        if (offered && run.in_ready) {
            if (sent++ == 0) first = cycle;
            moved = cycle;
            offered = false;
        }
        if (run.out_valid) {
            Result result;
            result.from(run.out_payload);
            const uint64_t ray = tags.give_back(result.tag());
            if (ray == NO_RAY || ray >= sent)
                fail("a result whose tag no ray has: lost, doubled or made up", received, result.tag(), "results, tag");
            result.get(results + ray * Result::ROW);
            last = moved = cycle;
            ++received;
        }
        if (most < sent - received) most = sent - received;
        run.out_ready = take.next();
        clock(run);
        if (received == count) {
            if (tail++ == 0) memory[0] = run.read_bursts, memory[1] = run.read_beats, memory[2] = run.busy_cycles;
        } else if (cycle % LOOK_EVERY == 0) {
            const uint64_t now = progress(run);
            if (now != before) stirred = cycle, before = now;
            if (cycle - moved > STUCK_CYCLES && cycle - stirred > STUCK_CYCLES)
                fail("the unit hangs: no ray, result, test or beat of the memory moves", tags.oldest(), received, STILL);
            if (cycle - moved > patience)
                fail("the unit gives no result for longer than the whole tree takes", tags.oldest(), received, STILL);
        }
    }
    if (run.violation || run.axi_master_rule || run.axi_slave_rule) {
        std::printf("axi_rules %u %u\n", unsigned{run.axi_master_rule}, unsigned{run.axi_slave_rule});
        std::fprintf(stderr, "a rule of AXI is broken\n");
        return 1;
    }

    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    std::printf("load_error %" PRIu64 "\ncycles %" PRIu64 "\n", load_error, count == 0 ? 0 : last - first);
    std::printf("bursts %" PRIu64 "\nbeats %" PRIu64 "\nbusy_cycles %" PRIu64 "\nmost_in_flight %" PRIu64 "\n",
                memory[0] - bursts, memory[1] - beats, memory[2] - busy, most);
    std::printf("simulated %" PRIu64 "\nseconds %.9f\n", cycle, seconds);
    Counters counters;
    counters.from(run.counters);
    for (unsigned k = 0; k < COUNTER_NUMBER; ++k)
        std::printf("counter %" PRIu64 "\n", counters.word[2 * k] | (uint64_t{counters.word[2 * k + 1]} << 32));
    return 0;
}
