// An AXI4 read memory for simulations: it serves a memory image with a latency, a bandwidth and an order that can be
// changed while it runs. docs/axi_memory.md describes it. For Verilator (--no-timing) and Icarus; not for synthesis.
//
// Everything happens in one clocked process over a ring of bursts in order of acceptance. Only the oldest few that are
// due are looked at, so that a cycle costs the same whatever the number of bursts under way.

`default_nettype none

// The state of the process is assigned with `=`, as in a program: a burst can be answered in the cycle that accepts it.
// Nothing else reads that state; outputs are assigned with `<=`.
// verilator lint_off BLKSEQ
module axi_memory #(
    parameter integer DATA_WIDTH = 512,    // 32 to 1024, a power of two
    parameter integer ADDRESS_WIDTH = 40,  // up to 63
    parameter integer ID_WIDTH = 8,
    parameter integer MEMORY_BITS = 27,    // the memory has 2**MEMORY_BITS bytes; up to 30
    parameter integer QUEUE = 256          // bursts under way: accepted, and the last beat not yet taken
) (
    input  wire                     clk,
    input  wire                     rst,           // drops all bursts, clears counters and flag, takes seed

    // Behaviour
    input  wire [15:0]              latency,       // cycles from accepting a burst to its first beat; 0 is as 1
    input  wire [8:0]               bandwidth,     // beats in 256 cycles; 256 and more: one every cycle
    input  wire [7:0]               reorder,       // of 256 bursts, those held until another id overtakes them
    input  wire                     interleave,    // beats of bursts of different ids come mixed
    input  wire [7:0]               stall,         // of 256 cycles, those without arready, or a new beat
    input  wire [31:0]              seed,          // of the random choices
    input  wire                     error_enable,  // a beat with a byte from error_first to error_last gives SLVERR
    input  wire [ADDRESS_WIDTH-1:0] error_first,
    input  wire [ADDRESS_WIDTH-1:0] error_last,

    // AXI4 read address channel
    input  wire                     arvalid,
    output reg                      arready,
    input  wire [ADDRESS_WIDTH-1:0] araddr,
    input  wire [ID_WIDTH-1:0]      arid,
    input  wire [7:0]               arlen,
    input  wire [2:0]               arsize,
    input  wire [1:0]               arburst,

    // AXI4 read data channel
    output reg                      rvalid,
    input  wire                     rready,
    output reg  [DATA_WIDTH-1:0]    rdata,
    output reg  [ID_WIDTH-1:0]      rid,
    output reg  [1:0]               rresp,
    output reg                      rlast,

    // Observation
    output reg                      violation,     // the master broke a rule; a message says which; stays until rst
    output reg  [63:0]              read_bursts,   // accepted
    output reg  [63:0]              read_beats,    // taken by the master
    output reg  [63:0]              busy_cycles    // with a burst under way
);

  localparam integer LANES = DATA_WIDTH / 8;
  localparam integer LANE_BITS = $clog2(LANES);
  localparam integer BYTES = 1 << MEMORY_BITS;
  localparam integer WORD_BITS = MEMORY_BITS - LANE_BITS;

  // ------------------------------------------------------------------------------------------------------- content

  reg [DATA_WIDTH-1:0] memory[0:(1 << WORD_BITS)-1];  // byte 0 is the highest: that is where $fread puts it
  reg [63:0] image_words;                             // what lies beyond reads as zero

  reg [8*1024-1:0] image;
  integer file, result, size, words;

  // The bytes in the opposite order: exchanges halves, then quarters within the halves, down to bytes.
  function [DATA_WIDTH-1:0] turned(input [DATA_WIDTH-1:0] bytes);
    reg [DATA_WIDTH-1:0] low;  // the lower part of each pair
    integer half;
    begin
      turned = bytes;
      low = {DATA_WIDTH{1'b1}};
      for (half = DATA_WIDTH / 2; half >= 8; half = half / 2) begin
        low = low ^ (low << half);
        turned = ((turned & low) << half) | ((turned >> half) & low);
      end
    end
  endfunction

  task give_up;
    begin
      $display("axi_memory: %0s: cannot be read; name a memory image with +image=FILE", image);
      $finish(2);
    end
  endtask

  // Every result is looked at: Verilator drops a $fseek whose result is not.
  initial begin
    image_words = 0;
    file = 0;
    result = -1;
    size = -1;
    if ($value$plusargs("image=%s", image)) file = $fopen(image, "rb");
    else image = "no memory image";
    if (file != 0) result = $fseek(file, 0, 2);
    if (result == 0) size = $ftell(file);
    if (result == 0) result = $fseek(file, 0, 0);
    if (result != 0 || size < 0) give_up;
    else if (size > BYTES) begin
      $display("axi_memory: %0s: %0d bytes are more than the memory holds, %0d; raise MEMORY_BITS", image, size, BYTES);
      $finish(2);
    end else begin
      words = (size + LANES - 1) / LANES;
      image_words = {32'd0, words};
      if (words > 0) begin
        memory[words-1] = 0;  // the file may end within it
        result = $fread(memory, file);
      end
      if (result != size) give_up;
    end
    if (file != 0) $fclose(file);
  end

  // ------------------------------------------------------------------------------------------------ bursts under way

  localparam integer WINDOW = 16;        // bursts among which the next beat's is chosen
  localparam [6:0] PATIENCE = 64;        // times that a held burst may be passed over in vain
  // Finished bursts behind an unfinished one keep their places, at most WINDOW - 1.
  localparam integer RING_BITS = $clog2(QUEUE + WINDOW);
  localparam integer RING = 1 << RING_BITS;

  reg [63:0] address[0:RING-1];          // of the next beat
  reg [ID_WIDTH-1:0] id[0:RING-1];
  reg [7:0] left[0:RING-1];              // beats after the next one
  reg [2:0] beat_size[0:RING-1];         // log2 of the bytes of a beat
  reg refused[0:RING-1];                 // a kind of burst that is not served
  reg [63:0] due[0:RING-1];              // the cycle from which beats may come
  reg [RING_BITS-1:0] turn[0:RING-1];    // its number among the bursts of its id
  reg [6:0] held[0:RING-1];              // patience of a burst that is to be overtaken; 0: it goes on
  reg begun[0:RING-1];
  reg done[0:RING-1];
  reg [RING_BITS-1:0] head, tail;        // the oldest burst, and behind the youngest

  reg [RING_BITS-1:0] next_turn[0:(1<<ID_WIDTH)-1];  // what the next burst of an id gets
  reg [RING_BITS-1:0] now_turn[0:(1<<ID_WIDTH)-1];   // the burst of an id that beats may come from

  reg [RING_BITS:0] under_way;
  reg engaged;                           // `current` has given a beat that was not its last
  reg [RING_BITS-1:0] current;

  // ------------------------------------------------------------------------------------------------------- one cycle

  localparam [1:0] INCR = 2'b01;
  localparam [1:0] OKAY = 2'b00, SLVERR = 2'b10, DECERR = 2'b11;
  localparam [31:0] POISON = 32'hDEADBEEF;  // the data of a beat that is not OKAY
  localparam [9:0] BEAT_COST = 256;

  reg [63:0] now;
  reg [63:0] state, random;              // xorshift64*
  reg [9:0] credit;

  reg waiting;                           // arvalid without arready in the cycle before, with:
  reg [ADDRESS_WIDTH+ID_WIDTH+12:0] waited;
  wire [ADDRESS_WIDTH+ID_WIDTH+12:0] asked = {araddr, arid, arlen, arsize, arburst};

  reg scanning, in_order, waits, found, oversized;
  reg [RING_BITS-1:0] slot, chosen;
  reg [63:0] first, last, width;         // bytes of a beat or a burst
  reg [1:0] response;
  integer k;

  task complain(input [8*64-1:0] what);
    begin
      $display("axi_memory: the master %0s (cycle %0d, address %h)", what, now, araddr);
      violation <= 1;
    end
  endtask

  always @(posedge clk) begin
    if (rst) begin
      arready <= 0;
      rvalid <= 0;
      violation <= 0;
      read_bursts <= 0;
      read_beats <= 0;
      busy_cycles <= 0;
      head = 0;
      tail = 0;
      under_way = 0;
      engaged = 0;
      for (k = 0; k < (1 << ID_WIDTH); k = k + 1) begin
        next_turn[k] = 0;
        now_turn[k] = 0;
      end
      now = 0;
      state = {seed, ~seed};
      credit = 0;
      waiting = 0;
    end else begin
      now = now + 1;
      state = state ^ (state >> 12);
      state = state ^ (state << 25);
      state = state ^ (state >> 27);
      random = state * 64'h2545F4914F6CDD1D;
      if (under_way != 0) busy_cycles <= busy_cycles + 1;

      // The master's rules.
      if (waiting && !arvalid) complain("withdrew arvalid");
      if (waiting && arvalid && asked !== waited) complain("changed a waiting address");
      waiting = arvalid && !arready;
      waited = asked;

      // Accept a burst.
      if (arvalid && arready) begin
        read_bursts <= read_bursts + 1;
        width = 64'd1 << arsize;
        first = {{(64 - ADDRESS_WIDTH) {1'b0}}, araddr};
        last = (first & ~(width - 1)) + ({56'd0, arlen} << arsize) + width - 1;
        if (arburst == INCR && first[63:12] != last[63:12]) complain("let a burst cross a 4 KB boundary");
        address[tail] = first;
        id[tail] = arid;
        left[tail] = arlen;
        beat_size[tail] = arsize;
        // verilator lint_off CMPCONST
        oversized = {29'd0, arsize} > LANE_BITS;  // constant where the bus has 1024 bits
        // verilator lint_on CMPCONST
        if (oversized) complain("asked for more bytes a beat than the bus has");
        refused[tail] = arburst != INCR || oversized;
        due[tail] = latency == 0 ? now : now + {48'd0, latency} - 1;
        turn[tail] = next_turn[arid];
        held[tail] = random[47:40] < reorder ? PATIENCE : 0;
        begun[tail] = 0;
        done[tail] = 0;
        next_turn[arid] = next_turn[arid] + 1;
        tail = tail + 1;
        under_way = under_way + 1;
      end

      // Let go of a beat.
      if (rvalid && rready) begin
        read_beats <= read_beats + 1;
        if (rlast) under_way = under_way - 1;
        rvalid <= 0;
      end

      // Choose the burst of the next beat, if one may be offered.
      if (credit < BEAT_COST) credit = credit + {1'b0, bandwidth};
      found = 0;
      if ((!rvalid || rready) && credit >= BEAT_COST && random[55:48] >= stall) begin
        if (engaged && !interleave) begin
          chosen = current;
          found = 1;
        end else begin
          scanning = 1;
          in_order = 1;  // all older bursts have begun, or are to be overtaken
          slot = head;
          for (k = 0; k < WINDOW && scanning; k = k + 1) begin
            if (slot == tail || now < due[slot]) scanning = 0;
            else if (!done[slot]) begin
              waits = turn[slot] != now_turn[id[slot]];
              if (!waits && held[slot] != 0) begin
                waits = 1;
                held[slot] = held[slot] - 1;
              end
              if (!waits && (begun[slot] || in_order)) begin
                if (!found || random[8+k]) chosen = slot;
                found = 1;
                scanning = interleave;
              end
              if (!begun[slot] && !(waits && reorder != 0)) in_order = 0;
            end
            slot = slot + 1;
          end
        end
      end

      // Offer that beat.
      if (found) begin
        credit = credit - BEAT_COST;
        width = 64'd1 << beat_size[chosen];
        first = address[chosen] & ~(width - 1);
        last = first + width - 1;
        response = OKAY;
        if (first >> MEMORY_BITS != 0) response = DECERR;
        if (error_enable && first <= {{(64 - ADDRESS_WIDTH) {1'b0}}, error_last} &&
            last >= {{(64 - ADDRESS_WIDTH) {1'b0}}, error_first})
          response = SLVERR;
        if (refused[chosen]) response = SLVERR;

        rvalid <= 1;
        if (response != OKAY) rdata <= {(DATA_WIDTH / 32) {POISON}};
        else if (first >> LANE_BITS >= image_words) rdata <= 0;
        else rdata <= turned(memory[first[MEMORY_BITS-1:LANE_BITS]]);
        rid <= id[chosen];
        rresp <= response;
        rlast <= left[chosen] == 0;

        if (!begun[chosen])
          for (slot = head; slot != chosen; slot = slot + 1)
            held[slot] = 0;  // it has been overtaken
        held[chosen] = 0;
        begun[chosen] = 1;
        address[chosen] = first + width;
        engaged = left[chosen] != 0;
        current = chosen;
        if (left[chosen] == 0) begin
          done[chosen] = 1;
          now_turn[id[chosen]] = now_turn[id[chosen]] + 1;
          while (head != tail && done[head]) head = head + 1;
        end
        left[chosen] = left[chosen] - 1;
      end

      arready <= {{(31 - RING_BITS) {1'b0}}, under_way} < QUEUE && random[63:56] >= stall;
    end
  end
endmodule

`default_nettype wire
