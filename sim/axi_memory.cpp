// How fast sim/axi_memory.v is, and whether its data are right at that: random single beats, as many bursts under way
// as it takes. It is also the smallest example of a C++ simulation with that memory.
//
//     axi_memory IMAGE CYCLES LATENCY REORDER STALL +image=IMAGE
//
// Prints "bursts beats cycles_per_second seconds_to_start"; exits with 1 and one line on stderr where a beat is wrong.
// Compiled with -DDATA_WIDTH as the memory is.

#include <chrono>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "Vaxi_memory.h"

namespace {

constexpr unsigned LANES = DATA_WIDTH / 8;
constexpr unsigned IDS = 256;

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::vector<unsigned char> content(const char* path) {
    std::FILE* file = std::fopen(path, "rb");
    if (!file) { std::perror(path); std::exit(2); }
    std::fseek(file, 0, SEEK_END);
    std::vector<unsigned char> bytes(static_cast<size_t>(std::ftell(file)));
    std::rewind(file);
    if (std::fread(bytes.data(), 1, bytes.size(), file) != bytes.size()) { std::perror(path); std::exit(2); }
    std::fclose(file);
    return bytes;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 7) { std::fprintf(stderr, "axi_memory IMAGE CYCLES LATENCY REORDER STALL +image=IMAGE\n"); return 2; }
    const auto image = content(argv[1]);
    const uint64_t cycles = std::strtoull(argv[2], nullptr, 10), words = image.size() / LANES;

    auto start = Clock::now();
    VerilatedContext context;
    context.commandArgs(argc, argv);
    Vaxi_memory memory{&context};
    memory.latency = std::atoi(argv[3]);
    memory.reorder = std::atoi(argv[4]);
    memory.stall = std::atoi(argv[5]);
    memory.bandwidth = 256;
    memory.seed = 1;
    memory.arsize = __builtin_ctz(LANES);
    memory.arburst = 1;  // INCR
    memory.rready = 1;
    memory.rst = 1;
    const auto clock = [&memory](int level) { memory.clk = level, memory.eval(); };
    clock(0), clock(1);
    if (context.gotFinish()) return 1;  // the memory has said why
    memory.rst = 0;
    const double starting = seconds_since(start);

    uint64_t random = 88172645463325252u, wanted[IDS] = {};
    unsigned id = 0;
    bool busy[IDS] = {};
    start = Clock::now();
    for (uint64_t cycle = 0; cycle < cycles; ++cycle) {
        if (!memory.arvalid && !busy[id]) {
            random ^= random << 13, random ^= random >> 7, random ^= random << 17;
            memory.araddr = random % words * LANES;
            memory.arid = id;
            memory.arvalid = 1;
        }
        clock(0);
        if (memory.rvalid) {
            const unsigned answered = memory.rid;
            if (!busy[answered] || memory.rresp || !memory.rlast ||
                std::memcmp(memory.rdata.data(), &image[wanted[answered]], LANES) != 0) {
                std::fprintf(stderr, "a wrong beat (cycle %" PRIu64 ", id %u)\n", cycle, answered);
                return 1;
            }
            busy[answered] = false;
        }
        const bool accepted = memory.arvalid && memory.arready;
        const uint64_t address = memory.araddr;
        clock(1);
        if (accepted) {
            wanted[id] = address;
            busy[id] = true;
            memory.arvalid = 0;
            id = (id + 1) % IDS;
        }
    }
    const double running = seconds_since(start);
    if (memory.violation) { std::fprintf(stderr, "a violation\n"); return 1; }
    const double rate = cycles / running;
    std::printf("%" PRIu64 " %" PRIu64 " %.0f %.3f\n", memory.read_bursts, memory.read_beats, rate, starting);
    return 0;
}
