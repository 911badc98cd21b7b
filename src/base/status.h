// Status codes, errors and warnings of the library.
//
// Every fallible function returns a pb_status and takes a pb_error last. On failure its arguments
// and the caller's state are unchanged and its outputs are empty. The library never prints or
// exits: what it has to say reaches the caller in a pb_error (one, fatal) or a pb_warnings (many,
// not fatal).
#ifndef PB_BASE_STATUS_H
#define PB_BASE_STATUS_H

#include <stdarg.h>
#include <stddef.h>

// name, short text; the enum, pb_status_name and pb_status_text all come from this one list.
#define PB_STATUS_LIST(X)                                                       \
  X(OK, "no error")                                                             \
  X(ERR_MEMORY, "out of memory")                                                \
  X(ERR_IO, "a file cannot be read or written")                                 \
  X(ERR_SYNTAX, "the text is not well-formed")                                  \
  X(ERR_SCHEMA, "a key is unknown, missing, of the wrong type or out of range") \
  X(ERR_REFERENCE, "a name refers to nothing")                                  \
  X(ERR_GEOMETRY, "the geometry does not close")                                \
  X(ERR_ELEMENT, "an element's matrices are not usable")                        \
  X(ERR_SINGULAR, "the equations are singular")                                 \
  X(ERR_NUMERIC, "a numerical method did not converge")                         \
  X(ERR_ARGUMENT, "an argument is out of range")                                \
  X(ERR_STATE, "not possible in the present state")

typedef enum pb_status {
#define PB_STATUS_ENUM(name, text) PB_##name,
  PB_STATUS_LIST(PB_STATUS_ENUM)
#undef PB_STATUS_ENUM
} pb_status;

typedef struct pb_error {
  pb_status code;
  char where[256];    // JSON pointer, file name or object name of the offender; may be empty
  char message[512];  // what is wrong and what was expected, one sentence without a full stop
} pb_error;

typedef struct pb_warning {
  char where[256];
  char message[512];
} pb_warning;

// A growing list of warnings. Zero-initialise, hand to library calls, free with pb_warnings_clear.
typedef struct pb_warnings {
  size_t count, capacity;
  pb_warning *item;
  struct pb_warnings
      *notes;  // where remarks that warn of nothing go, as the health of each element
               // that is read; NULL: they are not made. The caller's own list
} pb_warnings;

// Name ("ERR_SCHEMA") and explanation of a status; never NULL. [any]
const char *pb_status_name(pb_status code);
const char *pb_status_text(pb_status code);

// Fills *err (when not NULL) and returns code, so that a caller can `return pb_fail(...)`. [any]
pb_status pb_fail(pb_error *err, pb_status code, const char *where, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

// Same as pb_fail(err, PB_ERR_MEMORY, where, …); for the commonest failure. [any]
pb_status pb_fail_memory(pb_error *err, const char *where);

// Appends a warning; list may be NULL (then nothing is kept). Fails with PB_ERR_MEMORY. [init]
pb_status pb_warn(pb_warnings *list, pb_error *err, const char *where, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

// Frees the items; the list can be used again. [init]
void pb_warnings_clear(pb_warnings *list);

// "where: message" (or the message alone) into text, always terminated. [any]
void pb_error_format(const pb_error *err, char *text, size_t size);

#endif
