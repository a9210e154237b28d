// An AXI4 memory for simulations: it serves a memory image with a latency, a bandwidth and an order that can be changed
// while it runs, and takes writes where they are allowed. docs/axi_memory.md describes it. For Verilator (--no-timing)
// and Icarus; not for synthesis.
//
// Everything happens in one clocked process over a ring of bursts in order of acceptance, one of reads and one of writes.
// Only the oldest few that are due are looked at, so that a cycle costs the same whatever the number of bursts under way.
// Reads come first: what is written in a cycle is in the memory from the next one on.

`default_nettype none

// The state of the process is assigned with `=`, as in a program: a burst can be answered in the cycle that accepts it.
// Nothing else reads that state; outputs are assigned with `<=`.
// verilator lint_off BLKSEQ
module axi_memory #(
    parameter integer DATA_WIDTH = 512,    // 32 to 1024, a power of two
    parameter integer ADDRESS_WIDTH = 40,  // up to 63
    parameter integer ID_WIDTH = 8,
    parameter integer MEMORY_BITS = 27,    // the memory has 2**MEMORY_BITS bytes; up to 30
    parameter integer QUEUE = 256,         // bursts under way: accepted, and the last beat not yet taken
    parameter integer WRITES = 64,         // write bursts under way: accepted, and the answer not yet taken
    parameter integer WRITE_BEATS = 512    // beats of them, and of those to come; a power of two from 512 up
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
    input  wire                     write_error_enable,  // so does a write burst with such a beat, and is not written
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

    // AXI4 write address channel
    input  wire                     awvalid,
    output reg                      awready,
    input  wire [ADDRESS_WIDTH-1:0] awaddr,
    input  wire [ID_WIDTH-1:0]      awid,
    input  wire [7:0]               awlen,
    input  wire [2:0]               awsize,
    input  wire [1:0]               awburst,

    // AXI4 write data channel
    input  wire                     wvalid,
    output reg                      wready,
    input  wire [DATA_WIDTH-1:0]    wdata,
    input  wire [DATA_WIDTH/8-1:0]  wstrb,
    input  wire                     wlast,

    // AXI4 write response channel
    output reg                      bvalid,
    input  wire                     bready,
    output reg  [ID_WIDTH-1:0]      bid,
    output reg  [1:0]               bresp,

    // Observation
    output reg                      violation,     // the master broke a rule; a message says which; stays until rst
    output reg  [63:0]              read_bursts,   // accepted
    output reg  [63:0]              read_beats,    // taken by the master
    output reg  [63:0]              busy_cycles,   // with a read burst under way
    output reg  [63:0]              write_bursts,  // accepted
    output reg  [63:0]              write_beats    // taken from the master
);

  localparam integer LANES = DATA_WIDTH / 8;
  localparam integer LANE_BITS = $clog2(LANES);
  localparam [63:0] WORD = 64'd1 << LANE_BITS;  // its bytes
  localparam integer BYTES = 1 << MEMORY_BITS;
  localparam integer WORD_BITS = MEMORY_BITS - LANE_BITS;

  // ------------------------------------------------------------------------------------------------------- content

  reg [DATA_WIDTH-1:0] memory[0:(1 << WORD_BITS)-1];  // byte 0 is the highest: that is where $fread puts it
  reg [63:0] image_words;                             // what lies beyond reads as zero
  reg [LANES-1:0] writable[0:(1 << WORD_BITS)-1];     // the bytes of a word that may be written; byte 0 is the lowest
  reg [63:0] writable_words;                          // none beyond may be

  reg [8*1024-1:0] image;
  integer file, result, size, words;
  reg [8*1024-1:0] map;
  reg [63:0] region_first, region_last;

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
    read_map;
  end

  // What may be written: a line a region, its first and last byte in hexadecimal digits.
  task read_map;
    begin
      writable_words = 0;
      file = 0;
      if ($value$plusargs("writable=%s", map)) begin
        file = $fopen(map, "r");
        if (file == 0) begin
          $display("axi_memory: %0s: cannot be read; name a file of regions with +writable=FILE", map);
          $finish(2);
        end
      end
      if (file != 0) begin
        result = 2;
        while (result == 2) begin
          result = $fscanf(file, "%h %h", region_first, region_last);
          if (result == 2 && (region_first > region_last || region_last >> MEMORY_BITS != 0)) begin
            $display("axi_memory: %0s: %h to %h is no region of the memory", map, region_first, region_last);
            $finish(2);
            result = 0;
          end
          if (result == 2) allow_region;
        end
        $fclose(file);
      end
    end
  endtask

  task allow_region;
    begin
      while (writable_words <= region_last >> LANE_BITS) begin
        writable[writable_words[WORD_BITS-1:0]] = 0;
        writable_words = writable_words + 1;
      end
      while (image_words <= region_last >> LANE_BITS) begin
        memory[image_words[WORD_BITS-1:0]] = 0;
        image_words = image_words + 1;
      end
      while (region_first <= region_last)
        if (region_first[LANE_BITS-1:0] == 0 && region_last - region_first >= WORD - 1) begin
          writable[region_first[MEMORY_BITS-1:LANE_BITS]] = {LANES{1'b1}};
          region_first = region_first + WORD;
        end else begin
          writable[region_first[MEMORY_BITS-1:LANE_BITS]][region_first[LANE_BITS-1:0]] = 1;
          region_first = region_first + 1;
        end
    end
  endtask

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

  // ----------------------------------------------------------------------------------------------- writes under way

  localparam integer WRING_BITS = $clog2(WRITES + WINDOW);
  localparam integer WRING = 1 << WRING_BITS;
  localparam integer BEAT_BITS = $clog2(WRITE_BEATS);

  reg [63:0] waddress[0:WRING-1];
  reg [ID_WIDTH-1:0] wid[0:WRING-1];
  reg [7:0] wlength[0:WRING-1];          // beats, less one
  reg [2:0] wsize[0:WRING-1];            // log2 of the bytes of a beat
  reg wrefused[0:WRING-1];               // a kind of burst that is not served
  reg [63:0] wdue[0:WRING-1];            // the cycle from which it may be answered, once it has its data
  reg [WRING_BITS-1:0] wturn[0:WRING-1]; // its number among the bursts of its id
  reg [6:0] wheld[0:WRING-1];            // patience of a burst that is to be overtaken; 0: it goes on
  reg wdone[0:WRING-1];
  reg [BEAT_BITS-1:0] wfirst[0:WRING-1]; // where its beats begin
  reg [WRING_BITS-1:0] whead, wtail;     // the oldest burst, and behind the youngest
  reg [WRING_BITS-1:0] filling;          // the burst whose beat comes next
  reg [7:0] filled;                      // and its beats so far

  reg [WRING_BITS-1:0] wnext_turn[0:(1<<ID_WIDTH)-1];
  reg [WRING_BITS-1:0] wnow_turn[0:(1<<ID_WIDTH)-1];

  reg [DATA_WIDTH-1:0] beat_data[0:WRITE_BEATS-1];
  reg [LANES-1:0] beat_strobes[0:WRITE_BEATS-1];
  reg beat_last[0:WRITE_BEATS-1];
  // Those from `beat_next` on have no address yet; `beat_end` is behind the youngest.
  reg [BEAT_BITS-1:0] beat_next, beat_end;
  reg [BEAT_BITS:0] beats_kept;
  reg [WRING_BITS:0] wunder_way;
  // xorshift64*, of its own, so that reads do not depend on writes.
  reg [63:0] wstate;
  // verilator lint_off UNUSEDSIGNAL
  reg [63:0] wrandom;                    // the upper half is used
  // verilator lint_on UNUSEDSIGNAL

  reg [WRING_BITS-1:0] wslot, wchosen;
  reg wfound, wscanning;
  reg [BEAT_BITS-1:0] place;
  reg [LANES-1:0] strobes, lanes_of_beat;
  reg [DATA_WIDTH-1:0] mask;
  integer n, lane;

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

  task complain(input [8*64-1:0] what, input [ADDRESS_WIDTH-1:0] where);
    begin
      $display("axi_memory: the master %0s (cycle %0d, address %h)", what, now, where);
      violation <= 1;
    end
  endtask

  // The rules of an address that was accepted; `oversized` says that the burst cannot be served.
  task look_at_address(input [ADDRESS_WIDTH-1:0] begins, input [7:0] length, input [2:0] bytes, input [1:0] burst);
    begin
      first = {{(64 - ADDRESS_WIDTH) {1'b0}}, begins};
      width = 64'd1 << bytes;
      last = (first & ~(width - 1)) + ({56'd0, length} << bytes) + width - 1;
      if (burst == INCR && first[63:12] != last[63:12]) complain("let a burst cross a 4 KB boundary", begins);
      // verilator lint_off CMPCONST
      oversized = {29'd0, bytes} > LANE_BITS;  // constant where the bus has 1024 bits
      // verilator lint_on CMPCONST
      if (oversized) complain("asked for more bytes a beat than the bus has", begins);
    end
  endtask

  function in_error_range(input [63:0] from, input [63:0] to);
    in_error_range = from <= {{(64 - ADDRESS_WIDTH) {1'b0}}, error_last} &&
                     to >= {{(64 - ADDRESS_WIDTH) {1'b0}}, error_first};
  endfunction

  // The address of beat `n` of the burst in `wslot`, its bytes and its lanes.
  task locate_beat(input [63:0] number);
    begin
      width = 64'd1 << wsize[wslot];
      first = waddress[wslot];
      if (number != 0) first = (first & ~(width - 1)) + (number << wsize[wslot]);
      last = first | (width - 1);
      for (lane = 0; lane < LANES; lane = lane + 1)
        lanes_of_beat[lane] = lane >= {{(32 - LANE_BITS) {1'b0}}, first[LANE_BITS-1:0]} &&
                              lane <= {{(32 - LANE_BITS) {1'b0}}, last[LANE_BITS-1:0]};
    end
  endtask

  task accept_write;
    begin
      write_bursts <= write_bursts + 1;
      look_at_address(awaddr, awlen, awsize, awburst);
      waddress[wtail] = first;
      wid[wtail] = awid;
      wlength[wtail] = awlen;
      wsize[wtail] = awsize;
      wrefused[wtail] = awburst != INCR || oversized;
      wturn[wtail] = wnext_turn[awid];
      wheld[wtail] = wrandom[47:40] < reorder ? PATIENCE : 0;
      wdone[wtail] = 0;
      wnext_turn[awid] = wnext_turn[awid] + 1;
      wtail = wtail + 1;
      wunder_way = wunder_way + 1;
    end
  endtask

  task accept_beat;
    begin
      write_beats <= write_beats + 1;
      beat_data[beat_end] = wdata;
      beat_strobes[beat_end] = wstrb;
      beat_last[beat_end] = wlast;
      beat_end = beat_end + 1;
      beats_kept = beats_kept + 1;
    end
  endtask

  // Beats to the bursts that they are of, which is looked at then: data may come before its address.
  task give_beats;
    while (filling != wtail && beat_next != beat_end) begin
      wslot = filling;
      if (filled == 0) wfirst[wslot] = beat_next;
      if (beat_last[beat_next] != (filled == wlength[wslot])) complain("put WLAST on the wrong beat", waddress[wslot][ADDRESS_WIDTH-1:0]);
      if (!wrefused[wslot]) begin
        locate_beat({56'd0, filled});
        strobes = beat_strobes[beat_next];
        if ((strobes & ~lanes_of_beat) != 0) complain("set a strobe beside a beat's bytes", first[ADDRESS_WIDTH-1:0]);
        if (first >> LANE_BITS < writable_words) strobes = strobes & ~writable[first[MEMORY_BITS-1:LANE_BITS]];
        for (lane = LANES - 1; lane >= 0; lane = lane - 1)
          if (strobes[lane]) last = {first[63:LANE_BITS], {LANE_BITS{1'b0}}} + {32'd0, lane};
        if (strobes != 0) complain("wrote a byte that may not be written", last[ADDRESS_WIDTH-1:0]);
      end
      beat_next = beat_next + 1;
      filled = filled + 1;
      if (filled == wlength[wslot] + 8'd1) begin
        filled = 0;
        wdue[wslot] = latency == 0 ? now : now + {48'd0, latency} - 1;
        filling = filling + 1;
      end
    end
  endtask

  // The first of the oldest writes that may be answered.
  task choose_write;
    begin
      wfound = 0;
      wscanning = 1;
      wslot = whead;
      for (n = 0; n < WINDOW && wscanning; n = n + 1) begin
        if (wslot == filling) wscanning = 0;  // it has not all of its data
        else if (!wdone[wslot] && now >= wdue[wslot] && wturn[wslot] == wnow_turn[wid[wslot]]) begin
          if (wheld[wslot] != 0) wheld[wslot] = wheld[wslot] - 1;
          else begin
            wchosen = wslot;
            wfound = 1;
            wscanning = 0;
          end
        end else if (!wdone[wslot] && reorder == 0) wscanning = 0;
        wslot = wslot + 1;
      end
    end
  endtask

  // Its bytes into the memory, all or none, and its answer.
  task answer_write;
    begin
      for (wslot = whead; wslot != wchosen; wslot = wslot + 1) wheld[wslot] = 0;  // it has been overtaken
      wslot = wchosen;
      response = OKAY;
      for (n = 0; n <= {24'd0, wlength[wslot]}; n = n + 1) begin
        locate_beat({32'd0, n});
        if (first >> MEMORY_BITS != 0 && response == OKAY) response = DECERR;
        if (write_error_enable && in_error_range(first & ~(width - 1), last)) response = SLVERR;
      end
      if (wrefused[wslot]) response = SLVERR;
      place = wfirst[wslot];
      for (n = 0; n <= {24'd0, wlength[wslot]}; n = n + 1) begin
        locate_beat({32'd0, n});
        strobes = beat_strobes[place] & lanes_of_beat;
        if (first >> LANE_BITS >= writable_words) strobes = 0;
        else strobes = strobes & writable[first[MEMORY_BITS-1:LANE_BITS]];
        for (lane = 0; lane < LANES; lane = lane + 1) mask[8*lane+:8] = {8{strobes[lane]}};
        if (response == OKAY && strobes != 0)
          memory[first[MEMORY_BITS-1:LANE_BITS]] =
              (memory[first[MEMORY_BITS-1:LANE_BITS]] & ~turned(mask)) | turned(beat_data[place] & mask);
        place = place + 1;
      end
      bvalid <= 1;
      bid <= wid[wslot];
      bresp <= response;
      wdone[wslot] = 1;
      wnow_turn[wid[wslot]] = wnow_turn[wid[wslot]] + 1;
      while (whead != filling && wdone[whead]) begin
        beats_kept = beats_kept - {{(BEAT_BITS - 8) {1'b0}}, 1'b0, wlength[whead]} - 1;
        whead = whead + 1;
      end
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
      awready <= 0;
      wready <= 0;
      bvalid <= 0;
      write_bursts <= 0;
      write_beats <= 0;
      whead = 0;
      wtail = 0;
      filling = 0;
      filled = 0;
      beat_next = 0;
      beat_end = 0;
      beats_kept = 0;
      wunder_way = 0;
      wstate = {~seed, seed};
      head = 0;
      tail = 0;
      under_way = 0;
      engaged = 0;
      for (k = 0; k < (1 << ID_WIDTH); k = k + 1) begin
        next_turn[k] = 0;
        now_turn[k] = 0;
        wnext_turn[k] = 0;
        wnow_turn[k] = 0;
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
      if (waiting && !arvalid) complain("withdrew arvalid", araddr);
      if (waiting && arvalid && asked !== waited) complain("changed a waiting address", araddr);
      waiting = arvalid && !arready;
      waited = asked;

      // Accept a burst.
      if (arvalid && arready) begin
        read_bursts <= read_bursts + 1;
        look_at_address(araddr, arlen, arsize, arburst);
        address[tail] = first;
        id[tail] = arid;
        left[tail] = arlen;
        beat_size[tail] = arsize;
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
        if (error_enable && in_error_range(first, last)) response = SLVERR;
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

      // Writes.
      wstate = wstate ^ (wstate >> 12);
      wstate = wstate ^ (wstate << 25);
      wstate = wstate ^ (wstate >> 27);
      wrandom = wstate * 64'h2545F4914F6CDD1D;
      if (awvalid && awready) accept_write;
      if (wvalid && wready) accept_beat;
      give_beats;
      if (bvalid && bready) begin
        wunder_way = wunder_way - 1;
        bvalid <= 0;
      end
      if (whead != filling && (!bvalid || bready) && wrandom[55:48] >= stall) begin
        choose_write;
        if (wfound) answer_write;
      end
      awready <= {{(31 - WRING_BITS) {1'b0}}, wunder_way} < WRITES && wrandom[63:56] >= stall;
      wready <= {{(31 - BEAT_BITS) {1'b0}}, beats_kept} < WRITE_BEATS && wrandom[39:32] >= stall;
    end
  end
endmodule

`default_nettype wire
