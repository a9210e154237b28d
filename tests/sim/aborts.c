/* Aborts the unit of register_bus.h with rays under way, one that waits and results that do; then traces the first ray
 * again, and prints its result.
 *
 *     aborts IMAGE BASE QUERIES COUNT SEED
 */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "lightloom_formats.h"
#include "register_bus.h"
#include "traversal_axi4_lite.h"

#define AT(reg) ((uint32_t)offsetof(traversal_axi4_lite_registers_t, reg))
#define BIT(REG, FIELD) TRAVERSAL_AXI4_LITE_REGISTERS__##REG##__##FIELD##_bm

static void check(int holds, const char *what) {
  if (!holds) {
    fprintf(stderr, "not so: %s\n", what);
    exit(1);
  }
}

static void load(uint32_t base) {
  register_write(AT(base_low), base);
  register_write(AT(control), BIT(CONTROL, LOAD));
  while (!(register_read(AT(status)) & BIT(STATUS, LOADED))) {
  }
}

/* The answer to the submission. */
static unsigned submit(const uint32_t *query) {
  unsigned k;
  for (k = 0; k < 8; k++)
    if (register_try_write(AT(operand_origin_0) + 4 * k, query[k], 0xf)) return 2;
  if (register_try_write(AT(operand_rest), lightloom_get(query, LIGHTLOOM_RAY_QUERY_ANY_HIT_BIT, 10), 0xf)) return 2;
  return register_try_write(AT(submit), 1, 1);
}

int main(int argc, char **argv) {
  size_t count = argc == 6 ? strtoull(argv[4], NULL, 10) : 0, words = count * LIGHTLOOM_RAY_QUERY_WORDS, k = 0;
  uint32_t *queries = calloc(words + 1, 4), base, status, value;
  FILE *file = count ? fopen(argv[3], "rb") : NULL;
  check(file && queries && fread(queries, 4, words, file) == words, "the queries can be read");
  fclose(file);
  base = (uint32_t)strtoul(argv[2], NULL, 10);
  system_start(argv[1], strtoull(argv[5], NULL, 10));
  check(register_read(AT(events)) == 0 && !interrupt(), "nothing has happened before the first load");
  load(base);

  /* No result is taken: at last a ray waits, and its registers are held. */
  while (k < count && submit(queries + k * LIGHTLOOM_RAY_QUERY_WORDS) == 0) k++;
  status = register_read(AT(status));
  check(k > 4 && k < count, "rays wait when nobody takes results");
  check(status & BIT(STATUS, OPERANDS_WAIT), "operands_wait says so");
  check(status & BIT(STATUS, RESULT_WAITS), "a result waits");

  register_write(AT(events), 0xffffffffu);
  register_write(AT(event_enables), BIT(EVENT_ENABLES, ABORT_OVER_ENABLE));
  register_write(AT(control), BIT(CONTROL, ABORT));
  while (!interrupt()) {
  }
  check(register_read(AT(status)) == 0, "nothing is loaded, waits or goes on behind an abort");
  check(register_read(AT(events)) == BIT(EVENTS, ABORT_OVER), "no other event than its end");
  register_write(AT(events), BIT(EVENTS, ABORT_OVER));
  check(!interrupt(), "the event is cleared");
  value = 1;
  check(register_try_read(sizeof(traversal_axi4_lite_registers_t), &value) == 2 && value == 0, "beyond is SLVERR");
  check(register_try_write(AT(status), 0, 0xf) == 2, "what is only read is not written");

  load(base);
  check(submit(queries) == 0, "a ray is taken again");
  while (!(register_read(AT(status)) & BIT(STATUS, RESULT_WAITS))) {
  }
  printf("%08" PRIx32 " %08" PRIx32 "\n", register_read(AT(result_primitive)), register_read(AT(result_t)));
  register_write(AT(control), BIT(CONTROL, RELEASE));
  check(!(register_read(AT(status)) & BIT(STATUS, RESULT_WAITS)), "one ray has one result");
  check(register_read(AT(count_rays)) == 1, "the counters count from the abort on");
  system_end();
  free(queries);
  return 0;
}
