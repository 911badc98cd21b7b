// Result files that appear whole or not at all: see outfile.h.
#include "outfile.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static pb_status fail_errno(pb_error *err, const char *path, const char *what) {
  return pb_fail(err, PB_ERR_IO, path, "%s: %s", what, strerror(errno));
}

static bool is_special(const char *path) {
  struct stat info;
  return stat(path, &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode);
}

// mkstemp makes private files; a result has the permissions of any new file.
static int create_temp(char *temp) {
  int fd = mkstemp(temp);
  if (fd < 0) return -1;
  mode_t mask = umask(0);
  umask(mask);
  if (fchmod(fd, 0666 & ~mask) == 0) return fd;
  close(fd);
  unlink(temp);
  return -1;
}

pb_status pb_outfile_create(const char *path, pb_outfile *out, pb_error *err) {
  pb_outfile file = {.path = strdup(path), .direct = is_special(path)};
  *out = (pb_outfile){0};
  if (file.path && asprintf(&file.temp, file.direct ? "%s" : "%s.XXXXXX", path) < 0) {
    file.temp = NULL;
  }
  pb_status status = PB_OK;
  if (!file.path || !file.temp) {
    status = pb_fail_memory(err, path);
  } else if (!file.direct) {
    int fd = create_temp(file.temp);
    if (fd < 0) status = fail_errno(err, path, "cannot be created");
    if (fd >= 0) close(fd);
  }
  if (status) {
    free(file.path);
    free(file.temp);
    return status;
  }
  *out = file;
  return PB_OK;
}

pb_status pb_outfile_open(const char *path, pb_outfile *out, pb_error *err) {
  pb_status status = pb_outfile_create(path, out, err);
  if (status) return status;
  out->stream = fopen(out->temp, "w");
  if (out->stream) return PB_OK;
  status = fail_errno(err, path, "cannot be written");
  pb_outfile_discard(out);
  return status;
}

pb_status pb_outfile_close(pb_outfile *out, pb_error *err) {
  errno = 0;
  bool failed = ferror(out->stream) != 0;
  failed = fclose(out->stream) != 0 || failed;
  out->stream = NULL;
  if (!failed) return pb_outfile_commit(out, err);
  // An earlier write may be what failed: its reason is gone.
  pb_status status = errno ? fail_errno(err, out->path, "cannot be written")
                           : pb_fail(err, PB_ERR_IO, out->path, "cannot be written");
  pb_outfile_discard(out);
  return status;
}

pb_status pb_outfile_probe(const char *path, pb_error *err) {
  pb_outfile file;
  pb_status status = path ? pb_outfile_create(path, &file, err) : PB_OK;
  if (path && !status) pb_outfile_discard(&file);
  return status;
}

pb_status pb_outfile_commit(pb_outfile *out, pb_error *err) {
  pb_status status = PB_OK;
  if (!out->direct && rename(out->temp, out->path)) {
    status = fail_errno(err, out->path, "cannot be put in place");
    unlink(out->temp);
  }
  free(out->path);
  free(out->temp);
  *out = (pb_outfile){0};
  return status;
}

void pb_outfile_discard(pb_outfile *out) {
  if (out->stream) fclose(out->stream);
  if (out->temp && !out->direct) unlink(out->temp);
  free(out->path);
  free(out->temp);
  *out = (pb_outfile){0};
}
