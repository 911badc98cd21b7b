// The electrical boundary of a sensor stack as a key of the plant file: against the closed form of
// the 2-DoF actuator with a complex stiffness, its limits, elements, and the state carried over
// when the boundary is switched.
#include <complex.h>

#include "assembly/system.h"
#include "base/json.h"
#include "control/poles.h"
#include "model/transfer.h"
#include "plant/boundary.h"
#include "plant/plant.h"
#include "support/beam.h"
#include "support/check.h"

static const double two_pi = 6.283185307179586476925286766559;

typedef struct side {
  pb_model *model;
  pb_motion_map *map;
  pb_state *state;
} side;

// The shipped bench with a merge patch.
static char *patched(const char *patch) {
  char *text = NULL;
  cJSON *file = NULL, *change = cJSON_Parse(patch);
  REQUIRE(pb_json_read(PB_CONFIG "/plants/apa300ml-bench.json", &file, NULL, &err));
  assert_non_null(change);
  cJSON *merged = pb_json_merge(file, change);
  REQUIRE(pb_json_print(merged, &text, &err));
  cJSON_Delete(file);
  cJSON_Delete(change);
  cJSON_Delete(merged);
  return text;
}

static side side_of(const char *patch) {
  side s = {0};
  char *text = patched(patch);
  REQUIRE(pb_model_parse(text, strlen(text), NULL, NULL, &s.model, &s.map, NULL, &err));
  free(text);
  assert_non_null(s.map);
  s.state = pb_state_new(s.model);
  assert_non_null(s.state);
  return s;
}

static void side_free(side *s) {
  pb_model_free(s->model);
  pb_motion_map_free(s->map);
  free(s->state);
}

#define BOUNDARY(sensor)                                                              \
  "{\"models\":{\"apa300ml\":{\"boundary\":{\"sensor\":" sensor ",\"coupling\":0.67," \
  "\"capacitance\":4.4e-6}}}}"
#define RESISTOR(ohms) BOUNDARY("{\"resistance\":" ohms "}")

// y/V_a and V_s/V_a of the bench at s, the sensor stack's stiffness k_e + c_e s + dk s τ/(1 + s τ).
// inner: kg; without it the stacks' own damping is left out.
static void closed_form(double complex s, double inner, double dk, double tau,
                        double complex h[2]) {
  const double load = 5 + 0.056, damped = inner > 0;
  const double complex part = isinf(tau) ? 1 : s * tau / (1 + s * tau);
  const double complex k1 = 0.3e6 + 18 * s, ka = 2.15e6 + damped * 0.35 * s;
  const double complex ke = 4.3e6 + damped * 0.7 * s + dk * part;
  const double complex a = load * s * s + k1 + ke, b = inner * s * s + ka + ke;
  const double complex det = a * b - ke * ke, d = ke / det, w = a / det;
  h[0] = 2.7 * d;
  h[1] = 2.7 * 0.53e6 * (d - w) * (dk > 0 ? part : 1);
}

static void compare_at(const char *patch, double inner, double dk, double tau, double highest,
                       double tolerance) {
  const double hz[] = {0.3, 5, 38, 60, 93, 96, 110, 800, 9000, 13000};
  side s = side_of(patch);
  const int va = pb_model_input(s.model, "Va"), y = pb_model_output(s.model, "y");
  const int vs = pb_model_output(s.model, "Vs");
  double complex *h = calloc(s.model->nu * s.model->ny, sizeof *h);
  for (size_t f = 0; f < sizeof hz / sizeof *hz && hz[f] <= highest; f++) {
    double complex wanted[2];
    closed_form(I * two_pi * hz[f], inner, dk, tau, wanted);
    REQUIRE(pb_model_frf(s.model, PB_CONTINUOUS, &hz[f], 1, h, &err));
    const double complex gy = h[(size_t)y * s.model->nu + (size_t)va];
    const double complex gs = h[(size_t)vs * s.model->nu + (size_t)va];
    ASSERT_NEAR(cabs(gy / wanted[0] - 1), 0, tolerance);
    ASSERT_NEAR(cabs(gs / wanted[1] - 1), 0, tolerance);
  }
  free(h);
  side_free(&s);
}

static void compare(const char *patch, double dk, double tau) {
  compare_at(patch, 0.001, dk, tau, INFINITY, 1e-8);
}

static const double k33 = 0.67;

static void open_stack_is_stiffer(void **state) {
  (void)state;
  const double dk = 4.3e6 / (1 - k33 * k33) - 4.3e6;
  compare(BOUNDARY("\"open\""), dk, INFINITY);
  compare(BOUNDARY("\"short\""), 0, INFINITY);
  compare("{}", 0, INFINITY);
}

static void a_resistor_is_a_standard_linear_solid(void **state) {
  (void)state;
  const double dk = 4.3e6 / (1 - k33 * k33) - 4.3e6, capacitance = 4.4e-6 * (1 - k33 * k33);
  compare(RESISTOR("100"), dk, 100 * capacitance);
  compare(RESISTOR("700"), dk, 700 * capacitance);
  compare(RESISTOR("1e5"), dk, 1e5 * capacitance);
}

// An inner motion without mass is condensed with the resistor's state in it, and one above
// max_frequency replaced by its static response.
static void a_resistor_on_what_is_condensed_or_truncated(void **state) {
  (void)state;
  const double dk = 4.3e6 / (1 - k33 * k33) - 4.3e6, capacitance = 4.4e-6 * (1 - k33 * k33);
  compare_at("{\"models\":{\"apa300ml\":{\"intermediate_mass\":0,\"c_a\":0,\"c_e\":0,"
             "\"boundary\":{\"sensor\":{\"resistance\":700},\"coupling\":0.67,"
             "\"capacitance\":4.4e-6}}}}",
             0, dk, 700 * capacitance, INFINITY, 1e-8);
  // Up to 110 Hz the inner mass's 15 kHz are missed by less than ω/ω_i.
  compare_at("{\"max_frequency\":2000,\"models\":{\"apa300ml\":{\"boundary\":{\"sensor\":"
             "{\"resistance\":700},\"coupling\":0.67,\"capacitance\":4.4e-6}}}}",
             0.001, dk, 700 * capacitance, 110, 110.0 / 15000);
}

static double first_resonance(const pb_model *m, double *damping) {
  double complex *pole = malloc(m->nx * sizeof *pole);
  double best = INFINITY;
  REQUIRE(pb_model_poles(m, PB_CONTINUOUS, pole, &err));
  for (size_t i = 0; i < m->nx; i++)
    if (cimag(pole[i]) > 0 && cabs(pole[i]) < best) {
      best = cabs(pole[i]);
      *damping = -creal(pole[i]) / best;
    }
  free(pole);
  return best / two_pi;
}

// Between short and open the resonance rises, and damping has a maximum near ω τ = 1.
static void a_resistor_lies_between_short_and_open_and_damps(void **state) {
  (void)state;
  const char *const patch[] = {BOUNDARY("\"short\""), RESISTOR("0.001"), RESISTOR("700"),
                               RESISTOR("1e9"), BOUNDARY("\"open\"")};
  double hz[5], damping[5];
  for (int i = 0; i < 5; i++) {
    side s = side_of(patch[i]);
    hz[i] = first_resonance(s.model, &damping[i]);
    assert_int_equal(s.model->nx, i == 0 || i == 4 ? 4 : 5);
    side_free(&s);
  }
  ASSERT_RELATIVE(hz[1], hz[0], 1e-6);
  ASSERT_RELATIVE(hz[3], hz[4], 1e-6);
  ASSERT_NEAR(damping[1], damping[0], 1e-4 * damping[0] + 1e-5);
  ASSERT_NEAR(damping[3], damping[4], 1e-5);
  assert_true(hz[2] > hz[1] && hz[3] > hz[2]);
  assert_true(damping[2] > 5 * damping[0]);
}

// ---- elements -----------------------------------------------------------------------------------

enum { PARTS = 4, FRAMES = PARTS + 1, SIZE = 6 * FRAMES };
static const beam column = {
    .length = 0.08, .ea = 4.7e6, .ei = 40, .gj = 30, .mass = 0.1, .polar_inertia = 2e-6};

static void stiffness_between_frames(void **state) {
  (void)state;
  static double k[SIZE * SIZE], m[SIZE * SIZE], position[3 * FRAMES];
  const double z[3] = {0, 0, 1};
  pb_element *e = NULL;
  beam_chain(&column, PARTS, k, m, position);
  REQUIRE(pb_element_new("column", FRAMES, SIZE, position, k, m, NULL, &e, &err));
  double stiffness;
  REQUIRE(pb_element_stack_stiffness(e, (size_t[]){1, 2}, z, &stiffness, &err));
  ASSERT_RELATIVE(stiffness, column.ea / column.length * PARTS, 1e-10);
  // With a frame on the way: two parts in series.
  REQUIRE(pb_element_stack_stiffness(e, (size_t[]){1, 3}, z, &stiffness, &err));
  ASSERT_RELATIVE(stiffness, column.ea / column.length * PARTS / 2, 1e-10);
  pb_error refusal = {0};
  position[3 * 2] = 0.01;  // no longer on the line: it is held, and nothing is between the others
  pb_element_free(e);
  REQUIRE(pb_element_new("column", FRAMES, SIZE, position, k, m, NULL, &e, &err));
  assert_int_equal(pb_element_stack_stiffness(e, (size_t[]){1, 3}, z, &stiffness, &refusal),
                   PB_ERR_ELEMENT);
  assert_non_null(strstr(refusal.message, "between frames 2 and 4"));
  pb_element_free(e);
}

static const char element_plant[] =
    "{\"schema\":\"plantbus.plant/1\",\"name\":\"column\",\"components\":{\"column\":{"
    "\"type\":\"super_element\",\"file\":\"%s\",\"stacks\":{\"sensor\":{\"frames\":[\"2\",\"3\"],"
    "\"axis\":[0,0,1]}},\"g_s\":1e6,\"modal_damping\":0.01%s}},"
    "\"connections\":{\"base\":{\"from\":\"ground\",\"to\":\"column.1\",\"joint\":"
    "{\"type\":\"weld\"}}},"
    "\"inputs\":[{\"name\":\"F\",\"type\":\"force\",\"frame\":\"column.5\",\"direction\":[0,0,1]}],"
    "\"outputs\":[{\"name\":\"y\",\"type\":\"displacement\",\"frame\":\"column.5\",\"direction\":"
    "[0,0,1]},{\"name\":\"Vs\",\"type\":\"sensor_voltage\",\"component\":\"column\"}]}";

static pb_model *element_model(const char *file, const char *boundary) {
  char text[2048];
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  pb_model *model = NULL;
  snprintf(text, sizeof text, element_plant, file, boundary);
  REQUIRE(pb_plant_parse(text, strlen(text), NULL, NULL, &plant, &err));
  REQUIRE(pb_system_assemble(plant, NULL, &system, &err));
  REQUIRE(pb_model_compile(system, NULL, &model, &err));
  pb_system_free(system);
  pb_plant_free(plant);
  return model;
}

// A bar in series: the stretch of one of four parts falls by 1 − k_33² when its stack is opened.
static void an_elements_stack_is_stiffened(void **state) {
  (void)state;
  static double k[SIZE * SIZE], m[SIZE * SIZE], position[3 * FRAMES];
  char file[64];
  double gain[2];
  snprintf(file, sizeof file, "/tmp/pb-boundary-%d.mat", (int)getpid());
  beam_chain(&column, PARTS, k, m, position);
  assert_int_equal(beam_write(file, FRAMES, SIZE, k, m, position), 0);
  const double part = column.length / PARTS / column.ea, left = 1 - k33 * k33;
  static const struct {
    const char *key;
    double factor, voltage;
  } cases[] = {
      {"", 1, 1},
      {",\"boundary\":{\"sensor\":\"open\",\"coupling\":0.67}", 1 - 0.67 * 0.67, 1},
      {",\"boundary\":{\"sensor\":{\"resistance\":50},\"coupling\":0.67,\"capacitance\":4.4e-6}", 1,
       0},  // statically all charge has flowed off
      {",\"boundary\":{\"sensor\":\"open\",\"coupling\":0.67,\"stiffness\":117.5e6}", 0, 1},
  };
  for (int i = 0; i < 4; i++) {
    pb_model *model = element_model(file, cases[i].key);
    // A stack of half the stiffness is stiffened by half of that: k + ½ k (1/left − 1).
    const double factor = i == 3 ? 1 / (1 + 0.5 * (1 / left - 1)) : cases[i].factor;
    REQUIRE(pb_model_dc(model, gain, &err));
    ASSERT_RELATIVE(gain[0], (3 + factor) * part, 1e-6);
    ASSERT_NEAR(gain[1], 1e6 * factor * part * cases[i].voltage, 1e-6 * 1e6 * part);
    pb_model_free(model);
  }
  unlink(file);
}

// ---- refusals -----------------------------------------------------------------------------------

static void what_is_wrong_is_refused(void **state) {
  (void)state;
  static const struct {
    const char *boundary, *where;
  } cases[] = {
      {"{\"sensor\":\"loose\"}", "/models/apa300ml/boundary/sensor"},
      {"{\"coupling\":0.5}", "/models/apa300ml/boundary/sensor"},
      {"{\"sensor\":\"open\"}", "/models/apa300ml/boundary/coupling"},
      {"{\"sensor\":\"open\",\"coupling\":1}", "/models/apa300ml/boundary/coupling"},
      {"{\"sensor\":\"open\",\"coupling\":-0.2}", "/models/apa300ml/boundary/coupling"},
      {"{\"sensor\":{\"resistance\":0},\"coupling\":0.5,\"capacitance\":1e-6}",
       "/models/apa300ml/boundary/sensor/resistance"},
      {"{\"sensor\":{\"resistance\":9},\"coupling\":0.5}", "/models/apa300ml/boundary/capacitance"},
      {"{\"sensor\":{\"ohms\":9},\"coupling\":0.5}", "/models/apa300ml/boundary/sensor/ohms"},
      {"{\"sensor\":\"open\",\"coupling\":0.5,\"stiffness\":1e6}",
       "/models/apa300ml/boundary/stiffness"},
      {"\"open\"", "/models/apa300ml/boundary"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char patch[256];
    snprintf(patch, sizeof patch, "{\"models\":{\"apa300ml\":{\"boundary\":%s}}}",
             cases[i].boundary);
    char *text = patched(patch);
    pb_plant *plant = NULL;
    pb_error err = {0};
    if (pb_plant_parse(text, strlen(text), NULL, NULL, &plant, &err) != PB_ERR_SCHEMA)
      fail_msg("%s: not refused", cases[i].boundary);
    if (strcmp(err.where, cases[i].where))
      fail_msg("%s: at %s, not %s", cases[i].boundary, err.where, cases[i].where);
    assert_null(plant);
    free(text);
  }
}

// ---- switching ----------------------------------------------------------------------------------

static pb_transfer_report carry(side *from, side *to) {
  pb_transfer *t = NULL;
  pb_transfer_report report;
  REQUIRE(pb_transfer_new(from->model, from->map, to->model, to->map, NULL, &t, &err));
  pb_transfer_apply(t, from->state, to->state);
  REQUIRE(pb_transfer_examine(t, &report, &err));
  pb_transfer_free(t);
  return report;
}

static void shake(side *s, int steps) {
  for (int k = 0; k < steps; k++) {
    const double u[2] = {10 * sin(0.05 * k), 3};
    pb_step_advance(s->model, s->state, u);
  }
}

static double output(const side *s, const char *name) {
  double y[2];
  pb_step_output(s->model, s->state, y);
  return y[pb_model_output(s->model, name)];
}

#define LOAD(kg) ",\"components\":{\"mass\":{\"mass\":" kg "}}}"
static const char resistor_load[] =
    "{\"models\":{\"apa300ml\":{\"boundary\":{\"sensor\":{\"resistance\":700},\"coupling\":0.67,"
    "\"capacitance\":4.4e-6}}}" LOAD("7");

// Another load: what has relaxed in the stack stays relaxed; nothing jumps, no energy appears.
static void another_load_leaves_the_charge(void **state) {
  (void)state;
  side a = side_of(RESISTOR("700")), b = side_of(resistor_load), same = side_of(RESISTOR("700"));
  shake(&a, 345);
  pb_transfer_report r = carry(&a, &same);
  for (size_t i = 0; i < a.model->nx + a.model->nu; i++)
    ASSERT_NEAR(same.state->data[i], a.state->data[i], 1e-9);
  assert_true(r.energy_before > 0);
  ASSERT_RELATIVE(r.energy_after, r.energy_before, 1e-9);
  carry(&a, &b);
  assert_true(fabs(output(&a, "Vs")) > 1e-2);
  ASSERT_RELATIVE(output(&b, "Vs"), output(&a, "Vs"), 1e-6);
  ASSERT_RELATIVE(output(&b, "y"), output(&a, "y"), 1e-6);
  side_free(&a);
  side_free(&b);
  side_free(&same);
}

// Opened, a stack starts without charge; a resistor on an open stack starts with its voltage, on a
// short-circuited one with none. The platform does not jump: only the light inner mass would.
static void switching_keeps_the_motion(void **state) {
  (void)state;
  const char *const patch[] = {BOUNDARY("\"short\""), BOUNDARY("\"open\""), RESISTOR("700")};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      side a = side_of(patch[i]), b = side_of(patch[j]);
      shake(&a, 345);
      carry(&a, &b);
      assert_true(fabs(output(&a, "y")) > 1e-7);
      ASSERT_RELATIVE(output(&b, "y"), output(&a, "y"), 1e-6);
      if (i == 1 && j == 2) ASSERT_RELATIVE(output(&b, "Vs"), output(&a, "Vs"), 1e-6);
      if (i == 0 && j == 2) ASSERT_NEAR(output(&b, "Vs"), 0, 1e-6 * fabs(output(&a, "Vs")));
      side_free(&a);
      side_free(&b);
    }
}

// No energy comes out of a resistor: without input, the stored energy never grows.
static void a_resistor_only_takes(void **state) {
  (void)state;
  side s = side_of(RESISTOR("700"));
  const double none[2] = {0, 0};
  shake(&s, 345);
  pb_step_advance(s.model, s.state, none);
  double last = INFINITY;
  for (int k = 0; k < 500; k++) {
    double energy;
    REQUIRE(pb_motion_map_energy(s.map, s.state->data, none, &energy, &err));
    assert_true(energy <= last * (1 + 1e-12));
    last = energy;
    pb_step_advance(s.model, s.state, none);
  }
  side_free(&s);
}

// One state more for each of the six struts that have the model.
static void a_hexapods_struts_have_resistors(void **state) {
  (void)state;
  char *text = NULL;
  cJSON *file = NULL;
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  pb_model *model = NULL;
  REQUIRE(pb_json_read(PB_CONFIG "/plants/nano-hexapod.json", &file, NULL, &err));
  cJSON *models = cJSON_GetObjectItem(file, "models");
  for (cJSON *m = models->child; m; m = m->next) {
    const cJSON *type = pb_json_member(m, "type");
    if (strcmp(type->valuestring, "apa_2dof")) continue;
    cJSON_AddItemToObject(m, "boundary",
                          cJSON_Parse("{\"sensor\":{\"resistance\":900},\"coupling\":0.6,"
                                      "\"capacitance\":4.4e-6}"));
  }
  REQUIRE(pb_json_print(file, &text, &err));
  REQUIRE(pb_plant_parse(text, strlen(text), NULL, NULL, &plant, &err));
  REQUIRE(pb_system_assemble(plant, NULL, &system, &err));
  REQUIRE(pb_model_compile(system, NULL, &model, &err));
  assert_int_equal(model->nx, 2 * model->dof + 6);
  pb_model_free(model);
  pb_system_free(system);
  pb_plant_free(plant);
  cJSON_Delete(file);
  free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(open_stack_is_stiffer),
      cmocka_unit_test(a_resistor_is_a_standard_linear_solid),
      cmocka_unit_test(a_resistor_on_what_is_condensed_or_truncated),
      cmocka_unit_test(a_resistor_lies_between_short_and_open_and_damps),
      cmocka_unit_test(stiffness_between_frames),
      cmocka_unit_test(an_elements_stack_is_stiffened),
      cmocka_unit_test(what_is_wrong_is_refused),
      cmocka_unit_test(another_load_leaves_the_charge),
      cmocka_unit_test(switching_keeps_the_motion),
      cmocka_unit_test(a_resistor_only_takes),
      cmocka_unit_test(a_hexapods_struts_have_resistors),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
