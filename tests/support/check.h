// What every cmocka test of the library includes.
#ifndef PB_TESTS_CHECK_H
#define PB_TESTS_CHECK_H

#include <complex.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/status.h"

// Fails with the error's text unless the call succeeded.
#define REQUIRE(call)                                                   \
  do {                                                                  \
    pb_error err = {0};                                                 \
    pb_status status_ = (call);                                         \
    if (status_) fail_msg("%s: %s: %s", #call, err.where, err.message); \
  } while (0)

// |a − b| ≤ tolerance × scale, printing all of them when not.
#define ASSERT_NEAR(a, b, tolerance)                                                        \
  do {                                                                                      \
    double a_ = (a), b_ = (b), t_ = (tolerance);                                            \
    if (!(fabs(a_ - b_) <= t_))                                                             \
      fail_msg("%s = %.17g, expected %.17g ± %.1e (off by %.2e)", #a, a_, b_, t_, a_ - b_); \
  } while (0)

#define ASSERT_RELATIVE(a, b, tolerance) ASSERT_NEAR(a, b, (tolerance)*fabs((double)(b)))

#endif
