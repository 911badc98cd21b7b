// SIGINT and SIGTERM as a flag: see interrupt.h.
#include "interrupt.h"

#include <signal.h>

static volatile sig_atomic_t interrupted;  // written by the handler only

static void on_signal(int number) {
  (void)number;
  interrupted = 1;
}

void pb_interrupt_install(void) {
  // SA_RESETHAND: a tool that hangs on its way out can still be stopped by a second Ctrl-C.
  struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESETHAND | SA_RESTART};
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
}

bool pb_interrupted(void) {
  return interrupted != 0;
}
