// Controllers for the daemon: bodies of its host_controller requests (docs/bus.md).
#include "control_tool.h"
#include "outfile.h"

static void write_names(pb_jsonout *o, const char *key, const pb_signal *signal,
                        const size_t *index, size_t count) {
  pb_jsonout_row(o, key);
  for (size_t k = 0; k < count; k++) pb_jsonout_text(o, NULL, signal[index[k]].name);
  pb_jsonout_array_end(o);
}

void control_write_iff(FILE *stream, const iff_result *iff) {
  const pb_model *m = iff->model;
  pb_jsonout o;
  pb_jsonout_begin(&o, stream);
  pb_jsonout_object(&o, NULL);
  pb_jsonout_text(&o, "channel", "iff");
  pb_jsonout_text(&o, "type", "iff");
  write_names(&o, "inputs", m->input, iff->loops.input, iff->loops.count);
  write_names(&o, "outputs", m->output, iff->loops.output, iff->loops.count);
  pb_jsonout_number(&o, "gain", iff->loop.sign * iff->law.gain);
  pb_jsonout_number(&o, "integrator_hz", iff->law.integrator_hz);
  pb_jsonout_number(&o, "highpass_hz", iff->law.highpass_hz);
  pb_jsonout_object_end(&o);
  pb_jsonout_end(&o);
}

static void write_matrix(pb_jsonout *o, const char *key, const double *m, size_t rows, size_t cols,
                         double sign) {
  pb_jsonout_array(o, key);
  for (size_t r = 0; r < rows; r++) {
    pb_jsonout_row(o, NULL);
    for (size_t c = 0; c < cols; c++) pb_jsonout_number(o, NULL, sign * m[r + c * rows]);
    pb_jsonout_array_end(o);
  }
  pb_jsonout_array_end(o);
}

// Added to the inputs: u += −K y.
void control_write_hac(FILE *stream, const control_design *d) {
  const pb_lti *k = &d->hac;
  pb_jsonout o;
  pb_jsonout_begin(&o, stream);
  pb_jsonout_object(&o, NULL);
  pb_jsonout_text(&o, "channel", "hac");
  pb_jsonout_text(&o, "type", "lti");
  write_names(&o, "inputs", d->model->input, d->channels.input, d->n);
  write_names(&o, "outputs", d->model->output, d->metrology, d->n);
  write_matrix(&o, "a", k->a, k->nx, k->nx, 1);
  write_matrix(&o, "b", k->b, k->nx, k->nu, 1);
  write_matrix(&o, "c", k->c, k->ny, k->nx, -1);
  write_matrix(&o, "d", k->d, k->ny, k->nu, -1);
  pb_jsonout_number(&o, "dt", 1 / d->model->sample_rate);
  pb_jsonout_object_end(&o);
  pb_jsonout_end(&o);
}

static pb_status write_file(const char *dir, const char *name, const iff_result *iff,
                            const control_design *design, pb_error *err) {
  char path[1024];
  pb_outfile file = {0};
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  if (status == PB_OK) status = pb_outfile_open(path, &file, err);
  if (status != PB_OK) return status;
  if (design) control_write_hac(file.stream, design);
  if (iff) control_write_iff(file.stream, iff);
  return pb_outfile_close(&file, err);
}

pb_status control_export(const iff_result *iff, const control_design *design, const char *dir,
                         pb_error *err) {
  pb_status status = iff ? write_file(dir, "control-iff.json", iff, NULL, err) : PB_OK;
  if (status == PB_OK && design) status = write_file(dir, "control-hac.json", NULL, design, err);
  return status;
}

void control_mat_lti(pb_matfile *mat, const char *prefix, const pb_lti *lti) {
  const struct {
    const char *name;
    const double *m;
    size_t rows, cols;
  } part[4] = {{"a", lti->a, lti->nx, lti->nx},
               {"b", lti->b, lti->nx, lti->nu},
               {"c", lti->c, lti->ny, lti->nx},
               {"d", lti->d, lti->ny, lti->nu}};
  for (int k = 0; k < 4; k++) {
    char name[64];
    snprintf(name, sizeof name, "%s_%s", prefix, part[k].name);
    pb_matfile_real(mat, name, part[k].rows, part[k].cols, part[k].m);
  }
}
