// The top of a bulk run: the unit under plain port names.
//
// With STALLS both sides of the unit are wired through. Without, the unit's results are always taken and its inputs come
// from registers: then Verilator sees that no register is ever held and evaluates nothing when the inputs change, which
// makes the run several times as fast.

`default_nettype none

module bulk (
    input  wire                                  clk,
    input  wire                                  rst,
    input  wire                                  in_valid,
    output wire                                  in_ready,
    input  wire [`INPUT_BITS + `TAG_BITS - 1:0]  in_payload,
    output wire                                  out_valid,
    input  wire                                  out_ready,
    output wire [`OUTPUT_BITS + `TAG_BITS - 1:0] out_payload
);

`ifdef STALLS
  wire valid = in_valid;
  wire ready = out_ready;
  wire [`INPUT_BITS + `TAG_BITS - 1:0] payload = in_payload;
`else
  reg valid;
  wire ready = 1'b1;
  reg [`INPUT_BITS + `TAG_BITS - 1:0] payload;
  always @(posedge clk) begin
    valid <= in_valid;
    payload <= in_payload;
  end
`endif

  `UNIT unit (
      .clk(clk),
      .rst(rst),
      .i__valid(valid),
      .i__ready(in_ready),
      .i__payload(payload),
      .o__valid(out_valid),
      .o__ready(ready),
      .o__payload(out_payload)
  );

endmodule
