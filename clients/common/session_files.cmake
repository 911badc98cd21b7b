# The session on the bus (session.h), and who else is there (discovery.h).
set(PB_SESSION_SOURCES
  discovery.c
  discovery_plants.c
  session.c
  session_attach.c
  session_bus.c
  session_block.c
  session_change.c
  session_event.c
  session_find.c
  session_request.c
  session_run.c
)
