/* Traces rays by the traversal unit's registers alone: a driver as small as it can be.
 *
 *     trace IMAGE BASE QUERIES RESULTS COUNT SEED
 *
 * IMAGE is a memory image with a tree at byte BASE, QUERIES has COUNT rays as LIGHTLOOM_RAY_QUERY_WORDS words each, RESULTS
 * gets as many results of LIGHTLOOM_RAY_RESULT_WORDS words in the order of the rays. Several rays are under way at a time;
 * their tags say which results are whose. SEED is that of the bus's stalls.
 *
 * Offsets and fields are those of the header that PeakRDL makes (registers/ of a package); register_bus.h stands for what
 * reads and writes a word on the system at hand.
 */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "lightloom_formats.h"
#include "register_bus.h"
#include "traversal_axi4_lite.h"

#define AT(reg) ((uint32_t)offsetof(traversal_axi4_lite_registers_t, reg))
#define MASK(REG, FIELD) TRAVERSAL_AXI4_LITE_REGISTERS__##REG##__##FIELD##_bm
#define SHIFT(REG, FIELD) TRAVERSAL_AXI4_LITE_REGISTERS__##REG##__##FIELD##_bp
#define GET(word, REG, FIELD) (((word) & MASK(REG, FIELD)) >> SHIFT(REG, FIELD))
#define PUT(value, REG, FIELD) (((uint32_t)(value) << SHIFT(REG, FIELD)) & MASK(REG, FIELD))

#define QUERY(words, FIELD, k) \
  lightloom_get(words, LIGHTLOOM_RAY_QUERY_##FIELD##_BIT + (k) * LIGHTLOOM_RAY_QUERY_##FIELD##_WIDTH, \
                LIGHTLOOM_RAY_QUERY_##FIELD##_WIDTH)
#define RESULT(words, FIELD, value) \
  lightloom_set(words, LIGHTLOOM_RAY_RESULT_##FIELD##_BIT, LIGHTLOOM_RAY_RESULT_##FIELD##_WIDTH, value)

enum { UNDER_WAY = 8 }; /* rays at a time, each with a tag of its own */

static void *words_of(const char *path, size_t count) {
  FILE *file = fopen(path, "rb");
  void *words = calloc(count + 1, 4);
  if (!file || !words || fread(words, 4, count, file) != count) {
    perror(path);
    exit(2);
  }
  fclose(file);
  return words;
}

/* The tree's address: two registers, or one where the memory's addresses have 32 bits. */
static void set_base(uint64_t base) {
#ifdef TRAVERSAL_AXI4_LITE_REGISTERS__BASE_HIGH__BASE_HIGH_bm
  register_write(AT(base_low), (uint32_t)base);
  register_write(AT(base_high), (uint32_t)(base >> 32));
#else
  if (base >> 32) {
    fprintf(stderr, "no address of the memory: 0x%" PRIx64 "\n", base);
    exit(1);
  }
  register_write(AT(base), (uint32_t)base);
#endif
}

/* Has the tree loaded, and waits for the interrupt that says so. Returns why it was refused, or 0. */
static unsigned load(uint64_t base) {
  uint32_t status;
  set_base(base);
  register_write(AT(event_enables), MASK(EVENT_ENABLES, LOAD_OVER_ENABLE));
  register_write(AT(control), MASK(CONTROL, LOAD));
  while (!interrupt()) {
  }
  register_write(AT(events), MASK(EVENTS, LOAD_OVER));
  status = register_read(AT(status));
  if (interrupt() || GET(status, STATUS, LOADED) == (GET(status, STATUS, LOAD_ERROR) != 0)) {
    fprintf(stderr, "status %08" PRIx32 " behind a load\n", status);
    exit(1);
  }
  return GET(status, STATUS, LOAD_ERROR);
}

static void submit(const uint32_t *query, uint32_t tag) {
  register_write(AT(operand_origin_0), QUERY(query, ORIGIN, 0));
  register_write(AT(operand_origin_1), QUERY(query, ORIGIN, 1));
  register_write(AT(operand_origin_2), QUERY(query, ORIGIN, 2));
  register_write(AT(operand_direction_0), QUERY(query, DIRECTION, 0));
  register_write(AT(operand_direction_1), QUERY(query, DIRECTION, 1));
  register_write(AT(operand_direction_2), QUERY(query, DIRECTION, 2));
  register_write(AT(operand_t_min), QUERY(query, T_MIN, 0));
  register_write(AT(operand_t_max), QUERY(query, T_MAX, 0));
  register_write(AT(operand_rest), PUT(QUERY(query, ANY_HIT, 0), OPERAND_REST, OPERAND_ANY_HIT) |
                                       PUT(QUERY(query, CULL, 0), OPERAND_REST, OPERAND_CULL) |
                                       PUT(QUERY(query, MASK, 0), OPERAND_REST, OPERAND_MASK));
  register_write(AT(operand_tag), tag);
  register_write(AT(submit), MASK(SUBMIT, SUBMIT));
}

/* Takes the result that waits; returns its tag. */
static uint32_t take(uint32_t *result) {
  uint32_t rest = register_read(AT(result_rest)), tag = register_read(AT(result_tag));
  RESULT(result, PRIMITIVE, register_read(AT(result_primitive)));
  RESULT(result, T, register_read(AT(result_t)));
  RESULT(result, U, register_read(AT(result_u)));
  RESULT(result, V, register_read(AT(result_v)));
  RESULT(result, FRONT, GET(rest, RESULT_REST, RESULT_FRONT));
  RESULT(result, INVALID, GET(rest, RESULT_REST, RESULT_INVALID));
  RESULT(result, ERROR, GET(rest, RESULT_REST, RESULT_ERROR));
  RESULT(result, BLOCK, register_read(AT(result_block)));
  register_write(AT(control), MASK(CONTROL, RELEASE));
  return tag;
}

/* A counter: its lower word first, which keeps the upper one. */
static uint64_t counted(uint32_t offset) {
  uint64_t low = register_read(offset);
  return low | (uint64_t)register_read(offset + 4) << 32;
}

static void trace(const uint32_t *queries, uint32_t *results, size_t count) {
  size_t sent = 0, received = 0, ray[UNDER_WAY];
  int busy[UNDER_WAY] = {0};
  while (received < count) {
    uint32_t status = register_read(AT(status)), tag;
    if (GET(status, STATUS, RESULT_WAITS)) {
      uint32_t result[LIGHTLOOM_RAY_RESULT_WORDS] = {0};
      size_t k;
      tag = take(result);
      if (tag >= UNDER_WAY || !busy[tag]) {
        fprintf(stderr, "a result with tag %" PRIu32 ", which no ray has\n", tag);
        exit(1);
      }
      for (k = 0; k < LIGHTLOOM_RAY_RESULT_WORDS; k++) results[ray[tag] * LIGHTLOOM_RAY_RESULT_WORDS + k] = result[k];
      busy[tag] = 0;
      received++;
    }
    for (tag = 0; tag < UNDER_WAY && busy[tag]; tag++) {
    }
    if (sent < count && tag < UNDER_WAY && !GET(status, STATUS, OPERANDS_WAIT)) {
      submit(queries + sent * LIGHTLOOM_RAY_QUERY_WORDS, tag);
      busy[tag] = 1;
      ray[tag] = sent++;
    }
  }
}

int main(int argc, char **argv) {
  size_t count;
  uint32_t *queries, *results;
  FILE *file;
  unsigned error;
  uint64_t rays, cycles;
  if (argc != 7) {
    fprintf(stderr, "trace IMAGE BASE QUERIES RESULTS COUNT SEED\n");
    return 2;
  }
  count = strtoull(argv[5], NULL, 10);
  queries = words_of(argv[3], count * LIGHTLOOM_RAY_QUERY_WORDS);
  results = calloc(count + 1, 4 * LIGHTLOOM_RAY_RESULT_WORDS);
  system_start(argv[1], strtoull(argv[6], NULL, 10));
  error = load(strtoull(argv[2], NULL, 10));
  if (error || !results) {
    fprintf(stderr, "no tree: load_error %u\n", error);
    return 1;
  }
  register_write(AT(control), MASK(CONTROL, COUNT_CLEAR));
  trace(queries, results, count);
  rays = counted(AT(count_rays));
  printf("rays %" PRIu64 "\nbeats %" PRIu64 "\n", rays, counted(AT(count_beats)));
  cycles = system_end();
  printf("cycles %" PRIu64 "\n", cycles);
  file = fopen(argv[4], "wb");
  if (!file || fwrite(results, 4 * LIGHTLOOM_RAY_RESULT_WORDS, count, file) != count || fclose(file)) {
    perror(argv[4]);
    return 2;
  }
  free(queries);
  free(results);
  return rays == count ? 0 : 1;
}
