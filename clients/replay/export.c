// export: samples as CSV and MAT, and the plant file.
#include <string.h>

#include "outfile.h"
#include "replay.h"

static pb_status plant_write(const pb_recording *r, uint32_t revision, const char *path,
                             pb_error *err) {
  const pb_recorded_revision *v = revision ? pb_recording_revision(r, revision) : &r->revision[0];
  if (!v) return pb_fail(err, PB_ERR_REFERENCE, r->path, "has no revision %u", revision);
  if (!v->plant_text)
    return pb_fail(err, PB_ERR_STATE, r->path, "ends before the plant file of revision %u",
                   v->revision);
  if (!revision && r->revisions > 1)
    fprintf(stderr, "%s: warning: there are %zu revisions; %s is revision %u\n",
            program_invocation_short_name, r->revisions, path, v->revision);
  pb_outfile file;
  pb_status status = pb_outfile_open(path, &file, err);
  if (status) return status;
  fputs(v->plant_text, file.stream);
  return pb_outfile_close(&file, err);
}

pb_status command_export(const replay_options *o, const pb_recording *r, pb_error *err) {
  pb_status status = PB_OK;
  if (o->csv) status = pb_export_csv(r, &o->choice, o->csv, err);
  if (!status && o->mat) status = pb_export_mat(r, &o->choice, o->mat, err);
  if (!status && o->plant_out) status = plant_write(r, o->choice.revision, o->plant_out, err);
  return status;
}
