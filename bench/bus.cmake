# What goes over the bus: the daemon and clients in processes of their own.
pb_bench(bus SOURCES bench_bus.c bus_client.c child.c LIBS plantbus_bus TOOLS plantbusd)
pb_bench(realtime SOURCES bench_realtime.c bus_client.c child.c plants.c toolout.c
         LIBS plantbus_bus cjson TOOLS plantbusd plantbus-monitor)
pb_bench(identify SOURCES bench_identify.c child.c toolout.c
         LIBS cjson TOOLS plantbusd plantbus-identify)
