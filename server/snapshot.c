// Layout and checks of snapshot files: see snapshot.h; snapshot_file.c moves the octets.
#include "snapshot.h"

#include <math.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "snapshot_file.h"

enum { VERSION = 1, HEADER = 160, DIGEST = 32, PIECES = 4, HEX = 64 };

// As of PNG: what passes for text is not a snapshot, nor what was converted as one.
static const unsigned char magic[8] = {0x89, 'P', 'B', 'S', '\r', '\n', 0x1a, '\n'};

static void put(unsigned char *at, uint64_t value, size_t octets) {
  for (size_t i = 0; i < octets; i++) at[i] = (unsigned char)(value >> 8 * i);
}

static uint64_t get(const unsigned char *at, size_t octets) {
  uint64_t value = 0;
  for (size_t i = 0; i < octets; i++) value |= (uint64_t)at[i] << 8 * i;
  return value;
}

static void put_words(unsigned char *at, const void *words, size_t octets) {
  for (size_t i = 0; i < octets; i += 8) {
    uint64_t word;
    memcpy(&word, (const char *)words + i, sizeof word);
    put(at + i, word, 8);
  }
}

static void get_words(const unsigned char *at, void *words, size_t octets) {
  for (size_t i = 0; i < octets; i += 8) {
    const uint64_t word = get(at + i, 8);
    memcpy((char *)words + i, &word, sizeof word);
  }
}

static bool digest(const void *data, size_t octets, unsigned char out[DIGEST]) {
  unsigned char full[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(data, octets, full, &length, EVP_sha256(), NULL) != 1 || length != DIGEST)
    return false;
  memcpy(out, full, DIGEST);
  return true;
}

// What every snapshot fulfils, written or read.
static const char *what_is_wrong(const pb_snapshot_data *data) {
  unsigned char sum[DIGEST];
  char hex[HEX + 1];
  if (!data->plant_text || !data->host_text || !data->state) return "has no plant, state or host";
  if (data->state_bytes % 8 || data->host_bytes % 8) return "has a state that is not in words";
  if (data->host_bytes > 0 && !data->host) return "has no state of the host";
  if (!isfinite(data->sample_rate) || !(data->sample_rate > 0)) return "has no sample rate";
  if (!digest(data->plant_text, strlen(data->plant_text), sum)) return "cannot be hashed";
  for (int i = 0; i < DIGEST; i++) snprintf(hex + 2 * i, 3, "%02x", sum[i]);
  if (strcmp(hex, data->plant_sha256) != 0) return "names another plant than it holds";
  return NULL;
}

// The whole file, *size octets owned by the caller, or NULL.
static unsigned char *encode(const pb_snapshot_data *data, size_t *size) {
  const size_t piece[PIECES] = {strlen(data->plant_text), data->state_bytes,
                                strlen(data->host_text), data->host_bytes};
  const uint64_t number[] = {data->step, data->hash, 0, data->nx, data->nu, data->ny};
  *size = HEADER + DIGEST;
  for (int i = 0; i < PIECES; i++) *size += piece[i];
  unsigned char *file = malloc(*size);
  if (!file) return NULL;
  memcpy(file, magic, sizeof magic);
  put(file + 8, VERSION, 4);
  put(file + 12, data->revision, 4);
  for (size_t i = 0; i < sizeof number / sizeof *number; i++) put(file + 16 + 8 * i, number[i], 8);
  put_words(file + 32, &data->sample_rate, 8);
  memcpy(file + 64, data->plant_sha256, HEX);
  for (size_t i = 0; i < PIECES; i++) put(file + 128 + 8 * i, piece[i], 8);
  unsigned char *at = file + HEADER;
  memcpy(at, data->plant_text, piece[0]);
  put_words(at += piece[0], data->state, piece[1]);
  memcpy(at += piece[1], data->host_text, piece[2]);
  put_words(at += piece[2], data->host, piece[3]);
  if (digest(file, *size - DIGEST, at + piece[3])) return file;
  free(file);
  return NULL;
}

pb_status pb_snapshot_write(const char *path, const pb_snapshot_data *data, pb_error *err) {
  const char *wrong = what_is_wrong(data);
  if (wrong) return pb_fail(err, PB_ERR_ARGUMENT, path, "the snapshot %s", wrong);
  size_t size;
  unsigned char *file = encode(data, &size);
  if (!file) return pb_fail_memory(err, path);
  const pb_status status = pb_snapshot_file_write(path, file, size, err);
  free(file);
  return status;
}

// Magic, version, lengths, checksum: in the order in which they tell most.
static pb_status check_frame(const char *path, const unsigned char *file, size_t size,
                             size_t piece[PIECES], pb_error *err) {
  if (size < sizeof magic || memcmp(file, magic, sizeof magic) != 0)
    return pb_fail(err, PB_ERR_SYNTAX, path, "is not a snapshot");
  if (size < HEADER + DIGEST) return pb_fail(err, PB_ERR_SYNTAX, path, "is truncated");
  const unsigned version = (unsigned)get(file + 8, 4);
  if (version != VERSION)
    return pb_fail(err, PB_ERR_SYNTAX, path, "is of version %u, expected %d", version, VERSION);
  size_t left = size - HEADER - DIGEST;
  for (size_t i = 0; i < PIECES; i++) {
    const uint64_t octets = get(file + 128 + 8 * i, 8);
    if (octets > left) return pb_fail(err, PB_ERR_SYNTAX, path, "is truncated");
    piece[i] = (size_t)octets;
    left -= piece[i];
  }
  if (left > 0) return pb_fail(err, PB_ERR_SYNTAX, path, "goes on after its end");
  unsigned char sum[DIGEST];
  if (!digest(file, size - DIGEST, sum)) return pb_fail(err, PB_ERR_IO, path, "cannot be hashed");
  if (memcmp(sum, file + size - DIGEST, DIGEST) != 0)
    return pb_fail(err, PB_ERR_SYNTAX, path, "is damaged: its SHA-256 is another");
  return PB_OK;
}

static char *text_take(const unsigned char *at, size_t octets) {
  char *text = malloc(octets + 1);
  if (!text) return NULL;
  memcpy(text, at, octets);
  text[octets] = '\0';
  return text;
}

static bool texts_whole(const pb_snapshot_data *data, const size_t piece[PIECES]) {
  return strlen(data->plant_text) == piece[0] && strlen(data->host_text) == piece[2];
}

static pb_status decode(const char *path, const unsigned char *file, const size_t piece[PIECES],
                        pb_snapshot_data *out, pb_error *err) {
  if (piece[1] % 8 || piece[3] % 8)
    return pb_fail(err, PB_ERR_SYNTAX, path, "has a state that is not in words");
  out->revision = (uint32_t)get(file + 12, 4);
  out->step = get(file + 16, 8);
  out->hash = get(file + 24, 8);
  get_words(file + 32, &out->sample_rate, 8);
  out->nx = get(file + 40, 8);
  out->nu = get(file + 48, 8);
  out->ny = get(file + 56, 8);
  memcpy(out->plant_sha256, file + 64, HEX);
  out->state_bytes = piece[1];
  out->host_bytes = piece[3];
  const unsigned char *at = file + HEADER;
  out->plant_text = text_take(at, piece[0]);
  out->state = malloc(piece[1] + 1);
  out->host_text = text_take(at + piece[0] + piece[1], piece[2]);
  out->host = malloc(piece[3] + 1);
  if (!out->plant_text || !out->state || !out->host_text || !out->host)
    return pb_fail_memory(err, path);
  get_words(at + piece[0], out->state, piece[1]);
  get_words(at + piece[0] + piece[1] + piece[2], out->host, piece[3]);
  const char *wrong = texts_whole(out, piece) ? what_is_wrong(out) : "has a text with a NUL in it";
  return wrong ? pb_fail(err, PB_ERR_SYNTAX, path, "%s", wrong) : PB_OK;
}

pb_status pb_snapshot_read(const char *path, pb_snapshot_data *out, pb_error *err) {
  unsigned char *file;
  size_t size, piece[PIECES];
  *out = (pb_snapshot_data){0};
  pb_status status = pb_snapshot_file_read(path, &file, &size, err);
  if (status) return status;
  status = check_frame(path, file, size, piece, err);
  if (!status) status = decode(path, file, piece, out, err);
  if (status) pb_snapshot_clear(out);
  free(file);
  return status;
}

pb_status pb_snapshot_check(const pb_snapshot_data *data, const pb_model *model, pb_error *err) {
  if (data->sample_rate != model->sample_rate)
    return pb_fail(err, PB_ERR_STATE, "snapshot", "is of a plant at %.12g Hz, this one is at %.12g",
                   data->sample_rate, model->sample_rate);
  if (data->nx != model->nx || data->nu != model->nu || data->ny != model->ny)
    return pb_fail(err, PB_ERR_STATE, "snapshot",
                   "is of a plant with %llu states, %llu inputs, %llu outputs, this one has %zu, "
                   "%zu, %zu",
                   (unsigned long long)data->nx, (unsigned long long)data->nu,
                   (unsigned long long)data->ny, model->nx, model->nu, model->ny);
  const pb_state *state = data->state;
  if (data->state_bytes != pb_state_bytes(model) || state->nx != model->nx ||
      state->nu != model->nu || state->step != data->step)
    return pb_fail(err, PB_ERR_STATE, "snapshot", "holds a state of another form");
  return PB_OK;
}

void pb_snapshot_clear(pb_snapshot_data *data) {
  if (!data) return;
  free(data->plant_text);
  free(data->state);
  free(data->host_text);
  free(data->host);
  *data = (pb_snapshot_data){0};
}

bool pb_snapshot_name_valid(const char *name) {
  static const char allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  const size_t length = strlen(name);
  return length >= 1 && length <= 100 && name[0] != '.' && strspn(name, allowed) == length;
}
