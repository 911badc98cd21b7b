// Lines of text that fit a terminal: see screen.h.
#include "screen.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static bool full(const screen *s) {
  return s->height > 0 && s->row >= s->height;
}

// Length of a control character at p (also those of two octets, U+0080 to U+009F); 0: it is none.
static size_t control(const char *p) {
  const unsigned char c = (unsigned char)p[0], next = c ? (unsigned char)p[1] : 0;
  if (c < ' ' || c == 0x7f) return 1;
  return c == 0xc2 && next >= 0x80 && next < 0xa0 ? 2 : 0;
}

static void put_text(screen *s, const char *text) {
  for (const char *p = text; *p;) {
    const size_t bad = control(p);
    const bool inside = ((unsigned char)*p & 0xc0) == 0x80;  // of a character that is begun
    if (!inside && s->width > 0 && s->column >= s->width) return;
    pb_text_append_n(&s->text, bad ? "?" : p, 1);
    s->column += !inside;
    p += bad ? bad : 1;
  }
}

// A line is erased before it is written: behind a line of the full width the cursor still stands on
// its last character.
static void begin(screen *s) {
  if (s->terminal && !s->begun) pb_text_append(&s->text, "\033[K");
  s->begun = true;
}

void screen_put(screen *s, screen_style style, const char *format, ...) {
  static const char *const code[] = {"", "\033[1m", "\033[2m", "\033[33m", "\033[1;31m"};
  char text[1024];
  va_list arguments;
  if (full(s)) return;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  begin(s);
  const bool styled = s->terminal && style != SCREEN_PLAIN;
  const bool coloured = style == SCREEN_WARN || style == SCREEN_ALARM;
  if (styled) pb_text_append(&s->text, code[s->plain && coloured ? SCREEN_BOLD : style]);
  put_text(s, text);
  if (styled) pb_text_append(&s->text, "\033[0m");
}

// Characters of a text, as put_text counts them.
static size_t characters(const char *text, size_t length) {
  size_t count = 0;
  for (size_t i = 0; i < length; i++) count += ((unsigned char)text[i] & 0xc0) != 0x80;
  return count;
}

void screen_flow(screen *s, screen_style style, size_t indent, const char *format, ...) {
  char text[1024];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  for (const char *p = text; *p;) {
    const size_t blanks = strspn(p, " "), length = strcspn(p + blanks, " ");
    const size_t needed = s->column + blanks + characters(p + blanks, length);
    if (s->width > 0 && needed > s->width && s->column > indent) {
      screen_line(s);
      screen_put(s, SCREEN_PLAIN, "%*s", (int)indent, "");
      p += blanks;
    } else {
      screen_put(s, style, "%.*s", (int)(blanks + length), p);
      p += blanks + length;
    }
  }
}

void screen_to(screen *s, size_t column) {
  do {
    screen_put(s, SCREEN_PLAIN, " ");
  } while (!full(s) && s->column < column && !(s->width > 0 && s->column >= s->width));
}

void screen_line(screen *s) {
  if (full(s)) {
    s->left_out++;
    return;
  }
  begin(s);
  s->begun = false;
  s->row++;
  s->column = 0;
  // The last line of a terminal ends without a new one, which would scroll.
  if (!full(s)) pb_text_append(&s->text, s->terminal ? "\r\n" : "\n");
}
