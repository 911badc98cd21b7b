// What the readers of Ansys listings and of plain tables share.
#ifndef PB_PART_LISTING_H
#define PB_PART_LISTING_H

#include <string.h>

#include "part/lines.h"

// Splits off the words of a line; returns how many there are, at most `most`.
static inline int pb_listing_words(const char *text, char word[][12], int most) {
  int count = 0;
  while (count < most) {
    text += strspn(text, " \t");
    size_t length = strcspn(text, " \t");
    if (!length) break;
    snprintf(word[count++], 12, "%.*s", (int)(length < 11 ? length : 11), text);
    text += length;
  }
  return count;
}

// A row of a page: neither the blank line behind it nor the banner of the next page.
static inline bool pb_listing_row(const pb_lines *in) {
  return !pb_scan_done(in->text) && strncmp(in->text, " ***", 4);
}

// A first line without any number may be a header.
static inline bool pb_listing_title(const pb_lines *in) {
  return in->number == 1 && !strpbrk(in->text, "0123456789");
}

#endif
