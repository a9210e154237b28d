// Many requests through a block cache on the memory of the simulations; each has to be answered once, with its block.
//
//     block_cache_system IMAGE KIND COUNT STALL_SEED LATENCY REORDER INTERLEAVE STALL PREFETCHES +image=IMAGE
//
// KIND says which blocks are asked for: "rays", some of them hot, some one after another, some several times in a row;
// "half", alternately one of eight and a new one; "apart", each a new one. STALL_SEED 0 keeps both sides of the cache
// busy every cycle, any other seed stalls both at random; PREFETCHES of 256
// cycles prefetch a random block; the rest is of the memory. Prints "cycles hits misses merges
// stalls seconds"; exits with 1 and one line on stderr where an answer is wrong, missing or too many.
//
// Compiled with -DTAG_BITS, as the top, sim/block_cache_system.v, is: no more requests than tags are under way.

#include <chrono>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <sys/stat.h>
#include <vector>

#include "Vblock_cache_system.h"
#include "harness.h"

namespace {

constexpr uint64_t BLOCK_BYTES = 64, BASE = 4096, HANG_CYCLES = 100000, SEED = 88172645463325252u;
constexpr uint32_t TAGS = uint32_t{1} << TAG_BITS, NONE = UINT32_MAX;

[[noreturn]] void fail(const char* what, uint64_t cycle, uint64_t request) {
    std::fprintf(stderr, "%s (cycle %" PRIu64 ", request %" PRIu64 ")\n", what, cycle, request);
    std::exit(1);
}

class Random {
    uint64_t state_ = SEED;

  public:
    uint64_t operator()(uint64_t below) {
        state_ ^= state_ << 13, state_ ^= state_ >> 7, state_ ^= state_ << 17;
        return state_ % below;
    }
};

// The block of the next request.
class Requests {
    std::string kind_;
    uint64_t blocks_, number_ = 0, fresh_ = 8, block_ = 0;
    unsigned repeats_ = 0, follows_ = 0;
    Random random;

    uint64_t next_fresh() { return fresh_ = fresh_ + 1 < blocks_ ? fresh_ + 1 : 8; }

  public:
    Requests(const char* kind, uint64_t blocks) : kind_{kind}, blocks_{blocks} {}

    uint64_t next() {
        ++number_;
        if (kind_ == "half") return number_ % 2 ? random(8) : next_fresh();
        if (kind_ == "apart") return next_fresh();
        if (repeats_ != 0) return --repeats_, block_;
        if (follows_ != 0) return --follows_, ++block_;
        switch (random(4)) {
        case 0: repeats_ = random(12); break;
        case 1: follows_ = random(8); break;
        case 2: return random(24);  // hot
        }
        return block_ = random(blocks_ - 8);
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 11) {
        std::fprintf(stderr, "block_cache_system IMAGE KIND COUNT STALL_SEED LATENCY REORDER INTERLEAVE STALL PREFETCHES "
                             "+image=\n");
        return 2;
    }
    struct stat about;
    if (stat(argv[1], &about) != 0) { std::perror(argv[1]); return 2; }
    const auto size = static_cast<uint64_t>(about.st_size);
    const auto* image = static_cast<const unsigned char*>(harness::map(argv[1], size, false));
    const uint64_t blocks = (size - BASE) / BLOCK_BYTES;
    Requests requests{argv[2], blocks};
    const uint64_t count = std::strtoull(argv[3], nullptr, 10), seed = std::strtoull(argv[4], nullptr, 10);

    VerilatedContext context;
    context.commandArgs(argc, argv);
    Vblock_cache_system system{&context};
    // Verilator's names of i__valid and so on
    auto &i_valid = system.i___05Fvalid, &o_ready = system.o___05Fready, &prefetch_valid = system.prefetch___05Fvalid;
    const auto &i_ready = system.i___05Fready, &o_valid = system.o___05Fvalid;
    auto& i_payload = system.i___05Fpayload;
    const auto& o_payload = system.o___05Fpayload;
    const auto clock = [&system](int level) { system.clk = level, system.eval(); };
    system.base = BASE;
    system.latency = std::atoi(argv[5]);
    system.reorder = std::atoi(argv[6]);
    system.interleave = std::atoi(argv[7]);
    system.stall = std::atoi(argv[8]);
    const uint64_t prefetches = std::strtoull(argv[9], nullptr, 10);
    system.bandwidth = 256;
    system.seed = 1;
    system.rst = 1;
    for (int k = 0; k < 4; ++k) clock(0), clock(1);
    if (context.gotFinish()) return 1;  // the memory has said why
    system.rst = 0;

    harness::Stalls give{seed}, take{seed ? seed + 1 : 0};
    std::vector<uint32_t> asked(TAGS, NONE);  // the block that a tag waits for
    uint64_t sent = 0, answered = 0, cycle = 0, moved = 0, block = 0;
    bool offered = false;
    Random random;
    harness::Payload<512, TAG_BITS> answer, waiting;
    bool waits = false;
    const auto start = std::chrono::steady_clock::now();
    while (answered < count || cycle < moved + 1000) {
        const uint32_t tag = sent % TAGS;
        if (!offered && sent < count && asked[tag] == NONE && give.next()) {
            block = requests.next();
            harness::Payload<32, TAG_BITS> request;
            const auto number = static_cast<uint32_t>(block);
            request.put(&number, tag);
            request.to(i_payload);
            offered = true;
        }
        i_valid = offered;
        o_ready = take.next();
        prefetch_valid = random(256) < prefetches;
        system.prefetch___05Fblock = static_cast<uint32_t>((block + random(16)) % blocks);
        clock(0);
        if (o_valid) {
            answer.from(o_payload);
            if (waits && std::memcmp(answer.word, waiting.word, sizeof answer.word) != 0)
                fail("a waiting answer changed", cycle, answered);
            waits = !o_ready;
            waiting = answer;
            if (o_ready) {
                const uint64_t got = answer.tag();
                if (asked[got] == NONE) fail("an answer too many", cycle, got);
                if (std::memcmp(answer.word, image + BASE + asked[got] * BLOCK_BYTES, BLOCK_BYTES) != 0)
                    fail("a wrong block", cycle, got);
                if (answer.word[16] >> TAG_BITS & 1) fail("an error", cycle, got);
                asked[got] = NONE;
                ++answered, moved = cycle;
            }
        } else if (waits) {
            fail("a waiting answer was withdrawn", cycle, answered);
        }
        const bool accepted = offered && i_ready;
        clock(1);
        if (accepted) {
            asked[tag] = static_cast<uint32_t>(block);
            ++sent, moved = cycle;
            offered = false;
        }
        if (++cycle > moved + HANG_CYCLES) fail("hangs", cycle, answered);
    }
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    if (system.violation || system.axi_master_rule || system.axi_slave_rule) {
        std::fprintf(stderr, "a rule of AXI is broken: number %u, and %u by the memory\n",
                     unsigned{system.axi_master_rule}, unsigned{system.axi_slave_rule});
        return 1;
    }
    const bool prefetched = system.read_bursts > system.misses;
    if (system.hits + uint64_t{system.misses} + system.merges != count || system.read_bursts < system.misses ||
        prefetched != (prefetches != 0)) {
        std::fprintf(stderr, "the counters disagree\n");
        return 1;
    }
    if (prefetches == 0 && system.prefetching) { std::fprintf(stderr, "something is on its way\n"); return 1; }
    std::printf("%" PRIu64 " %u %u %u %u %.3f\n", moved + 1, system.hits, system.misses, system.merges, system.stalls,
                seconds.count());
    return 0;
}
