// xoshiro256++, splitmix64 and the polar method: see random.h.
#include "signal/random.h"

#include <math.h>

static uint64_t splitmix(uint64_t *state) {
  uint64_t z = (*state += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

static uint64_t rotate(uint64_t x, int bits) {
  return (x << bits) | (x >> (64 - bits));
}

void pb_random_seed(pb_random *random, uint64_t seed, uint64_t stream) {
  uint64_t mix = stream;
  uint64_t state = seed ^ splitmix(&mix);
  *random = (pb_random){0};
  for (int i = 0; i < 4; i++) random->s[i] = splitmix(&state);
}

uint64_t pb_random_bits(pb_random *random) {
  uint64_t *s = random->s;
  uint64_t result = rotate(s[0] + s[3], 23) + s[0];
  uint64_t t = s[1] << 17;
  s[2] ^= s[0];
  s[3] ^= s[1];
  s[1] ^= s[2];
  s[0] ^= s[3];
  s[2] ^= t;
  s[3] = rotate(s[3], 45);
  return result;
}

double pb_random_uniform(pb_random *random) {
  return (double)(pb_random_bits(random) >> 11) * 0x1p-53;
}

// ln x = 2 artanh((m − 1)/(m + 1)) + e ln 2 with x = m 2^e, m in [√½, √2): |series term 13| <
// 1e-20.
static double logarithm(double x) {
  int exponent;
  double m = frexp(x, &exponent);
  if (m < 0.70710678118654752) {
    m *= 2;
    exponent--;
  }
  double t = (m - 1) / (m + 1), t2 = t * t, sum = 0;
  for (int k = 25; k >= 1; k -= 2) sum = sum * t2 + 1.0 / k;
  return 2 * t * sum + exponent * 0.69314718055994531;
}

double pb_random_gaussian(pb_random *random) {
  if (random->has_spare) {
    random->has_spare = 0;
    return random->spare;
  }
  double x, y, r2;
  do {
    x = 2 * pb_random_uniform(random) - 1;
    y = 2 * pb_random_uniform(random) - 1;
    r2 = x * x + y * y;
  } while (r2 >= 1 || r2 == 0);
  double scale = sqrt(-2 * logarithm(r2) / r2);
  random->spare = y * scale;
  random->has_spare = 1;
  return x * scale;
}
