// plantbus-study: what its files share.
#ifndef PB_CLIENTS_STUDY_H
#define PB_CLIENTS_STUDY_H

#include "results.h"
#include "study/point.h"
#include "study/variation.h"

// The command line.
typedef struct study_options {
  pb_study_kind kind;
  const char *plant_path;
  pb_name_list values;           // as given; empty: the study's own
  pb_name_list models;           // "NAME=JSON" or "NAME=@FILE", added to the file's models
  pb_joint_stiffness stiffness;  // NaN: as the plant's joints have it
  pb_study_options point;
  size_t workers;  // processes on this host; 0: one a core
  pb_result_options result;
  bool live;  // on a running daemon
  pb_common_options common;
  double patience;  // live: seconds that a change may take
} study_options;

// The points to compute and what came of them.
typedef struct study {
  const study_options *options;
  cJSON *file;        // the plant file, with the models added
  char *directory;    // of element files
  const char *plant;  // its name
  size_t count;
  char **label;           // [count] values as text, owned
  double *value;          // [count] NaN: a name
  pb_study_point *point;  // [count]
} study;

// Reads the plant file, adds models, checks the values; a default value that this plant cannot have
// is left out with a warning on stderr. [init]
pb_status study_open(const study_options *options, study *out, pb_error *err);
void study_close(study *s);

// Adds "NAME=JSON" or "NAME=@FILE" to the models of a plant file. [init] PB_ERR_ARGUMENT,
// PB_ERR_SYNTAX, PB_ERR_IO, PB_ERR_MEMORY.
pb_status study_add_model(cJSON *file, const char *text, pb_error *err);

// One point, by itself: the same bits wherever it is computed. [init]
pb_status study_compute(const study *s, size_t index, pb_study_point *out, pb_error *err);

// All points: on this host's cores, and across the processes of mpirun where there are any. Only
// the first of these processes has the results afterwards. [init]
pb_status study_run(study *s, pb_error *err);

// Tables or JSON on stdout.
pb_status study_print(const study *s, pb_error *err);
pb_status study_print_json(const study *s, pb_error *err);

// study-KIND.csv, study-KIND-frf.csv, study-KIND-locus.csv, study-KIND.mat in a directory.
pb_status study_save(const study *s, const char *dir, pb_error *err);

// study-KIND-hac.png, -iff.png, -locus.png, -rga.png, -damping.png in a directory.
pb_status study_plot(const study *s, const char *dir, pb_error *err);

// The study's plants one after the other on a running daemon: changed, identified, compared with
// what the plant file says; the daemon gets its plant back. Prints its own report. [init]
pb_status study_live(const study_options *options, pb_error *err);

#endif
