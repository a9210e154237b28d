/* The simulated system of sim/register_bus.cpp, as a program in C sees it: a unit's registers, and a memory. */

#ifndef LIGHTLOOM_REGISTER_BUS_H
#define LIGHTLOOM_REGISTER_BUS_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Makes the system, with a file at address 0 of the memory, and resets it; call it first, once. The bus stalls at random
 * by `seed`; 0: it does not. */
void system_start(const char *image, uint64_t seed);

/* A word at a byte offset. An answer other than OKAY ends the program with 1 and one line on stderr. */
uint32_t register_read(uint32_t offset);
void register_write(uint32_t offset, uint32_t value);

/* The same, with the answer: 0 is OKAY, 2 SLVERR. `strobes` has a bit a byte. */
unsigned register_try_read(uint32_t offset, uint32_t *value);
unsigned register_try_write(uint32_t offset, uint32_t value, unsigned strobes);

/* Lets a cycle pass; the interrupt. */
int interrupt(void);

/* Ends with 1 where a rule of AXI4 was broken at the memory; returns the number of cycles so far. */
uint64_t system_end(void);

#ifdef __cplusplus
}
#endif

#endif
