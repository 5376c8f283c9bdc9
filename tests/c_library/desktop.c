/* What relight.c needs on a desktop. */

#include <inttypes.h>
#include <stdio.h>

void say(const char *name, uint32_t value) { printf("%s %" PRIu32 "\n", name, value); }

uint32_t instructions(void) { return 0; }

uint32_t largest_stack(void) { return 0; }
