// Allocations that fail. The linker routes those of the program through faults.c (pb_test's
// FAULTS); those of libraries that take allocators of their own come by hooks to the same
// functions.
#ifndef PB_TESTS_FAULTS_H
#define PB_TESTS_FAULTS_H

#include <stdbool.h>
#include <stddef.h>

extern long allocations;        // since it was last set to 0
extern long failing;            // the number of the allocation that fails; 0: none
extern bool only_growth_fails;  // giving memory back neither fails nor counts

void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *p, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);

#endif
