{# The memory of a testbench, behind wires `memory_<signal>` for the unit's port; `memory` is gen.package.memory's. #}
  wire violation;
{% for name, width in memory.wires.items() %}
  wire [{{ width }}-1:0] memory_{{ name }};
{% endfor %}

  axi_memory #(
      .DATA_WIDTH({{ memory.data_width }}),
      .ADDRESS_WIDTH({{ memory.address_width }}),
      .ID_WIDTH({{ memory.id_width }}),
      .MEMORY_BITS({{ memory_bits }})
  ) memory (
      .clk(clk),
      .rst(rst),
      .latency({{ latency }}),
      .bandwidth(9'd256),
      .reorder({{ reorder }}),
      .interleave({{ interleave }}),
      .stall({{ stall }}),
      .seed(32'd{{ seed }}),
      .error_enable(1'b0),
      .write_error_enable(1'b0),
      .error_first({{ memory.address_width }}'d0),
      .error_last({{ memory.address_width }}'d0),
{% for name in memory.wires %}
      .{{ name }}(memory_{{ name }}),
{% endfor %}
{% for name, width in memory.unused.items() %}
      .{{ name }}({{ "%d'd0" % width if width }}),
{% endfor %}
      .violation(violation),
      .read_bursts(),
      .read_beats(),
      .busy_cycles(),
      .write_bursts(),
      .write_beats()
  );
