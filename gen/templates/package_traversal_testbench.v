// Testbench of {{ module }}: rays through a small tree, compared with the golden model in all bits. Needs nothing but a
// Verilog simulator: the tree is in {{ module }}.bin, a memory image; the rays are in {{ module }}.hex, a line a ray with
// its result above it. The memory is axi_memory.v.
//
// All rays go through the unit twice: first one visit of a ray at a time, with a quick memory, when the unit's counters
// have to be those of the golden model; then with all overlap there is, both streams stalled, and a slow memory that
// stalls and answers out of order. No result may be lost, doubled or made up, and a result waits unchanged until it is
// taken. Prints one line that begins with PASS or FAIL.

`timescale 1ns / 1ps
`default_nettype none

module {{ module }}_tb;

  localparam integer COUNT = {{ count }};
  localparam integer IN = {{ input_bits }};
  localparam integer OUT = {{ output_bits }};
  localparam integer TAG = {{ tag_bits }};
  localparam integer TAGS = 1 << TAG;
  localparam integer PATIENCE = 20000;

  reg [OUT+IN-1:0] vectors[0:COUNT-1];
  reg [8*256-1:0] file;

  reg clk, rst, i_valid, o_ready, load, count_clear;
  reg [TAG+IN-1:0] i_payload;
  wire i_ready, o_valid, loaded;
  wire [TAG+OUT-1:0] o_payload;
  reg [{{ widths.overlap }}-1:0] overlap;
  wire [{{ widths.load_error }}-1:0] load_error;
{% for name in counters %}
  wire [{{ widths["count_" ~ name] }}-1:0] count_{{ name }};
{% endfor %}

  integer round;
  wire slow = round == 1;
{% set latency, reorder = "slow ? 16'd60 : 16'd4", "slow ? 8'd100 : 8'd0" %}
{% set interleave, stall = "slow", "slow ? 8'd60 : 8'd0" %}
{% include "package_memory.v" %}

  {{ module }} unit (
      .clk(clk),
      .rst(rst),
      .i__valid(i_valid),
      .i__ready(i_ready),
      .i__payload(i_payload),
      .o__valid(o_valid),
      .o__ready(o_ready),
      .o__payload(o_payload),
      .load(load),
      .base({{ widths.base }}'d{{ base }}),
      .loaded(loaded),
      .load_error(load_error),
      .overlap(overlap),
      .read_timeout({{ widths.read_timeout }}'d5000),
      .abort(1'b0),
      .aborting(),
{% for name in counters %}
      .count_{{ name }}(count_{{ name }}),
{% endfor %}
{% for name in memory.wires %}
      .m_axi_{{ name }}(memory_{{ name }}),
{% endfor %}
      .count_clear(count_clear)
  );

  integer cycle, entered, left, idle, seed, fault, k;
  reg running, offers, waiting, stalls;
  reg [TAG-1:0] tag;
  reg [TAG+OUT-1:0] held;
  reg [OUT-1:0] wanted;
  reg busy[0:TAGS-1];        // the tag is a ray's that is under way
  integer ray[0:TAGS-1];     // that ray

  task fail(input [8*64-1:0] what);
    begin
      if (fault == 0) begin
        $display("FAIL {{ module }}: %0s (round %0d, cycle %0d)", what, round, cycle);
        $display("  result %h", o_payload);
        $display("  wanted %h, ray %0d: %h", wanted, ray[tag], vectors[ray[tag]][IN-1:0]);
      end
      fault = 1;
    end
  endtask

  function draw(input ignored);
    draw = ({$random(seed)} % 4) == 0;
  endfunction

  always @(posedge clk) begin
    cycle = cycle + 1;
    idle = idle + 1;
    if (running) begin
      if (i_ready !== 1'b0 && i_ready !== 1'b1) fail("i__ready is unknown");
      if (o_valid !== 1'b0 && o_valid !== 1'b1) fail("o__valid is unknown");
      if (violation !== 1'b0) fail("an AXI4 rule is broken");

      if (i_valid && i_ready) begin
        tag = entered;
        busy[tag] = 1;
        ray[tag] = entered;
        entered = entered + 1;
        idle = 0;
      end

      if (waiting && (!o_valid || o_payload !== held)) fail("a waiting result changed");
      waiting = o_valid && !o_ready;
      held = o_payload;
      if (o_valid && o_ready) begin
        tag = o_payload[TAG+OUT-1:OUT];
        wanted = vectors[ray[tag]][OUT+IN-1:IN];
        if (busy[tag] !== 1'b1) fail("a result without a ray");
        else if (o_payload[OUT-1:0] !== wanted) fail("a wrong result");
        busy[tag] = 0;
        left = left + 1;
        idle = 0;
      end

      // What both sides do next. Nothing but a valid ray may matter, so there is none otherwise.
      if (!i_valid || i_ready) begin
        if (slow) offers = draw(0) ? !offers : offers;
        tag = entered;
        if (entered < COUNT && offers && !busy[tag]) begin
          i_valid <= 1;
          i_payload <= {tag, vectors[entered][IN-1:0]};
        end else begin
          i_valid <= 0;
          i_payload <= {TAG + IN{1'bx}};
        end
      end
      if (slow) stalls = draw(0) ? !stalls : stalls;
      o_ready <= !stalls;
    end
    if (idle > PATIENCE) fail("nothing moves");
    if (fault != 0) $finish;
  end

  task trace(input integer number, input integer visits);
    begin
      round = number;
      overlap = visits;
      entered = 0;
      left = 0;
      for (k = 0; k < TAGS; k = k + 1) busy[k] = 0;
      count_clear = 1;
      @(negedge clk);
      count_clear = 0;
      running = 1;
      wait (left == COUNT);
      repeat (50) @(negedge clk);
      running = 0;
      if (left != COUNT) fail("more results than rays");
      if (count_rays !== COUNT) fail("count_rays is not the number of rays");
      if (count_errors !== {{ errors }}) fail("count_errors is not the golden model's");
    end
  endtask

  always #5 clk = !clk;

  initial begin
    if (!$value$plusargs("vectors=%s", file)) file = "testbench/{{ module }}.hex";
    $readmemh(file, vectors);
    clk = 0;
    rst = 1;
    i_valid = 0;
    i_payload = {TAG + IN{1'bx}};
    o_ready = 0;
    load = 0;
    overlap = 1;
    count_clear = 0;
    round = 0;
    cycle = 0;
    entered = 0;
    left = 0;
    idle = 0;
    seed = {{ seed }};
    fault = 0;
    running = 0;
    offers = 1;
    waiting = 0;
    stalls = 0;
    repeat (4) @(negedge clk);
    rst = 0;
    @(negedge clk);
    load = 1;
    @(negedge clk);
    load = 0;
    wait (loaded === 1'b1 || load_error !== 0);
    @(negedge clk);
    if (loaded !== 1'b1) fail("the tree is refused");
    trace(0, 1);
{% for name, value in golden_counts.items() %}
    if (count_{{ name }} !== {{ value }}) fail("count_{{ name }} is not the golden model's");
{% endfor %}
    trace(1, {{ overlap }});
    @(negedge clk);
    if (fault == 0)
      $display("PASS {{ module }}: %0d rays twice, in all bits, %0d cycles", COUNT, cycle);
    $finish;
  end

endmodule

`default_nettype wire
