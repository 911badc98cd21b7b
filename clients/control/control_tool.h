// plantbus-control: what its files share.
#ifndef PB_CONTROL_TOOL_H
#define PB_CONTROL_TOOL_H

#include <cjson/cJSON.h>

#include "control/hac.h"
#include "control/margins.h"
#include "frf_files.h"
#include "iff_tool.h"
#include "jsonout.h"
#include "matfile.h"

typedef enum jacobian_source { JACOBIAN_AUTO, JACOBIAN_GEOMETRY, JACOBIAN_STATIC } jacobian_source;

// The plant of iff and hac: one of the two.
typedef struct control_source {
  const char *file;  // NULL: the plant on the bus
  bool live;
} control_source;

extern const struct argp control_source_argp;  // argp child; its input is a control_source

// The command line of hac and run.
typedef struct control_options {
  iff_options iff;        // bus, excitation, low authority loops (sensors: outputs), files
  control_source source;  // hac
  bool no_iff;            // HAC alone
  bool cartesian;         // frame
  double bandwidth_hz;    // 0: not given
  double lead;            // −1: default, as the next two
  double integrator_hz;
  double lowpass_hz;
  jacobian_source jacobian;
  pb_name_list metrology, motion, disturbance;  // empty: by name
  bool hosted;  // run: the daemon runs HAC too, instead of this client
  bool keep;    // run: leave the controllers where they run
} control_options;

extern const struct argp control_argp;  // its input is a control_options
void control_options_default(control_options *options);
void control_options_free(control_options *options);

// ---- the plant ----------------------------------------------------------------------------------

typedef struct control_plant {
  pb_bench bench;              // without session: a plant file
  pb_description description;  // of the file
  pb_model *model;             // owned: of the file
  char *text;                  // owned: of the file
} control_plant;

// Loads the file, or finds the plant on the bus where file is NULL. [init]
pb_status control_plant_open(const char *file, const iff_options *options, control_plant *out,
                             pb_error *err);
void control_plant_close(control_plant *plant);

// ---- the design ---------------------------------------------------------------------------------

// What is closed around the plant.
typedef enum control_stage { STAGE_UNDAMPED, STAGE_IFF, STAGE_HAC, STAGES } control_stage;

typedef struct control_frame {
  bool cartesian;
  const char *source;      // of J: "geometry" or "static gains"; NULL: no J
  double *j, *inverse;     // J and J⁻¹ [n × n]; NULL where there is none
  double *inverse_t;       // J⁻ᵀ
  double condition;        // of J
  double difference;       // largest |J_geometry − J_static| over the largest |J|; NaN: one known
  pb_hac_frame transform;  // from strut coordinates and back
} control_frame;

typedef struct control_design {
  const control_options *options;
  const control_plant *plant;
  const pb_model *model;
  iff_options iff_options;  // those of the command line, with the delay of a hosted controller
  iff_result iff;           // its loops always; the rest where IFF is used
  bool damped;              // IFF is used
  size_t n;
  pb_hac_channels channels;
  size_t *metrology;             // [n] outputs
  size_t motions, disturbances;  // at the point of interest
  size_t *motion, *disturbance;  // outputs, inputs
  control_frame frame;
  pb_hac_shape shape;
  pb_lti shape_lti;  // H
  double *gain;      // [n] k_i
  pb_lti hac;        // T_u K T_y, from metrology to −u
  unsigned iff_delay, hac_delay;
  pb_lti low, both;      // IFF alone and with HAC, from [sensors, metrology]
  size_t *read;          // [2n] sensors, metrology
  pb_loop loop[STAGES];  // of low and both
  pb_loop_solver *solver[STAGES];
  bool stable;                // with HAC: all closed-loop poles inside the unit circle
  pb_pole worst;              // the one of largest |z|
  size_t closed_states;       // of the closed loop that this was found of
  double gain_up, gain_down;  // HAC's gain may be multiplied by: from closed-loop poles; NaN: large
  pb_pole_list modes;         // oscillatory closed-loop poles of the band
} control_design;

// Channels, frame, gains, controllers, stability. realtime: the delays of channels in real time.
// [init] Fails where a name is unknown, J does not exist, a gain cannot be found.
pb_status control_design_make(const control_options *options, const control_plant *plant,
                              control_design *out, pb_error *err);
void control_design_clear(control_design *design);

// design.c's parts.
pb_status control_choose_channels(control_design *design, pb_error *err);  // channels.c
pb_status control_make_frame(control_design *design, pb_error *err);       // frame.c
int control_metrology_of(const pb_model *model, size_t input);  // dL… beside Va… or f…, or −1
void control_frame_clear(control_frame *frame);
pb_status control_prove(control_design *design, pb_error *err);  // prove.c

// Oscillatory poles near which responses turn fast, of the plant and of the stages closed so far,
// as far as the loops matter. Freed with pb_pole_list_clear. [init]
pb_status control_near_poles(const control_design *design, pb_pole_list *out, pb_error *err);

// Name of loop i in the frame: the metrology's or the motion's.
const char *control_loop_name(const control_design *design, size_t i);

// Closed-loop responses of a stage at hz[nf], [nf][ny][nu] of the model. [init]
pb_status control_response(const control_design *design, control_stage stage, const double *hz,
                           size_t nf, double complex *h, pb_error *err);

extern const char *const control_stage_name[STAGES];  // "undamped", "IFF", "HAC-LAC" …
extern const char *const control_stage_key[STAGES];   // for JSON and columns

// ---- the judgement ------------------------------------------------------------------------------

typedef struct control_judgement {
  size_t nf;
  double *hz;                            // [nf]
  double complex *plant[2];              // [nf][n][n] in the frame: undamped, damped
  double complex *l;                     // [nf][n][n]
  pb_margins *margins;                   // [n] of L_ii, the other loops open
  pb_mimo mimo;                          // loci, singular values
  double complex *transmission[STAGES];  // [nf][motions][disturbances]
} control_judgement;

// Why a loop does not cross where it was asked to: from the bandwidth on no loop gain exceeds 1,
// and a mode's peak up there takes the gain.
typedef struct control_limit {
  bool missed;      // the crossover is not within 10 % of the bandwidth
  double hz;        // where the loop touches 1; NaN where nothing is missed
  double short_db;  // so much gain is missing at the bandwidth
  pb_pole mode;     // nearest to it, of the plant or with IFF
} control_limit;

// *out [n] is the caller's (free). [init] PB_ERR_MEMORY, and as pb_loop_solver_poles.
pb_status control_limits_find(const control_design *design, const control_judgement *j,
                              control_limit **out, pb_error *err);

pb_status control_judge(const control_design *design, control_judgement *out, pb_error *err);
void control_judgement_clear(control_judgement *judgement);

// ---- telling ------------------------------------------------------------------------------------

pb_status control_print(const control_design *design, const control_judgement *j, pb_error *err);
pb_status control_print_json(const control_design *design, const control_judgement *j,
                             pb_error *err);

// Margins of the loops one by one and together, delay margins and what limits the bandwidth; of an
// unstable loop none. Warns on stderr where a bandwidth is not reached.
pb_status control_print_margins(const control_design *design, const control_judgement *j,
                                pb_error *err);
void control_json_margins(pb_jsonout *out, const control_design *design,
                          const control_judgement *j);

// The members that say what was designed, into an open object.
void control_json_design(pb_jsonout *out, const control_design *design);
void control_print_design(const control_design *design);

// hac.mat, hac-loops.csv, hac-transmission.csv and the controllers into a directory.
pb_status control_save(const control_design *design, const control_judgement *j, const char *dir,
                       pb_error *err);
pb_status control_plot(const control_design *design, const control_judgement *j, const char *dir,
                       pb_error *err);

// The plant with IFF as predicted: iff-predicted.csv, .mat and figures, as the options say. [init]
pb_status control_damped_plant(const iff_result *iff, pb_error *err);

// Bodies of host_controller requests.
void control_write_iff(FILE *stream, const iff_result *iff);
void control_write_hac(FILE *stream, const control_design *design);

// control-iff.json, control-hac.json (design NULL: IFF alone). [init]
pb_status control_export(const iff_result *iff, const control_design *design, const char *dir,
                         pb_error *err);

// A sampled controller as matrices PREFIX_a … PREFIX_d.
void control_mat_lti(pb_matfile *mat, const char *prefix, const pb_lti *lti);

// ---- commands -----------------------------------------------------------------------------------

int command_iff(int argc, char **argv);
int command_hac(int argc, char **argv);
int command_run(int argc, char **argv);

#endif
