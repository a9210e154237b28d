// A small unit with everything that a system may have: what the harness of systems is tested with.
//
// An operand is a number below 64. With `write` it is written, plus `add`, into the lowest four bytes of block number
// `operand` behind `base`; the result is what lay there before. `start` has to come first; then `started` is 1.

module stand_in(clk, rst, i__valid, i__ready, i__payload, o__valid, o__ready, o__payload, start, base, add, write, started,
    state, count_done, m_axi_arvalid, m_axi_arready, m_axi_araddr, m_axi_arid, m_axi_arlen, m_axi_arsize, m_axi_arburst,
    m_axi_rvalid, m_axi_rready, m_axi_rdata, m_axi_rid, m_axi_rresp, m_axi_rlast, m_axi_awvalid, m_axi_awready,
    m_axi_awaddr, m_axi_awid, m_axi_awlen, m_axi_awsize, m_axi_awburst, m_axi_wvalid, m_axi_wready, m_axi_wdata,
    m_axi_wstrb, m_axi_wlast, m_axi_bvalid, m_axi_bready, m_axi_bid, m_axi_bresp);
  input clk;
  input rst;
  input i__valid;
  output i__ready;
  input [35:0] i__payload;
  output o__valid;
  input o__ready;
  output [35:0] o__payload;
  input start;
  input [19:0] base;
  input [6:0] add;
  input write;
  output started;
  output [2:0] state;
  output [15:0] count_done;
  output m_axi_arvalid;
  input m_axi_arready;
  output [19:0] m_axi_araddr;
  output m_axi_arid;
  output [7:0] m_axi_arlen;
  output [2:0] m_axi_arsize;
  output [1:0] m_axi_arburst;
  input m_axi_rvalid;
  output m_axi_rready;
  input [511:0] m_axi_rdata;
  input m_axi_rid;
  input [1:0] m_axi_rresp;
  input m_axi_rlast;
  output m_axi_awvalid;
  input m_axi_awready;
  output [19:0] m_axi_awaddr;
  output m_axi_awid;
  output [7:0] m_axi_awlen;
  output [2:0] m_axi_awsize;
  output [1:0] m_axi_awburst;
  output m_axi_wvalid;
  input m_axi_wready;
  output [511:0] m_axi_wdata;
  output [63:0] m_axi_wstrb;
  output m_axi_wlast;
  input m_axi_bvalid;
  output m_axi_bready;
  input m_axi_bid;
  input [1:0] m_axi_bresp;

  localparam IDLE = 0, ASK = 1, WAIT = 2, SEND = 3, ANSWERED = 4, GIVE = 5;

  reg running, addressed, sent;
  reg [2:0] now;
  reg [35:0] operand;
  reg [31:0] found;
  reg [15:0] done;

  assign started = running;
  assign state = now;
  assign count_done = done;
  assign i__ready = running && now == IDLE;
  wire [19:0] place = base + {8'd0, operand[5:0], 6'd0};
  assign m_axi_arvalid = now == ASK;
  assign m_axi_araddr = place;
  assign m_axi_arid = 0;
  assign m_axi_arlen = 0;
  assign m_axi_arsize = 6;
  assign m_axi_arburst = 1;
  assign m_axi_rready = now == WAIT;
  assign m_axi_awvalid = now == SEND && !addressed;
  assign m_axi_awaddr = place;
  assign m_axi_awid = 0;
  assign m_axi_awlen = 0;
  assign m_axi_awsize = 6;
  assign m_axi_awburst = 1;
  assign m_axi_wvalid = now == SEND && !sent;
  assign m_axi_wdata = {480'd0, operand[31:0] + {25'd0, add}};
  assign m_axi_wstrb = 64'd15;
  assign m_axi_wlast = 1;
  assign m_axi_bready = now == ANSWERED;
  assign o__valid = now == GIVE;
  assign o__payload = {operand[35:32], found};

  always @(posedge clk) begin
    if (start) running <= 1;
    case (now)
      IDLE: if (i__valid && i__ready) begin operand <= i__payload; now <= ASK; end
      ASK: if (m_axi_arready) now <= WAIT;
      WAIT: if (m_axi_rvalid) begin found <= m_axi_rdata[31:0]; now <= write ? SEND : GIVE; addressed <= 0; sent <= 0; end
      SEND: begin
        if (m_axi_awready) addressed <= 1;
        if (m_axi_wready) sent <= 1;
        if ((addressed || m_axi_awready) && (sent || m_axi_wready)) now <= ANSWERED;
      end
      ANSWERED: if (m_axi_bvalid) now <= GIVE;
      default: if (o__ready) begin now <= IDLE; done <= done + 1; end
    endcase
    if (rst) begin
      running <= 0;
      now <= IDLE;
      done <= 0;
    end
  end
endmodule
