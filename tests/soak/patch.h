// The changes of the plant that the soak asks for: the model of the six bottom or of the six top
// joints becomes springs, or an element read from a file beside the plant file.
#ifndef PB_TESTS_SOAK_PATCH_H
#define PB_TESTS_SOAK_PATCH_H

#define SOAK_ELEMENT "joint.mat"

static const char *const soak_patch[] = {
    "{\"models\":{\"bottom\":{\"type\":\"super_element\",\"file\":\"" SOAK_ELEMENT
    "\",\"nodes\":[1,3],\"modal_damping\":0.01,\"k_f\":null,\"k_a\":null}}}",
    "{\"models\":{\"top\":{\"type\":\"super_element\",\"file\":\"" SOAK_ELEMENT
    "\",\"nodes\":[1,3],\"modal_damping\":0.01,\"k_f\":null,\"k_t\":null,\"k_a\":null}}}",
    "{\"models\":{\"bottom\":{\"type\":\"universal_axial\",\"k_f\":4.83,\"k_a\":94e6,"
    "\"file\":null,\"nodes\":null,\"modal_damping\":null}}}",
    "{\"models\":{\"top\":{\"type\":\"spherical_axial\",\"k_f\":4.83,\"k_t\":260,\"k_a\":94e6,"
    "\"file\":null,\"nodes\":null,\"modal_damping\":null}}}",
};
enum { SOAK_PATCHES = sizeof soak_patch / sizeof *soak_patch };

#endif
