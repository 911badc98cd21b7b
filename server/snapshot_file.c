// See snapshot_file.h.
#include "snapshot_file.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"

static const size_t largest_file = (size_t)1 << 31;

static pb_status fail_errno(pb_error *err, const char *path, const char *what) {
  return pb_fail(err, PB_ERR_IO, path, "%s: %s", what, strerror(errno));
}

static bool write_all(int fd, const unsigned char *data, size_t size) {
  while (size > 0) {
    const ssize_t n = write(fd, data, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    data += n;
    size -= (size_t)n;
  }
  return true;
}

// The new name itself is on the disk once its directory is.
static bool sync_directory(const char *path) {
  char *copy = pb_text_copy(path);
  const int fd = copy ? open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
  free(copy);
  if (fd < 0) return false;
  const bool done = fsync(fd) == 0;
  close(fd);
  return done;
}

// Creates and fills a new file; false with errno, and then there is none.
static bool new_file_write(const char *name, const unsigned char *data, size_t size) {
  const int fd = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (fd < 0) return false;
  bool done = write_all(fd, data, size) && fsync(fd) == 0;
  int reason = errno;
  if (close(fd) != 0 && done) {
    done = false;
    reason = errno;
  }
  if (!done) unlink(name);
  errno = reason;
  return done;
}

// Beside path under a name that is free: of another writer, or left by one that was killed.
static bool temp_write(const char *path, char *temp, size_t room, const unsigned char *data,
                       size_t size) {
  for (int attempt = 0; attempt < 1000; attempt++) {
    snprintf(temp, room, "%s.%03d", path, attempt);
    if (new_file_write(temp, data, size)) return true;
    if (errno != EEXIST) return false;
  }
  return false;
}

pb_status pb_snapshot_file_write(const char *path, const unsigned char *data, size_t size,
                                 pb_error *err) {
  if (size > largest_file) return pb_fail(err, PB_ERR_ARGUMENT, path, "is larger than 2 GiB");
  const size_t room = strlen(path) + 8;
  char *temp = malloc(room);
  if (!temp) return pb_fail_memory(err, path);
  pb_status status = PB_OK;
  if (!temp_write(path, temp, room, data, size)) {
    status = fail_errno(err, path, "cannot be written");
  } else if (rename(temp, path) != 0) {
    status = fail_errno(err, path, "cannot be put in place");
    unlink(temp);
  } else if (!sync_directory(path)) {
    status = fail_errno(err, path, "is written, but its directory is not on the disk");
  }
  free(temp);
  return status;
}

static pb_status read_all(const char *path, int fd, unsigned char *data, size_t size,
                          pb_error *err) {
  size_t have = 0;
  while (have < size) {
    const ssize_t n = read(fd, data + have, size - have);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return fail_errno(err, path, "cannot be read");
    if (n == 0) return pb_fail(err, PB_ERR_IO, path, "became shorter while it was read");
    have += (size_t)n;
  }
  return PB_OK;
}

pb_status pb_snapshot_file_read(const char *path, unsigned char **data, size_t *size,
                                pb_error *err) {
  *data = NULL;
  *size = 0;
  const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe would wait for a writer
  if (fd < 0) return fail_errno(err, path, "cannot be opened");
  struct stat info;
  pb_status status = PB_OK;
  unsigned char *octets = NULL;
  if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) {
    status = pb_fail(err, PB_ERR_IO, path, "is not a regular file");
  } else if ((uint64_t)info.st_size > largest_file) {
    status = pb_fail(err, PB_ERR_IO, path, "is larger than 2 GiB");
  } else if (!(octets = malloc((size_t)info.st_size + 1))) {
    status = pb_fail_memory(err, path);
  } else {
    status = read_all(path, fd, octets, (size_t)info.st_size, err);
  }
  close(fd);
  if (status) {
    free(octets);
    return status;
  }
  *data = octets;
  *size = (size_t)info.st_size;
  return PB_OK;
}
