// Results on standard output and in files: see tool.h.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "matfile.h"
#include "outfile.h"
#include "table.h"
#include "tool.h"

int tool_end(pb_status status, const pb_error *err) {
  if (!status) return PB_EXIT_DONE;
  pb_print_error(stderr, err);
  return PB_EXIT_FAILED;
}

bool wants_table(const tool *t) {
  return !t->json && !t->out;
}

int emit_done(const tool *t, pb_status status, const pb_error *err) {
  if (!status) fprintf(stderr, "%s: wrote %s\n", program_invocation_short_name, t->out);
  return tool_end(status, err);
}

// ---- JSON ---------------------------------------------------------------------------------------

static pb_status write_json_file(const tool *t, json_function *write, const void *context,
                                 pb_error *err) {
  pb_outfile file;
  pb_jsonout json;
  pb_status status = pb_outfile_open(t->out, &file, err);
  if (status) return status;
  pb_jsonout_begin(&json, file.stream);
  write(&json, context);
  pb_jsonout_end(&json);
  return pb_outfile_close(&file, err);
}

int emit_json(const tool *t, json_function *write, const void *context) {
  if (t->json) {
    pb_jsonout json;
    pb_jsonout_begin(&json, stdout);
    write(&json, context);
    pb_jsonout_end(&json);
  }
  if (t->out_format != FORMAT_JSON) return PB_EXIT_DONE;
  pb_error err = {0};
  return emit_done(t, write_json_file(t, write, context, &err), &err);
}

void emit_channels_json(pb_jsonout *json, const channels *ch) {
  pb_jsonout_texts(json, "inputs", ch->input_name, ch->inputs);
  pb_jsonout_texts(json, "outputs", ch->output_name, ch->outputs);
}

// ---- columns ------------------------------------------------------------------------------------

static void columns_json(pb_jsonout *json, const void *context) {
  const columns *data = context;
  pb_jsonout_object(json, NULL);
  if (data->channels) emit_channels_json(json, data->channels);
  for (size_t k = 0; k < data->count; k++) {
    pb_jsonout_numbers(json, data->column[k].key, data->column[k].value, data->rows);
  }
  pb_jsonout_object_end(json);
}

static pb_status columns_table(const columns *data, pb_error *err) {
  pb_table table = {0};
  pb_table_number_column(&table, "#", NULL, 6);
  for (size_t k = 0; k < data->count; k++) {
    const column *c = &data->column[k];
    pb_table_number_column(&table, c->name, c->unit, c->digits);
  }
  for (size_t i = 0; i < data->rows; i++) {
    pb_table_count(&table, i + 1);
    for (size_t k = 0; k < data->count; k++) pb_table_number(&table, data->column[k].value[i]);
  }
  pb_status status = pb_table_print(&table, stdout, 0, err);
  pb_table_free(&table);
  return status;
}

static pb_status columns_csv(const tool *t, const columns *data, pb_error *err) {
  pb_csv csv;
  pb_status status = pb_csv_open(t->out, &csv, err);
  if (status) return status;
  for (size_t k = 0; k < data->count; k++) {
    pb_csv_column(&csv, data->column[k].name, data->column[k].unit);
  }
  for (size_t i = 0; i < data->rows; i++) {
    for (size_t k = 0; k < data->count; k++) pb_csv_number(&csv, data->column[k].value[i]);
  }
  return pb_csv_close(&csv, err);
}

static pb_status columns_mat(const tool *t, const columns *data, pb_error *err) {
  pb_matfile *mat;
  pb_status status = pb_matfile_open(t->out, &mat, err);
  if (status) return status;
  for (size_t k = 0; k < data->count; k++) {
    pb_matfile_real(mat, data->column[k].key, data->rows, 1, data->column[k].value);
  }
  if (data->channels) {
    pb_matfile_names(mat, "inputs", data->channels->input_name, data->channels->inputs);
    pb_matfile_names(mat, "outputs", data->channels->output_name, data->channels->outputs);
  }
  return pb_matfile_close(mat, err);
}

int emit_columns(const tool *t, const columns *data) {
  pb_error err = {0};
  if (wants_table(t)) {
    return tool_end(columns_table(data, &err), &err);
  }
  int code = emit_json(t, columns_json, data);
  if (code) return code;
  if (t->out_format == FORMAT_CSV) return emit_done(t, columns_csv(t, data, &err), &err);
  if (t->out_format == FORMAT_MAT) return emit_done(t, columns_mat(t, data, &err), &err);
  return PB_EXIT_DONE;
}
