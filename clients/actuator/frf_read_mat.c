// Reading identify.mat: input_names, output_names, sample_rate, identified_frequency_hz,
// identified_h (ny × nu × nf), identified_variance (nu × ny·nf).
#include <matio.h>
#include <math.h>
#include <string.h>

#include "base/text.h"
#include "frf_read.h"

static pb_status get(mat_t *mat, const char *path, const char *name, matvar_t **out,
                     pb_error *err) {
  *out = Mat_VarRead(mat, name);
  if (*out && (*out)->data) return PB_OK;
  return pb_fail(err, PB_ERR_SYNTAX, path, "has no variable %s: is it of plantbus-identify?", name);
}

// The position of a name in a cell array of strings.
static pb_status position(mat_t *mat, const char *path, const char *list, const char *wanted,
                          size_t *count, size_t *index, pb_error *err) {
  matvar_t *v = NULL;
  pb_text names = {0};
  bool found = false;
  pb_status st = get(mat, path, list, &v, err);
  if (!st && v->class_type != MAT_C_CELL)
    st = pb_fail(err, PB_ERR_SYNTAX, path, "%s is not a cell array", list);
  *count = st ? 0 : v->nbytes / (size_t)v->data_size;
  for (size_t i = 0; i < *count; i++) {
    const matvar_t *cell = ((matvar_t **)v->data)[i];
    const bool text = cell && cell->class_type == MAT_C_CHAR && cell->data && cell->data_size == 1;
    const size_t length = text ? cell->nbytes : 0;
    pb_text_append(&names, " ");
    if (text) pb_text_append_n(&names, cell->data, length);
    if (text && length == strlen(wanted) && !memcmp(cell->data, wanted, length)) {
      *index = i;
      found = true;
    }
  }
  if (!st && !found)
    st = pb_fail(err, PB_ERR_REFERENCE, path, "%s is not among its %s:%s", wanted, list,
                 names.text ? names.text : " none");
  free(names.text);
  Mat_VarFree(v);
  return st;
}

static bool is_double(const matvar_t *v, bool has_imag) {
  return v->class_type == MAT_C_DOUBLE && v->data_type == MAT_T_DOUBLE &&
         (v->isComplex != 0) == has_imag;
}

static size_t entries(const matvar_t *v) {
  size_t n = 1;
  for (int i = 0; i < v->rank; i++) n *= v->dims[i];
  return n;
}

typedef struct shape {
  size_t ny, nu, input, output[PB_APA_OUTPUTS];
} shape;

static pb_status fill(const char *path, const shape *s, const matvar_t *hz, const matvar_t *h,
                      const matvar_t *variance, pb_apa_data *out, pb_error *err) {
  const size_t nf = entries(hz), all = nf * s->ny * s->nu;
  if (!is_double(hz, false) || !is_double(h, true) || !is_double(variance, false) ||
      entries(h) != all || entries(variance) != all || nf == 0)
    return pb_fail(err, PB_ERR_SYNTAX, path, "its responses do not have the sizes of its names");
  pb_status st = pb_frf_new(nf, PB_APA_OUTPUTS, 1, &out->frf, err);
  if (st) return st;
  const mat_complex_split_t *part = h->data;
  const double *re = part->Re, *im = part->Im, *f_hz = hz->data, *var = variance->data;
  for (size_t f = 0; f < nf; f++) {
    out->frf.frequency_hz[f] = f_hz[f];
    if (!(f_hz[f] > (f ? f_hz[f - 1] : 0)))
      return pb_fail(err, PB_ERR_SYNTAX, path, "frequencies are > 0 and ascend");
    for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
      const size_t from = s->output[k] + s->ny * (s->input + s->nu * f);
      const size_t to = f * PB_APA_OUTPUTS + k;
      out->frf.h[to] = re[from] + I * im[from];
      out->frf.variance[to] = var[s->input + s->nu * (s->output[k] + s->ny * f)];
      out->frf.coherence[to] = 1;
      if (!isfinite(cabs(out->frf.h[to])))
        return pb_fail(err, PB_ERR_SYNTAX, path, "the response at %g Hz is not finite", f_hz[f]);
    }
  }
  return PB_OK;
}

static pb_status read_responses(mat_t *mat, const char *path, const shape *s, pb_apa_data *out,
                                pb_error *err) {
  matvar_t *hz = NULL, *h = NULL, *variance = NULL, *rate = NULL;
  pb_status st = get(mat, path, "identified_frequency_hz", &hz, err);
  if (!st) st = get(mat, path, "identified_h", &h, err);
  if (!st) st = get(mat, path, "identified_variance", &variance, err);
  if (!st) st = get(mat, path, "sample_rate", &rate, err);
  if (!st && (!is_double(rate, false) || !(*(double *)rate->data > 0)))
    st = pb_fail(err, PB_ERR_SYNTAX, path, "sample_rate is not a number > 0");
  if (!st) st = fill(path, s, hz, h, variance, out, err);
  if (!st) out->sample_rate = *(double *)rate->data;
  Mat_VarFree(hz);
  Mat_VarFree(h);
  Mat_VarFree(variance);
  Mat_VarFree(rate);
  return st;
}

pb_status frf_read_mat(const char *path, const frf_names *names, pb_apa_data *out, pb_error *err) {
  shape s = {0};
  *out = (pb_apa_data){0};
  mat_t *mat = Mat_Open(path, MAT_ACC_RDONLY);
  if (!mat) return pb_fail(err, PB_ERR_IO, path, "cannot be read as a MAT file");
  pb_status st = position(mat, path, "input_names", names->input, &s.nu, &s.input, err);
  for (int k = 0; k < PB_APA_OUTPUTS && !st; k++)
    st = position(mat, path, "output_names", names->output[k], &s.ny, &s.output[k], err);
  if (!st) st = read_responses(mat, path, &s, out, err);
  Mat_Close(mat);
  if (st) pb_apa_data_clear(out);
  return st;
}
