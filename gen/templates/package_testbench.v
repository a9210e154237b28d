// Testbench of {{ module }}: operands and results of the golden model, compared in all bits. Needs nothing but a Verilog
// simulator: the vectors are in {{ module }}.hex, a line an operand with its result above it.
//
// What is tested besides: results keep the order and the tags of their operands, none is lost, doubled or made up; a
// result waits unchanged until it is taken; the stated latency and initiation interval hold while nothing stalls; a
// reset drops what is under way. Prints one line that begins with PASS or FAIL.

`timescale 1ns / 1ps
`default_nettype none

module {{ module }}_tb;

  localparam integer COUNT = {{ count }};
  localparam integer IN = {{ input_bits }};
  localparam integer OUT = {{ output_bits }};
  localparam integer TAG = {{ tag_bits }};
  localparam integer LATENCY = {{ latency }};
  localparam integer INTERVAL = {{ interval }};
  localparam integer PART = COUNT / 4;  // a quarter each: nothing stalls, operands do, results do, both do
  localparam integer PATIENCE = 1000 + 4 * LATENCY;

  reg [OUT+IN-1:0] vectors[0:COUNT-1];
  reg [8*256-1:0] file;

  reg clk, rst, i_valid, o_ready;
  reg [TAG+IN-1:0] i_payload;
  wire i_ready, o_valid;
  wire [TAG+OUT-1:0] o_payload;

  {{ module }} unit (
      .clk(clk),
      .rst(rst),
      .i__valid(i_valid),
      .i__ready(i_ready),
      .i__payload(i_payload),
      .o__valid(o_valid),
      .o__ready(o_ready),
      .o__payload(o_payload)
  );

  integer cycle, entered, left, next, idle, seed, first_in, fault, part;
  reg checking, offers, waiting, stalls;
  reg [TAG-1:0] tag;
  reg [TAG+OUT-1:0] held, wanted;

  task fail(input [8*64-1:0] what);
    begin
      if (fault == 0) begin
        $display("FAIL {{ module }}: %0s (cycle %0d, result %0d, operand %h)", what, cycle, left, vectors[left][IN-1:0]);
        $display("  wanted %h", wanted);
        $display("  found  %h", o_payload);
      end
      fault = 1;
    end
  endtask

  // Whether a side stalls in this cycle: in long and short runs, from one draw in four.
  function draw(input ignored);
    draw = ({$random(seed)} % 4) == 0;
  endfunction

  always @(posedge clk)
    if (checking) begin
      cycle = cycle + 1;
      idle = idle + 1;
      if (i_ready !== 1'b0 && i_ready !== 1'b1) fail("i__ready is unknown");
      if (o_valid !== 1'b0 && o_valid !== 1'b1) fail("o__valid is unknown");

      // An operand enters.
      if (i_valid && i_ready) begin
        if (entered == 0) first_in = cycle;
        if (entered == PART - 1 && cycle - first_in != (PART - 1) * INTERVAL) fail("the initiation interval is not as stated");
        entered = entered + 1;
        idle = 0;
      end

      // A result waits, or leaves.
      tag = left;
      wanted = {tag, vectors[left % COUNT][OUT+IN-1:IN]};
      if (waiting && (!o_valid || o_payload !== held)) fail("a waiting result changed");
      waiting = o_valid && !o_ready;
      held = o_payload;
      if (o_valid) begin
        if (left >= entered) fail("a result without an operand");
        else if (o_payload !== wanted) fail("a wrong result");
        if (left == 0 && o_ready && cycle - first_in != LATENCY) fail("the latency is not as stated");
      end
      if (o_valid && o_ready) begin
        left = left + 1;
        idle = 0;
      end

      // What both sides do next. Nothing but a valid operand may matter, so there is none otherwise.
      part = entered / PART;
      if (!i_valid || i_ready) begin
        if (part == 1 || part == 3) offers = draw(0) ? !offers : offers;
        else offers = 1;
        next = entered;
        tag = next;
        i_valid <= next < COUNT && offers;
        i_payload <= next < COUNT && offers ? {tag, vectors[next % COUNT][IN-1:0]} : {TAG + IN{1'bx}};
      end
      if (part == 2 || part == 3) stalls = draw(0) ? !stalls : stalls;
      else stalls = 0;
      o_ready <= !stalls;

      if (idle > PATIENCE && left != COUNT) fail("nothing moves");
      if (fault != 0) $finish;
      if (left == COUNT && idle > LATENCY + 20) begin
        $display("PASS {{ module }}: %0d results in all bits, latency %0d, interval %0d, %0d cycles", COUNT, LATENCY, INTERVAL, cycle);
        $finish;
      end
    end

  always #5 clk = !clk;

  initial begin
    if (!$value$plusargs("vectors=%s", file)) file = "testbench/{{ module }}.hex";
    $readmemh(file, vectors);
    clk = 0;
    rst = 1;
    i_valid = 0;
    i_payload = {TAG + IN{1'bx}};
    o_ready = 0;
    cycle = 0;
    entered = 0;
    left = 0;
    idle = 0;
    seed = {{ seed }};
    first_in = 0;
    fault = 0;
    checking = 0;
    offers = 1;
    waiting = 0;
    stalls = 0;
    repeat (3) @(negedge clk);
    // Operands that a reset drops: no result of theirs may come.
    rst = 0;
    i_valid = 1;
    i_payload = {{ "{" }}{TAG{1'b1}}, vectors[COUNT-1][IN-1:0]};
    repeat (LATENCY + 5) @(negedge clk);
    i_valid = 0;
    i_payload = {TAG + IN{1'bx}};
    rst = 1;
    @(negedge clk);
    rst = 0;
    o_ready = 1;
    checking = 1;
  end

endmodule

`default_nettype wire
