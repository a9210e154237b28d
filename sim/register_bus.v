// The top of a simulated system: the traversal unit behind AXI4-Lite, its streams tied off, with the memory of the
// simulations. axi_checker is emitted (gen/watched.py): it watches the memory port.

`default_nettype none

module register_bus (
    input  wire                           clk,
    input  wire                           rst,
    input  wire                           awvalid,
    output wire                           awready,
    input  wire [`BUS_ADDRESS_BITS - 1:0] awaddr,
    input  wire                           wvalid,
    output wire                           wready,
    input  wire [31:0]                    wdata,
    input  wire [3:0]                     wstrb,
    output wire                           bvalid,
    input  wire                           bready,
    output wire [1:0]                     bresp,
    input  wire                           arvalid,
    output wire                           arready,
    input  wire [`BUS_ADDRESS_BITS - 1:0] araddr,
    output wire                           rvalid,
    input  wire                           rready,
    output wire [31:0]                    rdata,
    output wire [1:0]                     rresp,
    output wire                           irq,

    input  wire [31:0]                    seed,
    output wire                           violation,
    output wire [`RULE_BITS - 1:0]        axi_master_rule,
    output wire [`RULE_BITS - 1:0]        axi_slave_rule
);

  wire m_arvalid, m_arready, m_rvalid, m_rready, m_rlast;
  wire [`ADDRESS_BITS - 1:0] m_araddr;
  wire [`ID_BITS - 1:0] m_arid, m_rid;
  wire [7:0] m_arlen;
  wire [2:0] m_arsize;
  wire [1:0] m_arburst, m_rresp;
  wire [`AXI_BITS - 1:0] m_rdata;

  traversal_axi4_lite unit (
      .clk(clk),
      .rst(rst),
      .i__valid(1'b0),
      .i__ready(),
      .i__payload({`QUERY_BITS + `TAG_BITS{1'b0}}),
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
      .irq(irq),
      .m_axi_arvalid(m_arvalid),
      .m_axi_arready(m_arready),
      .m_axi_araddr(m_araddr),
      .m_axi_arid(m_arid),
      .m_axi_arlen(m_arlen),
      .m_axi_arsize(m_arsize),
      .m_axi_arburst(m_arburst),
      .m_axi_rvalid(m_rvalid),
      .m_axi_rready(m_rready),
      .m_axi_rdata(m_rdata),
      .m_axi_rid(m_rid),
      .m_axi_rresp(m_rresp),
      .m_axi_rlast(m_rlast)
  );

  axi_checker watcher (
      .clk(clk),
      .rst(rst),
      .m_axi_arvalid(m_arvalid),
      .m_axi_arready(m_arready),
      .m_axi_araddr(m_araddr),
      .m_axi_arid(m_arid),
      .m_axi_arlen(m_arlen),
      .m_axi_arsize(m_arsize),
      .m_axi_arburst(m_arburst),
      .m_axi_rvalid(m_rvalid),
      .m_axi_rready(m_rready),
      .m_axi_rdata(m_rdata),
      .m_axi_rid(m_rid),
      .m_axi_rresp(m_rresp),
      .m_axi_rlast(m_rlast),
      .broken(),
      .master_rule(axi_master_rule),
      .slave_rule(axi_slave_rule)
  );

  axi_memory #(
      .DATA_WIDTH(`AXI_BITS),
      .ADDRESS_WIDTH(`ADDRESS_BITS),
      .ID_WIDTH(`ID_BITS),
      .MEMORY_BITS(`MEMORY_BITS)
  ) memory (
      .clk(clk),
      .rst(rst),
      .latency(16'd40),
      .bandwidth(9'd256),
      .reorder(8'd64),
      .interleave(1'b1),
      .stall(8'd32),
      .seed(seed),
      .error_enable(1'b0),
      .write_error_enable(1'b0),
      .error_first({`ADDRESS_BITS{1'b0}}),
      .error_last({`ADDRESS_BITS{1'b0}}),
      .arvalid(m_arvalid),
      .arready(m_arready),
      .araddr(m_araddr),
      .arid(m_arid),
      .arlen(m_arlen),
      .arsize(m_arsize),
      .arburst(m_arburst),
      .rvalid(m_rvalid),
      .rready(m_rready),
      .rdata(m_rdata),
      .rid(m_rid),
      .rresp(m_rresp),
      .rlast(m_rlast),
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
      .read_bursts(),
      .read_beats(),
      .busy_cycles(),
      .write_bursts(),
      .write_beats()
  );

endmodule

`default_nettype wire
