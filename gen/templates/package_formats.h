/* What Lightloom's hardware reads from memory, and what its streams carry, as C.
 *
 * Made from golden_model/contract/formats.py. Fields follow each other from the lowest bit of the first word up, without padding;
 * words are 32 bits, little-endian. Every field has its place in bits: LIGHTLOOM_<FORMAT>_<FIELD>_BIT and _WIDTH, and of
 * a vector _COUNT elements, one right after the other. lightloom_get and lightloom_set read and write them. Formats
 * whose fields are whole bytes are structs too; others are not, since C leaves the order of bit-fields open.
 */
#ifndef LIGHTLOOM_FORMATS_H
#define LIGHTLOOM_FORMATS_H

#include <stddef.h>
#include <stdint.h>

/* The `width` bits (1 to 32) from bit `bit` up. */
static inline uint32_t lightloom_get(const uint32_t *words, unsigned bit, unsigned width) {
  uint64_t pair = words[bit / 32];
  if (bit % 32 + width > 32) pair |= (uint64_t)words[bit / 32 + 1] << 32;
  return (uint32_t)(pair >> bit % 32 & (((uint64_t)1 << width) - 1));
}

/* Sets them to the lowest bits of `value`. */
static inline void lightloom_set(uint32_t *words, unsigned bit, unsigned width, uint32_t value) {
  unsigned k;
  for (k = 0; k < width; k++) {
    uint32_t mask = (uint32_t)1 << (bit + k) % 32;
    if (value >> k & 1) words[(bit + k) / 32] |= mask;
    else words[(bit + k) / 32] &= ~mask;
  }
}
{% for name, value in constants.items() %}
#define LIGHTLOOM_{{ name }} {{ value }}
{% endfor %}
{% for enum, values in enums.items() %}

/* {{ values.meaning }} */
enum lightloom_{{ enum }} {
{% for name, value in values.members.items() %}
  LIGHTLOOM_{{ enum | upper }}_{{ name | upper }} = {{ value }}{{ "," if not loop.last }}
{% endfor %}
};
{% endfor %}
{% for format in formats %}

/* {{ format.meaning }}: {{ format.width }} bits. */
#define LIGHTLOOM_{{ format.name }}_BITS {{ format.width }}
#define LIGHTLOOM_{{ format.name }}_WORDS {{ format.words }}
{% for field in format.fields %}
#define LIGHTLOOM_{{ format.name }}_{{ field.name | upper }}_BIT {{ field.bit }}
#define LIGHTLOOM_{{ format.name }}_{{ field.name | upper }}_WIDTH {{ field.width }}
{% if field.count > 1 %}
#define LIGHTLOOM_{{ format.name }}_{{ field.name | upper }}_COUNT {{ field.count }}
{% endif %}
{% endfor %}
{% if format.struct %}
struct lightloom_{{ format.name | lower }} {
{% for field in format.fields %}
  {{ field.type }} {{ field.name }}{{ "[%d]" % field.count if field.count > 1 }};
{% endfor %}
};
_Static_assert(sizeof(struct lightloom_{{ format.name | lower }}) == {{ format.width // 8 }}, "{{ format.name }}: size");
{% for field in format.fields %}
_Static_assert(offsetof(struct lightloom_{{ format.name | lower }}, {{ field.name }}) == {{ field.bit // 8 }}, "{{ format.name }}: {{ field.name }}");
{% endfor %}
{% endif %}
{% endfor %}

#endif
