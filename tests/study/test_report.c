// The report's statements on joints and actuators, as the shipped hexapods show them.
#include "study_rig.h"

enum { MOST = 5 };

// Points of a study, for the values of a blank-separated list.
typedef struct series {
  size_t count;
  pb_study_point point[MOST];
} series;

static series study(const char *path, pb_study_kind kind, const char *values) {
  series s = {0};
  char copy[128], *rest = copy, *value;
  cJSON *file = rig_file(path);
  snprintf(copy, sizeof copy, "%s", values);
  while ((value = strsep(&rest, " "))) s.point[s.count++] = rig_point(file, kind, value);
  cJSON_Delete(file);
  return s;
}

static void clear(series *s) {
  for (size_t k = 0; k < s->count; k++) pb_study_point_clear(&s->point[k]);
}

// Section 3.2: with struts of one degree of freedom and no stiffness in parallel, ideal joints
// leave no zero, and bending makes the zero that limits IFF.
static void bending_limits_iff_of_1dof_struts(void **state) {
  (void)state;
  series s = study(HEXAPOD_1DOF, PB_STUDY_BENDING, "0 50 100 500 1000");
  assert_true(isnan(s.point[0].zero_hz));
  ASSERT_NEAR(s.point[0].smallest_attainable, 1, 1e-9);
  for (size_t k = 1; k < s.count; k++) {
    const pb_study_point *p = &s.point[k], *before = &s.point[k - 1];
    if (k > 1) assert_true(p->zero_hz > 1.1 * before->zero_hz);
    assert_true(p->best.smallest < before->best.smallest);
    assert_true(p->smallest_attainable <= before->smallest_attainable);
    assert_true(p->mode_hz[0] > before->mode_hz[0]);
  }
  assert_true(s.point[3].smallest_attainable < 0.5);
  assert_true(s.point[4].smallest_attainable < 0.8 * s.point[3].smallest_attainable);
  // The zero is what the joints alone hold: its square grows with their stiffness.
  ASSERT_RELATIVE(pow(s.point[2].zero_hz / s.point[1].zero_hz, 2), 2, 0.02);
  clear(&s);
}

// The shell of the 2-DoF actuator is in parallel already: the same joints hardly matter.
static void bending_hardly_matters_with_the_2dof_actuator(void **state) {
  (void)state;
  series one = study(HEXAPOD_1DOF, PB_STUDY_BENDING, "0 100"),
         two = study(HEXAPOD, PB_STUDY_BENDING, "0 100");
  const pb_study_point *free1 = &one.point[0], *stiff1 = &one.point[1], *free2 = &two.point[0],
                       *stiff2 = &two.point[1];
  assert_true(stiff2->zero_hz < 1.1 * free2->zero_hz);
  assert_true(isnan(free1->zero_hz) && stiff1->zero_hz > 5);
  double lost1 = 1 - stiff1->best.smallest / free1->best.smallest,
         lost2 = 1 - stiff2->best.smallest / free2->best.smallest;
  assert_true(lost2 < 0.06);
  assert_true(lost1 > 0.3 && lost1 > 5 * lost2);
  clear(&one);
  clear(&two);
}

// Section 3.3: soft joints along the struts take damping away; 100 N/µm is enough.
static void axial_stiffness_of_100_newtons_a_micrometre_is_enough(void **state) {
  (void)state;
  series s = study(HEXAPOD, PB_STUDY_AXIAL, "1e6 1e7 1e8 1e9 inf");
  const pb_study_point *ideal = &s.point[4];
  for (size_t k = 1; k < s.count; k++) {
    for (size_t m = 0; m < 6; m++)
      assert_true(s.point[k].attainable[m] > s.point[k - 1].attainable[m]);
    assert_true(s.point[k].rga_open[0] < s.point[k - 1].rga_open[0]);
  }
  for (size_t m = 0; m < 6; m++) {
    assert_true(s.point[0].attainable[m] < 0.35 * ideal->attainable[m]);
    assert_true(s.point[1].attainable[m] < 0.85 * ideal->attainable[m]);
    assert_true(s.point[2].attainable[m] > 0.97 * ideal->attainable[m]);
  }
  // Coupling of the damped plant: with 1 N/µm more, with 100 as with rigid joints.
  assert_true(s.point[0].rga_damped > 1.5 * ideal->rga_damped);
  assert_true(s.point[2].rga_damped < 1.05 * ideal->rga_damped);
  clear(&s);
}

// Section 3.5, 2.6: the order of the models.
static void orders_are_those_of_the_report(void **state) {
  (void)state;
  series s = study(HEXAPOD, PB_STUDY_JOINT_MODEL, "ideal bending axial");
  assert_int_equal(s.point[0].states, 24);
  assert_int_equal(s.point[1].states, 24);
  assert_int_equal(s.point[2].states, 48);
  clear(&s);
  s = study(HEXAPOD_1DOF, PB_STUDY_JOINT_MODEL, "plant");
  assert_int_equal(s.point[0].states, 12);
  clear(&s);
}

// Section 3.5, fig. 3.8: springs with the stiffnesses of the shipped element damp as it does.
static void springs_stand_for_element_joints(void **state) {
  (void)state;
  series s = study(PB_CONFIG "/plants/nano-hexapod-element-joints.json", PB_STUDY_JOINT_MODEL,
                   "axial plant");
  const pb_study_point *spring = &s.point[0], *element = &s.point[1];
  assert_int_equal(spring->states, 48);
  assert_int_equal(element->states, 252);
  ASSERT_RELATIVE(spring->struts.bending, element->struts.bending, 1e-9);
  ASSERT_RELATIVE(element->struts.bending, 4.83, 0.02);
  for (size_t m = 0; m < 6; m++) {
    ASSERT_RELATIVE(spring->mode_hz[m], element->mode_hz[m], 0.03);
    ASSERT_RELATIVE(spring->attainable[m], element->attainable[m], 0.06);
  }
  clear(&s);
}

// A heavier payload lowers every mode.
static void mass_lowers_the_modes(void **state) {
  (void)state;
  series s = study(HEXAPOD, PB_STUDY_MASS, "0 1 25 50");
  for (size_t k = 1; k < s.count; k++)
    for (size_t m = 0; m < 6; m++) assert_true(s.point[k].mode_hz[m] < s.point[k - 1].mode_hz[m]);
  clear(&s);
}

// Torsion of the joints is in parallel with the struts too, and less so than bending.
static void torsion_takes_damping(void **state) {
  (void)state;
  series s = study(HEXAPOD, PB_STUDY_TORSION, "0 100 500 1000");
  for (size_t k = 1; k < s.count; k++) {
    assert_true(s.point[k].zero_hz > s.point[k - 1].zero_hz);
    assert_true(s.point[k].smallest_attainable < s.point[k - 1].smallest_attainable);
  }
  clear(&s);
}

// ---- McInroy ------------------------------------------------------------------------------------

// Section 3.2: 9000 Nm/rad for 1 N/µm and 95 mm, 90 for a soft strut.
static void the_condition_has_the_reports_numbers(void **state) {
  (void)state;
  pb_strut_condition stiff = pb_strut_condition_make(1e6, 0.095, 5);
  ASSERT_RELATIVE(stiff.limit, 9025, 1e-12);
  ASSERT_RELATIVE(stiff.margin, 1805, 1e-12);
  assert_true(stiff.held);
  pb_strut_condition soft = pb_strut_condition_make(1e4, 0.095, 5);
  ASSERT_RELATIVE(soft.limit, 90.25, 1e-12);
  ASSERT_RELATIVE(soft.margin, 18.05, 1e-12);
  assert_true(soft.held);
  assert_false(pb_strut_condition_make(1e4, 0.095, 9.1).held);
  assert_true(isinf(pb_strut_condition_make(1e6, 0.095, 0).margin));
  assert_false(pb_strut_condition_make(1e6, 0.095, INFINITY).held);
}

static void the_condition_is_the_plants(void **state) {
  (void)state;
  pb_strut_condition c;
  cJSON *file = rig_file(HEXAPOD);
  REQUIRE(pb_strut_condition_find(file, NULL, &c, &err));
  ASSERT_RELATIVE(c.k, 0.3e6 + 2.15e6 * 4.3e6 / 6.45e6, 1e-9);
  // From (114 mm, 221°) to (110 mm, 255°), 50 mm apart in height.
  double flat = 0.114 * 0.114 + 0.110 * 0.110 - 2 * 0.114 * 0.110 * cos(34 * M_PI / 180);
  ASSERT_RELATIVE(c.length, sqrt(flat + 0.05 * 0.05), 1e-12);
  ASSERT_RELATIVE(c.bending, 4.83, 1e-12);
  cJSON_Delete(file);
  file = rig_file(HEXAPOD_1DOF);
  REQUIRE(pb_strut_condition_find(file, NULL, &c, &err));
  ASSERT_RELATIVE(c.k, 1e6, 1e-9);
  ASSERT_RELATIVE(c.bending, 5, 1e-12);
  cJSON_Delete(file);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bending_limits_iff_of_1dof_struts),
      cmocka_unit_test(bending_hardly_matters_with_the_2dof_actuator),
      cmocka_unit_test(axial_stiffness_of_100_newtons_a_micrometre_is_enough),
      cmocka_unit_test(orders_are_those_of_the_report),
      cmocka_unit_test(springs_stand_for_element_joints),
      cmocka_unit_test(mass_lowers_the_modes),
      cmocka_unit_test(torsion_takes_damping),
      cmocka_unit_test(the_condition_has_the_reports_numbers),
      cmocka_unit_test(the_condition_is_the_plants),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
