// The terminal as a canvas: see terminal.h.
#include "terminal.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

static struct termios before;
static bool changed, keys;

void terminal_end(void) {
  if (!changed) return;
  changed = false;
  fputs("\033[?25h\033[?1049l", stdout);
  fflush(stdout);
  if (keys) tcsetattr(STDIN_FILENO, TCSANOW, &before);
}

void terminal_begin(void) {
  static bool registered;
  if (!registered) atexit(terminal_end);
  registered = true;
  keys = tcgetattr(STDIN_FILENO, &before) == 0;
  if (keys) {
    struct termios raw = before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    raw.c_cc[VSUSP] = _POSIX_VDISABLE;  // suspended, it would leave its screen behind
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  }
  changed = true;
  fputs("\033[?1049h\033[?25l\033[2J", stdout);
}

void terminal_size(size_t *width, size_t *height) {
  struct winsize size;
  const bool told = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col && size.ws_row;
  *width = told ? size.ws_col : 80;
  *height = told ? size.ws_row : 24;
}

bool terminal_wait(double seconds) {
  struct pollfd p = {.fd = keys ? STDIN_FILENO : -1, .events = POLLIN};
  const int ready = poll(&p, 1, (int)(seconds * 1e3) + 1);
  if (ready <= 0) return false;
  char c[32];
  const ssize_t n = read(STDIN_FILENO, c, sizeof c);
  for (ssize_t i = 0; i < n; i++)
    if (c[i] == 'q' || c[i] == 'Q') return true;
  return n <= 0;
}
