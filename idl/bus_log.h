// A log to stderr that never blocks and is rate-limited: the middleware writes a line for each bad
// packet, and a full pipe on stderr would otherwise stop whoever writes to it.
#ifndef PB_BUS_LOG_H
#define PB_BUS_LOG_H

// One line; dropped and counted when stderr cannot take it now or more than 20 lines came within a
// second. The next line that gets through tells how many were lost. [any]
void pb_log(const char *format, ...) __attribute__((format(printf, 1, 2)));

// Sends the log and trace lines of the middleware the same way. Before the first domain. [init]
void pb_log_install_dds(void);

#endif
