// Requested and offered qualities of service: see qos.h. A policy that a side does not state has
// its default.
#include "qos.h"

#include <inttypes.h>
#include <stdio.h>

typedef struct qualities {
  dds_reliability_kind_t reliability;
  dds_durability_kind_t durability;
  dds_destination_order_kind_t order;
  dds_liveliness_kind_t liveliness;
  dds_duration_t lease, deadline, budget;
  dds_ownership_kind_t ownership;
} qualities;

static qualities qualities_of(const dds_qos_t *qos, bool writer) {
  qualities q = {.reliability = writer ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                 .lease = DDS_INFINITY,
                 .deadline = DDS_INFINITY};
  dds_qget_reliability(qos, &q.reliability, NULL);
  dds_qget_durability(qos, &q.durability);
  dds_qget_destination_order(qos, &q.order);
  dds_qget_liveliness(qos, &q.liveliness, &q.lease);
  dds_qget_deadline(qos, &q.deadline);
  dds_qget_latency_budget(qos, &q.budget);
  dds_qget_ownership(qos, &q.ownership);
  return q;
}

// True when the offered kind is below the requested one.
static bool kinds(const char *policy, const char *const *name, int offered, int requested,
                  char *text, size_t size) {
  if (offered >= requested) return false;
  snprintf(text, size, "%s: %s offered, %s requested", policy, name[offered], name[requested]);
  return true;
}

static void duration(dds_duration_t d, char text[32]) {
  if (d == DDS_INFINITY)
    snprintf(text, 32, "infinite");
  else
    snprintf(text, 32, "%g s", (double)d * 1e-9);
}

static bool durations(const char *policy, dds_duration_t offered, dds_duration_t requested,
                      char *text, size_t size) {
  char a[32], b[32];
  if (offered <= requested) return false;
  duration(offered, a);
  duration(requested, b);
  snprintf(text, size, "%s: %s offered, %s requested", policy, a, b);
  return true;
}

bool qos_conflict(const dds_qos_t *offered, const dds_qos_t *requested, char *text, size_t size) {
  static const char *const reliability[] = {"BEST_EFFORT", "RELIABLE"};
  static const char *const durability[] = {"VOLATILE", "TRANSIENT_LOCAL", "TRANSIENT",
                                           "PERSISTENT"};
  static const char *const order[] = {"BY_RECEPTION_TIMESTAMP", "BY_SOURCE_TIMESTAMP"};
  static const char *const liveliness[] = {"AUTOMATIC", "MANUAL_BY_PARTICIPANT", "MANUAL_BY_TOPIC"};
  const qualities o = qualities_of(offered, true), r = qualities_of(requested, false);
  text[0] = '\0';
  if (o.ownership != r.ownership) {
    snprintf(text, size, "ownership: shared on one side, exclusive on the other");
    return true;
  }
  return kinds("reliability", reliability, (int)o.reliability, (int)r.reliability, text, size) ||
         kinds("durability", durability, (int)o.durability, (int)r.durability, text, size) ||
         kinds("destination order", order, (int)o.order, (int)r.order, text, size) ||
         kinds("liveliness", liveliness, (int)o.liveliness, (int)r.liveliness, text, size) ||
         durations("liveliness lease", o.lease, r.lease, text, size) ||
         durations("deadline", o.deadline, r.deadline, text, size) ||
         durations("latency budget", o.budget, r.budget, text, size);
}
