// Lexical rules of JSON (RFC 8259): see json_scan.h.
#include "base/json_scan.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

// Length of the UTF-8 sequence at s, 0 where it is none: RFC 3629 knows no overlong forms, no
// surrogates and nothing above U+10FFFF.
static size_t utf8_length(const char *s) {
  const unsigned char *u = (const unsigned char *)s;
  size_t n = u[0] < 0x80                   ? 1
             : u[0] >= 0xc2 && u[0] < 0xe0 ? 2
             : u[0] >= 0xe0 && u[0] < 0xf0 ? 3
                                           : 4;
  if ((u[0] >= 0x80 && u[0] < 0xc2) || u[0] > 0xf4) return 0;
  for (size_t i = 1; i < n; i++)
    if ((u[i] & 0xc0) != 0x80) return 0;
  if ((u[0] == 0xe0 && u[1] < 0xa0) || (u[0] == 0xed && u[1] > 0x9f)) return 0;
  if ((u[0] == 0xf0 && u[1] < 0x90) || (u[0] == 0xf4 && u[1] > 0x8f)) return 0;
  return n;
}

// s is behind the opening quote; returns the closing one (or the end of the text), or the offence.
static const char *scan_string(const char *s, const char **what) {
  while (*s && *s != '"') {
    size_t n = utf8_length(s);
    if ((unsigned char)*s < 0x20) {
      *what = "a control character in a string";
    } else if (n == 0) {
      *what = "a string that is not UTF-8";
    } else if (!strncmp(s, "\\u0000", 6)) {
      *what = "a NUL character in a string";
    }
    if (*what) break;
    s += *s == '\\' && s[1] ? 2 : n;
  }
  return s;
}

static const char *skip_digits(const char *s) {
  return s + strspn(s, "0123456789");
}

// Returns the end of the number that starts at s.
static const char *scan_number(const char *s, const char **what) {
  const char *digits = s + (*s == '-'), *end = skip_digits(digits);
  bool ok = end > digits && (*digits != '0' || end == digits + 1);
  if (*end == '.') {
    const char *fraction = end + 1;
    end = skip_digits(fraction);
    ok = ok && end > fraction;
  }
  if (*end == 'e' || *end == 'E') {
    const char *exponent = end + 1 + (end[1] == '-' || end[1] == '+');
    end = skip_digits(exponent);
    ok = ok && end > exponent;
  }
  if (!ok) *what = "a number that is not written as JSON wants it";
  return ok ? end : s;
}

const char *pb_json_scan(const char *text, const char **what) {
  *what = NULL;
  const char *s = text;
  while (*s && !*what) {
    if (*s == '"') {
      s = scan_string(s + 1, what);
      if (!*what && *s) s++;
    } else if (*s == '-' || (*s >= '0' && *s <= '9')) {
      s = scan_number(s, what);
    } else {
      s++;
    }
  }
  return *what ? s : NULL;
}
