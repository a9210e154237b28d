# Constraints of {{ module }}, preset {{ preset }}: one clock, inputs and outputs with a fifth of the period outside.
# Times are in {{ unit_name }}. The period is what the package was asked for, not what the unit is known to reach.

set period {{ period }}
set outside [expr {0.2 * $period}]

create_clock -name clk -period $period [get_ports clk]
{% for port in ports if port.name != "clk" %}
set_{{ port.direction }}_delay $outside -clock clk [get_ports {{ "{" }}{{ port.name }}{{ "[*]" if port.width > 1 }}{{ "}" }}]
{% endfor %}
