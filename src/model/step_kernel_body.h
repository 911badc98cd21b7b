// The kernels for one width of vectors; included by step_kernel.c once for each, with
//   NAME      suffix of the functions and the kernel's name
//   TARGET    attribute that allows the instruction set
//   V, W      vector type and its number of doubles (8, 4 or 2)
//   PASS      vectors of a group or panel that are kept in registers at once, divides 8 / W
//   EXCHANGE  the two doubles of each pair exchanged
// The compiler splits vectors wider than its registers badly, hence the widths.
// No include guard: it is meant to be included several times.

#define JOINED(a, b) a##b
#define JOIN(a, b) JOINED(a, b)
#define F(function) JOIN(function##_, NAME)

// ---- states -------------------------------------------------------------------------------------

// `groups` is a constant where this is inlined.
INLINE void F(advance_groups)(const double *restrict p, size_t nu, int groups, double *restrict x,
                              const double *restrict u) {
  const size_t row = (size_t)groups * LANES;
  for (int first = 0; first < LANES; first += PASS * W) {
    V s[AT_ONCE][PASS];
#pragma GCC unroll 4
    for (int g = 0; g < groups; g++)
#pragma GCC unroll 4
      for (int k = 0; k < PASS; k++) {
        const int l = LANES * g + first + W * k;
        const V now = *(const V *)(x + l);
        s[g][k] = *(const V *)(p + l) * now + *(const V *)(p + row + l) * EXCHANGE(now);
      }
    for (size_t i = 0; i < nu; i++) {
      const double *b = p + (2 + i) * row + first;
#pragma GCC unroll 4
      for (int g = 0; g < groups; g++)
#pragma GCC unroll 4
        for (int k = 0; k < PASS; k++) s[g][k] += *(const V *)(b + LANES * g + W * k) * u[i];
    }
#pragma GCC unroll 4
    for (int g = 0; g < groups; g++)
#pragma GCC unroll 4
      for (int k = 0; k < PASS; k++) *(V *)(x + LANES * g + first + W * k) = s[g][k];
  }
}

TARGET static void F(advance)(const pb_step_pack *pack, double *restrict x,
                              const double *restrict u) {
  const size_t nu = pack->nu, group = (2 + nu) * LANES;
  const double *p = pack->advance;
  size_t left = pack->states;
  for (; left >= AT_ONCE * LANES; left -= AT_ONCE * LANES, x += AT_ONCE * LANES) {
    F(advance_groups)(p, nu, AT_ONCE, x, u);
    p += AT_ONCE * group;
  }
  const size_t groups = left / LANES;
  if (groups == 3) F(advance_groups)(p, nu, 3, x, u);
  if (groups == 2) F(advance_groups)(p, nu, 2, x, u);
  if (groups == 1) F(advance_groups)(p, nu, 1, x, u);
  left -= groups * LANES, x += groups * LANES, p += groups * group;
  if (left) {
    double rest[LANES] = {0};
    memcpy(rest, x, left * sizeof *x);
    F(advance_groups)(p, nu, 1, rest, u);
    memcpy(x, rest, left * sizeof *x);
  }
}

// ---- outputs ------------------------------------------------------------------------------------

// The narrow panel, of two or four outputs (a constant where this is inlined): sums kept in pairs.
INLINE void F(add_tail)(const double *restrict t, int tail, double z, v2 sum[2]) {
  if (tail >= 2) sum[0] += *(const v2 *)t * z;
  if (tail == 4) sum[1] += *(const v2 *)(t + 2) * z;
}

// `panels` whole panels from p and one of width `tail` from t, both constants where this is
// inlined; y has room for `panels` × 8.
INLINE void F(output_panels)(const double *restrict p, int panels, const double *restrict t,
                             int tail, const double *restrict z, size_t nz, double *restrict y,
                             v2 sum[2]) {
  const size_t row = (size_t)panels * LANES;
  for (int first = 0; first < LANES; first += PASS * W) {
    V s[AT_ONCE][PASS] = {0};
    v2 narrow[2] = {0};
    for (size_t j = 0; j < nz; j++) {
#pragma GCC unroll 4
      for (int g = 0; g < panels; g++)
#pragma GCC unroll 4
        for (int k = 0; k < PASS; k++)
          s[g][k] += *(const V *)(p + j * row + LANES * g + first + W * k) * z[j];
      if (first == 0) F(add_tail)(t + (size_t)tail * j, tail, z[j], narrow);
    }
#pragma GCC unroll 4
    for (int g = 0; g < panels; g++)
#pragma GCC unroll 4
      for (int k = 0; k < PASS; k++) *(V *)(y + LANES * g + first + W * k) = s[g][k];
    if (first == 0) sum[0] = narrow[0], sum[1] = narrow[1];
    if (panels == 0) return;
  }
}

// As many outputs as there are, of a chunk that may be padded.
INLINE void F(output_chunk)(const double *restrict p, int panels, const double *restrict t,
                            int tail, const double *restrict z, size_t nz, double *restrict y,
                            size_t count) {
  const size_t whole = (size_t)panels * LANES;
  v2 sum[2];
  if (count >= whole) {
    F(output_panels)(p, panels, t, tail, z, nz, y, sum);
  } else {
    double padded[AT_ONCE * LANES];
    F(output_panels)(p, panels, t, tail, z, nz, padded, sum);
    memcpy(y, padded, count * sizeof *y);
  }
  if (tail) memcpy(y + whole, sum, (count - whole) * sizeof *y);
}

TARGET static void F(output)(const pb_step_pack *pack, const double *restrict z,
                             double *restrict y) {
  const size_t nz = pack->nz;
  const double *p = pack->output;
  size_t panels = pack->panels, left = pack->ny;
  for (; panels >= AT_ONCE; panels -= AT_ONCE) {
    F(output_chunk)(p, AT_ONCE, p, 0, z, nz, y, left);
    if (left <= AT_ONCE * LANES) return;
    left -= AT_ONCE * LANES, y += AT_ONCE * LANES, p += AT_ONCE * nz * LANES;
  }
  const double *t = p + panels * nz * LANES;
#define CASE(whole, tail)                               \
  case (whole)*LANES + (tail):                          \
    F(output_chunk)(p, whole, t, tail, z, nz, y, left); \
    break;
  switch (panels * LANES + pack->tail) {
    CASE(0, 2)
    CASE(0, 4)
    CASE(1, 0)
    CASE(1, 2)
    CASE(1, 4)
    CASE(2, 0)
    CASE(2, 2)
    CASE(2, 4)
    CASE(3, 0)
    CASE(3, 2)
    CASE(3, 4)
  }
#undef CASE
}

#define TEXT_OF(name) #name
#define TEXT(name) TEXT_OF(name)
static const pb_step_kernel F(kernel) = {TEXT(NAME), F(advance), F(output)};

#undef TEXT
#undef TEXT_OF
#undef F
#undef JOIN
#undef JOINED
#undef NAME
#undef TARGET
#undef V
#undef W
#undef PASS
#undef EXCHANGE
