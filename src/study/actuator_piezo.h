// Constants of a piezoelectric stack. [report 1.2, eq. 1.3a, 1.3b, Table 1.4]
//
//   g_a = d_33 n c^E A/L        force of the blocked stack per volt, N/V
//   g_s = d_33/(ε^T s^D n)      voltage of the open stack per elongation, V/m
//
// and, of the same stack, free: elongation n d_33 per volt; capacitance n² ε^T A/L; short-circuit
// stiffness c^E A/L; coupling k_33² = d_33²/(d_33² + s^D ε^T), from k_33² = d_33²/(s^E ε^T) and
// s^D = (1 − k_33²) s^E.
#ifndef PB_STUDY_ACTUATOR_PIEZO_H
#define PB_STUDY_ACTUATOR_PIEZO_H

typedef struct pb_piezo {
  double d33;     // m/V
  double eps_t;   // F/m, at constant stress
  double s_d;     // m²/N, at constant electric displacement
  double c_e;     // N/m², at constant electric field
  double length;  // m, of one stack
  double area;    // m²
  double layers;  // n
} pb_piezo;

pb_piezo pb_piezo_default(void);  // Table 1.4

double pb_piezo_force_constant(const pb_piezo *p);   // g_a, N/V
double pb_piezo_sensor_constant(const pb_piezo *p);  // g_s, V/m
double pb_piezo_stiffness(const pb_piezo *p);        // N/m
double pb_piezo_capacitance(const pb_piezo *p);      // F
double pb_piezo_coupling(const pb_piezo *p);         // k_33

#endif
