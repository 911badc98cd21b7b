// Velocities and accelerations: their digits at low frequencies, against the assembled equations
// solved in quadruple precision, and what truncation leaves of them.
#include "support/check.h"

#include "assembly/system.h"
#include "model/model.h"
#include "plant/plant.h"

typedef __float128 quad;

#define ELEMENT                                                                            \
  "\"models\": {\"apa\": {\"type\": \"super_element\", \"file\": "                         \
  "\"../elements/apa300ml.mat\", \"modal_damping\": 0.01, \"rayleigh\": {\"alpha\": 0, "   \
  "\"beta\": 1e-5}, \"ends\": [1, 2], \"half_height\": 0.015, \"stacks\": {\"sensor\": "   \
  "{\"frames\": [\"3\", \"4\"], \"axis\": [1, 0, 0]}, \"actuator\": {\"frames\": [\"5\", " \
  "\"7\"], \"axis\": [1, 0, 0]}}, \"g_a\": 26.1, \"g_s\": 5060000, \"polarity\": -1}}, "
#define SIGNAL(name, type, frame, x) \
  "{\"name\": \"" name "\", \"type\": \"" type "\", \"frame\": \"" frame "\", \"direction\": " x "}"
#define MOTION(n, frame, x)               \
  SIGNAL("y" n, "displacement", frame, x) \
  ", " SIGNAL("v" n, "velocity", frame, x) ", " SIGNAL("a" n, "acceleration", frame, x)
#define VOLTAGE "{\"name\": \"Va\", \"type\": \"actuator_voltage\", \"component\": \"apa\"}"

// The element with frame 1 held, seen at the other end along and across it.
#define HELD                                                                                     \
  ELEMENT                                                                                        \
  "\"components\": {\"apa\": {\"model\": \"apa\", \"position\": [0, 0, 0.015]}}, "               \
  "\"connections\": {\"base\": {\"from\": \"ground\", \"to\": \"apa.1\", \"joint\": {\"type\": " \
  "\"weld\"}}}, \"inputs\": [" VOLTAGE                                                           \
  ", " SIGNAL("F", "force", "apa.2", "[0, 0, 1]") ", " SIGNAL(                                   \
      "Fx", "force", "apa.2",                                                                    \
      "[1, 0, 0]") "], \"outputs\": [" MOTION("", "apa.2",                                       \
                                              "[0, 0, 1]") ", " MOTION("x", "apa.2",             \
                                                                       "[1, 0, 0]") "]"

// With a load on a guide without a spring along it: what a suspension of 5 kg does.
#define LOADED                                                                                    \
  ELEMENT                                                                                         \
  "\"components\": {\"apa\": {\"model\": \"apa\", \"position\": [0, 0, 0.015]}, \"mass\": "       \
  "{\"type\": \"rigid_body\", \"mass\": 5, \"inertia\": [0.01, 0.01, 0.01], \"position\": [0, "   \
  "0, 0.03]}}, \"connections\": {\"base\": {\"from\": \"ground\", \"to\": \"apa.1\", \"joint\": " \
  "{\"type\": \"weld\"}}, \"load\": {\"from\": \"apa.2\", \"to\": \"mass\", \"joint\": "          \
  "{\"type\": "                                                                                   \
  "\"weld\"}}}, \"inputs\": [" VOLTAGE                                                            \
  ", " SIGNAL("F", "force", "apa.5", "[1, 0, 0]") "], \"outputs\": [" MOTION(                     \
      "", "mass", "[0, 0, 1]") ", " MOTION("x", "apa.5", "[1, 0, 0]") "]"

typedef struct subject {
  pb_plant *plant;
  pb_system *system;
  pb_model *model;
} subject;

static subject make(const char *head, const char *body) {
  char text[8192];
  subject s;
  int n = snprintf(text, sizeof text, "{\"schema\": \"plantbus.plant/1\", \"name\": \"t\", %s%s}",
                   head, body);
  assert_true(n > 0 && (size_t)n < sizeof text);
  REQUIRE(pb_plant_parse(text, (size_t)n, PB_CONFIG "/plants", NULL, &s.plant, &err));
  REQUIRE(pb_system_assemble(s.plant, NULL, &s.system, &err));
  REQUIRE(pb_model_compile(s.system, NULL, &s.model, &err));
  return s;
}

static void drop(subject *s) {
  pb_model_free(s->model);
  pb_system_free(s->system);
  pb_plant_free(s->plant);
}

// ---- (K + s C + s² M) q = F u at s = iω, real and imaginary part stacked, in quadruple precision
// --

static void solve(quad *a, quad *b, size_t n, size_t columns) {
  for (size_t k = 0; k < n; k++) {
    size_t pivot = k;
    for (size_t i = k + 1; i < n; i++) {
      const quad x = a[i + k * n], y = a[pivot + k * n];
      if ((x < 0 ? -x : x) > (y < 0 ? -y : y)) pivot = i;
    }
    for (size_t j = k; j < n; j++) {
      const quad t = a[k + j * n];
      a[k + j * n] = a[pivot + j * n], a[pivot + j * n] = t;
    }
    for (size_t j = 0; j < columns; j++) {
      const quad t = b[k + j * n];
      b[k + j * n] = b[pivot + j * n], b[pivot + j * n] = t;
    }
    for (size_t i = k + 1; i < n; i++) {
      const quad f = a[i + k * n] / a[k + k * n];
      if (f == 0) continue;
      for (size_t j = k; j < n; j++) a[i + j * n] -= f * a[k + j * n];
      for (size_t j = 0; j < columns; j++) b[i + j * n] -= f * b[k + j * n];
    }
  }
  for (size_t j = 0; j < columns; j++)
    for (size_t k = n; k-- > 0;) {
      for (size_t i = k + 1; i < n; i++) b[k + j * n] -= a[k + i * n] * b[i + j * n];
      b[k + j * n] /= a[k + k * n];
    }
}

static void exact(const pb_system *p, double hz, double complex *h) {
  const size_t n = p->n, n2 = 2 * n;
  const quad w = 2 * (quad)M_PI * hz;
  quad *a = calloc(n2 * n2, sizeof *a), *x = calloc(n2 * p->nu, sizeof *x);
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) {
      const quad re = p->k[i + j * n] - w * w * p->m[i + j * n], im = w * p->c[i + j * n];
      a[i + j * n2] = a[n + i + (n + j) * n2] = re;
      a[n + i + j * n2] = im;
      a[i + (n + j) * n2] = -im;
    }
  for (size_t i = 0; i < p->nu; i++)
    for (size_t r = 0; r < n; r++) x[r + i * n2] = p->f[r + i * n];
  solve(a, x, n2, p->nu);
  for (size_t o = 0; o < p->ny; o++)
    for (size_t i = 0; i < p->nu; i++) {
      quad re = p->d[o + i * p->ny], im = 0;
      for (size_t r = 0; r < n; r++) {
        const quad qr = x[r + i * n2], qi = x[n + r + i * n2];
        const quad still = p->y0[o + r * p->ny] - w * w * p->y2[o + r * p->ny];
        const quad rate = w * p->y1[o + r * p->ny];
        re += still * qr - rate * qi;
        im += still * qi + rate * qr;
      }
      h[o * p->nu + i] = (double)re + I * (double)im;
    }
  free(a);
  free(x);
}

// Of each entry: `own` of itself and `row` of the largest of its output; outputs by their kind, 0
// displacement, 1 velocity, 2 acceleration, of first … last.
static void check_rows(const pb_model *m, const double complex *got, const double complex *want,
                       double own, double row, size_t first, size_t last) {
  for (size_t o = 0; o < m->ny; o++) {
    if (o % 3 < first || o % 3 > last) continue;
    double most = 0;
    for (size_t i = 0; i < m->nu; i++) most = fmax(most, cabs(want[o * m->nu + i]));
    assert_true(most > 0);
    for (size_t i = 0; i < m->nu; i++) {
      const size_t at = o * m->nu + i;
      const double error = cabs(got[at] - want[at]);
      if (!(error <= own * cabs(want[at]) + row * most))
        fail_msg("%s to %s: %g for %g, off by %g", m->input[i].name, m->output[o].name,
                 cabs(got[at]), cabs(want[at]), error);
    }
  }
}

static double complex *response(const pb_model *m, pb_time_base base, double hz) {
  double complex *h = malloc(m->ny * m->nu * sizeof *h);
  REQUIRE(pb_model_frf(m, base, &hz, 1, h, &err));
  return h;
}

static double complex *reference(const pb_system *p, double hz) {
  double complex *h = malloc(p->ny * p->nu * sizeof *h);
  exact(p, hz, h);
  return h;
}

static void test_digits_at_low_frequency(void **state) {
  (void)state;
  static const char *const body[] = {HELD, LOADED};
  static const double hz[] = {0.1, 0.7, 10, 300, 3000};
  for (size_t b = 0; b < 2; b++) {
    subject s = make("", body[b]);
    for (size_t k = 0; k < sizeof hz / sizeof *hz; k++) {
      double complex *want = reference(s.system, hz[k]);
      double complex *got = response(s.model, PB_CONTINUOUS, hz[k]);
      check_rows(s.model, got, want, 1e-8, 1e-9, 0, 2);
      free(want), free(got);
    }
    drop(&s);
  }
}

// A constant input accelerates nothing that is held, and moves nothing.
static void test_rest(void **state) {
  (void)state;
  static const char *const head[] = {"", "\"max_frequency\": 520, "};
  for (size_t k = 0; k < 2; k++) {
    subject s = make(head[k], HELD);
    double gain[18];
    REQUIRE(pb_model_dc(s.model, gain, &err));
    for (size_t o = 0; o < 6; o++)
      for (size_t i = 0; i < 3; i++)
        if (o % 3 == 2) assert_true(gain[o * 3 + i] == 0);
    drop(&s);
  }
}

// Beyond max_frequency: velocities and accelerations are of the displacement that is kept.
static void test_truncated(void **state) {
  (void)state;
  static const char *const body[] = {HELD, LOADED};
  static const double hz[] = {0.1, 10, 100};
  static const double worst[] = {1e-5, 1e-4, 2e-2};  // (f/520 Hz)² of what is left out
  for (size_t b = 0; b < 2; b++) {
    subject s = make("\"max_frequency\": 520, ", body[b]);
    assert_true(s.model->nx < 20);
    for (size_t k = 0; k < 3; k++) {
      double complex *want = reference(s.system, hz[k]);
      double complex *got = response(s.model, PB_CONTINUOUS, hz[k]);
      check_rows(s.model, got, want, 0, worst[k], 1, 2);
      free(want), free(got);
    }
    drop(&s);
  }
}

// Velocities of the stepped plant likewise, where it is sampled fast enough for the modes that are
// left out. (Accelerations sampled under held inputs are what each step of the input rings at.)
static void test_truncated_and_sampled(void **state) {
  (void)state;
  subject cut = make("\"sample_rate\": 1e6, \"max_frequency\": 520, ", HELD);
  subject whole = make("\"sample_rate\": 1e6, ", HELD);
  for (double hz = 0.1; hz < 20; hz *= 10) {
    double complex *want = response(whole.model, PB_SAMPLED, hz);
    double complex *got = response(cut.model, PB_SAMPLED, hz);
    check_rows(cut.model, got, want, 0, 1e-3, 1, 1);
    free(want), free(got);
  }
  drop(&cut), drop(&whole);
}

// A model that is cut for its poles has no others.
static void test_cut_has_no_poles_of_its_own(void **state) {
  (void)state;
  subject s = make("", HELD);
  pb_model *cut;
  double complex of[132], own[132];
  REQUIRE(pb_model_truncate(s.model, 2000, &cut, &err));
  assert_true(cut->nx > 0 && cut->nx < s.model->nx && s.model->nx <= 132);
  REQUIRE(pb_model_poles(s.model, PB_CONTINUOUS, of, &err));
  REQUIRE(pb_model_poles(cut, PB_CONTINUOUS, own, &err));
  for (size_t k = 0; k < cut->nx; k++) assert_true(own[k] == of[k]);
  pb_model_free(cut);
  drop(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_digits_at_low_frequency),
      cmocka_unit_test(test_rest),
      cmocka_unit_test(test_truncated),
      cmocka_unit_test(test_truncated_and_sampled),
      cmocka_unit_test(test_cut_has_no_poles_of_its_own),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
