// How fast sim/axi_memory.v is, and whether its data are right at that: random single beats, as many bursts under way
// as it takes. It is also the smallest example of a C++ simulation with that memory.
//
//     axi_memory IMAGE CYCLES LATENCY REORDER STALL WRITES +image=IMAGE +writable=REGIONS
//
// In WRITES of 256 cycles a write of some bytes is begun, too; the whole image has to be writable then. No word is read
// and written at a time, as nothing would say which is first.
//
// Prints "bursts beats writes cycles_per_second seconds_to_start"; exits with 1 and one line on stderr where a beat or an
// answer is wrong. Compiled with -DDATA_WIDTH as the memory is.

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

// Bytes into a port, whatever type Verilator gave it.
template <typename Port>
void put(Port& port, const void* bytes, size_t count) {
    std::memcpy(&port, bytes, count);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 8) {
        std::fprintf(stderr, "axi_memory IMAGE CYCLES LATENCY REORDER STALL WRITES +image=IMAGE\n");
        return 2;
    }
    auto image = content(argv[1]);
    const uint64_t cycles = std::strtoull(argv[2], nullptr, 10), words = image.size() / LANES;

    auto start = Clock::now();
    VerilatedContext context;
    context.commandArgs(argc, argv);
    Vaxi_memory memory{&context};
    memory.latency = std::atoi(argv[3]);
    memory.reorder = std::atoi(argv[4]);
    memory.stall = std::atoi(argv[5]);
    const unsigned writes = std::atoi(argv[6]);
    memory.bandwidth = 256;
    memory.seed = 1;
    memory.arsize = __builtin_ctz(LANES);
    memory.arburst = 1;  // INCR
    memory.rready = 1;
    memory.awsize = memory.arsize;
    memory.awburst = 1;
    memory.wlast = 1;
    memory.bready = 1;
    memory.rst = 1;
    const auto clock = [&memory](int level) { memory.clk = level, memory.eval(); };
    clock(0), clock(1);
    if (context.gotFinish()) return 1;  // the memory has said why
    memory.rst = 0;
    const double starting = seconds_since(start);

    uint64_t state = 88172645463325252u, wanted[IDS] = {};
    const auto random = [&state](uint64_t below) {
        state ^= state << 13, state ^= state >> 7, state ^= state << 17;
        return state % below;
    };
    unsigned id = 0, write_id = 0;
    bool busy[IDS] = {}, write_busy[IDS] = {}, addressed = true, given = true;
    std::vector<uint8_t> in_use(words);  // bursts under way that read or write a word
    struct Write { uint64_t address; unsigned char data[LANES]; uint64_t strobes[2]; } written[IDS] = {};
    start = Clock::now();
    for (uint64_t cycle = 0; cycle < cycles; ++cycle) {
        if (!memory.arvalid && !busy[id]) {
            const uint64_t word = random(words);
            if (!in_use[word] || writes == 0) {
                ++in_use[word];
                memory.araddr = word * LANES;
                memory.arid = id;
                memory.arvalid = 1;
            }
        }
        if (addressed && given && !write_busy[write_id] && random(256) < writes) {
            const uint64_t word = random(words);
            if (!in_use[word]) {
                Write& write = written[write_id];
                write.address = word * LANES;
                for (unsigned lane = 0; lane < LANES; ++lane) write.data[lane] = static_cast<unsigned char>(random(256));
                for (auto& half : write.strobes) random(2), half = state;
                ++in_use[word];
                write_busy[write_id] = true;
                memory.awaddr = write.address;
                memory.awid = write_id;
                put(memory.wdata, write.data, LANES);
                put(memory.wstrb, write.strobes, LANES / 8);
                addressed = given = false;
                memory.awvalid = memory.wvalid = 1;
            }
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
            --in_use[wanted[answered] / LANES];
        }
        if (memory.bvalid) {
            const Write& write = written[memory.bid];
            if (!write_busy[memory.bid] || memory.bresp) {
                std::fprintf(stderr, "a wrong answer (cycle %" PRIu64 ", id %u)\n", cycle, unsigned{memory.bid});
                return 1;
            }
            for (unsigned lane = 0; lane < LANES; ++lane)
                if (write.strobes[lane / 64] >> lane % 64 & 1) image[write.address + lane] = write.data[lane];
            write_busy[memory.bid] = false;
            --in_use[write.address / LANES];
        }
        addressed |= memory.awvalid && memory.awready;
        given |= memory.wvalid && memory.wready;
        const bool accepted = memory.arvalid && memory.arready;
        const uint64_t address = memory.araddr;
        clock(1);
        memory.awvalid = !addressed;
        memory.wvalid = !given;
        if (addressed && given && write_busy[write_id]) write_id = (write_id + 1) % IDS;
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
    std::printf("%" PRIu64 " %" PRIu64 " %" PRIu64 " %.0f %.3f\n", memory.read_bursts, memory.read_beats,
                memory.write_bursts, rate, starting);
    return 0;
}
