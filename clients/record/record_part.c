// The files of a recording: their names, beginnings and ends, and what is due now and then.
#include <errno.h>
#include <libgen.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "bus_schema.h"
#include "recorder_internal.h"
#include "recording.h"

static const int64_t flush_ns = 1000000000;  // a recorder that is killed loses no more than this

bool record_part_path(const char *path, uint32_t part, char *text, size_t size) {
  const char *slash = strrchr(path, '/'), *dot = strrchr(path, '.');
  if (!dot || dot == path || (slash && dot <= slash + 1)) dot = path + strlen(path);
  const int written = part == 1
                          ? snprintf(text, size, "%s", path)
                          : snprintf(text, size, "%.*s-%u%s", (int)(dot - path), path, part, dot);
  return written >= 0 && (size_t)written < size;
}

// ---- begin --------------------------------------------------------------------------------------

static pb_status channels_create(recorder *r, pb_error *err) {
  const pb_mcap_pair metadata[] = {{"plant", r->report->plant}};
  pb_status status = PB_OK;
  for (int i = 0; i < RECORD_TOPICS && !status; i++) {
    record_topic *t = &r->topic[i];
    char type[64];
    uint16_t schema;
    if (!t->reader) continue;
    t->sequence = 0;
    snprintf(type, sizeof type, "plantbus::%s", t->type);
    status = pb_mcap_writer_schema(r->part.writer, type, "omgidl", pb_bus_schema, &schema, err);
    if (!status)
      status = pb_mcap_writer_channel(r->part.writer, schema, pb_topic_name(t->recorded), "cdr",
                                      metadata, 1, &t->channel, err);
  }
  return status;
}

pb_status record_part_begin(recorder *r, pb_error *err) {
  const record_options *o = r->options;
  record_part *p = &r->part;
  const pb_mcap_writer_options options = {
      .library = "plantbus " PB_VERSION, .compression = o->compression, .exclusive = !o->force};
  p->revisions = 0;
  if (!record_part_path(o->path, p->number, p->path, sizeof p->path))
    return pb_fail(err, PB_ERR_ARGUMENT, o->path, "the path is too long");
  if (!o->force && access(p->path, F_OK) == 0)
    return pb_fail(err, PB_ERR_IO, p->path, "is there already: name another file, or --force");
  pb_status status = pb_mcap_writer_create(p->path, &options, &p->writer, err);
  if (!status) r->report->files = p->number;
  if (!status) status = channels_create(r, err);
  return status;
}

// ---- end ----------------------------------------------------------------------------------------

static pb_status summary_write(recorder *r, pb_error *err) {
  static const char *const end[] = {"limit", "interrupted", "daemon gone", "disk full"};
  const bool last = r->done || r->report->end != RECORD_END_LIMIT;
  return pb_recording_end_write(r->part.writer, &r->part.spans, r->report->plant, r->part.number,
                                last ? end[r->report->end] : "next part", err);
}

pb_status record_part_end(recorder *r, pb_error *err) {
  record_part *p = &r->part;
  struct stat info;
  pb_status status = summary_write(r, err);
  if (!status && r->options->sync > 0.0) status = pb_mcap_writer_sync(p->writer, err);
  if (status) return status;
  status = pb_mcap_writer_close(p->writer, err);
  p->writer = NULL;
  pb_spans_free(&p->spans);
  if (!status && stat(p->path, &info) == 0) r->report->bytes += (uint64_t)info.st_size;
  return status;
}

pb_status record_part_next(recorder *r, pb_error *err) {
  pb_status status = record_part_end(r, err);
  r->part.number++;
  if (!status) status = record_part_begin(r, err);
  return status ? status : record_describe_again(r, err);
}

bool record_part_full(const recorder *r) {
  const record_options *o = r->options;
  const pb_spans *s = &r->part.spans;
  if (s->samples == 0) return false;
  return (o->split_bytes > 0 && pb_mcap_writer_bytes(r->part.writer) >= o->split_bytes) ||
         (o->split_seconds > 0.0 && pb_spans_seconds(s, r->report->sample_rate) >=
                                        o->split_seconds - 0.5 / r->report->sample_rate);
}

// ---- now and then -------------------------------------------------------------------------------

// Its own file takes the space: looked at before the disk is full, so that the end still fits.
static pb_status space_check(recorder *r, pb_error *err) {
  char directory[sizeof r->part.path];
  struct statvfs disk;
  if (r->options->min_free == 0) return PB_OK;
  memcpy(directory, r->part.path, sizeof directory);
  if (statvfs(dirname(directory), &disk) != 0)
    return pb_fail(err, PB_ERR_IO, r->part.path, "its disk does not tell what is free: %s",
                   strerror(errno));
  if ((uint64_t)disk.f_bavail * disk.f_frsize >= r->options->min_free) return PB_OK;
  r->report->end = RECORD_END_SPACE;
  r->done = true;
  return PB_OK;
}

pb_status record_part_tend(recorder *r, pb_error *err) {
  const int64_t now = record_clock();
  if (now - r->flushed <= flush_ns) return PB_OK;
  const double sync = r->options->sync;
  const bool sync_due = sync > 0.0 && (double)(now - r->synced) * 1e-9 >= sync;
  const pb_status status = sync_due ? pb_mcap_writer_sync(r->part.writer, err)
                                    : pb_mcap_writer_flush(r->part.writer, err);
  r->flushed = now;
  if (sync_due) r->synced = now;
  return status ? status : space_check(r, err);
}
