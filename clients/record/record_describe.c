// Describing a revision of the plant in the file: metadata, the plant file, the compiled model.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "jsonout.h"
#include "recorder_internal.h"
#include "recording.h"

// A JSON array of the texts, owned by the caller.
static pb_status texts_print(const dds_sequence_string *list, char **out, pb_error *err) {
  *out = NULL;
  cJSON *array = cJSON_CreateStringArray((const char *const *)list->_buffer, (int)list->_length);
  const pb_status status =
      array ? pb_json_print_compact(array, out, err) : pb_fail_memory(err, "names");
  cJSON_Delete(array);
  return status;
}

typedef struct names {
  char revision[16], rate[32], states[16], dof[16];
  char attachment[48], model[48];
} names;

// The first plant file is plant.json; those that follow carry their revision's number.
static void names_make(const recorder *r, const plantbus_PlantDescription *d, names *n) {
  char mark[24] = "";
  if (r->part.revisions > 0) snprintf(mark, sizeof mark, "-r%u", d->revision);
  snprintf(n->attachment, sizeof n->attachment, "plant%s.json", mark);
  snprintf(n->model, sizeof n->model, "model%s.f64", mark);
  snprintf(n->revision, sizeof n->revision, "%u", d->revision);
  snprintf(n->states, sizeof n->states, "%u", d->states);
  snprintf(n->dof, sizeof n->dof, "%u", d->dof);
  pb_jsonout_format(d->sample_rate, n->rate);
}

static pb_status metadata_put(recorder *r, const plantbus_PlantDescription *d, const names *n,
                              pb_error *err) {
  const dds_sequence_string *list[4] = {&d->input_names, &d->input_units, &d->output_names,
                                        &d->output_units};
  char *text[4] = {NULL};
  pb_status status = PB_OK;
  for (int i = 0; i < 4 && !status; i++) status = texts_print(list[i], &text[i], err);
  if (!status) {
    const pb_mcap_pair pairs[] = {
        {"plant", d->name},
        {"revision", n->revision},
        {"sample_rate", n->rate},
        {"states", n->states},
        {"dof", n->dof},
        {"inputs", text[0]},
        {"input_units", text[1]},
        {"outputs", text[2]},
        {"output_units", text[3]},
        {"sha256", d->plant_sha256},
        {"attachment", n->attachment},
        {"model", n->model},
        {"software", d->software_version},
        {"recorder", PB_VERSION},
    };
    status = pb_mcap_writer_metadata(r->part.writer, PB_RECORDING_REVISION, pairs,
                                     sizeof pairs / sizeof *pairs, err);
  }
  for (int i = 0; i < 4; i++) free(text[i]);
  return status;
}

static bool described(const recorder *r, uint32_t revision) {
  for (size_t i = 0; i < r->part.revisions; i++)
    if (r->part.revision[i] == revision) return true;
  return false;
}

static pb_status describe(recorder *r, const plantbus_PlantDescription *d, pb_error *err) {
  if (described(r, d->revision)) return PB_OK;
  if (r->part.revisions == RECORD_REVISIONS)
    return pb_fail(err, PB_ERR_STATE, d->name, "more than %d revisions in one recording",
                   RECORD_REVISIONS);
  names n;
  names_make(r, d, &n);
  const uint64_t now = record_wall_clock(r);
  pb_status status = metadata_put(r, d, &n, err);
  if (!status)
    status = pb_mcap_writer_attach(r->part.writer, n.attachment, "application/json", now,
                                   d->plant_text, strlen(d->plant_text), err);
  if (!status)
    status = pb_mcap_writer_attach(r->part.writer, n.model, "application/octet-stream", now,
                                   d->model._buffer, d->model._length * sizeof(double), err);
  if (!status) status = pb_mcap_writer_flush(r->part.writer, err);
  if (!status) r->part.revision[r->part.revisions++] = d->revision;
  return status;
}

pb_status record_describe_again(recorder *r, pb_error *err) {
  return r->described ? describe(r, r->described, err) : PB_OK;
}

// A description of the daemon that is followed, or of the one that takes its place. Takes it over.
static pb_status accept(recorder *r, plantbus_PlantDescription *d, const dds_guid_t *from,
                        pb_error *err) {
  const bool same = memcmp(from, &r->daemon, sizeof *from) == 0;
  const bool known = same && described(r, d->revision);
  if (r->described) plantbus_PlantDescription_free(r->described, DDS_FREE_ALL);
  r->described = d;
  r->report->sample_rate = d->sample_rate;
  r->report->revisions += !known;
  // Its steps, epochs and revisions are counted anew.
  const bool next = !same && r->part.writer;
  r->daemon = *from;
  if (next) pb_spans_part(&r->report->spans);
  return next ? record_part_next(r, err) : r->part.writer ? describe(r, d, err) : PB_OK;
}

// Of several daemons of the name the one that is followed counts, as long as it is there.
pb_status record_describe(recorder *r, bool *taken, pb_error *err) {
  pb_status status = PB_OK;
  *taken = false;
  for (;;) {
    plantbus_PlantDescription *d = plantbus_PlantDescription__alloc();
    if (!d) return pb_fail_memory(err, "description");
    memset(d, 0, sizeof *d);
    void *sample[1] = {d};
    dds_sample_info_t info;
    dds_guid_t from = {0};
    const bool got = dds_take(r->description, sample, &info, 1, 1) == 1;
    const bool wanted =
        got && info.valid_data && !status &&
        record_participant(r->description, info.publication_handle, &from) &&
        (!r->described || r->away_since > 0 || memcmp(&from, &r->daemon, sizeof from) == 0);
    if (wanted) {
      status = accept(r, d, &from, err);
      *taken = true;
    } else {
      plantbus_PlantDescription_free(d, DDS_FREE_ALL);
    }
    if (!got) return status;
  }
}
