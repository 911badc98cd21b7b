// Constants of a piezoelectric stack: see actuator_piezo.h.
#include "study/actuator_piezo.h"

#include <math.h>

pb_piezo pb_piezo_default(void) {
  return (pb_piezo){.d33 = 680e-12,
                    .eps_t = 4.0e-8,
                    .s_d = 21e-12,
                    .c_e = 48e9,
                    .length = 20e-3,
                    .area = 1e-4,
                    .layers = 160};
}

double pb_piezo_stiffness(const pb_piezo *p) {
  return p->c_e * p->area / p->length;
}

double pb_piezo_force_constant(const pb_piezo *p) {
  return p->d33 * p->layers * pb_piezo_stiffness(p);
}

double pb_piezo_sensor_constant(const pb_piezo *p) {
  return p->d33 / (p->eps_t * p->s_d * p->layers);
}

double pb_piezo_capacitance(const pb_piezo *p) {
  return p->layers * p->layers * p->eps_t * p->area / p->length;
}

double pb_piezo_coupling(const pb_piezo *p) {
  const double d2 = p->d33 * p->d33;
  return sqrt(d2 / (d2 + p->s_d * p->eps_t));
}
