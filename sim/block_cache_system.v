// A block cache on the memory of the simulations, with counters of its events: what verif/benches/test_block_cache.py and
// sim/block_cache_system.cpp drive. TAG_BITS, DATA_BITS and ID_BITS are those of the cache; axi_checker is emitted.

`default_nettype none

module block_cache_system (
    input  wire                   clk,
    input  wire                   rst,
    input  wire                   i__valid,
    output wire                   i__ready,
    input  wire [`TAG_BITS + 31:0]  i__payload,
    output wire                   o__valid,
    input  wire                   o__ready,
    output wire [`TAG_BITS + 512:0] o__payload,
    input  wire [39:0]            base,
    input  wire                   invalidate,
    input  wire                   prefetch__valid,
    input  wire [31:0]            prefetch__block,
    output wire                   prefetching,

    // The memory's behaviour; docs/axi_memory.md.
    input  wire [15:0]            latency,
    input  wire [8:0]             bandwidth,
    input  wire [7:0]             reorder,
    input  wire                   interleave,
    input  wire [7:0]             stall,
    input  wire [31:0]            seed,
    input  wire                   error_enable,
    input  wire [39:0]            error_first,
    input  wire [39:0]            error_last,

    output wire                   violation,
    output wire [5:0]             axi_master_rule,
    output wire [5:0]             axi_slave_rule,
    output wire [63:0]            read_bursts,
    output reg  [31:0]            hits,
    output reg  [31:0]            misses,
    output reg  [31:0]            merges,
    output reg  [31:0]            stalls,
    output reg  [31:0]            evictions
);

  wire arvalid, arready, rvalid, rready, rlast;
  wire [39:0] araddr;
  wire [`ID_BITS - 1:0] arid, rid;
  wire [7:0] arlen;
  wire [2:0] arsize;
  wire [1:0] arburst, rresp;
  wire [`DATA_BITS - 1:0] rdata;
  wire hit, miss, merged, stalled, evicted;

  block_cache cache (
      .clk(clk), .rst(rst),
      .i__valid(i__valid), .i__ready(i__ready), .i__payload(i__payload),
      .o__valid(o__valid), .o__ready(o__ready), .o__payload(o__payload),
      .base(base), .invalidate(invalidate), .tick(1'b0),
      .prefetch__valid(prefetch__valid), .prefetch__block(prefetch__block), .prefetching(prefetching), .crowded(),
      .m_axi_arvalid(arvalid), .m_axi_arready(arready), .m_axi_araddr(araddr), .m_axi_arid(arid),
      .m_axi_arlen(arlen), .m_axi_arsize(arsize), .m_axi_arburst(arburst),
      .m_axi_rvalid(rvalid), .m_axi_rready(rready), .m_axi_rdata(rdata), .m_axi_rid(rid), .m_axi_rresp(rresp),
      .m_axi_rlast(rlast),
      .hit(hit), .miss(miss), .merged(merged), .stalled(stalled), .evicted(evicted)
  );

  axi_checker watcher (
      .clk(clk), .rst(rst),
      .m_axi_arvalid(arvalid), .m_axi_arready(arready), .m_axi_araddr(araddr), .m_axi_arid(arid),
      .m_axi_arlen(arlen), .m_axi_arsize(arsize), .m_axi_arburst(arburst),
      .m_axi_rvalid(rvalid), .m_axi_rready(rready), .m_axi_rdata(rdata), .m_axi_rid(rid), .m_axi_rresp(rresp),
      .m_axi_rlast(rlast),
      .broken(), .master_rule(axi_master_rule), .slave_rule(axi_slave_rule)
  );

  axi_memory #(
      .DATA_WIDTH(`DATA_BITS), .ID_WIDTH(`ID_BITS), .MEMORY_BITS(20)
  ) memory (
      .clk(clk), .rst(rst),
      .latency(latency), .bandwidth(bandwidth), .reorder(reorder), .interleave(interleave), .stall(stall), .seed(seed),
      .error_enable(error_enable), .write_error_enable(1'b0), .error_first(error_first), .error_last(error_last),
      .arvalid(arvalid), .arready(arready), .araddr(araddr), .arid(arid), .arlen(arlen), .arsize(arsize),
      .arburst(arburst),
      .rvalid(rvalid), .rready(rready), .rdata(rdata), .rid(rid), .rresp(rresp), .rlast(rlast),
      .awvalid(1'b0), .awready(), .awaddr(40'd0), .awid({`ID_BITS{1'b0}}), .awlen(8'd0), .awsize(3'd0), .awburst(2'd0),
      .wvalid(1'b0), .wready(), .wdata({`DATA_BITS{1'b0}}), .wstrb({`DATA_BITS / 8{1'b0}}), .wlast(1'b0),
      .bvalid(), .bready(1'b1), .bid(), .bresp(),
      .violation(violation), .read_bursts(read_bursts), .read_beats(), .busy_cycles(), .write_bursts(), .write_beats()
  );

  always @(posedge clk)
    if (rst) begin
      hits <= 0;
      misses <= 0;
      merges <= 0;
      stalls <= 0;
      evictions <= 0;
    end else begin
      hits <= hits + {31'd0, hit};
      misses <= misses + {31'd0, miss};
      merges <= merges + {31'd0, merged};
      stalls <= stalls + {31'd0, stalled};
      evictions <= evictions + {31'd0, evicted};
    end
endmodule

`default_nettype wire
