// plantbus-doctor: why is nothing seen? Looks at everything between a client and its plant.
#include <stdlib.h>
#include <string.h>

#include "doctor.h"
#include "interrupt.h"

enum { KEY_TIMEOUT = 0x100, KEY_JSON, KEY_SCAN };

static const struct argp_option option_table[] = {
    {"timeout", KEY_TIMEOUT, "S", 0, "Listen this long where nothing comes (default 3)", 1},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of a table", 1},
    {"scan", KEY_SCAN, "A-B", 0, "Only tell who is in these domains", 1},
    {0}};

static const char description[] =
    "Tells why nothing is seen on the bus: checks configuration, interfaces, ports, who is in the "
    "domain, plants, qualities of service, types, buffers, and whether a plant answers and its "
    "samples come.\v"
    "Each check says OK, WARN or FAIL, and where there is something to mend, how. A plant that "
    "stands still for a reason is not a failure.\n\n"
    "Exit codes: 0 nothing failed, 1 something did, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-doctor --plant nano-hexapod\n"
    "  plantbus-doctor --scan 0-20\n";

static void parse_scan(struct argp_state *state, doctor_options *o, const char *text) {
  char first[16];
  uint64_t a, b;
  const char *dash = strchr(text, '-');
  snprintf(first, sizeof first, "%.*s", (int)(dash ? dash - text : 15), text);
  if (!pb_parse_uint64(first, &a) || !pb_parse_uint64(dash ? dash + 1 : first, &b) || a > b ||
      b > 230)
    argp_error(state, "--scan: '%s' is not a range of domains, such as 0-20", text);
  else
    o->scan = true, o->scan_first = (uint32_t)a, o->scan_last = (uint32_t)b;
}

static error_t parse(int key, char *text, struct argp_state *state) {
  doctor_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    return 0;
  case KEY_TIMEOUT:
    o->timeout = pb_option_double(state, "--timeout", text, 0.1, 600);
    return 0;
  case KEY_JSON:
    o->json = true;
    return 0;
  case KEY_SCAN:
    parse_scan(state, o, text);
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static void examine(doctor *d) {
  if (!doctor_configuration(d)) return;
  doctor_interfaces(d);
  doctor_ports(d);
  // With these the domain cannot be joined, or would not be the one meant.
  if (report_worst(&d->report) == GRADE_FAIL) return;
  if (!doctor_join(d)) return;
  doctor_discover(d);
  doctor_participants(d);
  doctor_plants(d);
  doctor_endpoints(d);
  doctor_buffers(d);
  doctor_flow(d);
  doctor_firewall(d);
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {option_table, parse, NULL, description, children, NULL, NULL};
  doctor_options options = {.timeout = 3.0};
  doctor d = {.options = &options};
  pb_error err = {0};
  pb_status status;
  pb_options_parse(&argp, argc, argv, &options);
  if (options.scan) {
    pb_interrupt_install();
    status = doctor_scan(&options, &err);
  } else {
    examine(&d);
    status = options.json ? report_print_json(&d.report, stdout, &err)
                          : report_print(&d.report, stdout, &err);
  }
  const bool failed = status || report_worst(&d.report) == GRADE_FAIL;
  if (status) pb_print_error(stderr, &err);
  pb_plants_clear(&d.plants);
  pb_discovery_clear(&d.seen);
  report_clear(&d.report);
  if (d.participant > 0) dds_delete(d.participant);
  return failed ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
