// A plant's names and rates, and requests written in C strings with ' for ", for the tests of what
// runs inside the step.
#ifndef TESTS_HOST_RIG_H
#define TESTS_HOST_RIG_H

#include "support/check.h"

#include "host.h"

enum { RIG_INPUTS = 3, RIG_OUTPUTS = 4 };

static inline const pb_model *rig_model(void) {
  static pb_signal input[] = {{"u1", "V"}, {"u2", "V"}, {"u3", "N"}};
  static pb_signal output[] = {{"y1", "V"}, {"y2", "V"}, {"y3", "m"}, {"y4", "m"}};
  static const pb_model model = {.name = "rig",
                                 .sample_rate = 1000,
                                 .nu = RIG_INPUTS,
                                 .ny = RIG_OUTPUTS,
                                 .input = input,
                                 .output = output};
  return &model;
}

static inline cJSON *rig_parse(const char *text) {
  char *copy = strdup(text);
  assert_non_null(copy);
  for (char *c = copy; *c; c++)
    if (*c == '\'') *c = '"';
  cJSON *body = NULL;
  REQUIRE(pb_json_parse(copy, strlen(copy), &body, &err));
  free(copy);
  return body;
}

static inline pb_status rig_try(const pb_host *host, const char *request, const char *text,
                                pb_host **out, pb_error *err) {
  cJSON *body = rig_parse(text);
  const pb_status status = pb_host_add(host, body, request, rig_model(), "rig", out, NULL, err);
  cJSON_Delete(body);
  return status;
}

// Adds to *host in place, as the daemon does between two steps.
static inline void rig_add(pb_host **host, const char *request, const char *text) {
  pb_host *more = NULL;
  REQUIRE(rig_try(*host, request, text, &more, &err));
  pb_host_take_state(more, *host);
  pb_host_free(*host);
  *host = more;
}

static inline pb_host *rig_one(const char *request, const char *text) {
  pb_host *host = NULL;
  rig_add(&host, request, text);
  return host;
}

// One step with outputs y (NULL: zeros) and nothing else on the inputs.
static inline void rig_run(pb_host *host, const double *y, double u[RIG_INPUTS]) {
  static const double zeros[RIG_OUTPUTS];
  memset(u, 0, RIG_INPUTS * sizeof *u);
  pb_host_run(host, y ? y : zeros, u);
}

// One of each kind.
static const char *const rig_request[][2] = {
    {"host_controller",
     "{'channel': 'damping', 'type': 'iff', 'inputs': ['u1', 'u3'], 'outputs': ['y2', 'y1'], "
     "'gain': [-3.5, 20], 'integrator_hz': 1.5, 'highpass_hz': 0.25}"},
    {"host_controller",
     "{'channel': 'lag', 'type': 'lti', 'inputs': ['u2'], 'outputs': ['y3', 'y4'], 'a': [[-30, 4], "
     "[1, -2]], 'b': [[1, 0.5], [0, 2]], 'c': [[3, 7]], 'd': [[0.1, 0]], 'method': 'zoh'}"},
    {"excite", "{'channel': 'w', 'type': 'white', 'inputs': ['u1', 'u2'], 'rms': 2, 'seed': 9}"},
    {"excite",
     "{'channel': 'n', 'type': 'noise', 'inputs': ['u2', 'u3'], 'rms': 0.5, 'f1': 10, 'f2': 200, "
     "'seconds': 0.11, 'seed': 3, 'repeat': true}"},
    {"excite",
     "{'channel': 'm', 'type': 'multisine', 'inputs': ['u3', 'u1'], 'rms': 1.5, 'f1': 10, 'f2': "
     "300, 'seconds': 0.1}"},
    {"excite",
     "{'channel': 'ch', 'type': 'chirp', 'inputs': ['u1', 'u3'], 'amplitude': 2, 'f1': 5, 'f2': "
     "400, 'seconds': 0.12}"},
    {"excite",
     "{'channel': 's', 'type': 'sine', 'inputs': ['u2'], 'amplitude': 4, 'frequency': 123.456, "
     "'phase': 0.5}"},
    {"excite",
     "{'channel': 'st', 'type': 'step', 'inputs': ['u1', 'u2'], 'amplitude': -0.25, 'at': 0.06}"},
    {"excite",
     "{'channel': 't', 'type': 'table', 'inputs': ['u3', 'u2'], 'values': [[1, -2], [0.1, 5], [3, "
     "1e-3]], 'repeat': true}"},
};

enum { RIG_KINDS = sizeof rig_request / sizeof *rig_request };

static inline pb_host *rig_all(void) {
  pb_host *host = NULL;
  for (int i = 0; i < RIG_KINDS; i++) rig_add(&host, rig_request[i][0], rig_request[i][1]);
  return host;
}

// Outputs of some plant at step k.
static inline void rig_outputs(unsigned k, double y[RIG_OUTPUTS]) {
  for (unsigned o = 0; o < RIG_OUTPUTS; o++) y[o] = sin(0.37 * k + o) + 0.1 * o;
}

#endif
