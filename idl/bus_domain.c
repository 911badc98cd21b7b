// See bus_domain.h. The values of the built-in configuration were measured on loopback with Cyclone
// DDS 0.10.2: lost packets are asked for again at once (the default waits 100 ms), heartbeats come
// every 2 to 20 ms, a dead host is given up after 3 s. A description of 2100 states is close to
// 1 MB: MaxSampleSize admits 8 MiB and the writer's high-water mark lies above it, so that a
// description that a stopped reader has not acknowledged does not hold the next one back. There is
// no Tracing element: with any verbosity, the middleware opens cyclonedds.log in the working
// directory and refuses to start where it cannot. Warnings and errors reach the log (bus_log.h)
// without it.
#include "bus_domain.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "bus_log.h"

static const char builtin_format[] =
    "<CycloneDDS><Domain id=\"any\">"
    "<General><Interfaces><NetworkInterface name=\"%s\" multicast=\"true\"/></Interfaces>"
    "<AllowMulticast>true</AllowMulticast></General>"
    "<Discovery><LeaseDuration>3 s</LeaseDuration><SPDPInterval>1 s</SPDPInterval></Discovery>"
    "<Internal><NackDelay>0 ms</NackDelay>"
    "<HeartbeatInterval min=\"1 ms\" minsched=\"2 ms\" max=\"20 ms\">2 ms</HeartbeatInterval>"
    "<MaxSampleSize>8 MiB</MaxSampleSize>"
    "<WriterLingerDuration>50 ms</WriterLingerDuration>"
    "<Watermarks><WhcHigh>32 MiB</WhcHigh><WhcHighInit>32 MiB</WhcHighInit></Watermarks></Internal>"
    "</Domain></CycloneDDS>";

void pb_domain_config(const char *interface, char *text, size_t size) {
  snprintf(text, size, builtin_format, interface ? interface : "lo");
}

static bool interface_name_valid(const char *name) {
  return *name && strlen(name) < 64 &&
         strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRST"
                      "UVWXYZ0123456789._-:@") == strlen(name);
}

static bool environment_configures(void) {
  const char *uri = getenv("CYCLONEDDS_URI");
  return uri && *uri;
}

// The middleware takes what it cannot read for an empty configuration, which would open the plant
// to every network of the host; and a list of files at each comma.
static pb_status config_check(const char *name, pb_error *err) {
  struct stat file;
  if (access(name, R_OK) != 0 || stat(name, &file) != 0)
    return pb_fail(err, PB_ERR_IO, name, "cannot be read");
  if (!S_ISREG(file.st_mode) || file.st_size == 0)
    return pb_fail(err, PB_ERR_IO, name, "is not a file with a configuration");
  if (strchr(name, ','))
    return pb_fail(err, PB_ERR_ARGUMENT, name, "the name of a configuration holds no comma");
  return PB_OK;
}

static pb_status domain_create(const pb_domain_options *options, pb_error *err) {
  char text[2048];
  if (options->config) {
    pb_status status = config_check(options->config, err);
    if (status) return status;
    if ((size_t)snprintf(text, sizeof text, "file://%s", options->config) >= sizeof text)
      return pb_fail(err, PB_ERR_ARGUMENT, options->config, "the file name is too long");
  } else if (!options->interface && environment_configures()) {
    return PB_OK;
  } else {
    if (options->interface && !interface_name_valid(options->interface))
      return pb_fail(err, PB_ERR_ARGUMENT, options->interface, "is not the name of an interface");
    pb_domain_config(options->interface, text, sizeof text);
  }
  const dds_entity_t domain = dds_create_domain(options->domain, text);
  // PRECONDITION_NOT_MET: this process has opened the domain before.
  if (domain < 0 && domain != DDS_RETCODE_PRECONDITION_NOT_MET)
    return pb_fail(err, PB_ERR_IO, options->config ? options->config : "DDS configuration",
                   "was refused: %s", dds_strretcode(-domain));
  return PB_OK;
}

pb_status pb_domain_join(const pb_domain_options *options, dds_entity_t *participant,
                         pb_error *err) {
  *participant = 0;
  if (options->domain > 230)
    return pb_fail(err, PB_ERR_ARGUMENT, "domain", "is %u, expected 0 to 230", options->domain);
  pb_log_install_dds();
  pb_status status = domain_create(options, err);
  if (status) return status;
  const dds_entity_t made = dds_create_participant(options->domain, NULL, NULL);
  if (made < 0)
    return pb_fail(err, PB_ERR_IO, "DDS", "domain %u cannot be joined: %s", options->domain,
                   dds_strretcode(-made));
  *participant = made;
  return PB_OK;
}
