# The session on the bus (session.h).
set(PB_SESSION_SOURCES
  session.c
  session_attach.c
  session_bus.c
  session_find.c
  session_request.c
  session_run.c
)
