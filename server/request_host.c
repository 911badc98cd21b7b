// Requests about what runs inside the step: host_controller, excite, remove_controller.
#include <string.h>

#include "daemon.h"
#include "request_body.h"

pb_status pb_request_host(pb_daemon *d, pb_request *request, pb_error *err) {
  char name[PB_ENGINE_NAME];
  pb_host *next = NULL;
  uint64_t period = 0;
  pb_status status = pb_configure_idle(d, err);
  if (status) return status;
  pb_request_client_name(d, request, NULL, name);
  status = pb_host_add(d->host, request->body, request->kind, pb_daemon_live(d)->model, name, &next,
                       &period, err);
  if (status) return status;
  const char *channel = "";
  pb_body_string(request->body, "channel", true, &channel, err);
  return pb_configure_host(d, request, next, channel, false, period);
}

pb_status pb_request_unhost(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"channel", NULL};
  const char *channel = NULL;
  pb_host *next = NULL;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_string(request->body, "channel", true, &channel, err);
  if (!status) status = pb_configure_idle(d, err);
  if (!status && !d->host)
    status = pb_fail(err, PB_ERR_REFERENCE, "/channel", "nothing runs inside the step");
  if (!status) status = pb_host_remove(d->host, channel, &next, err);
  return status ? status : pb_configure_host(d, request, next, channel, true, 0);
}
