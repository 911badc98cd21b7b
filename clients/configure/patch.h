// From "this value at this place" to a merge patch (RFC 7396). Pure: no bus, no files.
//
// A merge patch names members of objects only. A place inside an array is therefore sent as the
// whole outermost array, taken from the present document with that element replaced. An object put
// in an object's place would be merged with it: members that the new one does not have are named
// with null, so that it takes the place of the old one.
#ifndef PB_CLIENTS_CONFIGURE_PATCH_H
#define PB_CLIENTS_CONFIGURE_PATCH_H

#include <cjson/cJSON.h>

#include "base/status.h"

// The value at a JSON pointer (RFC 6901; "" is the whole; the first / may be missing). The
// value belongs to the document. Fails with PB_ERR_REFERENCE, naming the first part of the pointer
// that is not there, or PB_ERR_ARGUMENT (an escape that is not ~0 or ~1, too long). [any]
pb_status pb_pointer_find(const cJSON *document, const char *pointer, const cJSON **out,
                          pb_error *err);

// The merge patch after which `value` stands at the pointer. Objects on the way that are not there
// are made (a template's "/components/strut3/k_1" is not in the file before it is changed); the
// last part may be "-" or the length of an array to append. value null removes a member, whose
// parents must be there. *out is owned by the caller (cJSON_Delete). Fails as pb_pointer_find, with
// PB_ERR_ARGUMENT (the whole document; a null inside an object, which a merge patch cannot say) and
// PB_ERR_MEMORY. [init]
pb_status pb_patch_make(const cJSON *document, const char *pointer, const cJSON *value, cJSON **out,
                        pb_error *err);

#endif
