// Text files line by line: see lines.h.
//
// A number of up to 19 digits whose value and power of ten are exact doubles takes one
// multiplication or division, which rounds correctly (W. Clinger, "How to read floating point
// numbers accurately", 1990); all others go to strtod.
#include "part/lines.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { FIRST_CAPACITY = 1 << 16, LAST_CAPACITY = 1 << 28 };

pb_status pb_lines_open(pb_lines *in, const char *path, pb_error *err) {
  *in = (pb_lines){.path = path, .err = err};
  in->buffer = malloc(FIRST_CAPACITY);
  if (!in->buffer) return in->status = pb_fail_memory(err, path);
  in->capacity = FIRST_CAPACITY;
  in->stream = fopen(path, "rb");
  struct stat info;
  bool known = in->stream && !fstat(fileno(in->stream), &info);
  if (!known || S_ISDIR(info.st_mode)) {
    in->status =
        pb_fail(err, PB_ERR_IO, path, "cannot be read: %s", strerror(known ? EISDIR : errno));
    pb_lines_close(in);
    return in->status;
  }
  if (S_ISREG(info.st_mode)) in->bytes = (size_t)info.st_size;
  setvbuf(in->stream, NULL, _IONBF, 0);
  return PB_OK;
}

void pb_lines_close(pb_lines *in) {
  if (in->stream) fclose(in->stream);
  free(in->buffer);
  in->stream = NULL;
  in->buffer = in->text = NULL;
  in->begin = in->end = in->capacity = 0;
}

pb_status pb_lines_fail(pb_lines *in, const char *format, ...) {
  enum { NUMBER = 24 };
  char where[sizeof in->err->where], message[512];
  size_t length = strlen(in->path), most = sizeof where - NUMBER;  // of a long path its end
  snprintf(where, sizeof where, "%s:%zu", in->path + (length > most ? length - most : 0),
           in->number);
  va_list args;
  va_start(args, format);
  vsnprintf(message, sizeof message, format, args);
  va_end(args);
  return in->status = pb_fail(in->err, PB_ERR_SYNTAX, where, "%s", message);
}

// Moves what is left to the front, grows the buffer where a line fills it, and reads on.
static bool refill(pb_lines *in) {
  memmove(in->buffer, in->buffer + in->begin, in->end - in->begin);
  in->end -= in->begin;
  in->begin = 0;
  if (in->end + 1 >= in->capacity) {
    if (in->capacity >= LAST_CAPACITY) {
      in->number++;
      pb_lines_fail(in, "the line is longer than 256 MiB");
      return false;
    }
    char *larger = realloc(in->buffer, 2 * in->capacity);
    if (!larger) {
      in->status = pb_fail_memory(in->err, in->path);
      return false;
    }
    in->buffer = larger;
    in->capacity *= 2;
  }
  size_t got = fread(in->buffer + in->end, 1, in->capacity - 1 - in->end, in->stream);
  if (!got && ferror(in->stream)) {
    in->status = pb_fail(in->err, PB_ERR_IO, in->path, "cannot be read: %s", strerror(errno));
    return false;
  }
  in->ended = !got;
  in->end += got;
  return true;
}

bool pb_lines_next(pb_lines *in) {
  if (in->status || !in->stream) return false;
  if (in->again) {
    in->again = false;
    return true;
  }
  char *stop = NULL;
  for (size_t seen = in->begin;;) {
    if (in->end > seen) stop = memchr(in->buffer + seen, '\n', in->end - seen);
    if (stop || in->ended) break;
    size_t offset = in->end - in->begin;
    if (!refill(in)) return false;
    seen = in->begin + offset;
  }
  if (!stop && in->begin == in->end) return false;
  in->number++;
  in->text = in->buffer + in->begin;
  in->length = (stop ? (size_t)(stop - in->buffer) : in->end) - in->begin;
  in->begin += in->length + (stop != NULL);
  while (in->length && in->text[in->length - 1] == '\r') in->length--;
  in->text[in->length] = 0;
  if (memchr(in->text, 0, in->length)) {
    pb_lines_fail(in, "a NUL byte: this is not a text file, or it is damaged");
  } else if (!stop && !pb_scan_done(in->text)) {
    pb_lines_fail(in, "the file ends within a line, without a newline: it is truncated");
  }
  return !in->status;
}

bool pb_lines_next_filled(pb_lines *in) {
  while (pb_lines_next(in))
    if (!pb_scan_done(in->text)) return true;
  return false;
}

void pb_lines_back(pb_lines *in) {
  in->again = true;
}

// ---- numbers ------------------------------------------------------------------------------------

static char *skip_blanks(char *p) {
  while (*p == ' ' || *p == '\t') p++;
  return p;
}

static bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

static bool is_separator(char c) {
  return !c || c == ' ' || c == '\t' || c == ',' || c == ';' || c == '[' || c == ']' || c == ')';
}

bool pb_scan_integer(char **at, int64_t *out) {
  char *p = skip_blanks(*at);
  bool negative = *p == '-';
  if (*p == '-' || *p == '+') p++;
  if (!is_digit(*p)) return false;
  int64_t value = 0;
  for (; is_digit(*p); p++) {
    if (value > (INT64_MAX - 9) / 10) return false;
    value = 10 * value + (*p - '0');
  }
  if (!is_separator(*p)) return false;
  *out = negative ? -value : value;
  *at = p;
  return true;
}

typedef struct decimal {
  bool negative, exact;  // exact: all digits are in the mantissa
  uint64_t mantissa;
  int64_t power;  // of ten
} decimal;

// Sign, digits and point; false without any digit.
static bool read_mantissa(char **at, decimal *d) {
  char *p = *at;
  d->negative = *p == '-';
  if (*p == '-' || *p == '+') p++;
  int digits = 0, kept = 0;
  bool point = false;
  for (;; p++) {
    if (*p == '.' && !point) {
      point = true;
    } else if (is_digit(*p)) {
      digits++;
      if (kept < 19) {
        d->mantissa = 10 * d->mantissa + (uint64_t)(*p - '0');
        if (d->mantissa) kept++;
        d->power -= point;
      } else {
        d->exact &= *p == '0';
        d->power += !point;
      }
    } else {
      break;
    }
  }
  *at = p;
  return digits > 0;
}

static bool read_exponent(char **at, bool bare, decimal *d) {
  char *p = *at;
  bool letter = *p == 'e' || *p == 'E' || *p == 'd' || *p == 'D';
  if (!letter && !(bare && (*p == '-' || *p == '+'))) return true;
  if (letter) p++;
  bool negative = *p == '-';
  if (*p == '-' || *p == '+') p++;
  if (!is_digit(*p)) return false;
  int64_t value = 0;
  for (; is_digit(*p); p++)
    if (value < 100000) value = 10 * value + (*p - '0');
  d->power += negative ? -value : value;
  *at = p;
  return true;
}

// Digits beyond the 19th are lost on the fast path, so they are read again by strtod.
static double slow_value(const char *from, const char *to, bool bare) {
  char text[128];
  size_t n = 0;
  for (const char *p = from; p < to && n + 2 < sizeof text; p++) {
    bool letter = *p == 'd' || *p == 'D' || *p == 'e' || *p == 'E';
    bool sign = bare && p > from && (*p == '-' || *p == '+') && (is_digit(p[-1]) || p[-1] == '.');
    if (letter || sign) text[n++] = 'e';
    if (!letter) text[n++] = *p;
  }
  text[n] = 0;
  return strtod(text, NULL);
}

static bool scan_real(char **at, bool bare, double *out) {
  static const double power[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                 1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  char *begin = skip_blanks(*at), *p = begin;
  decimal d = {.exact = true};
  if (!read_mantissa(&p, &d) || !read_exponent(&p, bare, &d) || !is_separator(*p)) return false;
  if (p - begin > 100) return false;
  double value;
  if (!d.mantissa && d.exact) {
    value = d.negative ? -0.0 : 0.0;
  } else if (d.exact && d.mantissa <= UINT64_C(1) << 53 && d.power >= -22 && d.power <= 22) {
    value =
        d.power < 0 ? (double)d.mantissa / power[-d.power] : (double)d.mantissa * power[d.power];
    if (d.negative) value = -value;
  } else {
    value = slow_value(begin, p, bare);
  }
  if (!isfinite(value)) return false;
  *out = value;
  *at = p;
  return true;
}

bool pb_scan_real(char **at, double *out) {
  return scan_real(at, false, out);
}

bool pb_scan_real_bare(char **at, double *out) {
  return scan_real(at, true, out);
}

bool pb_scan_separator(char **at, const char *separators) {
  char *p = skip_blanks(*at);
  bool crossed = *p && strchr(separators, *p);
  if (crossed) p = skip_blanks(p + 1);
  *at = p;
  return *p || crossed;
}

bool pb_scan_done(const char *at) {
  while (*at == ' ' || *at == '\t' || *at == '\f') at++;
  return !*at;
}
