// The Verilated system of a unit behind AXI4-Lite, for a program in C (register_bus.h): each access is a transfer.
//
// Everything that the bus sees of the unit is a register there, so what is ready or valid before a rising edge is what
// was so behind the one before.

#include <memory>
#include <string>

#include "register_bus.h"
#include "system.h"

namespace {

constexpr uint64_t PATIENCE = 100000;  // cycles that an answer may take
constexpr unsigned OKAY = 0;

std::unique_ptr<harness::System> whole;
Vsystem* bus = nullptr;  // its top
harness::Stalls stalls{0};
uint64_t cycles = 0;

[[noreturn]] void fail(const char* what, uint32_t offset) {
    std::fprintf(stderr, "register_bus: %s, offset 0x%" PRIx32 ", cycle %" PRIu64 "\n", what, offset, cycles);
    std::exit(1);
}

void tick() {
    whole->clock();
    if (whole->over()) std::exit(1);
    ++cycles;
}

}  // namespace

extern "C" {

void system_start(const char* image, uint64_t seed) {
    const std::string name = std::string("+image=") + image;
    const char* arguments[] = {"register_bus", name.c_str()};
    whole = std::make_unique<harness::System>(2, arguments);
    bus = &whole->top();
    stalls = harness::Stalls{seed};
    // A memory that does what memories may do.
    whole->set({MEMORY_LATENCY}, 40), whole->set({MEMORY_BANDWIDTH}, 256), whole->set({MEMORY_REORDER}, 64);
    whole->set({MEMORY_INTERLEAVE}, 1), whole->set({MEMORY_STALL}, 32), whole->set({MEMORY_SEED}, static_cast<uint32_t>(seed) | 1);
    whole->reset(3);
    cycles = 5;
}

unsigned register_try_write(uint32_t offset, uint32_t value, unsigned strobes) {
    bool address = true, data = true, answer = true;  // what is still to be transferred
    unsigned response = 0;
    bus->awaddr = offset, bus->wdata = value, bus->wstrb = strobes;
    for (uint64_t start = cycles; address || data || answer;) {
        // An offer stays until it is taken; a new one may be late.
        bus->awvalid = address && (bus->awvalid || stalls.next());
        bus->wvalid = data && (bus->wvalid || stalls.next());
        bus->bready = answer && stalls.next();
        const bool moved[] = {bus->awvalid && bus->awready, bus->wvalid && bus->wready, bus->bready && bus->bvalid};
        if (bus->bvalid && (address || data)) fail("an answer before its write has come", offset);
        if (moved[2]) response = bus->bresp;
        tick();
        address &= !moved[0], data &= !moved[1], answer &= !moved[2];
        if (moved[0]) bus->awvalid = 0;
        if (moved[1]) bus->wvalid = 0;
        if (cycles - start > PATIENCE) fail("a write hangs", offset);
    }
    bus->bready = 0;
    return response;
}

unsigned register_try_read(uint32_t offset, uint32_t* value) {
    bool address = true, answer = true;
    unsigned response = 0;
    bus->araddr = offset;
    for (uint64_t start = cycles; address || answer;) {
        bus->arvalid = address && (bus->arvalid || stalls.next());
        bus->rready = answer && stalls.next();
        const bool moved[] = {bus->arvalid && bus->arready, bus->rready && bus->rvalid};
        if (bus->rvalid && address) fail("data before their read has come", offset);
        if (moved[1]) *value = bus->rdata, response = bus->rresp;
        tick();
        address &= !moved[0], answer &= !moved[1];
        if (moved[0]) bus->arvalid = 0;
        if (cycles - start > PATIENCE) fail("a read hangs", offset);
    }
    bus->rready = 0;
    return response;
}

uint32_t register_read(uint32_t offset) {
    uint32_t value = 0;
    if (register_try_read(offset, &value) != OKAY) fail("a read is refused", offset);
    return value;
}

void register_write(uint32_t offset, uint32_t value) {
    if (register_try_write(offset, value, 0xf) != OKAY) fail("a write is refused", offset);
}

int interrupt(void) {
    tick();
    return bus->irq;
}

uint64_t system_end(void) {
    if (!whole->keeps_rules()) std::exit(1);
    whole->end();
    return cycles;
}

}  // extern "C"
