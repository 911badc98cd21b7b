// Between the parts of the plant loader: reading components, joints and signals, expanding
// templates.
#ifndef PB_PLANT_LOADER_H
#define PB_PLANT_LOADER_H

#include "plant/plant.h"
#include "plant/reader.h"

// What every part of the loader needs: models, where element files are, and elements already read.
typedef struct pb_loader {
  const cJSON *models;    // may be NULL
  const char *directory;  // of relative element paths
  pb_warnings *warnings;
  pb_error *err;
  pb_element_store *store;  // of earlier plants' elements; may be NULL
  size_t element_count;
  pb_element **element;  // one user each; files are read once
} pb_loader;

// The element of the reader's key "file", loaded once per file; one more user for the caller.
pb_status pb_loader_element(pb_loader *loader, const pb_reader *r, pb_element **out);

// Damping keys of a super-element ("modal_damping", "rayleigh") into *super.
pb_status pb_loader_damping(const pb_reader *r, pb_super_element *super);

// Orientation keys of a component or connection into a rotation (column-major 3 × 3).
// *given tells whether there were any; without, the rotation is the identity.
pb_status pb_loader_orientation(const pb_reader *r, double rotation[9], bool *given);

// Check a model by itself, as far as its type is one of theirs (*known): its keys and numbers; what
// is missing may come from the object that names the model.
pb_status pb_loader_check_component_model(const pb_reader *r, const char *type, bool *known);
pb_status pb_loader_check_joint_model(const pb_reader *r, const char *type, bool *known);

// Fills *out (zeroed by the caller) from the component `name`; on failure what was allocated stays
// in *out for pb_component_clear.
pb_status pb_loader_component(pb_loader *loader, const cJSON *object, const char *name,
                              pb_component *out);
void pb_component_clear(pb_component *component);

// Fills *out from the connection `name`; component names are looked up in plant.
pb_status pb_loader_connection(pb_loader *loader, const cJSON *object, const char *name,
                               const pb_plant *plant, pb_connection *out);
void pb_connection_clear(pb_connection *connection);

// "component.frame", "component" or "ground" into an anchor.
pb_status pb_loader_anchor(const pb_reader *r, const char *key, const pb_plant *plant,
                           pb_anchor *out);

// Fills *out from a signal of "inputs" or "outputs".
pb_status pb_loader_signal(pb_loader *loader, const cJSON *object, const char *pointer,
                           bool is_input, const pb_plant *plant, pb_port *out);
void pb_port_clear(pb_port *port);

// Reads an "electronics" object, of an input or of an output. Fails with PB_ERR_SCHEMA.
pb_status pb_loader_electronics(const cJSON *object, const char *pointer, bool is_input,
                                pb_electronics *out, pb_error *err);

// Expands "template": *out is a copy of the plant file's object with the template's components,
// connections and signals, changed by the file's own entries of the same name; without a template,
// a plain copy.
pb_status pb_loader_expand(const cJSON *file, cJSON **out, pb_error *err);

#endif
