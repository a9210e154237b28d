// Testbench of {{ module }}: operands and results of the golden model through registers alone, compared in all bits. Needs
// nothing but a Verilog simulator: the vectors are in {{ module }}.hex, a line an operand with its result above it.
{% if memory %}
// The tree is in {{ module }}.bin, a memory image; the memory is axi_memory.v.
{% endif %}
//
// What is tested besides: the tag comes back; no result comes without operands; what is not there and what cannot be
// written is answered with SLVERR; the interrupt follows its event; no answer is unknown. The streams are tied off. Prints
// one line that begins with PASS or FAIL.

`timescale 1ns / 1ps
`default_nettype none

module {{ module }}_tb;

  localparam integer COUNT = {{ count }};
  localparam integer IN = {{ input_bits }};
  localparam integer OUT = {{ output_bits }};
  localparam integer TAG = {{ tag_bits }};
  localparam integer PATIENCE = 20000;
  localparam integer ADDRESS = {{ address_bits }};

  reg [OUT+IN-1:0] vectors[0:COUNT-1];
  reg [8*256-1:0] file;

  reg clk, rst;
  reg awvalid, wvalid, bready, arvalid, rready;
  reg [ADDRESS-1:0] awaddr, araddr;
  reg [31:0] wdata;
  reg [3:0] wstrb;
  wire awready, wready, bvalid, arready, rvalid, irq;
  wire [1:0] bresp, rresp;
  wire [31:0] rdata;
{% if memory %}
{% set latency, reorder, interleave, stall = "16'd20", "8'd100", "1'b1", "8'd60" %}
{% include "package_memory.v" %}
{% endif %}

  {{ module }} unit (
      .clk(clk),
      .rst(rst),
      .i__valid(1'b0),
      .i__ready(),
      .i__payload({TAG + IN{1'b0}}),
      .o__valid(),
      .o__ready(1'b0),
      .o__payload(),
      .s_axi_awvalid(awvalid),
      .s_axi_awready(awready),
      .s_axi_awaddr(awaddr),
      .s_axi_awprot(3'd0),
      .s_axi_wvalid(wvalid),
      .s_axi_wready(wready),
      .s_axi_wdata(wdata),
      .s_axi_wstrb(wstrb),
      .s_axi_bvalid(bvalid),
      .s_axi_bready(bready),
      .s_axi_bresp(bresp),
      .s_axi_arvalid(arvalid),
      .s_axi_arready(arready),
      .s_axi_araddr(araddr),
      .s_axi_arprot(3'd0),
      .s_axi_rvalid(rvalid),
      .s_axi_rready(rready),
      .s_axi_rdata(rdata),
      .s_axi_rresp(rresp),
{% if memory %}
{% for name in memory.wires %}
      .m_axi_{{ name }}(memory_{{ name }}),
{% endfor %}
{% endif %}
      .irq(irq)
  );

  integer cycle, k, idle, silent, fault, seed;
  reg [31:0] found, wanted;
  reg [1:0] response;
  reg [TAG-1:0] tag;

  task fail(input [8*64-1:0] what);
    begin
      if (fault == 0)
        $display("FAIL {{ module }}: %0s (cycle %0d, operation %0d, wanted %h, found %h)", what, cycle, k, wanted, found);
      fault = 1;
      $finish;
    end
  endtask

  // A cycle more in which nothing comes.
  task waited(input [8*64-1:0] what);
    begin
      silent = silent + 1;
      if (silent > PATIENCE) fail(what);
    end
  endtask

  // Some cycles of nothing, now and then.
  task pause(input ignored);
    repeat ({$random(seed)} % 4) @(negedge clk);
  endtask

  // The address first, the data first, or both at once.
  task write(input [ADDRESS-1:0] address, input [31:0] data, input [1:0] expected);
    integer order;
    begin
      order = {$random(seed)} % 3;
      wdata = data;
      wstrb = 4'hf;
      awaddr = address;
      awvalid = order != 1;
      wvalid = order != 0;
      silent = 0;
      response = 2'bxx;
      while (awvalid || wvalid || order < 2) begin
        @(posedge clk);
        if (awvalid && awready) awvalid <= 0;
        if (wvalid && wready) wvalid <= 0;
        @(negedge clk);
        if (order == 0) wvalid = 1;
        if (order == 1) awvalid = 1;
        order = 2;
        waited("a write is not taken");
      end
      pause(0);
      bready = 1;
      silent = 0;
      while (!(bvalid === 1'b1)) begin
        @(negedge clk);
        waited("a write is not answered");
      end
      response = bresp;
      @(negedge clk);
      bready = 0;
      wanted = expected;
      found = response;
      if (response !== expected) fail("a write is answered wrongly");
    end
  endtask

  task read(input [ADDRESS-1:0] address, input [1:0] expected);
    begin
      araddr = address;
      arvalid = 1;
      silent = 0;
      @(posedge clk);
      while (!(arready === 1'b1)) begin
        @(posedge clk);
        waited("a read is not taken");
      end
      @(negedge clk);
      arvalid = 0;
      pause(0);
      rready = 1;
      silent = 0;
      while (!(rvalid === 1'b1)) begin
        @(negedge clk);
        waited("a read is not answered");
      end
      found = rdata;
      response = rresp;
      @(negedge clk);
      rready = 0;
      if (response !== expected) fail("a read is answered wrongly");
    end
  endtask

  // Reads until a bit of the status is what it should be.
  task await(input integer bit_number, input value);
    begin
      idle = 0;
      found = 0;
      found[bit_number] = !value;
      while (found[bit_number] !== value) begin
        read({{ at.status }}, 2'b00);
        idle = idle + 1;
        if (idle > PATIENCE) fail("the status does not change");
      end
    end
  endtask

  always #5 clk = !clk;
  always @(posedge clk) begin
    cycle = cycle + 1;
{% if memory %}
    if (!rst && violation !== 1'b0) fail("an AXI4 rule is broken");
{% endif %}
  end

  initial begin
    if (!$value$plusargs("vectors=%s", file)) file = "testbench/{{ module }}.hex";
    $readmemh(file, vectors);
    clk = 0;
    rst = 1;
    awvalid = 0;
    wvalid = 0;
    bready = 0;
    arvalid = 0;
    rready = 0;
    cycle = 0;
    fault = 0;
    k = 0;
    seed = {{ seed }};
    repeat (4) @(negedge clk);
    rst = 0;
    @(negedge clk);
{% if end < 2 ** address_bits %}
    read({{ end }}, 2'b10);
    write({{ end }}, 32'd0, 2'b10);
{% endif %}
    write({{ at.status }}, 32'hffffffff, 2'b10);
    if (irq !== 1'b0) fail("an interrupt that nobody wants");
{% if memory %}
{% if "base" in at %}
    write({{ at.base }}, 32'd{{ base }}, 2'b00);
{% else %}
    write({{ at.base_low }}, 32'd{{ base % 2**32 }}, 2'b00);
    write({{ at.base_high }}, 32'd{{ base // 2**32 }}, 2'b00);
{% endif %}
    write({{ at.event_enables }}, 32'd1 << {{ fields.load_over_enable.low }}, 2'b00);
    write({{ at.control }}, 32'd1 << {{ fields.load.low }}, 2'b00);
    idle = 0;
    while (irq !== 1'b1) begin
      @(negedge clk);
      idle = idle + 1;
      if (idle > PATIENCE) fail("no interrupt when the tree is loaded");
    end
    read({{ at.status }}, 2'b00);
    if (found[{{ fields.loaded.low }}] !== 1'b1) fail("the tree is refused");
    write({{ at.events }}, 32'd1 << {{ fields.load_over.low }}, 2'b00);
    if (irq !== 1'b0) fail("the interrupt stays");
{% endif %}
    for (k = 0; k < COUNT; k = k + 1) begin
      tag = k;
{% for offset, parts in operands %}
      wanted = 0;
{% for low, bit, width in parts %}
      wanted[{{ low + width - 1 }}:{{ low }}] = vectors[k][{{ bit + width - 1 }}:{{ bit }}];
{% endfor %}
      write({{ offset }}, wanted, 2'b00);
{% endfor %}
      write({{ at.operand_tag }}, {{ "{" }}{32 - TAG{1'b0}}, tag}, 2'b00);
      write({{ at.submit }}, 32'd1, 2'b00);
      await({{ fields.result_waits.low }}, 1'b1);
      read({{ at.result_tag }}, 2'b00);
      wanted = tag;
      if (found !== wanted) fail("a wrong tag");
{% for offset, parts in results %}
      read({{ offset }}, 2'b00);
      wanted = 0;
{% for low, bit, width in parts %}
      wanted[{{ low + width - 1 }}:{{ low }}] = vectors[k][IN+{{ bit + width - 1 }}:IN+{{ bit }}];
{% endfor %}
      if (found !== wanted) fail("a wrong result");
{% endfor %}
      write({{ at.control }}, 32'd1 << {{ fields.release.low }}, 2'b00);
    end
    repeat (50) @(negedge clk);
    read({{ at.status }}, 2'b00);
    if (found[{{ fields.result_waits.low }}] !== 1'b0) fail("more results than operands");
    if (fault == 0) $display("PASS {{ module }}: %0d results in all bits, through registers, %0d cycles", COUNT, cycle);
    $finish;
  end

endmodule

`default_nettype wire
