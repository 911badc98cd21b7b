// Who is attached, as a table that fits the width: the names give way first, then columns are left
// out.
#include <inttypes.h>
#include <stdio.h>

#include "monitor.h"

enum { COLUMNS = 9, CELL = 72 };

// The order of the columns, their widths with the blank behind them, how narrow they may become,
// and which is left out first (0: never).
static const struct {
  const char *head;
  size_t width, least;
  int leave;
} column[COLUMNS] = {
    {"client", 24, 12, 0}, {"channel", 14, 8, 7}, {"prio", 5, 5, 1},
    {"acts", 5, 5, 4},     {"bar.", 5, 5, 2},     {"commands", 11, 11, 6},
    {"late", 7, 7, 8},     {"age", 7, 7, 5},      {"oldest", 7, 7, 3},
};

static size_t total(const size_t width[COLUMNS]) {
  size_t sum = 0;
  for (size_t c = 0; c < COLUMNS; c++) sum += width[c];
  return sum;
}

static void narrow(size_t width[COLUMNS], size_t c, size_t available) {
  const size_t sum = total(width), room = width[c] - column[c].least;
  if (sum > available) width[c] -= sum - available < room ? sum - available : room;
}

// Widths of the columns in this many characters (0: unlimited); 0 where a column is left out.
static void widths(size_t available, size_t width[COLUMNS]) {
  for (size_t c = 0; c < COLUMNS; c++) width[c] = column[c].width;
  if (available == 0) return;
  if (total(width) < available) width[0] += available - total(width);
  if (width[0] > CELL - 8) width[0] = CELL - 8;
  narrow(width, 1, available);
  narrow(width, 0, available);
  for (int leave = 1; leave <= COLUMNS && total(width) > available; leave++)
    for (size_t c = 0; c < COLUMNS; c++)
      if (column[c].leave == leave) width[c] = 0;
}

static void cells(const plantbus_Attached *a, char cell[COLUMNS][CELL]) {
  snprintf(cell[0], CELL, "%s%s", a->waited ? "*" : "", a->client_name);
  snprintf(cell[1], CELL, "%s", a->channel);
  snprintf(cell[2], CELL, "%d", a->priority);
  snprintf(cell[3], CELL, "%s", a->acting ? "yes" : "no");
  snprintf(cell[4], CELL, "%s", a->barrier ? "yes" : "no");
  snprintf(cell[5], CELL, "%" PRIu64, a->commands);
  snprintf(cell[6], CELL, "%" PRIu64, a->late);
  snprintf(cell[7], CELL, "%" PRIu64, a->age);
  snprintf(cell[8], CELL, "%" PRIu64, a->age_max);
}

static void row(screen *s, const size_t width[COLUMNS], char cell[COLUMNS][CELL],
                const screen_style style[COLUMNS]) {
  size_t at = 0;
  for (size_t c = 0; c < COLUMNS; c++) {
    if (width[c] == 0) continue;
    if (at > 0) screen_to(s, at);
    screen_put(s, style[c], "%.*s", (int)width[c] - 1, cell[c]);
    at += width[c];
  }
  screen_line(s);
}

static void head(screen *s, const size_t width[COLUMNS]) {
  char cell[COLUMNS][CELL];
  screen_style style[COLUMNS];
  for (size_t c = 0; c < COLUMNS; c++) {
    snprintf(cell[c], CELL, "%s", column[c].head);
    style[c] = SCREEN_DIM;
  }
  row(s, width, cell, style);
}

// Who keeps a plant that stands still waiting.
static void waits(const plantbus_PlantStatus *p, screen *s) {
  bool any = false;
  for (uint32_t i = 0; i < p->attached._length; i++) {
    if (!p->attached._buffer[i].waited) continue;
    screen_flow(s, SCREEN_ALARM, 2, "%s%s", any ? ", " : "stands still, waits for ",
                p->attached._buffer[i].client_name);
    any = true;
  }
  if (any) screen_line(s);
}

void monitor_view_members(const plantbus_PlantStatus *p, screen *s) {
  const bool still = p->mode == plantbus_LOCKSTEP && p->steps_per_second == 0.0;
  size_t width[COLUMNS];
  widths(s->width, width);
  screen_line(s);
  if (p->attached._length == 0) {
    screen_put(s, SCREEN_DIM, "nobody is attached");
    screen_line(s);
    return;
  }
  head(s, width);
  for (uint32_t i = 0; i < p->attached._length; i++) {
    const plantbus_Attached *a = &p->attached._buffer[i];
    char cell[COLUMNS][CELL];
    screen_style style[COLUMNS] = {SCREEN_PLAIN};
    // In lockstep a plant that runs waits for someone at any moment.
    style[0] = a->waited && still ? SCREEN_ALARM : a->late ? SCREEN_WARN : SCREEN_PLAIN;
    style[6] = a->late ? SCREEN_WARN : SCREEN_PLAIN;
    cells(a, cell);
    row(s, width, cell, style);
  }
  if (still) waits(p, s);
}
