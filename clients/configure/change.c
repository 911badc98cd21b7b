// Changing the plant of a running daemon: a request, the event that tells its end, and what it did
// to the plant's outputs and energy.
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/json.h"
#include "configure.h"
#include "interrupt.h"
#include "jsontext.h"
#include "patch.h"
#include "plant/plant.h"
#include "session_change.h"

// ---- dry run ------------------------------------------------------------------------------------

// Element files may lie on the daemon's host only: then nothing can be said, and that is no error.
static pb_status check_text(const configure_options *o, const char *text, pb_error *err) {
  pb_warnings warnings = {0};
  pb_plant *plant = NULL;
  pb_error inner = {0};
  pb_status status = pb_plant_parse(text, strlen(text), o->directory, &warnings, &plant, &inner);
  pb_plant_free(plant);
  pb_print_warnings(stderr, &warnings);
  pb_warnings_clear(&warnings);
  if (status == PB_ERR_IO) {
    fprintf(stderr, "%s: not checked: %s: %s (--directory names the place of element files)\n",
            program_invocation_short_name, inner.where, inner.message);
    return PB_OK;
  }
  if (status) *err = inner;
  return status;
}

static pb_status dry_run(const configure_options *o, const cJSON *plant, const cJSON *patch,
                         pb_error *err) {
  cJSON *merged = pb_json_merge(plant, patch);
  char *text = NULL;
  pb_status status = merged ? pb_json_print(merged, &text, err) : pb_fail_memory(err, "patch");
  if (!status) fputs(text, stdout);
  if (!status) status = check_text(o, text, err);
  free(text);
  cJSON_Delete(merged);
  return status;
}

// ---- what became of it --------------------------------------------------------------------------

// Copies the members of `from` that `to` does not have.
static pb_status fill_up(cJSON *to, const cJSON *from, pb_error *err) {
  for (const cJSON *m = from ? from->child : NULL; m; m = m->next) {
    if (pb_json_member(to, m->string)) continue;
    cJSON *copy = cJSON_Duplicate(m, 1);
    if (copy && cJSON_AddItemToObject(to, m->string, copy)) continue;
    cJSON_Delete(copy);
    return pb_fail_memory(err, "result");
  }
  return PB_OK;
}

static void print_number(const cJSON *result, const char *key, const char *label,
                         const char *unit) {
  const cJSON *item = pb_json_member(result, key);
  if (cJSON_IsNumber(item))
    printf("%-16s %.6g%s%s\n", label, item->valuedouble, unit[0] ? " " : "", unit);
}

static void print_count(const cJSON *result, const char *key, const char *label) {
  const cJSON *item = pb_json_member(result, key);
  if (cJSON_IsNumber(item)) printf("%-16s %.0f\n", label, item->valuedouble);
}

static void print_result(const cJSON *result) {
  const cJSON *jump = pb_json_member(result, "output_jump");
  const cJSON *worst = pb_json_member(result, "worst_output");
  const cJSON *message = pb_json_member(result, "message");
  print_count(result, "revision", "revision");
  print_count(result, "step", "at step");
  print_count(result, "states", "states");
  print_number(result, "compile_seconds", "compiled in", "s");
  if (cJSON_IsNumber(jump) && cJSON_IsString(worst))
    printf("%-16s %.6g (%s)\n", "output jump", jump->valuedouble, worst->valuestring);
  else
    print_number(result, "output_jump", "output jump", "");
  print_number(result, "energy_before", "energy before", "J");
  print_number(result, "energy_after", "energy after", "J");
  if (cJSON_IsString(message)) printf("%s\n", message->valuestring);
}

// The event's word, and from the history what the reply could not know yet.
static pb_status add_swap(const configure_options *o, pb_session *session, pb_change *change,
                          pb_error *err) {
  cJSON *entry = NULL;
  const cJSON *revision = pb_json_member(change->result, "revision");
  pb_status status = PB_OK;
  if (!cJSON_AddStringToObject(change->result, "message", change->event.message) ||
      !cJSON_AddNumberToObject(change->result, "step", (double)change->event.step))
    status = pb_fail_memory(err, "result");
  if (!status)
    status = history_entry(o, session, cJSON_IsNumber(revision) ? revision->valuedouble : 0.0,
                           &entry, err);
  if (!status) status = fill_up(change->result, entry, err);
  cJSON_Delete(entry);
  return status;
}

static pb_status ask(const configure_options *o, pb_session *session, const char *kind,
                     const cJSON *body, pb_error *err) {
  const pb_change_options options = {.timeout = o->timeout > o->wait ? o->timeout : o->wait,
                                     .wait = o->wait,
                                     .interrupted = pb_interrupted};
  pb_change change = {0};
  pb_status status = pb_session_change(session, kind, body, &options, &change, err);
  if (!status && change.event.kind[0]) status = add_swap(o, session, &change, err);
  if (!status && o->json)
    status = pb_json_show(change.result, stdout, err);
  else if (!status)
    print_result(change.result);
  pb_change_clear(&change);
  return status;
}

// Under this name the change stands in events and in the history.
static bool add_name(cJSON *body) {
  char name[64];
  snprintf(name, sizeof name, "%.40s[%d]", program_invocation_short_name, (int)getpid());
  return cJSON_AddStringToObject(body, "name", name) != NULL;
}

static pb_status add_options(const configure_options *o, cJSON *body, pb_error *err) {
  if (!add_name(body)) return pb_fail_memory(err, "request");
  if (o->at_step_given && !cJSON_AddNumberToObject(body, "at_step", (double)o->at_step))
    return pb_fail_memory(err, "request");
  if (o->comment && !cJSON_AddStringToObject(body, "comment", o->comment))
    return pb_fail_memory(err, "request");
  return PB_OK;
}

static pb_status send_patch(const configure_options *o, pb_session *session, const cJSON *plant,
                            const cJSON *patch, pb_error *err) {
  if (o->dry_run) return dry_run(o, plant, patch, err);
  cJSON *body = cJSON_CreateObject();
  // A reference: the patch stays the caller's.
  bool good = body && cJSON_AddItemReferenceToObject(body, "patch", (cJSON *)patch);
  pb_status status = good ? add_options(o, body, err) : pb_fail_memory(err, "request");
  if (!status) status = ask(o, session, "configure", body, err);
  cJSON_Delete(body);
  return status;
}

// ---- commands -----------------------------------------------------------------------------------

// JSON, or what does not look like JSON as a string: a model's name needs no quotes.
static pb_status value_read(const char *text, cJSON **out, pb_error *err) {
  if (!pb_json_parse(text, strlen(text), out, err)) return PB_OK;
  if (text[0] == '{' || text[0] == '[' || text[0] == '"') return PB_ERR_SYNTAX;
  *out = cJSON_CreateString(text);
  return *out ? PB_OK : pb_fail_memory(err, "VALUE");
}

pb_status configure_set(const configure_options *o, pb_session *session, const cJSON *plant,
                        pb_error *err) {
  cJSON *value = NULL, *patch = NULL;
  pb_status status = value_read(o->second, &value, err);
  if (!status) status = pb_patch_make(plant, o->first, value, &patch, err);
  if (!status) status = send_patch(o, session, plant, patch, err);
  cJSON_Delete(patch);
  cJSON_Delete(value);
  return status;
}

pb_status configure_patch(const configure_options *o, pb_session *session, const cJSON *plant,
                          pb_error *err) {
  cJSON *patch = NULL;
  pb_status status = strcmp(o->first, "-") == 0
                         ? pb_json_stream(stdin, "standard input", &patch, err)
                         : pb_json_read(o->first, &patch, NULL, err);
  if (!status && !cJSON_IsObject(patch))
    status = pb_fail(err, PB_ERR_SYNTAX, o->first, "a merge patch is a JSON object");
  if (!status) status = send_patch(o, session, plant, patch, err);
  cJSON_Delete(patch);
  return status;
}

pb_status configure_revert(const configure_options *o, pb_session *session, pb_error *err) {
  uint64_t revision = 0;
  if (!pb_parse_uint64(o->first, &revision) || revision > UINT32_MAX)
    return pb_fail(err, PB_ERR_ARGUMENT, o->first, "is not the number of a revision");
  cJSON *body = cJSON_CreateObject();
  bool good = body && cJSON_AddNumberToObject(body, "revision", (double)revision);
  pb_status status = good ? add_options(o, body, err) : pb_fail_memory(err, "request");
  if (!status) status = ask(o, session, "revert", body, err);
  cJSON_Delete(body);
  return status;
}
