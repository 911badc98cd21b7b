// See bus_log.h.
#include "bus_log.h"

#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "dds/dds.h"
#include "dds/ddsrt/log.h"

enum { PB_LOG_LINES_PER_SECOND = 20, PB_LOG_LINE = 1024 };

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static time_t second;         // under lock: the second being counted
static unsigned lines, lost;  // under lock

// A pipe with room for PIPE_BUF bytes polls as writable, and shorter writes then do not block.
static bool stderr_ready(void) {
  struct pollfd fd = {.fd = STDERR_FILENO, .events = POLLOUT};
  return poll(&fd, 1, 0) == 1 && (fd.revents & POLLOUT);
}

static void line_write(const char *text, size_t length) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  pthread_mutex_lock(&lock);
  if (now.tv_sec != second) second = now.tv_sec, lines = 0;
  if (++lines > PB_LOG_LINES_PER_SECOND || !stderr_ready()) {
    lost++;
  } else {
    char head[64];
    if (lost > 0) {
      const int n = snprintf(head, sizeof head, "(%u lines were left out)\n", lost);
      if (write(STDERR_FILENO, head, (size_t)n) == n) lost = 0;
    }
    if (write(STDERR_FILENO, text, length) < 0) lost++;
  }
  pthread_mutex_unlock(&lock);
}

void pb_log(const char *format, ...) {
  char line[PB_LOG_LINE];
  va_list args;
  va_start(args, format);
  int length = vsnprintf(line, sizeof line - 1, format, args);
  va_end(args);
  if (length < 0) return;
  if (length > (int)sizeof line - 2) length = (int)sizeof line - 2;
  line[length] = '\n';
  line_write(line, (size_t)length + 1);
}

static void dds_line(void *context, const dds_log_data_t *data) {
  (void)context;
  const size_t length = strnlen(data->message, data->size);
  int shown = length > PB_LOG_LINE - 64 ? PB_LOG_LINE - 64 : (int)length;
  while (shown > 0 && data->message[shown - 1] == '\n') shown--;
  pb_log("dds: %.*s", shown, data->message);
}

void pb_log_install_dds(void) {
  dds_set_log_sink(dds_line, NULL);
  dds_set_trace_sink(dds_line, NULL);
}
