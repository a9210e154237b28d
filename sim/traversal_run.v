// The top of a run of the traversal unit: the unit with the memory of the simulations behind it.
//
// Every input meets a register first. Then nothing is evaluated when the inputs change, and the harness, which sets them
// between two rising edges, sees outputs that depend on registers alone. So a ray is offered to the unit one cycle after
// the harness offers it, and out_ready holds for the cycle after. out_valid is high where a result is taken.
//
// COUNTERS connects the unit's counters, each of 64 bits here; LOAD_ERROR_BITS and so on are the widths of its ports.
// axi_checker is emitted (gen/watched.py): it watches the memory port, and says which rules of AXI were broken first.

`default_nettype none

module traversal_run (
    input  wire                                  clk,
    input  wire                                  rst,

    input  wire                                  in_valid,
    output wire                                  in_ready,
    input  wire [`QUERY_BITS + `TAG_BITS - 1:0]  in_payload,
    output wire                                  out_valid,
    input  wire                                  out_ready,
    output wire [`RESULT_BITS + `TAG_BITS - 1:0] out_payload,

    input  wire                                  load,
    input  wire [`ADDRESS_BITS - 1:0]            base,
    output wire                                  loaded,
    output wire [`LOAD_ERROR_BITS - 1:0]         load_error,
    input  wire [`OVERLAP_BITS - 1:0]            overlap,
    input  wire [`TIMEOUT_BITS - 1:0]            read_timeout,
    input  wire                                  count_clear,
    output wire [64 * `COUNTER_NUMBER - 1:0]     counters,

    // Of the memory; docs/axi_memory.md
    input  wire [15:0]                           latency,
    input  wire [8:0]                            bandwidth,
    input  wire [7:0]                            reorder,
    input  wire                                  interleave,
    input  wire [7:0]                            stall,
    input  wire [31:0]                           seed,
    input  wire                                  error_enable,
    input  wire [`ADDRESS_BITS - 1:0]            error_first,
    input  wire [`ADDRESS_BITS - 1:0]            error_last,
    output wire                                  violation,
    output wire [63:0]                           read_bursts,
    output wire [63:0]                           read_beats,
    output wire [63:0]                           busy_cycles,
    output wire [`RULE_BITS - 1:0]               axi_master_rule,
    output wire [`RULE_BITS - 1:0]               axi_slave_rule
);

  reg reset, valid, ready, loading, clearing;
  reg [`QUERY_BITS + `TAG_BITS - 1:0] payload;
  reg [`ADDRESS_BITS - 1:0] tree_base;
  reg [`OVERLAP_BITS - 1:0] visits;
  wire unit_ready, unit_valid;

  assign in_ready = !valid || unit_ready;
  assign out_valid = unit_valid && ready;

  always @(posedge clk) begin
    reset <= rst;
    ready <= out_ready;
    loading <= load;
    clearing <= count_clear;
    tree_base <= base;
    visits <= overlap;
    if (rst) valid <= 0;
    else if (in_ready) begin
      valid <= in_valid;
      payload <= in_payload;
    end
  end

  wire arvalid, arready, rvalid, rready, rlast;
  wire [`ADDRESS_BITS - 1:0] araddr;
  wire [`ID_BITS - 1:0] arid, rid;
  wire [7:0] arlen;
  wire [2:0] arsize;
  wire [1:0] arburst, rresp;
  wire [`AXI_BITS - 1:0] rdata;

  traversal unit (
      .clk(clk),
      .rst(reset),
      .i__valid(valid),
      .i__ready(unit_ready),
      .i__payload(payload),
      .o__valid(unit_valid),
      .o__ready(ready),
      .o__payload(out_payload),
      .load(loading),
      .base(tree_base),
      .loaded(loaded),
      .load_error(load_error),
      .overlap(visits),
      .read_timeout(read_timeout),
      .abort(1'b0),
      .aborting(),
      .count_clear(clearing),
      `COUNTERS
      .m_axi_arvalid(arvalid),
      .m_axi_arready(arready),
      .m_axi_araddr(araddr),
      .m_axi_arid(arid),
      .m_axi_arlen(arlen),
      .m_axi_arsize(arsize),
      .m_axi_arburst(arburst),
      .m_axi_rvalid(rvalid),
      .m_axi_rready(rready),
      .m_axi_rdata(rdata),
      .m_axi_rid(rid),
      .m_axi_rresp(rresp),
      .m_axi_rlast(rlast)
  );

  axi_checker watcher (
      .clk(clk),
      .rst(reset),
      .m_axi_arvalid(arvalid),
      .m_axi_arready(arready),
      .m_axi_araddr(araddr),
      .m_axi_arid(arid),
      .m_axi_arlen(arlen),
      .m_axi_arsize(arsize),
      .m_axi_arburst(arburst),
      .m_axi_rvalid(rvalid),
      .m_axi_rready(rready),
      .m_axi_rdata(rdata),
      .m_axi_rid(rid),
      .m_axi_rresp(rresp),
      .m_axi_rlast(rlast),
      .broken(),
      .master_rule(axi_master_rule),
      .slave_rule(axi_slave_rule)
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
      .write_error_enable(1'b0),
      .error_first(error_first),
      .error_last(error_last),
      .arvalid(arvalid),
      .arready(arready),
      .araddr(araddr),
      .arid(arid),
      .arlen(arlen),
      .arsize(arsize),
      .arburst(arburst),
      .rvalid(rvalid),
      .rready(rready),
      .rdata(rdata),
      .rid(rid),
      .rresp(rresp),
      .rlast(rlast),
      .awvalid(1'b0),
      .awready(),
      .awaddr({`ADDRESS_BITS{1'b0}}),
      .awid({`ID_BITS{1'b0}}),
      .awlen(8'd0),
      .awsize(3'd0),
      .awburst(2'd0),
      .wvalid(1'b0),
      .wready(),
      .wdata({`AXI_BITS{1'b0}}),
      .wstrb({`AXI_BITS / 8{1'b0}}),
      .wlast(1'b0),
      .bvalid(),
      .bready(1'b1),
      .bid(),
      .bresp(),
      .violation(violation),
      .read_bursts(read_bursts),
      .read_beats(read_beats),
      .busy_cycles(busy_cycles),
      .write_bursts(),
      .write_beats()
  );

endmodule

`default_nettype wire
