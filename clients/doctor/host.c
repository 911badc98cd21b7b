// What the host says: configuration, interfaces, ports, buffers.
#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>

#include "bus_domain.h"
#include "doctor.h"

enum { PORT_INDICES = 120 };  // those that fit between the ports of two domains

static uint32_t port_base(const doctor *d) {
  return 7400 + 250 * d->options->common.domain;
}

// ---- configuration ------------------------------------------------------------------------------

bool doctor_configuration(doctor *d) {
  const doctor_options *o = d->options;
  const char *uri = getenv("CYCLONEDDS_URI");
  char builtin[2048];
  pb_error err = {0};
  const bool environment = !o->common.config && !o->common.interface && uri && *uri;
  const char *source = o->common.config ? "--config" : environment ? "CYCLONEDDS_URI" : "built-in";
  pb_domain_config(o->common.interface, builtin, sizeof builtin);
  const char *text = o->common.config ? o->common.config : environment ? uri : builtin;
  if (config_read(text, &d->facts, &err)) {
    report_add(&d->report, GRADE_FAIL, "configuration",
               environment ? "unset CYCLONEDDS_URI, or let it name a readable file: file:///…/x.xml"
                           : "name a readable Cyclone DDS configuration",
               "%s: %s: %s", source, err.where, err.message);
    return false;
  }
  if (o->common.config || environment)
    report_add(&d->report, GRADE_OK, "configuration", NULL, "%s: %.300s", source, text);
  else
    report_add(&d->report, GRADE_OK, "configuration", NULL,
               "built-in, interface %s (CYCLONEDDS_URI is not set)",
               o->common.interface ? o->common.interface : "lo");
  return true;
}

// ---- interfaces ---------------------------------------------------------------------------------

static const struct ifaddrs *find(const struct ifaddrs *list, const config_interface *i) {
  for (const struct ifaddrs *a = list; a; a = a->ifa_next) {
    char address[INET_ADDRSTRLEN] = "";
    if (!a->ifa_addr || a->ifa_addr->sa_family != AF_INET) continue;
    inet_ntop(AF_INET, &((const struct sockaddr_in *)(const void *)a->ifa_addr)->sin_addr, address,
              sizeof address);
    if (i->name[0] ? strcmp(a->ifa_name, i->name) == 0 || strcmp(address, i->name) == 0
                   : strcmp(address, i->address) == 0)
      return a;
  }
  return NULL;
}

static void names(const struct ifaddrs *list, char *text, size_t size) {
  size_t used = 0;
  text[0] = '\0';
  for (const struct ifaddrs *a = list; a && used < size; a = a->ifa_next)
    if (a->ifa_addr && a->ifa_addr->sa_family == AF_INET && (a->ifa_flags & IFF_UP))
      used += (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "", a->ifa_name);
}

static void check_interface(doctor *d, const struct ifaddrs *list, const config_interface *i) {
  char text[200], mend[300];
  const char *name = i->name[0] ? i->name : i->address;
  const struct ifaddrs *a = find(list, i);
  names(list, text, sizeof text);
  if (!a) {
    const bool there = i->name[0] && if_nametoindex(i->name) != 0;
    snprintf(mend, sizeof mend, "name one that is up with an IPv4 address: %s", text);
    report_add(&d->report, GRADE_FAIL, "interface", mend, "%s %s", name,
               there ? "has no IPv4 address" : "does not exist on this host");
    return;
  }
  const bool multicast = i->multicast_told ? i->multicast : (a->ifa_flags & IFF_MULTICAST) != 0;
  if (!(a->ifa_flags & IFF_UP)) {
    snprintf(mend, sizeof mend, "ip link set %s up", a->ifa_name);
    report_add(&d->report, GRADE_FAIL, "interface", mend, "%s is down", name);
  } else if (!multicast && d->facts.multicast && d->facts.peers == 0) {
    report_add(&d->report, GRADE_WARN, "interface",
               "set multicast=\"true\" where it can, else list <Peers> and AllowMulticast false",
               "%s is up but cannot multicast, and no peers are listed", name);
  } else {
    report_add(&d->report, GRADE_OK, "interface", NULL, "%s is up%s", name,
               multicast ? ", multicast" : ", without multicast");
  }
  d->loopback = d->loopback && (a->ifa_flags & IFF_LOOPBACK);
}

static void check_chosen(doctor *d, const struct ifaddrs *list) {
  char text[200];
  bool network = false;
  for (const struct ifaddrs *a = list; a; a = a->ifa_next)
    network = network || (a->ifa_addr && a->ifa_addr->sa_family == AF_INET &&
                          (a->ifa_flags & IFF_UP) && !(a->ifa_flags & IFF_LOOPBACK));
  names(list, text, sizeof text);
  d->loopback = !network;
  if (network)
    report_add(&d->report, GRADE_OK, "interface", NULL,
               "chosen by the middleware among those that are up: %s", text);
  else
    report_add(&d->report, GRADE_WARN, "interface", "connect one, or use --interface lo",
               "no interface but %s is up", text);
}

void doctor_interfaces(doctor *d) {
  struct ifaddrs *list = NULL;
  if (getifaddrs(&list) != 0) {
    report_add(&d->report, GRADE_WARN, "interface", NULL, "the host does not list its interfaces");
    return;
  }
  bool any = false;
  d->loopback = true;
  for (size_t i = 0; i < d->facts.interfaces; i++) {
    const config_interface *c = &d->facts.interface[i];
    if (!c->name[0] && !c->address[0]) continue;  // autodetermine
    check_interface(d, list, c);
    any = true;
  }
  if (!any) check_chosen(d, list);
  freeifaddrs(list);
}

// ---- ports --------------------------------------------------------------------------------------

// How many of the ports base + 10 + 2 i, i below `indices`, are bound by UDP sockets of this host.
static int ports_used(uint32_t base, uint32_t indices) {
  bool used[PORT_INDICES] = {false};
  char line[512];
  int count = 0;
  FILE *file = fopen("/proc/net/udp", "r");
  if (!file) return -1;
  while (fgets(line, sizeof line, file)) {
    unsigned port;
    if (sscanf(line, "%*d: %*[0-9A-Fa-f]:%x", &port) != 1 || port < base + 10) continue;
    const unsigned i = (port - base - 10) / 2;
    if ((port - base) % 2 == 0 && i < indices && i < PORT_INDICES) used[i] = true;
  }
  fclose(file);
  for (int i = 0; i < PORT_INDICES; i++) count += used[i];
  return count;
}

// MaxAutoParticipantIndex N admits N processes on a host (measured with Cyclone DDS 0.10.2).
static void tell_indices(doctor *d, uint32_t base, uint32_t used) {
  const uint32_t most = d->facts.index_max;
  const grade result = used >= most ? GRADE_FAIL : 5 * used >= 4 * most ? GRADE_WARN : GRADE_OK;
  report_add(&d->report, result, "ports",
             result == GRADE_OK
                 ? NULL
                 : "raise <Discovery><MaxAutoParticipantIndex> in every configuration on this host",
             "%u of %u participant indices are in use, by a process each (MaxAutoParticipantIndex, "
             "ports from %u)",
             used, most, base + 10);
}

void doctor_ports(doctor *d) {
  const uint32_t base = port_base(d);
  const int used = ports_used(base, d->facts.index_auto ? d->facts.index_max : PORT_INDICES);
  if (used < 0)
    report_add(&d->report, GRADE_WARN, "ports", NULL, "/proc/net/udp cannot be read");
  else if (d->facts.index_auto)
    tell_indices(d, base, (uint32_t)used);
  else
    report_add(&d->report, GRADE_OK, "ports", NULL,
               "taken freely, by any number of processes (no participant index)");
}

// ---- buffers ------------------------------------------------------------------------------------

static double description_bytes(const doctor *d) {
  double largest = 0.0;
  for (size_t i = 0; i < d->plants.count; i++) {
    const plantbus_PlantDescription *p = d->plants.plant[i].description;
    const double bytes = 8.0 * p->model._length + (double)strlen(p->plant_text);
    if (bytes > largest) largest = bytes;
  }
  return largest;
}

void doctor_buffers(doctor *d) {
  long limit = 0;
  FILE *file = fopen("/proc/sys/net/core/rmem_max", "r");
  const bool known = file && fscanf(file, "%ld", &limit) == 1;
  if (file) fclose(file);
  const double seen = description_bytes(d), needed = seen > 0.0 ? seen : 1048576.0;
  const char *what = seen > 0.0 ? "the largest description here" : "a description of 2100 states";
  if (!known)
    report_add(&d->report, GRADE_OK, "buffers", NULL, "net.core.rmem_max is not told here");
  else if ((double)limit >= needed)
    report_add(&d->report, GRADE_OK, "buffers", NULL, "net.core.rmem_max is %ld, %s %.0f bytes",
               limit, what, needed);
  else
    report_add(&d->report, GRADE_WARN, "buffers", "sysctl -w net.core.rmem_max=4194304",
               "net.core.rmem_max is %ld, %s %.0f bytes: parts of it are lost and sent again",
               limit, what, needed);
}

// ---- firewall -----------------------------------------------------------------------------------

void doctor_firewall(doctor *d) {
  const uint32_t base = port_base(d);
  char mend[300];
  if (d->loopback) {
    report_add(&d->report, GRADE_OK, "firewall", NULL,
               "this configuration stays on this host: daemons elsewhere are not seen (--interface "
               "or CYCLONEDDS_URI, the same on both sides)");
    return;
  }
  snprintf(mend, sizeof mend,
           "let UDP pass from the hosts of the bus: multicast 239.255.0.1 port %u "
           "(and %u), unicast ports %s",
           base, base + 1,
           d->facts.index_auto ? "from there on" : "above 1024, or set ParticipantIndex auto");
  if (report_worst(&d->report) == GRADE_FAIL)
    report_add(&d->report, GRADE_WARN, "firewall", mend,
               "a firewall, or a switch without multicast, may stand between the hosts");
  else
    report_add(&d->report, GRADE_OK, "firewall", NULL, "what is needed passes");
}
