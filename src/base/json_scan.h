// The lexical rules of JSON that cJSON is lax about.
#ifndef PB_BASE_JSON_SCAN_H
#define PB_BASE_JSON_SCAN_H

// The first place in a terminated text that breaks a rule, and what is wrong with it; NULL: none.
// Checked: strings are UTF-8 without control characters and without \u0000 (which would end a C
// string early), numbers have no leading zeros and digits on both sides of their point. The rest is
// the parser's. [any]
const char *pb_json_scan(const char *text, const char **what);

#endif
