/* Register view of {{ module }}: its control and status ports, laid out as registers.
 *
 * A proposal: {{ module }} has these as ports and no bus. It holds for a block of registers made from {{ module }}.rdl.
 * Offsets are in bytes. A register of more than 32 bits is two words, the lower one first.
 */
#ifndef LIGHTLOOM_{{ module | upper }}_REGISTERS_H
#define LIGHTLOOM_{{ module | upper }}_REGISTERS_H
{% for register in registers %}

/* {{ register.meaning }} */
#define LIGHTLOOM_{{ module | upper }}_{{ register.name | upper }} {{ "0x%03xu" % register.offset }}
{% for field in register.fields %}
#define LIGHTLOOM_{{ module | upper }}_{{ register.name | upper }}_{{ field.name | upper }}_SHIFT {{ field.low }}
#define LIGHTLOOM_{{ module | upper }}_{{ register.name | upper }}_{{ field.name | upper }}_WIDTH {{ field.width }}
{% endfor %}
{% endfor %}

#define LIGHTLOOM_{{ module | upper }}_BYTES {{ "0x%03xu" % size }}
{% for register in registers %}
{% for field in register.fields if field["values"] %}

/* {{ register.name }}.{{ field.name }}: {{ field.meaning }}. */
enum lightloom_{{ module }}_{{ field.name }} {
{% for name, value in field["values"].items() %}
  LIGHTLOOM_{{ module | upper }}_{{ field.name | upper }}_{{ name | upper }} = {{ value }}{{ "," if not loop.last }}
{% endfor %}
};
{% endfor %}
{% endfor %}

#endif
