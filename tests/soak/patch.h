// The changes of the plant that the soak asks for: the model of the six bottom or of the six top
// joints becomes springs, or an element read from a file beside the plant file. With one number in
// each that is drawn, no change leaves the plant as it was.
#ifndef PB_TESTS_SOAK_PATCH_H
#define PB_TESTS_SOAK_PATCH_H

#include <stdio.h>

#define SOAK_ELEMENT "joint.mat"

enum { SOAK_PATCHES = 4, SOAK_PATCH_TEXT = 320 };

// Patch `index` with a number u from 0 to 1 into text [SOAK_PATCH_TEXT].
static inline void soak_patch(int index, double u, char *text) {
  const char *const joint = index % 2 ? "top" : "bottom";
  if (index < 2)
    snprintf(text, SOAK_PATCH_TEXT,
             "{\"models\":{\"%s\":{\"type\":\"super_element\",\"file\":\"" SOAK_ELEMENT
             "\",\"nodes\":[1,3],\"modal_damping\":%.6g,\"k_f\":null,\"k_t\":null,\"k_a\":null}}}",
             joint, 0.005 + 0.01 * u);
  else
    snprintf(text, SOAK_PATCH_TEXT,
             "{\"models\":{\"%s\":{\"type\":\"%s\",\"k_f\":%.6g,%s\"k_a\":94e6,\"file\":null,"
             "\"nodes\":null,\"modal_damping\":null}}}",
             joint, index % 2 ? "spherical_axial" : "universal_axial", 4.0 + u,
             index % 2 ? "\"k_t\":260," : "");
}

#endif
