// What the driver sees of the daemon, and the verdict. See soak.h.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/json.h"
#include "soak.h"

static const double longest_stop = 10.0;  // s without a step, of a plant with clients that attach
static const double growth = 1.2;

static void event_count(soak_seen *seen, const char *kind) {
  seen->evicted += strcmp(kind, "evicted") == 0;
  seen->lost += strcmp(kind, "lost") == 0;
  seen->reconfigured += strcmp(kind, "reconfigured") == 0;
  seen->configure_failed += strcmp(kind, "configure_failed") == 0;
}

// Only a step counts, not a new epoch. Statuses and pings may come in another order than they were
// made.
static void progress_count(soak_seen *seen, uint32_t epoch, uint64_t step) {
  const double now = soak_clock();
  const bool further = epoch == seen->epoch && step > seen->step;
  if (further) seen->progress += step - seen->step;
  if (further || seen->progress_at <= 0.0) seen->progress_at = now;
  if (now - seen->progress_at > seen->longest_stop) seen->longest_stop = now - seen->progress_at;
  if (further || epoch > seen->epoch) seen->step = step;
  if (epoch > seen->epoch) seen->epoch = epoch;
}

void soak_watch(soak *s) {
  void *sample[1] = {NULL};
  dds_sample_info_t info;
  while (dds_take(s->event, sample, &info, 1, 1) == 1) {
    if (info.valid_data) event_count(&s->seen, ((plantbus_Event *)sample[0])->kind);
    dds_return_loan(s->event, sample, 1);
    sample[0] = NULL;
  }
  while (dds_take(s->status, sample, &info, 1, 1) == 1) {
    const plantbus_PlantStatus *status = sample[0];
    if (info.valid_data) {
      s->seen.statuses++;
      s->seen.faults |= status->faults;
      s->seen.revision = status->revision;
      progress_count(&s->seen, status->epoch, status->step);
      s->seen.refused_commands = status->refused.session + status->refused.size +
                                 status->refused.non_finite + status->refused.step;
    }
    dds_return_loan(s->status, sample, 1);
    sample[0] = NULL;
  }
}

static double rss_of(pid_t pid) {
  char path[64];
  unsigned long long pages = 0;
  snprintf(path, sizeof path, "/proc/%d/statm", (int)pid);
  FILE *file = fopen(path, "r");
  if (!file) return 0.0;
  if (fscanf(file, "%*u %llu", &pages) != 1) pages = 0;
  fclose(file);
  return (double)pages * (double)sysconf(_SC_PAGESIZE);
}

static void rss_add(soak_seen *seen, double rss) {
  if (seen->rss_count == seen->rss_room) {
    const size_t room = seen->rss_room ? 2 * seen->rss_room : 256;
    double *more = realloc(seen->rss, room * sizeof *more);
    if (!more) return;
    seen->rss = more;
    seen->rss_room = room;
  }
  seen->rss[seen->rss_count++] = rss;
}

static double number(const cJSON *object, const char *key) {
  const cJSON *item = pb_json_member(object, key);
  return cJSON_IsNumber(item) ? item->valuedouble : 0.0;
}

void soak_measure(soak *s) {
  char *result = NULL;
  cJSON *json = NULL;
  rss_add(&s->seen, rss_of(s->daemon_pid));
  soak_request(s, "ping", NULL, &result);
  if (result && !pb_json_parse(result, strlen(result), &json, NULL))
    progress_count(&s->seen, (uint32_t)number(json, "epoch"), (uint64_t)number(json, "step"));
  cJSON_Delete(json);
  free(result);
  if (s->seen.rss_count % 60 == 0)
    printf("soak: %zu min, %.1f MB, %" PRIu64 " steps, %" PRIu64 " reconfigurations\n",
           s->seen.rss_count / 60, s->seen.rss[s->seen.rss_count - 1] * 1e-6, s->seen.progress,
           s->seen.reconfigured);
}

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// Sorts the quarter.
static double quarter_median(const soak_seen *seen, size_t quarter) {
  const size_t n = seen->rss_count / 4;
  double *from = seen->rss + quarter * n;
  qsort(from, n, sizeof *from, ascending);
  return from[n / 2];
}

static bool memory_judge(const soak *s) {
  if (s->seen.rss_count < 8) {
    printf("soak: too short to judge memory\n");
    return false;
  }
  const double early = quarter_median(&s->seen, 1), late = quarter_median(&s->seen, 3);
  const bool good = late <= growth * early + s->slack;
  printf(
      "soak: memory of the daemon: median %.1f MB in the second quarter, %.1f MB in the last%s\n",
      early * 1e-6, late * 1e-6, good ? "" : ": GROWS");
  return good;
}

static bool requests_judge(const soak *s) {
  bool good = true;
  for (int i = 0; i < SOAK_KINDS && s->count[i].kind; i++) {
    const soak_count *c = &s->count[i];
    printf("soak: %-18s sent %" PRIu64 " done %" PRIu64 " refused %" PRIu64 " not served %" PRIu64
           " unanswered %" PRIu64 "%s%s\n",
           c->kind, c->sent, c->done, c->refused, c->unknown, c->unanswered,
           c->refused ? ", first: " : "", c->refusal);
    good = good && c->unanswered == 0;
  }
  if (!good) printf("soak: REQUESTS WITHOUT AN ANSWER\n");
  return good;
}

static soak_count counted(const soak *s, const char *kind) {
  for (int i = 0; i < SOAK_KINDS && s->count[i].kind; i++)
    if (strcmp(s->count[i].kind, kind) == 0) return s->count[i];
  return (soak_count){.kind = kind};
}

// One that comes while another is compiled is refused, as it must be, and on a slow machine that is
// every second one. Of the accepted ones only the last may still be under way at the end.
static bool configure_judge(const soak *s) {
  const soak_count configure = counted(s, "configure"), revert = counted(s, "revert");
  const uint64_t accepted = configure.done + revert.done;
  printf("soak: reconfigurations: %" PRIu64 " asked, %" PRIu64 " accepted, %" PRIu64
         " swapped, %" PRIu64 " failed\n",
         configure.sent + revert.sent, accepted, s->seen.reconfigured, s->seen.configure_failed);
  if (!s->must_configure) return true;
  const bool good = s->seen.configure_failed == 0 && s->seen.reconfigured >= 2 &&
                    s->seen.reconfigured + 1 >= accepted;
  if (!good) printf("soak: TOO FEW RECONFIGURATIONS\n");
  return good;
}

bool soak_judge(soak *s) {
  const soak_seen *seen = &s->seen;
  bool good = requests_judge(s);
  good = configure_judge(s) && good;
  good = memory_judge(s) && good;
  printf("soak: clients: started %" PRIu64 ", killed %" PRIu64 ", stopped %" PRIu64
         ", ended by themselves %" PRIu64 "; evicted %" PRIu64 ", lost %" PRIu64 "\n",
         s->started, s->kills, s->stops, s->died, seen->evicted, seen->lost);
  printf("soak: %u hostile acts; %" PRIu64 " commands refused; %" PRIu64
         " statuses, fault bits %u; %" PRIu64 " steps, longest stop %.1f s\n",
         s->hostile, seen->refused_commands, seen->statuses, seen->faults, seen->progress,
         seen->longest_stop);
  if (seen->faults & plantbus_FLAG_NON_FINITE) printf("soak: AN OUTPUT WAS NOT FINITE\n");
  if (seen->progress == 0 || seen->longest_stop > longest_stop) printf("soak: IT STOOD STILL\n");
  if (s->died > 0) printf("soak: CLIENTS ENDED\n");
  return good && !(seen->faults & plantbus_FLAG_NON_FINITE) && seen->progress > 0 &&
         seen->longest_stop <= longest_stop && seen->statuses > 0 && s->died == 0;
}
