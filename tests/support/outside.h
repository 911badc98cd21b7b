// Elements as other programs write them: layouts set down here by hand, apart from the readers.
#ifndef PB_TESTS_OUTSIDE_H
#define PB_TESTS_OUTSIDE_H

#include <stddef.h>

enum { OUTSIDE_FRAMES = 3, OUTSIDE_MODES = 2, OUTSIDE_SIZE = 6 * OUTSIDE_FRAMES + OUTSIDE_MODES };

// Three frames of a steel beam, nodes 101, 205 and 300, and two coordinates that stand for modes.
typedef struct outside_element {
  double k[OUTSIDE_SIZE * OUTSIDE_SIZE], m[OUTSIDE_SIZE * OUTSIDE_SIZE];
  double position[3 * OUTSIDE_FRAMES];
  long node[OUTSIDE_FRAMES];
} outside_element;

// One way to write one matrix; 'which' is K or M.
typedef struct outside_form {
  const char *name;
  void (*write)(const char *path, char which, const double *x);
  double digits;     // relative error that the printed digits allow, of √(x_ii x_jj)
  int labelled;      // rows have nodes and directions
  int counted;       // a file cut anywhere is refused
  const char *kind;  // pb_matrix_format_name
} outside_form;

extern const outside_form outside_forms[];  // ends with name NULL

void outside_make(outside_element *e);
double outside_entry(const double *x, size_t i, size_t j);

// Both matrices in one file: "print", "dmig-large", "abaqus-user-element". 0, or −1: no such form.
int outside_write_both(const char *form, const char *path, const outside_element *e);

// Ansys listings: pages of `page` rows with banners; nodes that are no masters among them;
// angles: the header with THXY THYZ THZX. masters: the MLIST behind (or, < 0, in front of) it.
void outside_write_listing(const char *path, const outside_element *e, int page, int angles,
                           int masters);

#endif
