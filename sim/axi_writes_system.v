// Two writers of blocks behind an arbiter, on the memory of the simulations, which can be read beside them: what
// verif/benches/test_axi_writes.py drives. DATA_BITS and ID_BITS are those of the memory's port; PAYLOAD_BITS is a block
// with its address and strobes. axi_writer, axi_write_arbiter and axi_checker are emitted.

`default_nettype none

module axi_writes_system (
    input  wire                        clk,
    input  wire                        rst,

    input  wire                        i0__valid,
    output wire                        i0__ready,
    input  wire [`PAYLOAD_BITS - 1:0]  i0__payload,
    input  wire [39:0]                 base0,
    input  wire [40:0]                 limit0,
    output wire                        idle0,
    input  wire                        clear0,
    output wire [1:0]                  error0,
    output wire [33:0]                 error_block0,
    input  wire                        abort0,
    output wire                        aborting0,
    input  wire                        i1__valid,
    output wire                        i1__ready,
    input  wire [`PAYLOAD_BITS - 1:0]  i1__payload,
    input  wire [39:0]                 base1,
    input  wire [40:0]                 limit1,
    output wire                        idle1,
    input  wire                        clear1,
    output wire [1:0]                  error1,
    output wire [33:0]                 error_block1,
    input  wire                        abort1,
    output wire                        aborting1,
    input  wire                        abort,
    output wire                        aborting,

    // The memory's behaviour; docs/axi_memory.md.
    input  wire [15:0]                 latency,
    input  wire [7:0]                  reorder,
    input  wire [7:0]                  stall,
    input  wire [31:0]                 seed,
    input  wire                        write_error_enable,
    input  wire [39:0]                 error_first,
    input  wire [39:0]                 error_last,

    input  wire                        arvalid,
    output wire                        arready,
    input  wire [39:0]                 araddr,
    input  wire [`ID_BITS - 1:0]       arid,
    input  wire [7:0]                  arlen,
    input  wire [2:0]                  arsize,
    input  wire [1:0]                  arburst,
    output wire                        rvalid,
    input  wire                        rready,
    output wire [`DATA_BITS - 1:0]     rdata,
    output wire [`ID_BITS - 1:0]       rid,
    output wire [1:0]                  rresp,
    output wire                        rlast,

    output wire                        violation,
    output wire [63:0]                 write_bursts,
    output wire [63:0]                 write_beats,
    output wire [5:0]                  axi_master_rule,
    output wire [5:0]                  axi_slave_rule
);

  wire awvalid0, awready0, wvalid0, wready0, wlast0, bvalid0, bready0;
  wire [39:0] awaddr0;
  wire [`ID_BITS - 2:0] awid0, bid0;
  wire [7:0] awlen0;
  wire [2:0] awsize0;
  wire [1:0] awburst0, bresp0;
  wire [`DATA_BITS - 1:0] wdata0;
  wire [`DATA_BITS / 8 - 1:0] wstrb0;

  axi_writer writer0 (
      .clk(clk), .rst(rst | aborting),
      .i__valid(i0__valid), .i__ready(i0__ready), .i__payload(i0__payload),
      .base(base0), .limit(limit0), .idle(idle0), .clear(clear0), .error(error0), .error_block(error_block0),
      .abort(abort0), .tick(1'b0), .timed(1'b0), .aborting(aborting0),
      .m_axi_awvalid(awvalid0), .m_axi_awready(awready0), .m_axi_awaddr(awaddr0), .m_axi_awid(awid0),
      .m_axi_awlen(awlen0), .m_axi_awsize(awsize0), .m_axi_awburst(awburst0),
      .m_axi_wvalid(wvalid0), .m_axi_wready(wready0), .m_axi_wdata(wdata0), .m_axi_wstrb(wstrb0),
      .m_axi_wlast(wlast0),
      .m_axi_bvalid(bvalid0), .m_axi_bready(bready0), .m_axi_bid(bid0), .m_axi_bresp(bresp0)
  );

  wire awvalid1, awready1, wvalid1, wready1, wlast1, bvalid1, bready1;
  wire [39:0] awaddr1;
  wire [`ID_BITS - 2:0] awid1, bid1;
  wire [7:0] awlen1;
  wire [2:0] awsize1;
  wire [1:0] awburst1, bresp1;
  wire [`DATA_BITS - 1:0] wdata1;
  wire [`DATA_BITS / 8 - 1:0] wstrb1;

  axi_writer writer1 (
      .clk(clk), .rst(rst | aborting),
      .i__valid(i1__valid), .i__ready(i1__ready), .i__payload(i1__payload),
      .base(base1), .limit(limit1), .idle(idle1), .clear(clear1), .error(error1), .error_block(error_block1),
      .abort(abort1), .tick(1'b0), .timed(1'b0), .aborting(aborting1),
      .m_axi_awvalid(awvalid1), .m_axi_awready(awready1), .m_axi_awaddr(awaddr1), .m_axi_awid(awid1),
      .m_axi_awlen(awlen1), .m_axi_awsize(awsize1), .m_axi_awburst(awburst1),
      .m_axi_wvalid(wvalid1), .m_axi_wready(wready1), .m_axi_wdata(wdata1), .m_axi_wstrb(wstrb1),
      .m_axi_wlast(wlast1),
      .m_axi_bvalid(bvalid1), .m_axi_bready(bready1), .m_axi_bid(bid1), .m_axi_bresp(bresp1)
  );

  wire awvalid, awready, wvalid, wready, wlast, bvalid, bready;
  wire [39:0] awaddr;
  wire [`ID_BITS - 1:0] awid, bid;
  wire [7:0] awlen;
  wire [2:0] awsize;
  wire [1:0] awburst, bresp;
  wire [`DATA_BITS - 1:0] wdata;
  wire [`DATA_BITS / 8 - 1:0] wstrb;

  axi_write_arbiter arbiter (
      .clk(clk), .rst(rst),
      .masters__0__awvalid(awvalid0), .masters__0__awready(awready0), .masters__0__awaddr(awaddr0),
      .masters__0__awid(awid0), .masters__0__awlen(awlen0), .masters__0__awsize(awsize0),
      .masters__0__awburst(awburst0), .masters__0__wvalid(wvalid0), .masters__0__wready(wready0),
      .masters__0__wdata(wdata0), .masters__0__wstrb(wstrb0), .masters__0__wlast(wlast0),
      .masters__0__bvalid(bvalid0), .masters__0__bready(bready0), .masters__0__bid(bid0),
      .masters__0__bresp(bresp0),
      .masters__1__awvalid(awvalid1), .masters__1__awready(awready1), .masters__1__awaddr(awaddr1),
      .masters__1__awid(awid1), .masters__1__awlen(awlen1), .masters__1__awsize(awsize1),
      .masters__1__awburst(awburst1), .masters__1__wvalid(wvalid1), .masters__1__wready(wready1),
      .masters__1__wdata(wdata1), .masters__1__wstrb(wstrb1), .masters__1__wlast(wlast1),
      .masters__1__bvalid(bvalid1), .masters__1__bready(bready1), .masters__1__bid(bid1),
      .masters__1__bresp(bresp1),
      .abort(abort), .tick(1'b0), .timed(1'b0), .aborting(aborting),
      .m_axi_awvalid(awvalid), .m_axi_awready(awready), .m_axi_awaddr(awaddr), .m_axi_awid(awid),
      .m_axi_awlen(awlen), .m_axi_awsize(awsize), .m_axi_awburst(awburst),
      .m_axi_wvalid(wvalid), .m_axi_wready(wready), .m_axi_wdata(wdata), .m_axi_wstrb(wstrb), .m_axi_wlast(wlast),
      .m_axi_bvalid(bvalid), .m_axi_bready(bready), .m_axi_bid(bid), .m_axi_bresp(bresp)
  );

  axi_checker watcher (
      .clk(clk), .rst(rst),
      .m_axi_awvalid(awvalid), .m_axi_awready(awready), .m_axi_awaddr(awaddr), .m_axi_awid(awid),
      .m_axi_awlen(awlen), .m_axi_awsize(awsize), .m_axi_awburst(awburst),
      .m_axi_wvalid(wvalid), .m_axi_wready(wready), .m_axi_wdata(wdata), .m_axi_wstrb(wstrb), .m_axi_wlast(wlast),
      .m_axi_bvalid(bvalid), .m_axi_bready(bready), .m_axi_bid(bid), .m_axi_bresp(bresp),
      .broken(), .master_rule(axi_master_rule), .slave_rule(axi_slave_rule)
  );

  axi_memory #(
      .DATA_WIDTH(`DATA_BITS), .ID_WIDTH(`ID_BITS), .MEMORY_BITS(16)
  ) memory (
      .clk(clk), .rst(rst),
      .latency(latency), .bandwidth(9'd256), .reorder(reorder), .interleave(1'b0), .stall(stall), .seed(seed),
      .error_enable(1'b0), .write_error_enable(write_error_enable), .error_first(error_first), .error_last(error_last),
      .arvalid(arvalid), .arready(arready), .araddr(araddr), .arid(arid), .arlen(arlen), .arsize(arsize),
      .arburst(arburst),
      .rvalid(rvalid), .rready(rready), .rdata(rdata), .rid(rid), .rresp(rresp), .rlast(rlast),
      .awvalid(awvalid), .awready(awready), .awaddr(awaddr), .awid(awid), .awlen(awlen), .awsize(awsize),
      .awburst(awburst),
      .wvalid(wvalid), .wready(wready), .wdata(wdata), .wstrb(wstrb), .wlast(wlast),
      .bvalid(bvalid), .bready(bready), .bid(bid), .bresp(bresp),
      .violation(violation), .read_bursts(), .read_beats(), .busy_cycles(),
      .write_bursts(write_bursts), .write_beats(write_beats)
  );

endmodule

`default_nettype wire
