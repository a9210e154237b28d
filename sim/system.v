// The top of a simulated system: any unit, with the memory of the simulations behind its AXI4 port where it has one.
//
// Every input but those of the bus meets a register first. Then nothing is evaluated when the inputs change, and the
// harness, which sets them between two rising edges, sees outputs that depend on registers alone. So an operand is
// offered to the unit one cycle after the harness offers it, and out_ready holds for the cycle after. out_valid is high
// where a result is taken.
//
// sim/system.py says by macros what the unit is: UNIT its module, PORTS the connections of its other ports to parts of
// `controls`, `statuses` and `counters`, BUS whether it is behind AXI4-Lite, READS and WRITES what its memory port does.
// axi_checker is emitted (gen/watched.py): it watches the memory port, and says which rules of AXI were broken first.

`default_nettype none

module system (
    input  wire                                  clk,
    input  wire                                  rst,

    input  wire                                  in_valid,
    output wire                                  in_ready,
    input  wire [`INPUT_BITS + `TAG_BITS - 1:0]  in_payload,
    output wire                                  out_valid,
    input  wire                                  out_ready,
    output wire [`OUTPUT_BITS + `TAG_BITS - 1:0] out_payload,

    input  wire [`CONTROL_BITS - 1:0]            controls,  // the memory's in the lowest bits: docs/axi_memory.md
    output wire [`STATUS_BITS - 1:0]             statuses,
    output wire [`COUNTER_BITS - 1:0]            counters,  // 64 bits each

`ifdef BUS
    input  wire                                  awvalid,
    output wire                                  awready,
    input  wire [`BUS_ADDRESS_BITS - 1:0]        awaddr,
    input  wire                                  wvalid,
    output wire                                  wready,
    input  wire [31:0]                           wdata,
    input  wire [3:0]                            wstrb,
    output wire                                  bvalid,
    input  wire                                  bready,
    output wire [1:0]                            bresp,
    input  wire                                  arvalid,
    output wire                                  arready,
    input  wire [`BUS_ADDRESS_BITS - 1:0]        araddr,
    output wire                                  rvalid,
    input  wire                                  rready,
    output wire [31:0]                           rdata,
    output wire [1:0]                            rresp,
    output wire                                  irq,
`endif

    output wire                                  violation,
    output wire [64 * 5 - 1:0]                   figures,  // read bursts, read beats, busy cycles, write bursts, beats
    output wire [7:0]                            axi_master_rule,
    output wire [7:0]                            axi_slave_rule
);

  reg reset, valid, ready;
  reg [`INPUT_BITS + `TAG_BITS - 1:0] payload;
  reg [`CONTROL_BITS - 1:0] set;
  wire unit_ready, unit_valid;

  assign in_ready = !valid || unit_ready;
  assign out_valid = unit_valid && ready;

  always @(posedge clk) begin
    reset <= rst;
    ready <= out_ready;
    set <= controls;
    if (rst) valid <= 0;
    else if (in_ready) begin
      valid <= in_valid;
      payload <= in_payload;
    end
  end

`ifdef MEMORY
  wire [15:0] latency;
  wire [8:0] bandwidth;
  wire [7:0] reorder, stall;
  wire interleave, error_enable, write_error_enable;
  wire [31:0] seed;
  wire [`ADDRESS_BITS - 1:0] error_first, error_last;
  assign {error_last, error_first, write_error_enable, error_enable, seed, stall, interleave, reorder, bandwidth, latency}
      = set[2 * `ADDRESS_BITS + 75:0];

  wire arvalid_, arready_, rvalid_, rready_, rlast;
  wire [`ADDRESS_BITS - 1:0] araddr_;
  wire [`ID_BITS - 1:0] arid, rid;
  wire [7:0] arlen;
  wire [2:0] arsize;
  wire [1:0] arburst, rresp_;
  wire [`AXI_BITS - 1:0] rdata_;
  wire awvalid_, awready_, wvalid_, wready_, wlast, bvalid_, bready_;
  wire [`ADDRESS_BITS - 1:0] awaddr_;
  wire [`ID_BITS - 1:0] awid, bid;
  wire [7:0] awlen;
  wire [2:0] awsize;
  wire [1:0] awburst, bresp_;
  wire [`AXI_BITS - 1:0] wdata_;
  wire [`AXI_BITS / 8 - 1:0] wstrb_;

`ifndef READS
  assign {arvalid_, araddr_, arid, arlen, arsize, arburst} = 0;
  assign rready_ = 1;
`endif
`ifndef WRITES
  assign {awvalid_, awaddr_, awid, awlen, awsize, awburst, wvalid_, wdata_, wstrb_, wlast} = 0;
  assign bready_ = 1;
`endif

`define READ_CHANNELS \
      .m_axi_arvalid(arvalid_), \
      .m_axi_arready(arready_), \
      .m_axi_araddr(araddr_), \
      .m_axi_arid(arid), \
      .m_axi_arlen(arlen), \
      .m_axi_arsize(arsize), \
      .m_axi_arburst(arburst), \
      .m_axi_rvalid(rvalid_), \
      .m_axi_rready(rready_), \
      .m_axi_rdata(rdata_), \
      .m_axi_rid(rid), \
      .m_axi_rresp(rresp_), \
      .m_axi_rlast(rlast),
`define WRITE_CHANNELS \
      .m_axi_awvalid(awvalid_), \
      .m_axi_awready(awready_), \
      .m_axi_awaddr(awaddr_), \
      .m_axi_awid(awid), \
      .m_axi_awlen(awlen), \
      .m_axi_awsize(awsize), \
      .m_axi_awburst(awburst), \
      .m_axi_wvalid(wvalid_), \
      .m_axi_wready(wready_), \
      .m_axi_wdata(wdata_), \
      .m_axi_wstrb(wstrb_), \
      .m_axi_wlast(wlast), \
      .m_axi_bvalid(bvalid_), \
      .m_axi_bready(bready_), \
      .m_axi_bid(bid), \
      .m_axi_bresp(bresp_),
`endif

  `UNIT unit (
      .clk(clk),
      .rst(reset),
      .i__valid(valid),
      .i__ready(unit_ready),
      .i__payload(payload),
`ifdef READS
      `READ_CHANNELS
`endif
`ifdef WRITES
      `WRITE_CHANNELS
`endif
`ifdef BUS
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
      .irq(irq),
`endif
      `PORTS
      .o__valid(unit_valid),
      .o__ready(ready),
      .o__payload(out_payload)
  );

`ifdef MEMORY
  axi_checker watcher (
      .clk(clk),
      .rst(reset),
`ifdef READS
      `READ_CHANNELS
`endif
`ifdef WRITES
      `WRITE_CHANNELS
`endif
      .broken(),
      .master_rule(axi_master_rule[`RULE_BITS - 1:0]),
      .slave_rule(axi_slave_rule[`RULE_BITS - 1:0])
  );

  axi_memory #(
      .DATA_WIDTH(`AXI_BITS),
      .ADDRESS_WIDTH(`ADDRESS_BITS),
      .ID_WIDTH(`ID_BITS),
      .MEMORY_BITS(`MEMORY_BITS),
      .QUEUE(1024)  // a burst a cycle at any latency that is of interest
  ) memory (
      .clk(clk),
      .rst(reset),
      .latency(latency),
      .bandwidth(bandwidth),
      .reorder(reorder),
      .interleave(interleave),
      .stall(stall),
      .seed(seed),
      .error_enable(error_enable),
      .write_error_enable(write_error_enable),
      .error_first(error_first),
      .error_last(error_last),
      .arvalid(arvalid_),
      .arready(arready_),
      .araddr(araddr_),
      .arid(arid),
      .arlen(arlen),
      .arsize(arsize),
      .arburst(arburst),
      .rvalid(rvalid_),
      .rready(rready_),
      .rdata(rdata_),
      .rid(rid),
      .rresp(rresp_),
      .rlast(rlast),
      .awvalid(awvalid_),
      .awready(awready_),
      .awaddr(awaddr_),
      .awid(awid),
      .awlen(awlen),
      .awsize(awsize),
      .awburst(awburst),
      .wvalid(wvalid_),
      .wready(wready_),
      .wdata(wdata_),
      .wstrb(wstrb_),
      .wlast(wlast),
      .bvalid(bvalid_),
      .bready(bready_),
      .bid(bid),
      .bresp(bresp_),
      .violation(violation),
      .read_bursts(figures[63:0]),
      .read_beats(figures[127:64]),
      .busy_cycles(figures[191:128]),
      .write_bursts(figures[255:192]),
      .write_beats(figures[319:256])
  );

  // What was written, for the harness: +written=FILE, from byte +from=ADDRESS to +to=ADDRESS, hexadecimal, whole words.
  reg [8*1024-1:0] written;
  reg [63:0] from, to;
  final
    if ($value$plusargs("written=%s", written) && $value$plusargs("from=%h", from) && $value$plusargs("to=%h", to))
      $writememh(written, memory.memory, from * 8 / `AXI_BITS, to * 8 / `AXI_BITS);
`else
  assign violation = 0;
  assign figures = 0;
  assign axi_master_rule = 0;
  assign axi_slave_rule = 0;
`endif

endmodule

`default_nettype wire
