// The terminal as a canvas: another screen, keys as they come, and everything as it was at the end.
#ifndef PB_CLIENTS_MONITOR_TERMINAL_H
#define PB_CLIENTS_MONITOR_TERMINAL_H

#include <stdbool.h>
#include <stddef.h>

// Changes to the alternate screen and hides the cursor; restored when the process exits, whichever
// way it calls exit. SIGINT and SIGTERM are the caller's (interrupt.h).
void terminal_begin(void);
void terminal_end(void);

// Size in characters; 80 × 24 when it does not tell.
void terminal_size(size_t *width, size_t *height);

// Waits up to `seconds` for a key, or for a signal; true when q was pressed or the input ended.
bool terminal_wait(double seconds);

#endif
