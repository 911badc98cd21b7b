// The points of a study: read, checked, computed on cores and machines, put in order.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "interrupt.h"
#include "jsontext.h"
#include "pool.h"
#include "progress.h"
#include "ranks.h"
#include "study.h"

// ---- reading ------------------------------------------------------------------------------------

static pb_status directory_of(const char *path, char **out, pb_error *err) {
  const char *slash = strrchr(path, '/');
  *out = slash ? strndup(path, slash == path ? 1 : (size_t)(slash - path)) : strdup(".");
  return *out ? PB_OK : pb_fail_memory(err, path);
}

pb_status study_add_model(cJSON *file, const char *text, pb_error *err) {
  const char *equals = strchr(text, '=');
  cJSON *models = cJSON_GetObjectItemCaseSensitive(file, "models"), *model = NULL;
  if (!equals || equals == text)
    return pb_fail(err, PB_ERR_ARGUMENT, "--model", "'%s' is not NAME=JSON or NAME=@FILE", text);
  pb_error inner = {0};
  char *name = strndup(text, (size_t)(equals - text));
  pb_status status =
      name ? pb_json_argument(equals + 1, &model, &inner) : pb_fail_memory(&inner, "argument");
  if (status)
    pb_fail(err, status, "--model", "%.80s: %.80s: %.280s", name ? name : text, inner.where,
            inner.message);
  if (!status && !cJSON_IsObject(model))
    status = pb_fail(err, PB_ERR_SYNTAX, "--model", "%.80s: a model is a JSON object", name);
  if (!status && !models) models = cJSON_AddObjectToObject(file, "models");
  if (!status) cJSON_DeleteItemFromObjectCaseSensitive(models, name);
  if (!status && cJSON_AddItemToObject(models, name, model))
    model = NULL;
  else if (!status)
    status = pb_fail_memory(err, name);
  cJSON_Delete(model);
  free(name);
  return status;
}

static pb_variation variation_of(const study *s, size_t index) {
  return (pb_variation){s->options->kind, s->label[index], s->options->stiffness, s->directory};
}

// Keeps a value that the plant can have; one that was not asked for may be left out.
static pb_status keep_value(study *s, const char *text, bool asked, pb_error *err) {
  cJSON *varied = NULL;
  s->label[s->count] = pb_text_copy(text);
  if (!s->label[s->count]) return pb_fail_memory(err, text);
  pb_variation v = variation_of(s, s->count);
  pb_status status = pb_variation_number(&v, &s->value[s->count], err);
  if (!status) status = pb_variation_apply(s->file, &v, &varied, err);
  cJSON_Delete(varied);
  if (!status) {
    s->count++;
    return PB_OK;
  }
  free(s->label[s->count]);
  s->label[s->count] = NULL;
  bool fits = status == PB_ERR_ARGUMENT || status == PB_ERR_STATE || status == PB_ERR_REFERENCE;
  if (asked || !fits || !pb_json_member(s->file, "template")) return status;
  if (study_rank() == 0)
    fprintf(stderr, "%s: without %s: %s: %s\n", program_invocation_short_name, text, err->where,
            err->message);
  return PB_OK;
}

static pb_status keep_values(study *s, pb_error *err) {
  const study_options *o = s->options;
  pb_name_list list = o->values, defaults = {0};
  bool asked = list.count > 0;
  if (!asked && !pb_parse_names(pb_study_kind_of(o->kind)->values, &defaults))
    return pb_fail_memory(err, "values");
  if (!asked) list = defaults;
  s->label = calloc(list.count, sizeof *s->label);
  s->value = calloc(list.count, sizeof *s->value);
  s->point = calloc(list.count, sizeof *s->point);
  pb_status status = s->label && s->value && s->point ? PB_OK : pb_fail_memory(err, "values");
  for (size_t k = 0; k < list.count && !status; k++)
    status = keep_value(s, list.name[k], asked, err);
  pb_name_list_free(&defaults);
  if (status || s->count > 0) return status;
  return pb_fail(err, PB_ERR_STATE, o->plant_path, "the plant can have none of the study's values");
}

pb_status study_open(const study_options *o, study *out, pb_error *err) {
  *out = (study){.options = o};
  pb_status status = pb_json_read(o->plant_path, &out->file, NULL, err);
  if (!status) status = directory_of(o->plant_path, &out->directory, err);
  if (!status && !cJSON_IsObject(out->file))
    status = pb_fail(err, PB_ERR_SCHEMA, o->plant_path, "a plant file is a JSON object");
  for (size_t k = 0; k < o->models.count && !status; k++)
    status = study_add_model(out->file, o->models.name[k], err);
  if (!status) status = keep_values(out, err);
  const cJSON *name = status ? NULL : pb_json_member(out->file, "name");
  out->plant = cJSON_IsString(name) ? name->valuestring : o->plant_path;
  if (status) study_close(out);
  return status;
}

void study_close(study *s) {
  for (size_t k = 0; k < s->count; k++) {
    free(s->label[k]);
    pb_study_point_clear(&s->point[k]);
  }
  free(s->label);
  free(s->value);
  free(s->point);
  free(s->directory);
  cJSON_Delete(s->file);
  *s = (study){0};
}

// ---- computing ----------------------------------------------------------------------------------

pb_status study_compute(const study *s, size_t index, pb_study_point *out, pb_error *err) {
  pb_variation v = variation_of(s, index);
  cJSON *varied = NULL;
  pb_status status = pb_variation_apply(s->file, &v, &varied, err);
  if (!status) status = pb_study_point_find(varied, s->directory, &s->options->point, out, err);
  cJSON_Delete(varied);
  return status;
}

typedef struct gathering {
  study *s;
  size_t done;
  pb_progress progress;
} gathering;

static pb_status compute(void *context, size_t index, pb_study_point *out, pb_error *err) {
  return study_compute(((gathering *)context)->s, index, out, err);
}

// A result of this or another process into its place; a failure names the value.
static pb_status place(gathering *g, study_message *m, pb_error *err) {
  study *s = g->s;
  if (m->index >= s->count) {
    pb_study_point_clear(&m->point);
    return pb_fail(err, PB_ERR_STATE, "study", "the processes do not study the same values");
  }
  if (m->status)
    return pb_fail(err, m->status, m->err.where, "at %s: %s", s->label[m->index], m->err.message);
  pb_study_point_clear(&s->point[m->index]);
  s->point[m->index] = m->point;
  pb_progress_update(&g->progress, (double)++g->done, (double)s->count, s->label[m->index]);
  return PB_OK;
}

static pb_status take_others(gathering *g, bool wait, bool *taken, pb_error *err) {
  void *bytes;
  size_t size;
  study_message m;
  *taken = false;
  pb_status status = study_ranks_receive(wait, &bytes, &size, err);
  if (status || !bytes) return status;
  *taken = true;
  status = study_message_unpack(bytes, size, &m, err);
  free(bytes);
  return status ? status : place(g, &m, err);
}

static pb_status collect(void *context, study_message *m, pb_error *err) {
  gathering *g = context;
  if (study_rank() == 0) {
    bool taken = true;
    pb_status status = place(g, m, err);
    while (!status && taken && study_ranks() > 1) status = take_others(g, false, &taken, err);
    return status;
  }
  void *bytes;
  size_t size;
  pb_status status = study_message_pack(m, &bytes, &size, err);
  if (!status) {
    status = study_ranks_send(bytes, size, err);
    free(bytes);
  }
  pb_study_point_clear(&m->point);
  return status;
}

static size_t workers_of(const study_options *o) {
  if (o->workers > 0) return o->workers;
  if (study_ranks() > 1) return 1;
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
  return cores > 1 ? (size_t)cores : 1;
}

pb_status study_run(study *s, pb_error *err) {
  gathering g = {.s = s};
  size_t count = 0, *index = malloc((s->count + 1) * sizeof *index);
  if (!index) return pb_fail_memory(err, "study");
  for (size_t k = study_rank(); k < s->count; k += study_ranks()) index[count++] = k;
  const study_pool pool = {compute, collect, pb_interrupted, &g};
  bool first = study_rank() == 0;
  if (first) {
    pb_progress_begin(&g.progress, stderr, pb_study_kind_of(s->options->kind)->name);
    pb_progress_update(&g.progress, 0, (double)s->count, NULL);
  }
  pb_status status = study_pool_run(&pool, index, count, workers_of(s->options), err);
  while (!status && first && g.done < s->count) {
    bool taken;
    status = take_others(&g, true, &taken, err);
  }
  if (first) pb_progress_end(&g.progress);
  free(index);
  return status;
}
