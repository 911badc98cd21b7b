#include "control_tool.h"
pb_status control_plot(const control_design *design, const control_judgement *j, const char *dir,
                       pb_error *err) {
  (void)design;
  (void)j;
  (void)dir;
  (void)err;
  return PB_OK;
}
