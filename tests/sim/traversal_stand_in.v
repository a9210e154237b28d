// Has the ports of the traversal unit, and answers a ray with words of a block: what the harness is tested with.
//
// The block is the bits of the origin's x; primitive, t and u are its first three words, v the origin's x, the mask is in
// `error`. A block that the memory cannot read gives error 1. Tags are the ids of the bursts, so answers come in any order.

module traversal(clk, rst, i__valid, i__ready, i__payload, o__valid, o__ready, o__payload, load, base, loaded, load_error,
    overlap, read_timeout, abort, aborting, count_clear, count_rays, count_node_tests, count_leaf_visits, m_axi_arvalid, m_axi_arready, m_axi_araddr,
    m_axi_arid, m_axi_arlen, m_axi_arsize, m_axi_arburst, m_axi_rvalid, m_axi_rready, m_axi_rdata, m_axi_rid, m_axi_rresp,
    m_axi_rlast);
  input clk;
  input rst;
  input i__valid;
  output i__ready;
  input [271:0] i__payload;
  output o__valid;
  input o__ready;
  output [170:0] o__payload;
  input load;
  input [39:0] base;
  output loaded;
  output [3:0] load_error;
  input [2:0] overlap;
  input [23:0] read_timeout;
  input abort;
  output aborting;
  input count_clear;
  output [47:0] count_rays;
  output [47:0] count_node_tests;
  output [15:0] count_leaf_visits;
  output m_axi_arvalid;
  input m_axi_arready;
  output [39:0] m_axi_araddr;
  output [6:0] m_axi_arid;
  output [7:0] m_axi_arlen;
  output [2:0] m_axi_arsize;
  output [1:0] m_axi_arburst;
  input m_axi_rvalid;
  output m_axi_rready;
  input [511:0] m_axi_rdata;
  input [6:0] m_axi_rid;
  input [1:0] m_axi_rresp;
  input m_axi_rlast;

  localparam [31:0] MAGIC = 32'h56424C4C;
  localparam [6:0] HEADER = 7'd64;  // the id of its burst

  reg [2:0] state;  // asks for the header, waits for it, has a tree, has refused one
  reg [39:0] tree;
  reg asks;
  reg [5:0] tag;
  reg [31:0] block;
  reg [31:0] rays, tests;
  reg [31:0] wanted [0:63];

  assign loaded = state == 3;
  assign load_error = state == 4 ? 4'd2 : 4'd0;
  wire header = m_axi_rid == HEADER;

  assign i__ready = state >= 3 && (!asks || m_axi_arready);
  assign m_axi_arvalid = state == 1 || asks;
  assign m_axi_araddr = state == 1 ? tree : tree + {2'd0, block, 6'd0};
  assign m_axi_arid = state == 1 ? HEADER : {1'b0, tag};
  assign m_axi_arlen = 0;
  assign m_axi_arsize = 6;
  assign m_axi_arburst = 1;

  assign o__valid = m_axi_rvalid && !header;
  assign m_axi_rready = o__ready || header;
  wire [5:0] out_tag = m_axi_rid[5:0];
  wire [31:0] out_primitive = m_axi_rdata[31:0];
  assign o__payload = {out_tag, wanted[m_axi_rid[5:0]], {2'd0, m_axi_rresp[1]}, 1'b0, overlap[0],
                       wanted[m_axi_rid[5:0]], m_axi_rdata[95:32], out_primitive};

  assign count_rays = {16'd0, rays};
  assign count_node_tests = {16'd0, tests};
  assign count_leaf_visits = 0;
  assign aborting = 0;

  always @(posedge clk) begin
    if (load) begin
      tree <= base;
      state <= 1;
    end else if (state == 1 && m_axi_arready) state <= 2;
    else if (state == 2 && m_axi_rvalid) state <= m_axi_rdata[31:0] == MAGIC ? 3 : 4;
    if (i__valid && i__ready) begin
      block <= i__payload[31:0];
      tag <= i__payload[271:266];
      wanted[i__payload[271:266]] <= i__payload[31:0];
      asks <= 1;
    end else if (m_axi_arready) asks <= 0;
    if (o__valid && o__ready) rays <= rays + 1;
    if (i__valid && i__ready) tests <= tests + 1;
    if (rst || count_clear) begin
      rays <= 0;
      tests <= 0;
    end
    if (rst) begin
      state <= 0;
      asks <= 0;
    end
  end
endmodule
